"""The joints from the base to the tip as tables for kernels, and configurations to start from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.ik.reference_descent import DAMPING, DAMPING_SHARE, LARGEST_STEP, PER_CHORD, SHARE_GROWTH, STALLED
from rrtik_ompl.ik.tip_columns import TipColumns, tip_columns
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.tables.memory import Table, table
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.tip_distance import reach_of

SEEDS = 512


@dataclass(frozen=True, slots=True, eq=False)
class Seeds:
    """Configurations inside the limits, shape (k, dof), and the poses that they bring the tip to, shape (k, 4, 4)."""

    q: Matrix
    tips: NDArray[np.float64]


@lru_cache(maxsize=64)
def seeds_of(robot: Robot) -> Seeds:
    """Random configurations of a robot, always the same."""
    q = np.random.default_rng(0).uniform(*robot.finite_range(), (SEEDS, robot.dof))
    return Seeds(frozen(q), frozen(robot.fk_batch(q)))


@lru_cache(maxsize=64)
def limb_of(robot: Robot) -> Table | None:
    """The table of a robot's limb without seeds; None if a joint hangs on several numbers of q."""
    return limb_table(robot, tip_columns(robot))


def limb_table(robot: Robot, tip: TipColumns) -> Table | None:
    """The table of the joints that move a frame, without seeds; None if one of them hangs on several numbers of q."""
    if (np.count_nonzero(tip.gain, axis=1) > 1).any():
        return None
    columns = np.argmax(np.abs(tip.gain), axis=1)
    numbers = [1.0 / reach_of(robot), PER_CHORD, DAMPING, DAMPING_SHARE, SHARE_GROWTH, LARGEST_STEP, STALLED]
    return table(
        {
            ik_layout.JOINTS: len(columns),
            ik_layout.DOF: robot.dof,
            ik_layout.FIXED: pose_numbers(tip.fixed),
            ik_layout.SLIDING: tip.prismatic.astype(np.int32),
            ik_layout.COLUMN: columns.astype(np.int32),
            ik_layout.GAIN: tip.gain[np.arange(len(columns)), columns],
            ik_layout.OFFSET: tip.offset,
            ik_layout.LOWER: np.asarray(robot.lower),
            ik_layout.UPPER: np.asarray(robot.upper),
            ik_layout.SEED_COUNT: 0,
            ik_layout.SEEDS: 0,
            ik_layout.SEED_TIPS: 0,
            ik_layout.NUMBERS: np.array(numbers),
        }
    )


@lru_cache(maxsize=64)
def seeded_limb_of(robot: Robot) -> Table | None:
    """The same with seeds."""
    bare, seeds = limb_of(robot), seeds_of(robot)
    if bare is None:
        return None
    fields: dict[int, Any] = {place: bare.arrays.get(place, int(number)) for place, number in enumerate(bare.header)}
    fields |= {
        ik_layout.SEED_COUNT: len(seeds.q),
        ik_layout.SEEDS: seeds.q,
        ik_layout.SEED_TIPS: pose_numbers(seeds.tips),
    }
    return table(fields)


def pose_numbers(poses: NDArray[np.float64]) -> Matrix:
    """Poses, shape (k, 4, 4), as 12 numbers each: the rotation row by row, then the origin."""
    return np.concatenate([poses[:, :3, :3].reshape(-1, 9), poses[:, :3, 3]], axis=1)
