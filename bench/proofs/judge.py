"""A judge of paths that knows nothing of proofs: very fine samples, and coal's own distances where these touch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.world.world import World

FINER = 50.0  # than the world's motion resolution
AT_ONCE = 100_000  # configurations
EVERY = 100  # of these by coal alone, with forward kinematics in numpy


def deepest_cut(world: World, path: JointPath) -> float:
    """How deep a path enters anything at samples 1/50 of the resolution apart [m]; 0 if it touches nothing."""
    deepest = 0.0
    for a, b in pairwise(path.waypoints):
        count = max(world.steps(a, b, world.motion_resolution / FINER), 1)
        for first in range(0, count + 1, AT_ONCE):
            shares = np.arange(first, min(first + AT_ONCE, count + 1)) / count
            deepest = max(deepest, _deepest(world, (1.0 - shares)[:, None] * a + shares[:, None] * b))
    return deepest


def _deepest(world: World, rows: Matrix) -> float:
    free = world.valid_batch(rows)
    free[::EVERY] &= Certificate(world.robot, world.bodies, world.pairs).free(rows[::EVERY])
    return max((-min(world.clearance(row), 0.0) for row in rows[~free]), default=0.0)
