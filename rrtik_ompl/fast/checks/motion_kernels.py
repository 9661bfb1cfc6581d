"""Kernels that every search shares: from configurations to joint values, and the configurations of a motion.

They are those of :class:`rrtik_ompl.world.World`, to the bit: a motion and its reverse are checked at the same ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.check_kernels import check_edge
from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, set_double
from rrtik_ompl.fast.tables.accessors import arm_of, joint_count_of, joint_row
from rrtik_ompl.fast.tables.layout import JointValues, WorldTable

SLACK = 1e-9  # a motion this little longer than a number of steps is checked in that number of steps


@inlined
def copy_row(count: int, source: int, sink: int) -> None:
    """Copy numbers from one address to another."""
    for k in range(count):
        set_double(sink, k, double_at(source, k))


@kernel
def joint_values(dof: int, joints: int, gain: int, offset: int, row: int, values: int) -> None:
    """Joint values ``gain @ q + offset`` of a configuration."""
    for joint in range(joints):
        total = 0.0
        for k in range(dof):
            total += double_at(gain, joint * dof + k) * double_at(row, k)
        set_double(values, joint, total + double_at(offset, joint))


@kernel
def travel(dof: int, weights: int, start: int, end: int) -> float:
    """How far any point of the arm goes at most on a motion: ``weights @ |end - start|``."""
    total = 0.0
    for k in range(dof):
        total += double_at(weights, k) * abs(double_at(end, k) - double_at(start, k))
    return total


@inlined
def whole_steps(steps: float) -> Any:
    """Number of steps in which a motion is checked; the rule of :meth:`rrtik_ompl.world.World.steps`."""
    return max(1, int(np.ceil(steps - SLACK)))


@kernel
def descends(dof: int, start: int, end: int) -> Any:
    """Whether the start comes after the end in the order of their coordinates."""
    for k in range(dof):
        if double_at(start, k) != double_at(end, k):
            return double_at(start, k) > double_at(end, k)
    return False


@kernel
def check_motion(
    world: WorldTable,
    dof: int,
    gain: int,
    offset: int,
    start: int,
    end: int,
    steps: int,
    values: JointValues,
    resolve: bool,
) -> Any:
    """Check the motion between two configurations; ``values`` has room for the joint values of both."""
    joints = joint_count_of(arm_of(world))
    others = joint_row(values, joints, 1)
    first, second = (end, start) if descends(dof, start, end) else (start, end)
    joint_values(dof, joints, gain, offset, first, values)
    joint_values(dof, joints, gain, offset, second, others)
    return check_edge(world, values, others, steps, resolve)
