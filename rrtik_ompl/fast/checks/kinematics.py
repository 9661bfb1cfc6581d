"""Forward kinematics in kernels: frames of all joints for ``WIDTH`` configurations at a time, one to a SIMD lane.

Joint values stay in float64 until they are reduced to an eighth of a turn, so that neither large angles nor long
motions cost precision; frames are float32.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.obstacle_kernels import along
from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    absolute,
    choose,
    floor,
    int_at,
    nearest,
    single,
    wide_lanes_at,
)
from rrtik_ompl.fast.tables.accessors import (
    first_row_of,
    frame_at,
    frames_of,
    joint_count_of,
    origin_at,
    origin_of,
    parents_of,
    placement_of,
    rotation_row,
    second_row_of,
    set_origin,
    set_rotation_row,
    sliding_of,
    third_row_of,
    values_of,
)
from rrtik_ompl.fast.tables.layout import (
    ArmTable,
    Frame,
    Placement,
    ScratchTable,
)

QUARTERS_PER_RADIAN = 2.0 / np.pi
QUARTER_HIGH = 1.5707963267948966  # pi / 2 in two parts: the second is what float64 cannot hold of it
QUARTER_LOW = 6.123233995736766e-17

# Polynomials in z = x^2 for |x| <= pi / 4, fitted to the smallest greatest error [45]:
# sin x = x + x z S(z), error 1.8e-9; cos x = 1 - z / 2 + z^2 C(z), error 1e-10.
SINE = (np.float32(-0.16666651), np.float32(0.00833198), np.float32(-0.00019496))
COSINE = (np.float32(4.16666469e-02), np.float32(-1.38873672e-03), np.float32(2.44384155e-05))
HALF, ONE, TWO, ONE_AND_HALF = (np.float32(x) for x in (0.5, 1.0, 2.0, 1.5))


@inlined
def sine_and_cosine(angle: Any) -> Any:
    """Sine and cosine of wide lanes as lanes, within 1.5e-7 for angles up to 1e8 [rad]."""
    quarters = nearest(angle * QUARTERS_PER_RADIAN)
    x = single((angle - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW)
    quarter = single(quarters - floor(quarters * 0.25) * 4.0)  # 0, 1, 2 or 3
    z = x * x
    sine = x + x * z * (SINE[0] + z * (SINE[1] + z * SINE[2]))
    cosine = (ONE - HALF * z) + z * z * (COSINE[0] + z * (COSINE[1] + z * COSINE[2]))
    odd = absolute(absolute(quarter - TWO) - ONE) < HALF
    turned_sine, turned_cosine = choose(odd, cosine, sine), choose(odd, sine, cosine)
    return (
        choose(quarter > ONE_AND_HALF, -turned_sine, turned_sine),
        choose(absolute(quarter - ONE_AND_HALF) < ONE, -turned_cosine, turned_cosine),
    )


@kernel
def forward_kinematics(arm: ArmTable, scratch: ScratchTable) -> None:
    """Frames of all joints from the joint values in the scratch memory (the world's own frame is there already)."""
    parents, sliding = parents_of(arm), sliding_of(arm)
    values, frames = values_of(scratch), frames_of(scratch)
    for joint in range(joint_count_of(arm)):
        parent, frame = frame_at(frames, int_at(parents, joint)), frame_at(frames, joint + 1)
        fixed = placement_of(arm, joint)
        value = wide_lanes_at(values, joint)
        if int_at(sliding, joint) != 0:
            slide(parent, frame, fixed, single(value))
        else:
            turn(parent, frame, fixed, value)


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
def turn(parent: Frame, frame: Frame, fixed: Placement, value: Any) -> None:
    """Frame of a turning joint: about its own z."""
    sine, cosine = sine_and_cosine(value)
    for row in range(3):
        a, b, c = rotation_row(parent, row)
        x, y, z = rotated(fixed, a, b, c)
        set_rotation_row(frame, row, x * cosine + y * sine, y * cosine - x * sine, z)
        set_origin(frame, row, origin_at(parent, row) + along(origin_of(fixed), a, b, c))


@inlined
def rotated(fixed: Placement, a: Any, b: Any, c: Any) -> Any:
    """A row (a, b, c) times the rotation of a placement."""
    first, second, third = first_row_of(fixed), second_row_of(fixed), third_row_of(fixed)
    return (
        a * first[0] + b * second[0] + c * third[0],
        a * first[1] + b * second[1] + c * third[1],
        a * first[2] + b * second[2] + c * third[2],
    )
