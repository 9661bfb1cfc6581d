"""Gaps of two solids at one place, in float64: how large, between which points, and how fast joints change them.

Nothing is proven here: a gap says where to go, and proofs say whether a motion is free.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.kernels.checks.gjk import cross, dot, minus, nearest_on_triangle, scaled
from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.cloud_planes import cloud_at, put_box
from rrtik_ompl.kernels.proof.frames import frame_at, node_frames, origin_of, place_frames, turned, vector_at
from rrtik_ompl.kernels.proof.layout import Frame, PairRows, ProofTable
from rrtik_ompl.kernels.proof.planes import farthest, sizes_at, solid_at
from rrtik_ompl.kernels.proof.proof_kernels import kind_of
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at

MOST_STEPS = 20
LOOSE = 0.03  # share of a distance up to which it is measured
CONVERGED = 1e-4  # [m]
SHORTEST = 1e-7  # [m] of a vector that has a direction
SMALLEST_AREA = 1e-18  # [m^4] square of a triangle's that has an inside
LOWEST = -1e18
HERE = layout.NODES - 1  # the node that a place is computed in


@inlined
def makes_contact(proof: ProofTable, pair: PairRows) -> bool:
    """Whether a pair of solids has a gap that can be measured."""
    kind = kind_of(proof, pair[layout.PAIR_ONE])
    other_kind = kind_of(proof, pair[layout.PAIR_OTHER])
    known = other_kind == layout.CONVEX_SOLID or other_kind == layout.HALF_SPACE or other_kind >= layout.CLOUD
    return bool(kind == layout.CONVEX_SOLID and known)


@inlined
def show_point(proof: ProofTable, solid: int, point: Doubles) -> None:
    """Let the solid that stands for a cloud be one of its points, or the cube with that lowest corner.

    It does nothing for other solids.
    """
    kind = kind_of(proof, solid)
    if kind >= layout.CLOUD:
        side = 2.0 * cloud_at(proof.clouds, kind - layout.CLOUD).half
        put_box(proof, solid, vector_at(point, 0), (side, side, side))


@kernel
def measure_gap(
    motions: MotionTable,
    pair: PairRows,
    values: JointValues,
    ends: JointValues,
    share: float,
    way: Doubles,
    sink: Doubles,
) -> float:
    """The gap of a pair of solids at a share of a motion [m].

    Args:
        motions: Of the world; its proof has the solids.
        pair: The pair.
        values: Joint values at the start of the motion.
        ends: At its end.
        share: The place.
        way: Unit normal to begin with; gets the one that is found.
        sink: Gets the gradient with respect to the configuration at this place.
    """
    proof = motions.proof
    proof.stamps[HERE] = 0  # no longer the end of the last motion
    place_frames(proof, values, ends, share, HERE)
    frames = node_frames(proof, HERE)
    one = solid_at(proof, pair[layout.PAIR_ONE])[layout.SOLID_FRAME]
    other = solid_at(proof, pair[layout.PAIR_OTHER])[layout.SOLID_FRAME]
    gap, normal, p, q = nearest_points(proof, pair, frame_at(frames, one), frame_at(frames, other), vector_at(way, 0))

    way[0] = normal[0]
    way[1] = normal[1]
    way[2] = normal[2]
    for k in range(motions.dof):
        sink[k] = 0.0
    add_rates(motions, frames, one, p, normal, sink)
    add_rates(motions, frames, other, q, scaled(normal, -1.0), sink)
    return gap  # type: ignore[no-any-return]


@kernel
def add_rates(motions: MotionTable, frames: Frame, number: int, point: Any, way: Any, sink: Doubles) -> None:
    """Add how fast a point of a frame moves along a vector, for each number of a configuration."""
    proof = motions.proof
    while number != 0:
        joint = number - 1
        frame = frame_at(frames, number)
        axis = turned(frame, vector_at(row_at(proof.joints, layout.JOINT_SIZE, joint), layout.JOINT_AXIS))
        rate = dot(axis, way)
        if proof.sliding[joint] == 0:
            rate = dot(way, cross(axis, minus(point, origin_of(frame))))
        gain = row_at(motions.gain, motions.dof, joint)
        for k in range(motions.dof):
            sink[k] += rate * gain[k]
        number = proof.parents[joint]


@kernel
def nearest_points(proof: ProofTable, pair: PairRows, frame: Frame, other_frame: Frame, way: Any) -> Any:
    """The gap of two solids [m], its unit normal towards the first one, and the nearest points of both.

    Points are those of the solids' cores, without the balls around these.
    """
    one = pair[layout.PAIR_ONE]
    other = pair[layout.PAIR_OTHER]
    around = sizes_at(proof, one)[layout.ROUND]
    if kind_of(proof, other) == layout.HALF_SPACE:
        half_space = sizes_at(proof, other)
        normal = turned(other_frame, vector_at(half_space, layout.DISC_AXIS))
        p = farthest(proof, one, frame, scaled(normal, -1.0))
        return dot(normal, p) - half_space[layout.DISC] - around, normal, p, p

    around += sizes_at(proof, other)[layout.ROUND]
    best = LOWEST
    best_way = way
    distance = -LOWEST  # of the triangle from the origin
    nearest = way
    a = b = c = way  # a triangle of differences of points, and the points of the first solid that they are of
    of_a = of_b = of_c = way
    for step in range(MOST_STEPS):  # GJK [35]
        first = farthest(proof, one, frame, scaled(way, -1.0))
        p = minus(first, farthest(proof, other, other_frame, way))
        height = dot(p, way)
        if height > best:
            best = height
            best_way = way
        if distance - height < CONVERGED + LOOSE * distance:
            break
        if step == 0:
            a, b, c, nearest = p, p, p, p
            of_a, of_b, of_c = first, first, first
        else:  # p takes the place of one of the three corners
            u = nearest_on_triangle(a, b, p)
            v = nearest_on_triangle(b, c, p)
            w = nearest_on_triangle(c, a, p)
            to_u = dot(u, u)
            to_v = dot(v, v)
            to_w = dot(w, w)
            if to_u <= to_v and to_u <= to_w:
                c, of_c, nearest = p, first, u
            elif to_v <= to_w:
                a, of_a, nearest = p, first, v
            else:
                b, of_b, nearest = p, first, w
        distance = sqrt(dot(nearest, nearest))
        if distance < SHORTEST:
            break
        way = scaled(nearest, 1.0 / distance)

    shares = shares_of_corners(a, b, c, nearest)
    p = weighted(shares, of_a, of_b, of_c)
    return best - around, best_way, p, minus(p, nearest)


@inlined
def shares_of_corners(a: Any, b: Any, c: Any, p: Any) -> Any:
    """The shares with which the corners of a triangle, which may be a segment or a point, make up a point of it."""
    ab = minus(b, a)
    ac = minus(c, a)
    normal = cross(ab, ac)
    area = dot(normal, normal)
    ap = minus(p, a)
    if area > SMALLEST_AREA:
        of_b = dot(cross(ap, ac), normal) / area
        of_c = dot(cross(ab, ap), normal) / area
        return 1.0 - of_b - of_c, of_b, of_c
    if dot(ab, ab) >= dot(ac, ac):
        of_b = share_along(ap, ab)
        return 1.0 - of_b, of_b, 0.0
    of_c = share_along(ap, ac)
    return 1.0 - of_c, 0.0, of_c


@inlined
def share_along(p: Any, segment: Any) -> float:
    """How much of a segment from the origin lies before a point."""
    square = dot(segment, segment)
    share: float = min(1.0, max(0.0, dot(p, segment) / square)) if square > 0.0 else 0.0
    return share


@inlined
def weighted(shares: Any, a: Any, b: Any, c: Any) -> Any:
    """The point that three points make up."""
    p = scaled(a, shares[0])
    q = scaled(b, -shares[1])
    r = scaled(c, -shares[2])
    return minus(minus(p, q), r)
