"""Post-processing behind one face: a valid path in, a path with the same ends that is no worse out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.path import JointPath
from rrtik_ompl.problem import Problem
from rrtik_ompl.shorten.axis import MotionValid, double_axis_cut

Method: TypeAlias = Callable[[Matrix, MotionValid], Matrix]

METHODS: Mapping[str, Method] = MappingProxyType({"axis": double_axis_cut})


def shorten(path: JointPath, problem: Problem, *, method: str = "axis") -> JointPath:
    """Shorten a path of a problem.

    Args:
        path: A valid path of the problem.
        problem: Whose world judges the new motions.
        method: "axis" is the published double axis cut: fewer moves of one joint at a time.

    Returns:
        A path with the same ends. It passes the same second check as a plan; if a shortened path does not, the
        input is returned.

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If the path is not valid for the problem.
    """
    if method not in METHODS:
        raise UnknownNameError("shortening method", method, METHODS)
    faults = path.violations(problem.world)
    if faults:
        raise InputError(f"path to shorten: edge {faults[0].edge} is not valid: {faults[0].reason}")
    shorter = path.with_waypoints(METHODS[method](path.waypoints, problem.world.motion_valid))
    return path if shorter.violations(problem.world) else shorter
