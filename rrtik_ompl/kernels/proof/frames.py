"""Forward kinematics of a proof in float64, and the bound on how far a motion bends away from a straight line."""

from __future__ import annotations

from math import cos, sin
from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot
from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.accessors import (
    base_of_sweep,
    bends_of,
    frame_of_sweep,
    frames_of,
    joint_count_of,
    joints_of,
    node_frames,
    parents_of,
    reaches_of,
    sliding_of,
    sweep_count_of,
    sweeps_of,
    vector_at,
)
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, int_at, set_double


@inlined
def turned(array: int, place: int, p: Any) -> Any:
    """A vector of a frame in the frame's surroundings."""
    return (
        dot(vector_at(array, place), p),
        dot(vector_at(array, place + 3), p),
        dot(vector_at(array, place + 6), p),
    )


@inlined
def turned_back(array: int, place: int, p: Any) -> Any:
    """A vector of the surroundings in a frame."""
    a, b, c = vector_at(array, place), vector_at(array, place + 3), vector_at(array, place + 6)
    return (
        a[0] * p[0] + b[0] * p[1] + c[0] * p[2],
        a[1] * p[0] + b[1] * p[1] + c[1] * p[2],
        a[2] * p[0] + b[2] * p[1] + c[2] * p[2],
    )


@inlined
def carried(array: int, place: int, p: Any) -> Any:
    """A point of a frame in the frame's surroundings."""
    x, y, z = turned(array, place, p)
    origin = vector_at(array, place + layout.SHIFT)
    return x + origin[0], y + origin[1], z + origin[2]


@kernel
def place_frames(table: ProofTable, start: JointValues, end: JointValues, s: float, node: int) -> None:
    """Write the frames of all joints at a share s of the motion between two rows of joint values."""
    frames, joints, parents = frames_of(table), joints_of(table), parents_of(table)
    first = node_frames(table, node)
    for place in range(layout.FRAME_SIZE):
        set_double(frames, first + place, 1.0 if place in (0, 4, 8) else 0.0)
    for k in range(joint_count_of(table)):
        q = double_at(start, k) + s * (double_at(end, k) - double_at(start, k))
        parent, to = first + layout.FRAME_SIZE * int_at(parents, k), first + layout.FRAME_SIZE * (k + 1)
        record = layout.JOINT_SIZE * k
        axis = vector_at(joints, record + layout.JOINT_AXIS)
        shift = vector_at(joints, record + layout.SHIFT)
        slides = int_at(sliding_of(table), k) != 0
        c, e = (1.0, 0.0) if slides else (cos(q), sin(q))
        d = 1.0 - c
        x, y, z = axis
        for i in range(3):
            row = vector_at(frames, parent + 3 * i)
            u, v, w = turned_back(joints, record, row)
            along = q * (u * x + v * y + w * z) if slides else 0.0
            set_double(frames, to + 3 * i, u * (c + x * x * d) + v * (y * x * d + z * e) + w * (z * x * d - y * e))
            set_double(frames, to + 3 * i + 1, u * (x * y * d - z * e) + v * (c + y * y * d) + w * (z * y * d + x * e))
            set_double(frames, to + 3 * i + 2, u * (x * z * d + y * e) + v * (y * z * d - x * e) + w * (c + z * z * d))
            origin = double_at(frames, parent + layout.SHIFT + i)
            set_double(frames, to + layout.SHIFT + i, origin + dot(row, shift) + along)


@kernel
def seen_from(frames: int, frame: int, base: int, seen: int, to: int) -> None:
    """Write a frame as seen from another one, all by their places."""
    for column in range(3):
        way = (
            double_at(frames, frame + column),
            double_at(frames, frame + 3 + column),
            double_at(frames, frame + 6 + column),
        )
        x, y, z = turned_back(frames, base, way)
        set_double(seen, to + column, x)
        set_double(seen, to + 3 + column, y)
        set_double(seen, to + 6 + column, z)
    a, b = vector_at(frames, frame + layout.SHIFT), vector_at(frames, base + layout.SHIFT)
    x, y, z = turned_back(frames, base, (a[0] - b[0], a[1] - b[1], a[2] - b[2]))
    set_double(seen, to + layout.SHIFT, x)
    set_double(seen, to + layout.SHIFT + 1, y)
    set_double(seen, to + layout.SHIFT + 2, z)


@kernel
def bound_bends(table: ProofTable, start: JointValues, end: JointValues) -> None:
    """Bound the acceleration of each sweep's points over a whole motion, time running from 0 to 1 [m].

    From the body inwards: what turns at rate w about an axis at most r away adds the centripetal w^2 r and the Coriolis
    term 2 w V of the velocity V that it has already; what slides adds velocity alone.
    """
    count, sliding, parents = joint_count_of(table), sliding_of(table), parents_of(table)
    reaches, bends, sweeps = reaches_of(table), bends_of(table), sweeps_of(table)
    for sweep in range(sweep_count_of(table)):
        velocity, bend = 0.0, 0.0
        frame, base = frame_of_sweep(sweeps, sweep), base_of_sweep(sweeps, sweep)
        while frame != base:
            k = frame - 1
            rate = abs(double_at(end, k) - double_at(start, k))
            if int_at(sliding, k) != 0:
                velocity += rate
            else:
                reach = double_at(reaches, count * sweep + k)
                bend += rate * (2.0 * velocity + rate * reach)
                velocity += rate * reach
            frame = int_at(parents, k)
        set_double(bends, sweep, bend)
