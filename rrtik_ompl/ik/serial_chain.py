"""The joints from the base to the tip as tables for kernels, and configurations to start from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.ik.reference_descent import DAMPING, DAMPING_SHARE, LARGEST_STEP, PER_CHORD, SHARE_GROWTH, STALLED
from rrtik_ompl.ik.tip_columns import TipColumns, tip_columns
from rrtik_ompl.kernels.ik.ik_layout import LimbTable
from rrtik_ompl.kernels.tables.memory import aligned, packed
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.tip_distance import reach_of

SEEDS = 512  # configurations that walks may start from


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
def limb_of(robot: Robot) -> LimbTable | None:
    """The table of a robot's limb without seeds; None if a joint hangs on several numbers of q."""
    return limb_table(robot, tip_columns(robot))


def limb_table(robot: Robot, tip: TipColumns) -> LimbTable | None:
    """The table of the joints that move a frame, without seeds; None if one of them hangs on several numbers of q."""
    if (np.count_nonzero(tip.gain, axis=1) > 1).any():
        return None
    columns = np.argmax(np.abs(tip.gain), axis=1)
    return packed(
        LimbTable,
        joints=len(columns),
        dof=robot.dof,
        fixed=pose_numbers(tip.fixed),
        sliding=tip.prismatic.astype(np.int32),
        column=columns.astype(np.int32),
        gain=tip.gain[np.arange(len(columns)), columns],
        offset=tip.offset,
        lower=np.asarray(robot.lower),
        upper=np.asarray(robot.upper),
        per_metre=1.0 / reach_of(robot),
        per_chord=PER_CHORD,
        damping=DAMPING,
        share=DAMPING_SHARE,
        share_growth=SHARE_GROWTH,
        largest_step=LARGEST_STEP,
        stalled=STALLED,
    )


@lru_cache(maxsize=64)
def seeded_limb_of(robot: Robot) -> LimbTable | None:
    """As `limb_of`, with the configurations of `seeds_of` to start from."""
    limb = limb_table(robot, tip_columns(robot))
    seeds = seeds_of(robot)
    if limb is not None:
        limb.put(seed_count=len(seeds.q), seeds=aligned(seeds.q), seed_tips=aligned(pose_numbers(seeds.tips)))
    return limb


def pose_numbers(poses: NDArray[np.float64]) -> Matrix:
    """Poses, shape (k, 4, 4), as 12 numbers each: the rotation row by row, then the origin."""
    return np.concatenate([poses[:, :3, :3].reshape(-1, 9), poses[:, :3, 3]], axis=1)
