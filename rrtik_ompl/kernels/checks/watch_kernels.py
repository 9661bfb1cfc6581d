"""Motions under watch: what keeps its distance at some configurations is not checked at those between them.

The first block of configurations is spread over the motion, the others lie between. Bounds of groups, bodies and
clusters are widened in that block by how far they can move until any of the others (WATCH). What is clear even so is
clear at all of them. The principle is that of adaptive collision checking [16], without its halving.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.layout import CLEAR, JointValues, Watch, WorldTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    choose,
    double_at,
    float_at,
    highest,
    lanes_at,
    set_float,
    set_lanes,
    smaller,
    spread,
)
from rrtik_ompl.kernels.simd.records import exists

ZERO = np.float32(0.0)
NOW_CLEAR = np.float32(CLEAR)


@inlined
def slack_at(watch: Watch, number: int) -> Any:
    """By how much a bound is widened; negative if nothing is to be checked."""
    return float_at(watch, number) if exists(watch) else ZERO


@inlined
def set_clear(watch: Watch, number: int, clear: bool) -> None:
    """Note whether nothing can be met in the rest of the motion."""
    set_float(watch, number, NOW_CLEAR if clear else ZERO)


@kernel
def watch_motion(world: WorldTable, start: JointValues, end: JointValues, share: float) -> None:
    """Set by how much the bounds are widened: as far as things can move in a share of a motion."""
    bounds = world.motion_bounds
    watch = world.scratch.watch
    joints = world.arm.joint_count
    blocks = bounds.blocks
    rows = bounds.rows

    for block in range(blocks):
        total = lanes_at(rows, blocks + block)
        for joint in range(joints):
            travel = np.float32(abs(double_at(end, joint) - double_at(start, joint)) * share)
            total = total + lanes_at(rows, (joint + 2) * blocks + block) * travel
        set_lanes(watch, block, total)


@kernel
def joints_left(world: WorldTable) -> int:
    """After the first block, how many of the first joints carry what is yet to be checked; no bound is wide now."""
    bounds = world.motion_bounds
    watch = world.scratch.watch
    last = ZERO

    for block in range(bounds.blocks):
        slack = lanes_at(watch, block)
        frames = lanes_at(bounds.rows, block)
        last = max(last, highest(choose(slack >= ZERO, frames, spread(ZERO))))
        set_lanes(watch, block, smaller(slack, ZERO))

    return int(last)
