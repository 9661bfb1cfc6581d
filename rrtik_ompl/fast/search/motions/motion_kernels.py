"""Straight motions in kernels: joint values of configurations, steps of motions, and whether motions are free.

The configurations that are checked are those of :class:`rrtik_ompl.world.World`, to the bit: a motion and its reverse
are checked at the same ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.check_kernels import check_edge, check_part
from rrtik_ompl.fast.search.motions.motion_layout import (
    DOF,
    ENDS,
    GAIN,
    JOINTS,
    NUMBERS,
    OFFSET,
    RESOLUTION,
    RESOLVE,
    STEP_TOLERANCE,
    STEPS_PER_UNIT,
    WEIGHTS,
    WORLD,
    FastMotions,
)
from rrtik_ompl.fast.search.motions.row_kernels import Configuration, JointValues, distance, row_at
from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, set_double
from rrtik_ompl.fast.tables.layout import FREE


@inlined
def dof_of(motions: FastMotions) -> Any:
    """How many numbers a configuration has."""
    return field(motions, DOF)


@inlined
def world_of(motions: FastMotions) -> Any:
    """The tables of the checks."""
    return field(motions, WORLD)


@inlined
def resolves(motions: FastMotions) -> bool:
    """Whether doubtful motions are resolved in this world."""
    resolve: bool = field(motions, RESOLVE) != 0
    return resolve


@kernel
def set_joint_values(motions: FastMotions, row: Configuration, values: JointValues) -> None:
    """Write the joint values of a configuration."""
    dof, gain, offset = field(motions, DOF), field(motions, GAIN), field(motions, OFFSET)
    for joint in range(field(motions, JOINTS)):
        total = 0.0
        for k in range(dof):
            total += double_at(gain, joint * dof + k) * double_at(row, k)
        set_double(values, joint, total + double_at(offset, joint))


@inlined
def whole_steps(steps: float) -> Any:
    """The number of steps that a length of so many steps takes."""
    return max(1, int(np.ceil(steps - STEP_TOLERANCE)))


@kernel
def step_count(motions: FastMotions, start: Configuration, end: Configuration) -> Any:
    """Number of steps in which a motion is checked; :func:`rrtik_ompl.fast.search.motions.motion_table.step_counts`."""
    dof, weights, numbers = field(motions, DOF), field(motions, WEIGHTS), field(motions, NUMBERS)
    travel = 0.0
    for k in range(dof):
        travel += double_at(weights, k) * abs(double_at(end, k) - double_at(start, k))
    steps, per_unit = travel / double_at(numbers, RESOLUTION), double_at(numbers, STEPS_PER_UNIT)
    if per_unit > 0.0:
        steps = max(steps, per_unit * distance(dof, start, end))
    return whole_steps(steps)


@kernel
def descends(dof: int, start: Configuration, end: Configuration) -> Any:
    """Whether the start comes after the end in the order of their coordinates."""
    for k in range(dof):
        if double_at(start, k) != double_at(end, k):
            return double_at(start, k) > double_at(end, k)
    return False


@kernel
def check_motion(motions: FastMotions, start: Configuration, end: Configuration, resolve: bool) -> Any:
    """Check the motion between two configurations: FREE, UNDECIDED or COLLIDING.

    Without ``resolve`` the outer balls alone decide, and what they do not prove free is UNDECIDED.
    """
    first, second = (end, start) if descends(field(motions, DOF), start, end) else (start, end)
    values = field(motions, ENDS)
    others = row_at(values, field(motions, JOINTS), 1)
    set_joint_values(motions, first, values)
    set_joint_values(motions, second, others)
    return check_edge(world_of(motions), values, others, step_count(motions, start, end), resolve)


@kernel
def configuration_free(motions: FastMotions, row: Configuration) -> bool:
    """Whether the outer balls prove a configuration free."""
    values = field(motions, ENDS)
    set_joint_values(motions, row, values)
    return check_part(world_of(motions), values, values, 1, 1, 1, False) == FREE
