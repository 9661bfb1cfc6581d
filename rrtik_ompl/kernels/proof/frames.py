"""Forward kinematics of a proof in float64, and the bound on how far a motion bends away from a straight line."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot
from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.layout import CarriedSolids, Frame, ProofTable
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import set_wide_lanes, spread_wide, wide_lanes_at
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.simd.wide_angles import wide_sine_and_cosine


@inlined
def vector_at(numbers: Any, place: int) -> Any:
    """Three numbers of an array from a place on."""
    return numbers[place], numbers[place + 1], numbers[place + 2]


@inlined
def frame_at(frames: Frame, number: int) -> Frame:
    """One of several frames."""
    return row_at(frames, layout.FRAME_SIZE, number)


@inlined
def node_frames(proof: CarriedSolids, node: int) -> Frame:
    """The frames of a node; the first one is the world."""
    return row_at(proof.frames, layout.FRAME_SIZE * (proof.joint_count + 1), node)


@inlined
def blocks_of(count: int) -> int:
    """How many blocks of lanes hold so many numbers."""
    return (count + WIDTH - 1) // WIDTH


@inlined
def origin_of(frame: Frame) -> Any:
    """The origin of a frame."""
    return vector_at(frame, layout.ORIGIN)


@inlined
def turned(frame: Frame, p: Any) -> Any:
    """A vector of a frame in the frame's surroundings."""
    return dot(vector_at(frame, 0), p), dot(vector_at(frame, 3), p), dot(vector_at(frame, 6), p)


@inlined
def turned_back(frame: Frame, p: Any) -> Any:
    """A vector of the surroundings in a frame."""
    a = vector_at(frame, 0)
    b = vector_at(frame, 3)
    c = vector_at(frame, 6)
    return (
        a[0] * p[0] + b[0] * p[1] + c[0] * p[2],
        a[1] * p[0] + b[1] * p[1] + c[1] * p[2],
        a[2] * p[0] + b[2] * p[1] + c[2] * p[2],
    )


@inlined
def carried(frame: Frame, p: Any) -> Any:
    """A point of a frame in the frame's surroundings."""
    x, y, z = turned(frame, p)
    origin = origin_of(frame)
    return x + origin[0], y + origin[1], z + origin[2]


@kernel
def place_frames(proof: CarriedSolids, start: JointValues, end: JointValues, share: float, node: int) -> None:
    """Write the frames of all joints at a share of the motion between two rows of joint values."""
    frames = node_frames(proof, node)
    for place in range(layout.FRAME_SIZE):
        frames[place] = 1.0 if place in (0, 4, 8) else 0.0
    joints = proof.joint_count
    angles = proof.angles
    blocks = blocks_of(joints)
    for k in range(joints):
        angles[k] = start[k] + share * (end[k] - start[k])
    for block in range(blocks):
        sine, cosine = wide_sine_and_cosine(wide_lanes_at(angles, block))
        set_wide_lanes(angles, blocks + block, sine)
        set_wide_lanes(angles, 2 * blocks + block, cosine)

    sines = row_at(angles, blocks * WIDTH, 1)
    cosines = row_at(angles, blocks * WIDTH, 2)
    for k in range(joints):
        value = angles[k]
        slides = proof.sliding[k] != 0
        cosine, sine = (1.0, 0.0) if slides else (cosines[k], sines[k])
        joint = row_at(proof.joints, layout.JOINT_SIZE, k)
        move_frame(joint, value, slides, cosine, sine, frame_at(frames, proof.parents[k]), frame_at(frames, k + 1))


@inlined
def move_frame(joint: Any, value: float, slides: bool, cosine: float, sine: float, parent: Frame, frame: Frame) -> None:
    """Write the frame of a joint: its placement in the parent's frame, then its own turn (Rodrigues) or slide."""
    x, y, z = vector_at(joint, layout.JOINT_AXIS)
    shift = origin_of(joint)
    c = cosine
    s = sine
    d = 1.0 - cosine
    for i in range(3):
        row = vector_at(parent, 3 * i)
        u, v, w = turned_back(joint, row)
        frame[3 * i] = u * (c + x * x * d) + v * (y * x * d + z * s) + w * (z * x * d - y * s)
        frame[3 * i + 1] = u * (x * y * d - z * s) + v * (c + y * y * d) + w * (z * y * d + x * s)
        frame[3 * i + 2] = u * (x * z * d + y * s) + v * (y * z * d - x * s) + w * (c + z * z * d)
        along = value * (u * x + v * y + w * z) if slides else 0.0
        frame[layout.ORIGIN + i] = parent[layout.ORIGIN + i] + dot(row, shift) + along


@kernel
def seen_from(base: Frame, frame: Frame, seen: Frame) -> None:
    """Write a frame as seen from another one."""
    for column in range(3):
        axis = frame[column], frame[3 + column], frame[6 + column]
        x, y, z = turned_back(base, axis)
        seen[column] = x
        seen[3 + column] = y
        seen[6 + column] = z
    a = origin_of(frame)
    b = origin_of(base)
    x, y, z = turned_back(base, (a[0] - b[0], a[1] - b[1], a[2] - b[2]))
    seen[layout.ORIGIN] = x
    seen[layout.ORIGIN + 1] = y
    seen[layout.ORIGIN + 2] = z


@kernel
def bound_bends(proof: ProofTable, start: JointValues, end: JointValues) -> None:
    """Bound the acceleration of each sweep's points over a whole motion, time running from 0 to 1 [m].

    From the body inwards: what turns at rate w about an axis at most r away adds the centripetal w^2 r and the Coriolis
    term 2 w V of the velocity V that it has already; what slides adds velocity alone. Here lanes hold sweeps.
    """
    joints = proof.joint_count
    for block in range(blocks_of(proof.sweep_count)):
        velocity = spread_wide(0.0)
        bend = spread_wide(0.0)
        joint = joints
        while joint > 0:  # parents have smaller numbers
            joint -= 1
            rate = abs(end[joint] - start[joint])
            own = wide_lanes_at(proof.carries, block * joints + joint) * rate
            if proof.sliding[joint] != 0:
                velocity = velocity + own
            elif rate > 0.0:
                turned = wide_lanes_at(proof.reaches, block * joints + joint) * rate
                bend = bend + own * (2.0 * velocity + turned)
                velocity = velocity + turned
        set_wide_lanes(proof.bends, block, bend)
