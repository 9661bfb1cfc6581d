"""Forward kinematics in kernels: frames of all joints for ``WIDTH`` configurations at a time, one to a SIMD lane.

Joint values stay in float64 until they are reduced to half a turn, so that neither large angles nor long motions cost
precision; frames are float32. A placement that turns about x alone, as in tables of Denavit and Hartenberg [33], costs
less than others; the tables of the arm have such ones where they can.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.layout import ALIGNED_TURN, FIRST_TURN, TURN, ArmTable, Frame, Placement, ScratchTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, int_at, nearest, single, spread, wide_lanes_at
from rrtik_ompl.kernels.simd.vectors import along
from rrtik_ompl.kernels.tables.accessors import (
    first_row_of,
    frame_at,
    origin_at,
    origin_of,
    placement_at,
    rotation_row,
    second_row_of,
    set_origin,
    set_rotation_row,
    third_row_of,
)

HALF_TURNS_PER_RADIAN = 1.0 / np.pi
HALF_TURN = np.pi

# Polynomials in z = x^2 for |x| <= pi / 2, fitted to the smallest greatest error [45]:
# sin x = x + x z S(z), error 4.7e-9; cos x = 1 - z / 2 + z^2 C(z), error 4.0e-10.
SINE = tuple(np.float32(x) for x in (-0.166666571, 8.33301729e-03, -1.98066152e-04, 2.60005473e-06))
COSINE = tuple(np.float32(x) for x in (4.16666558e-02, -1.38885692e-03, 2.47693042e-05, -2.61938150e-07))
HALF, ONE, EIGHT = (np.float32(x) for x in (0.5, 1.0, 8.0))


@inlined
def sine_and_cosine(angle: Any) -> Any:
    """Sine and cosine of wide lanes as lanes, within 1.5e-7 for angles up to 1e8 [rad]."""
    whole = nearest(angle * HALF_TURNS_PER_RADIAN)
    halved = 0.5 * whole
    x = single(angle - whole * HALF_TURN)
    odd = single(halved - nearest(halved))  # odd: 1/2 after a half turn, or 0
    sign = ONE - EIGHT * odd * odd
    z = x * x
    sine = x + x * z * (SINE[0] + z * (SINE[1] + z * (SINE[2] + z * SINE[3])))
    cosine = (ONE - HALF * z) + z * z * (COSINE[0] + z * (COSINE[1] + z * (COSINE[2] + z * COSINE[3])))

    return sign * sine, sign * cosine


@kernel
def forward_kinematics(arm: ArmTable, scratch: ScratchTable) -> None:
    """Frames of all joints from the joint values in the scratch memory."""
    first_frames(arm, scratch, arm.joint_count)


@kernel
def first_frames(arm: ArmTable, scratch: ScratchTable, count: int) -> None:
    """Frames of the first joints; their parents are among them, and the world's own frame is there already."""
    parents = arm.parents
    kinds = arm.joint_kinds
    phases = arm.phases
    values = scratch.values
    frames = scratch.frames

    for joint in range(count):
        parent = frame_at(frames, int_at(parents, joint))
        frame = frame_at(frames, joint + 1)
        fixed = placement_at(arm.placements, joint)
        kind = int_at(kinds, joint)
        value = wide_lanes_at(values, joint)

        if kind == ALIGNED_TURN:
            sine, cosine = sine_and_cosine(value + double_at(phases, joint))
            turn_aligned(parent, frame, fixed, sine, cosine)
        elif kind == FIRST_TURN:
            sine, cosine = sine_and_cosine(value)
            turn_first(frame, fixed, sine, cosine)
        elif kind == TURN:
            sine, cosine = sine_and_cosine(value)
            turn(parent, frame, fixed, sine, cosine)
        else:
            slide(parent, frame, fixed, single(value))


@inlined
def slide(parent: Frame, frame: Frame, fixed: Placement, value: Any) -> None:
    """Frame of a sliding joint: along its own z."""
    for row in range(3):
        a, b, c = rotation_row(parent, row)
        x, y, z = rotated(fixed, a, b, c)
        set_rotation_row(frame, row, x, y, z)
        origin = origin_at(parent, row) + along(origin_of(fixed), a, b, c)
        set_origin(frame, row, origin + z * value)


@inlined
def turn(parent: Frame, frame: Frame, fixed: Placement, sine: Any, cosine: Any) -> None:
    """Frame of a turning joint: about its own z."""
    for row in range(3):
        a, b, c = rotation_row(parent, row)
        x, y, z = rotated(fixed, a, b, c)
        set_rotation_row(frame, row, x * cosine + y * sine, y * cosine - x * sine, z)
        set_origin(frame, row, origin_at(parent, row) + along(origin_of(fixed), a, b, c))


@inlined
def turn_aligned(parent: Frame, frame: Frame, fixed: Placement, sine: Any, cosine: Any) -> None:
    """The same where the placement turns about x alone."""
    tilted_cosine = second_row_of(fixed)[1]
    tilted_sine = third_row_of(fixed)[1]
    for row in range(3):
        x, b, c = rotation_row(parent, row)
        y = b * tilted_cosine + c * tilted_sine
        z = c * tilted_cosine - b * tilted_sine
        set_rotation_row(frame, row, x * cosine + y * sine, y * cosine - x * sine, z)
        set_origin(frame, row, origin_at(parent, row) + along(origin_of(fixed), x, b, c))


@inlined
def turn_first(frame: Frame, fixed: Placement, sine: Any, cosine: Any) -> None:
    """The same where the parent is the world."""
    first = first_row_of(fixed)
    second = second_row_of(fixed)
    third = third_row_of(fixed)
    origin = origin_of(fixed)
    set_turned_row(frame, 0, first, origin[0], sine, cosine)
    set_turned_row(frame, 1, second, origin[1], sine, cosine)
    set_turned_row(frame, 2, third, origin[2], sine, cosine)


@inlined
def set_turned_row(frame: Frame, row: int, fixed: Any, origin: float, sine: Any, cosine: Any) -> None:
    """Set a row of a frame to that of a placement, turned about z."""
    x = fixed[0]
    y = fixed[1]
    set_rotation_row(frame, row, x * cosine + y * sine, y * cosine - x * sine, spread(fixed[2]))
    set_origin(frame, row, spread(origin))


@inlined
def rotated(fixed: Placement, a: Any, b: Any, c: Any) -> Any:
    """A row (a, b, c) times the rotation of a placement."""
    first = first_row_of(fixed)
    second = second_row_of(fixed)
    third = third_row_of(fixed)
    return (
        a * first[0] + b * second[0] + c * third[0],
        a * first[1] + b * second[1] + c * third[1],
        a * first[2] + b * second[2] + c * third[2],
    )
