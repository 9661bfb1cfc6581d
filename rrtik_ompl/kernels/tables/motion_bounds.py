"""How far joints carry the balls of the arm: what motions are watched by.

If a group of balls keeps farther from everything than it can move until the next configuration that is checked, then
it is clear there, too.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.layout import (
    BALL_FLOATS,
    CLUSTER_END,
    CLUSTER_FIRST,
    CLUSTER_INTS,
    GROUP_END,
    GROUP_FIRST,
    GROUP_FRAME,
    GROUP_INTS,
    PAIR_GROUP_INTS,
    PAIR_GROUP_ONE,
    PAIR_GROUP_OTHER,
    BallTable,
    BoundTable,
)
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.model.robot import Chain

SLACK = 1e-6  # of a bound, for rounding
NOTHING = -1e30  # stands where there is nothing to watch


def bounds_table(chain: Chain, balls: BallTable, strokes: Vector, margin: float) -> BoundTable:
    """How far a unit of each joint moves each group of balls, and the groups of each pair against each other, at most.

    Args:
        chain: The tree.
        balls: Table of its balls.
        strokes: Largest value of each sliding joint [m], shape (n,).
        margin: How far rounding may misplace a ball [m].
    """
    clusters = balls.clusters.reshape(-1, CLUSTER_INTS)
    spheres = balls.balls.reshape(-1, BALL_FLOATS)
    lines = [np.zeros(len(chain.parent))]

    for group in balls.groups.reshape(-1, GROUP_INTS):
        first = clusters[group[GROUP_FIRST]]
        last = clusters[group[GROUP_END] - 1]
        carried = spheres[first[CLUSTER_FIRST] : last[CLUSTER_END]].astype(np.float64)
        lines.append(_levers(chain, int(group[GROUP_FRAME]) - 1, carried, strokes))

    own = np.array(lines)[1:].reshape(-1, len(chain.parent))
    pairs = balls.pair_groups.reshape(-1, PAIR_GROUP_INTS)
    one = own[pairs[:, PAIR_GROUP_ONE]]
    other = own[pairs[:, PAIR_GROUP_OTHER]]
    common = (one > 0.0) & (other > 0.0)  # what carries both does not move them against each other
    rows = np.concatenate([own, np.where(common, 0.0, one + other)])
    made = np.zeros((2 + len(chain.parent), -(-max(len(rows), 1) // WIDTH) * WIDTH), dtype=np.float32)
    frames = balls.groups.reshape(-1, GROUP_INTS)[:, GROUP_FRAME]
    made[0, : len(rows)] = [*frames, *frames[pairs[:, [PAIR_GROUP_ONE, PAIR_GROUP_OTHER]]].max(axis=1)]
    made[1] = NOTHING
    made[1, : len(rows)] = 2.0 * margin
    made[2:, : len(rows)] = (1.0 + SLACK) * rows.T

    return packed(BoundTable, blocks=made.shape[1] // WIDTH, rows=made)


def _levers(chain: Chain, joint: int, spheres: Matrix, strokes: Vector) -> Vector:
    """Largest distance of balls, in the turned frame of a joint, from the axis of each joint that carries them.

    1 for sliding joints, 0 for joints that do not carry them. Shape (n,).
    """
    found = np.zeros(len(chain.parent))
    reach = float((np.linalg.norm(spheres[:, :3], axis=1) + spheres[:, 3]).max())
    aside = float((np.linalg.norm(spheres[:, :2], axis=1) + spheres[:, 3]).max())

    while joint >= 0:
        found[joint] = 1.0 if chain.prismatic[joint] else aside
        parent = chain.parent[joint]
        origin = chain.placement[joint][:3, 3]
        stroke = float(strokes[joint]) if chain.prismatic[joint] else 0.0
        away = np.cross(origin, chain.axis[parent]) if parent >= 0 else origin
        aside = float(np.linalg.norm(away)) + stroke + reach
        reach += float(np.linalg.norm(origin)) + stroke
        joint = int(parent)

    return found
