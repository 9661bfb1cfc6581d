"""Postures: free ones that no proof covers, and the singular poses of TITAN-4 that are answered inside the limits."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.world.world import World
from rrtik_robots.titan4.singular_samples import configurations_inside

REACHED = 1e-6  # [m] and [rad] of a matrix


@dataclass(frozen=True)
class Free:
    """Free postures of an arm, drawn at random; how many are not proven, by kernels alone too, and how near these are.

    ``nearest`` and ``farthest``: distances of the pairs that kernels leave open, by coal [m].
    """

    count: int
    open: int
    open_to_kernels: int
    nearest: float
    farthest: float


def free_postures(arm: str, count: int) -> Free:
    """Draw postures within the limits, keep the free ones, and prove each."""
    world, rng = World(rrtik.load_robot(arm)), np.random.default_rng(3)
    low, high = world.robot.finite_range()
    Q: Matrix = rng.uniform(low, high, (count, world.robot.dof))
    Q = Q[world.valid_batch(Q)]
    left = int((~world.motions_proven(Q, Q)).sum())
    with _kernels_alone():
        open_ = np.flatnonzero(~world.motions_proven(Q, Q))
        away = [world.prove(Q[[k, k]]).unproven[0].distance for k in open_]
    return Free(len(Q), left, len(open_), min(away, default=np.nan), max(away, default=np.nan))


@contextmanager
def _kernels_alone() -> Iterator[None]:
    with patch("rrtik_ompl.world.proof.CoalProof.settle", lambda *_: None):
        yield


def singular_answers(case: str, count: int) -> tuple[int, int]:
    """Poses of TITAN-4 of a singular family, of postures inside the limits: how many, and how many are answered.

    An answer is a posture inside the limits that is at the pose, by forward kinematics.
    """
    robot = rrtik.load_robot("titan4")
    limits = robot.lower, robot.upper
    answered = 0
    for pose in robot.fk_batch(configurations_inside(case, count, np.random.default_rng(9), limits)):
        found = rrtik.solve_ik(robot, pose).solutions
        inside = [q for q in found if robot.within_limits(q[None]).all()]
        answered += any(np.abs(robot.fk_batch(q[None])[0] - pose).max() <= REACHED for q in inside)
    return count, answered
