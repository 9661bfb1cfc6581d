"""Straight motions in kernels: joint values of configurations, steps of motions, and whether motions are free.

The configurations that are checked are those of :class:`rrtik_ompl.World`, to the bit: a motion and its reverse
are checked at the same ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_edge, check_part
from rrtik_ompl.kernels.layout import FREE, DoubleArray, JointValues, WorldTable
from rrtik_ompl.kernels.search.motions import motion_layout
from rrtik_ompl.kernels.search.motions.motion_layout import STEP_TOLERANCE, MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.simd.access import field_reader
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, set_double
from rrtik_ompl.kernels.tables.accessors import joint_row

world_of: Callable[[MotionTable], WorldTable] = field_reader(motion_layout.WORLD)
dof_of: Callable[[MotionTable], int] = field_reader(motion_layout.DOF)
joints_of: Callable[[MotionTable], int] = field_reader(motion_layout.JOINTS)
gain_of: Callable[[MotionTable], DoubleArray] = field_reader(motion_layout.GAIN)
offset_of: Callable[[MotionTable], DoubleArray] = field_reader(motion_layout.OFFSET)
weights_of: Callable[[MotionTable], DoubleArray] = field_reader(motion_layout.WEIGHTS)
numbers_of: Callable[[MotionTable], DoubleArray] = field_reader(motion_layout.NUMBERS)
ends_of: Callable[[MotionTable], JointValues] = field_reader(motion_layout.ENDS)
resolve_of: Callable[[MotionTable], int] = field_reader(motion_layout.RESOLVE)


@inlined
def resolves(motions: MotionTable) -> bool:
    """Whether doubtful motions are resolved in this world."""
    return resolve_of(motions) != 0


@kernel
def set_joint_values(motions: MotionTable, row: Configuration, values: JointValues) -> None:
    """Write the joint values of a configuration."""
    dof, gain, offset = dof_of(motions), gain_of(motions), offset_of(motions)
    for joint in range(joints_of(motions)):
        total = 0.0
        for k in range(dof):
            total += double_at(gain, joint * dof + k) * double_at(row, k)
        set_double(values, joint, total + double_at(offset, joint))


@inlined
def whole_steps(steps: float) -> Any:
    """The number of steps that a length of so many steps takes."""
    return max(1, int(np.ceil(steps - STEP_TOLERANCE)))


@kernel
def step_count(motions: MotionTable, start: Configuration, end: Configuration) -> Any:
    """Number of steps in which a motion is checked, as :func:`~.motion_table.step_counts` gives it."""
    dof, weights, numbers = dof_of(motions), weights_of(motions), numbers_of(motions)
    travel, square = 0.0, 0.0
    for k in range(dof):
        gap = double_at(end, k) - double_at(start, k)
        travel += double_at(weights, k) * abs(gap)
        square += gap * gap
    steps = travel / double_at(numbers, motion_layout.RESOLUTION)
    per_unit = double_at(numbers, motion_layout.STEPS_PER_UNIT)
    if per_unit > 0.0:
        steps = max(steps, per_unit * np.sqrt(square))
    return whole_steps(steps)


@kernel
def descends(dof: int, start: Configuration, end: Configuration) -> Any:
    """Whether the start comes after the end in the order of their coordinates."""
    for k in range(dof):
        if double_at(start, k) != double_at(end, k):
            return double_at(start, k) > double_at(end, k)
    return False


@kernel
def check_motion(motions: MotionTable, start: Configuration, end: Configuration, resolve: bool) -> Any:
    """Check the motion between two configurations: FREE, UNDECIDED or COLLIDING.

    Without ``resolve`` the outer balls alone decide, and what they do not prove free is UNDECIDED.
    """
    first, second = (end, start) if descends(dof_of(motions), start, end) else (start, end)
    values = ends_of(motions)
    others = joint_row(values, joints_of(motions), 1)
    set_joint_values(motions, first, values)
    set_joint_values(motions, second, others)
    return check_edge(world_of(motions), values, others, step_count(motions, start, end), resolve)


@kernel
def configuration_free(motions: MotionTable, row: Configuration) -> bool:
    """Whether the outer balls prove a configuration free."""
    values = ends_of(motions)
    set_joint_values(motions, row, values)
    return check_part(world_of(motions), values, values, 1, 1, 1, False) == FREE
