"""An exact judge of paths of planar arms: how deep a motion cuts, by branch and bound, in plane geometry alone.

A point of a link moves at most as far as the joints before it turn, times its distance from each. So the room halfway
of an interval, less what half the interval can change, bounds the room in all of it; intervals whose bound says that
they are free, or cut less deep than another place, are dropped, the others halved. Nothing of a world is asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from bench.moves.fewest_moves_oracle import ROOM, drawn_arm, world_of
from bench.proofs.measurements import by_every_method
from rrtik_bench.shortening.plane_arms import PlaneArm
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.planning.shortening import METHODS
from rrtik_ompl.world.problem import Problem

Motion: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64]]

EXACT = 1e-7  # [m] of a cut
DRAWS = 400  # configurations among the obstacles, for a start and a goal


@dataclass(frozen=True)
class PlaneJudged:
    """How deep a path of one method cuts [m], whether it is proven; before: without proofs and clearance."""

    found: bool
    proven: bool = False
    cut: float = 0.0
    cut_before: float = 0.0


def deepest_cut(arm: PlaneArm, route: NDArray[np.float64]) -> float:
    """How deep the links enter obstacles along a route of straight motions, shape (k, n), to within EXACT [m].

    Returns:
        0 if the whole route is free; the radius of the links for all that is deeper.
    """
    least = min(max(float(arm.room(route).min()), -arm.radius), 0.0)
    for a, b in pairwise(route):
        # the farthest that a point of each link moves from a to b, the links before it stretched out
        most = [float(np.abs(b - a)[: k + 1] @ np.cumsum(arm.lengths[: k + 1][::-1])[::-1]) for k in range(len(a))]
        for link, way in enumerate(most):
            least = _least(arm, (a, b), link, way, least)
    return max(0.0, -least)


def _least(arm: PlaneArm, ends: Motion, link: int, way: float, least: float) -> float:
    """The least room of one link along a motion, if it is less than what is known to be there [m]."""
    a, b = ends
    middles, half = np.array([0.5]), 0.5
    while len(middles) > 0 and least > -arm.radius:
        places = arm.places((a + middles[:, None] * (b - a))[:, : link + 1])
        room = np.maximum(arm.link_room(places[:, link], places[:, link + 1]), -arm.radius)
        least = min(least, float(room.min()))
        left = middles[room - way * half < least - EXACT]
        half *= 0.5
        middles = np.concatenate([left - half, left + half])
    return least


def plane_shortened(number: int) -> list[PlaneJudged]:
    """A path among discs and rectangles, shortened by every method; the same number gives the same path."""
    rng = np.random.default_rng([13, number])
    arm = drawn_arm(rng, 2 + number % 3)
    problem = _problem(arm, rng)
    if problem is None:
        return [PlaneJudged(found=False)] * len(METHODS)
    both = by_every_method(problem, number)
    return [PlaneJudged(found=False) if each is None else _judged(arm, *each) for each in both]


def _problem(arm: PlaneArm, rng: np.random.Generator) -> Problem | None:
    """A start and a goal that keep some room, between which the straight way collides."""
    rows = rng.uniform(-3.1, 3.1, (DRAWS, len(arm.lengths)))
    rows = rows[arm.room(rows) > ROOM]
    for start, goal in zip(rows[::2], rows[1::2], strict=False):
        if deepest_cut(arm, np.array([start, goal])) > 0.0:
            return Problem(world_of(arm), start, goal)
    return None


def _judged(arm: PlaneArm, short: JointPath, old: JointPath) -> PlaneJudged:
    proven = short.proof is not None and short.proof.proven
    return PlaneJudged(True, proven, deepest_cut(arm, short.waypoints), deepest_cut(arm, old.waypoints))
