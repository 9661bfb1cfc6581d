"""Straight motions in kernels: joint values of configurations, steps of motions, and whether motions are free.

The configurations that are checked are those of :class:`rrtik_ompl.World`, to the bit: a motion and its reverse
are checked at the same ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_edge, check_part
from rrtik_ompl.kernels.layout import FREE, JointValues
from rrtik_ompl.kernels.search.motions.motion_layout import STEP_TOLERANCE, MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.tables.accessors import joint_row


@inlined
def resolves(motions: MotionTable) -> bool:
    """Whether doubtful motions are resolved in this world."""
    return motions.resolve != 0


@kernel
def set_joint_values(motions: MotionTable, row: Configuration, values: JointValues) -> None:
    """Write the joint values of a configuration."""
    for joint in range(motions.joints):
        gain = row_at(motions.gain, motions.dof, joint)
        total = 0.0
        for k in range(motions.dof):
            total += gain[k] * row[k]
        values[joint] = total + motions.offset[joint]


@inlined
def whole_steps(steps: float) -> Any:
    """The number of steps that a length of so many steps takes."""
    return max(1, int(np.ceil(steps - STEP_TOLERANCE)))


@kernel
def step_count(motions: MotionTable, start: Configuration, end: Configuration) -> Any:
    """Number of steps in which a motion is checked, as :func:`~.motion_table.step_counts` gives it."""
    travel = 0.0
    square = 0.0
    for k in range(motions.dof):
        gap = end[k] - start[k]
        travel += motions.weights[k] * abs(gap)
        square += gap * gap
    steps = travel / motions.resolution
    if motions.steps_per_unit > 0.0:
        steps = max(steps, motions.steps_per_unit * np.sqrt(square))
    return whole_steps(steps)


@kernel
def descends(dof: int, start: Configuration, end: Configuration) -> Any:
    """Whether the start comes after the end in the order of their coordinates."""
    for k in range(dof):
        if start[k] != end[k]:
            return start[k] > end[k]
    return False


@kernel
def check_motion(motions: MotionTable, start: Configuration, end: Configuration, resolve: bool) -> Any:
    """Check the motion between two configurations: FREE, UNDECIDED or COLLIDING.

    Without ``resolve`` the outer balls alone decide, and what they do not prove free is UNDECIDED.
    """
    first, second = (end, start) if descends(motions.dof, start, end) else (start, end)
    values = motions.ends
    others = joint_row(values, motions.joints, 1)
    set_joint_values(motions, first, values)
    set_joint_values(motions, second, others)
    return check_edge(motions.world, values, others, step_count(motions, start, end), resolve)


@kernel
def configuration_free(motions: MotionTable, row: Configuration) -> bool:
    """Whether the outer balls prove a configuration free."""
    values = motions.ends
    set_joint_values(motions, row, values)
    return check_part(motions.world, values, values, 1, 1, 1, False) == FREE
