"""The closed form of arms whose axes 2, 3, 4 are parallel and whose axes 5, 6 meet: formulas in wide lanes.

Lanes are poses, or the branches of one pose: signs and vectors may be lanes or numbers. What the symbols mean is said
in :mod:`rrtik_ompl.ik.analytic.parallel_arm`, which is the same in numpy; turns are passed on as cosine and sine.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_layout import DOUBLE_ROOT, REACH_TOLERANCE
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.lanes import absolute, choose, larger, spread_wide, square_root
from rrtik_ompl.kernels.simd.wide_angles import arc_tangent, within_half_turn

Lanes: TypeAlias = Any
Vector: TypeAlias = Any  # three numbers or lanes
SHORTEST = 1e-300  # divisor


@inlined
def vector_of(numbers: Doubles, place: int) -> Vector:
    """Three numbers of an arm."""
    return numbers[place], numbers[place + 1], numbers[place + 2]


@inlined
def dot(a: Vector, b: Vector) -> Any:
    """Dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def minus(a: Vector, b: Vector) -> Vector:
    """Difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def turned(axis: Vector, turn: Any, v: Vector) -> Vector:
    """A vector turned about an axis."""
    c, s = turn
    w = cross(axis, v)
    along = dot(axis, v) * (1.0 - c)
    return (
        v[0] * c + w[0] * s + axis[0] * along,
        v[1] * c + w[1] * s + axis[1] * along,
        v[2] * c + w[2] * s + axis[2] * along,
    )


@inlined
def turned_back(axis: Vector, turn: Any, v: Vector) -> Vector:
    """A vector turned about an axis the other way round."""
    return turned(axis, (turn[0], -turn[1]), v)


@inlined
def onto(h: Vector, axis: Vector, v: Vector, goal: Lanes, sign: Any) -> Any:
    """The turn of v about an axis after which h . v = goal, one or the other by its sign; whether there is one.

    Where there is none, it is the turn that comes nearest.
    """
    level = dot(h, axis) * dot(axis, v)
    a = dot(h, v) - level
    b = dot(h, cross(axis, v))
    c = goal - level
    square = a * a + b * b
    rest = square - c * c
    root = sign * square_root(choose(rest < DOUBLE_ROOT * square, spread_wide(0.0), rest))
    scale = 1.0 / larger(square_root(square * larger(c * c, square)), SHORTEST)
    return ((a * c + b * root) * scale, (b * c - a * root) * scale), rest >= -REACH_TOLERANCE * square


@inlined
def between(a: Vector, b: Vector, axis: Vector) -> Any:
    """The turn about an axis that brings a to b; how long their parts across it are."""
    x = dot(a, b) - dot(a, axis) * dot(axis, b)
    y = dot(axis, cross(a, b))
    size = square_root(x * x + y * y)
    scale = 1.0 / larger(size, SHORTEST)
    return (x * scale, y * scale), size


@inlined
def wrist_of(numbers: Doubles, x: Vector, y: Vector, z: Vector, origin: Vector) -> Any:
    """Of a pose, given by the rows of its rotation and its origin: the turn since zero by rows; the place of P."""
    t0 = vector_of(numbers, branch_layout.TURN)
    t1 = vector_of(numbers, branch_layout.TURN + 3)
    t2 = vector_of(numbers, branch_layout.TURN + 6)
    turn = (
        (dot(x, t0), dot(x, t1), dot(x, t2)),
        (dot(y, t0), dot(y, t1), dot(y, t2)),
        (dot(z, t0), dot(z, t1), dot(z, t2)),
    )
    start = vector_of(numbers, branch_layout.P01)
    return turn, minus(minus(origin, start), times(turn, vector_of(numbers, branch_layout.LEVER)))


@inlined
def times(rows: Any, v: Vector) -> Vector:
    """A matrix times a vector."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


@inlined
def shoulder(numbers: Doubles, turn: Any, place: Vector, sign: Any) -> Any:
    """The turn of joint 1; P, axis 6 and the normal of axes 5 and 6 as seen behind it; real ones; how far P is away.

    That is the distance from the place, on axis 1, where joint 1 is free, which is left to numpy.
    """
    h1 = vector_of(numbers, branch_layout.H1)
    h2 = vector_of(numbers, branch_layout.H2)
    h6 = vector_of(numbers, branch_layout.H6)
    across = cross(vector_of(numbers, branch_layout.H5), h6)
    aside = dot(h2, vector_of(numbers, branch_layout.P12)) + dot(h2, vector_of(numbers, branch_layout.P45))

    first, real = onto(h2, (-h1[0], -h1[1], -h1[2]), place, spread_wide(aside), sign)
    away = cross(h1, place)
    distance = larger(square_root(dot(away, away)), absolute(dot(place, h1) * dot(h1, h2) - aside))
    seen = (
        turned_back(h1, first, place),
        turned_back(h1, first, times(turn, h6)),
        turned_back(h1, first, times(turn, across)),
    )
    return first, seen, real, distance


@inlined
def wrist(numbers: Doubles, seen: Any, sign: Any) -> Any:
    """The turns of joints 5, of 2, 3 and 4 together, and 6; real ones; the sine between axis 6 and h2.

    Where that is 0 joint 6 is free, which is left to numpy.
    """
    h2 = vector_of(numbers, branch_layout.H2)
    h5 = vector_of(numbers, branch_layout.H5)
    h6 = vector_of(numbers, branch_layout.H6)
    _, axis6, across = seen
    fifth, real = onto(h2, h5, h6, dot(h2, axis6), sign)
    middle, size = between(turned(h5, fifth, h6), axis6, h2)
    sixth, _ = between(cross(h5, h6), turned_back(h5, fifth, turned_back(h2, middle, across)), h6)
    return fifth, middle, sixth, real, square_root(size)  # both parts across are as long as the sine


@inlined
def elbow(numbers: Doubles, place: Vector, middle: Any, sign: Any) -> Any:
    """The turns of joints 2 and 3; real ones."""
    h2 = vector_of(numbers, branch_layout.H2)
    p23 = vector_of(numbers, branch_layout.P23)
    p34 = vector_of(numbers, branch_layout.P34)
    hand = turned(h2, middle, vector_of(numbers, branch_layout.P45))
    d = minus(minus(place, vector_of(numbers, branch_layout.P12)), hand)
    along = dot(d, h2)
    half = 0.5 * (dot(d, d) - along * along - dot(p23, p23) - dot(p34, p34))
    third, real = onto(p23, h2, p34, half, sign)
    forearm = turned(h2, third, p34)
    second, _ = between((forearm[0] + p23[0], forearm[1] + p23[1], forearm[2] + p23[2]), d, h2)
    return second, third, real


@inlined
def joints_of(numbers: Doubles, first: Any, second: Any, third: Any, middle: Any, fifth: Any, sixth: Any) -> Any:
    """Values of the six joints from the turns about their axes [rad]."""
    q2 = arc_tangent(second[1], second[0])
    q3 = arc_tangent(third[1], third[0])
    q4 = within_half_turn(arc_tangent(middle[1], middle[0]) - q2 - q3)
    signs = branch_layout.SIGNS
    return (
        arc_tangent(first[1], first[0]),
        q2 * numbers[signs + 1],
        q3 * numbers[signs + 2],
        q4 * numbers[signs + 3],
        arc_tangent(fifth[1], fifth[0]),
        arc_tangent(sixth[1], sixth[0]),
    )
