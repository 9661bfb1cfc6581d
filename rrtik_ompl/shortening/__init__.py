"""Post-processing behind one face: a valid path in, a path with the same ends that is no worse out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.errors import InputError, UnknownNameError, require
from rrtik_ompl.path import SECOND_CHECK, JointPath
from rrtik_ompl.problem import Problem
from rrtik_ompl.shortening.axis import double_axis_cut
from rrtik_ompl.shortening.axis_rounds import axis_cut_rounds
from rrtik_ompl.shortening.fewest_moves import fewest_moves
from rrtik_ompl.world import World

Method: TypeAlias = Callable[[Matrix, World], Matrix]

METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "axis": lambda route, world: double_axis_cut(route, world.motion_valid),
        "axis-rounds": lambda route, world: axis_cut_rounds(route, world.motion_valid),
        # what travels little touches what it goes round, so it is judged as densely as by the second check
        "fewest-moves": lambda route, world: fewest_moves(route, world.refined(SECOND_CHECK)).route,
    }
)


def shorten(path: JointPath, problem: Problem, *, method: str = "axis") -> JointPath:
    """Shorten a path of a problem.

    Args:
        path: A valid path of the problem.
        problem: Whose world judges the new motions.
        method: "axis" is the published double axis cut: fewer moves of one joint at a time. "axis-rounds" goes on with
            twenty passes in random joint orders (always the same ones): fewer moves still, several times as long.
            "fewest-moves" takes single-joint moves and looks for the fewest, with the least travel among those.

    Returns:
        A path with the same ends. It passes the same second check as a plan: if a shortened path does not, its
        motions are checked as densely as that; if that does not help, the input is returned.

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If the path is not valid for the problem.
    """
    require(path, JointPath, "path to shorten", "a plan has one if plan.found")
    require(problem, Problem, "problem of a path to shorten")
    if method not in METHODS:
        raise UnknownNameError("shortening method", method, METHODS)
    faults = path.violations(problem.world)
    if faults:
        raise InputError(f"path to shorten: edge {faults[0].edge} is not valid: {faults[0].reason}")
    for world in (problem.world, problem.refined(SECOND_CHECK).world):  # the finer one if the second check objects
        shorter = path.with_waypoints(METHODS[method](path.waypoints, world))
        if not shorter.violations(problem.world):
            return shorter
    return path
