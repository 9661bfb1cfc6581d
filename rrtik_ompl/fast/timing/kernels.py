"""The kernels for timing: places on a curve through rounded corners, and reachability along it.

Source of the search: [19], algorithm 1; the constraints of a point are asked for at the next point too, which [19]
calls the interpolation scheme. Of the two linear programs of its backward pass one is needed here, for standing still
is always allowed; it has two unknowns and is solved by Newton's method on a concave function of one of them, which
is linear in pieces, so that it ends after a few rounds.
"""

from __future__ import annotations

from collections.abc import Callable

from rrtik_ompl.fast.simd.access import double_row, field_reader
from rrtik_ompl.fast.simd.compiled import entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, set_double
from rrtik_ompl.fast.tables.layout import DoubleArray
from rrtik_ompl.fast.timing import layout
from rrtik_ompl.fast.timing.layout import FLAT, ROUNDS, CurveTable, SearchTable

along_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.ALONG)
radii_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.RADII)
directions_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.DIRECTIONS)
vertices_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.VERTICES)
at_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.AT)
values_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.VALUES)
widest_of: Callable[[CurveTable], DoubleArray] = field_reader(layout.WIDEST)
dof_of: Callable[[CurveTable], int] = field_reader(layout.DOF)
count_of: Callable[[CurveTable], int] = field_reader(layout.COUNT)
places_of: Callable[[CurveTable], int] = field_reader(layout.PLACES)

shape_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.SHAPE)
velocity_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.VELOCITY)
acceleration_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.ACCELERATION)
cap_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.CAP)
grid_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.GRID)
squares_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.SQUARES)
reached_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.REACHED)
joints_of: Callable[[SearchTable], int] = field_reader(layout.JOINTS)
rows_of: Callable[[SearchTable], int] = field_reader(layout.ROWS)
points_of: Callable[[SearchTable], int] = field_reader(layout.POINTS)
first_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.FIRST)
second_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.SECOND)
low_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.LOW)
high_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.HIGH)


@kernel
def place_on_edge(curve: CurveTable, edge: int, at: float, sink: DoubleArray) -> None:
    """What the path itself is at a place of an edge."""
    dof, ahead = dof_of(curve), at - double_at(along_of(curve), edge)
    vertex, direction = double_row(vertices_of(curve), dof, edge), double_row(directions_of(curve), dof, edge)
    for k in range(dof):
        slope = double_at(direction, k)
        set_double(sink, k, double_at(vertex, k) + ahead * slope)
        set_double(sink, dof + k, slope)
        set_double(sink, 2 * dof + k, 0.0)


@kernel
def add_rounding(curve: CurveTable, corner: int, gap: float, sink: DoubleArray) -> None:
    """Add what the rounding of a corner makes of a place ``gap`` behind it: a ramp instead of a bend."""
    dof, radius = dof_of(curve), double_at(radii_of(curve), corner)
    inside = radius - abs(gap)
    bend = inside / (radius * radius)
    slope = 0.5 * bend * inside
    lift = slope * inside / 3.0
    if gap >= 0.0:
        slope = -slope
    before, after = (
        double_row(directions_of(curve), dof, corner - 1),
        double_row(directions_of(curve), dof, corner),
    )
    for k in range(dof):
        turn = double_at(after, k) - double_at(before, k)
        set_double(sink, k, double_at(sink, k) + lift * turn)
        set_double(sink, dof + k, double_at(sink, dof + k) + slope * turn)
        set_double(sink, 2 * dof + k, double_at(sink, 2 * dof + k) + bend * turn)


@entry
def sample_curve(curve: CurveTable) -> int:
    """Position and derivatives at all places."""
    dof, last, along = dof_of(curve), count_of(curve) - 2, along_of(curve)
    widest, edge, first = double_at(widest_of(curve), 0), 0, 1
    for i in range(places_of(curve)):
        at, sink = double_at(at_of(curve), i), double_row(values_of(curve), 3 * dof, i)
        while edge < last and at >= double_at(along, edge + 1):
            edge += 1
        place_on_edge(curve, edge, at, sink)
        while first <= last and double_at(along, first) <= at - widest:
            first += 1
        corner = first
        while corner <= last and double_at(along, corner) < at + widest:
            gap = at - double_at(along, corner)
            if abs(gap) < double_at(radii_of(curve), corner):
                add_rounding(curve, corner, gap, sink)
            corner += 1
    return 0


@inlined
def narrowed(found: tuple, x: float, low: float, high: float, slope: float) -> tuple:  # type: ignore[type-arg]
    """``found`` with one more row, which says ``low <= u - slope x <= high``."""
    least, least_value, least_slope, most, most_value, most_slope = found
    if high + slope * x < most:
        most, most_value, most_slope = high + slope * x, high, slope
    if low + slope * x > least:
        least, least_value, least_slope = low + slope * x, low, slope
    return least, least_value, least_slope, most, most_value, most_slope


@inlined
def by_joints(search: SearchTable, point: int, step: float, x: float, found: tuple) -> tuple:  # type: ignore[type-arg]
    """``found`` narrowed by the acceleration limits of a point, ``0.5 * step`` ahead of the one where x holds."""
    n = joints_of(search)
    shape = double_row(shape_of(search), 3 * n, point)
    for k in range(n):
        second = double_at(shape, 2 * n + k)
        first = double_at(shape, n + k) + step * second
        if abs(first) < FLAT:
            continue
        share = 1.0 / first
        most = double_at(acceleration_of(search), k) * abs(share)
        found = narrowed(found, x, -most, most, -second * share)
    return found


@inlined
def by_rows(search: SearchTable, point: int, step: float, x: float, found: tuple) -> tuple:  # type: ignore[type-arg]
    """The same by the further rows of a point."""
    rows = rows_of(search)
    firsts, seconds = double_row(first_of(search), rows, point), double_row(second_of(search), rows, point)
    lows, highs = double_row(low_of(search), rows, point), double_row(high_of(search), rows, point)
    for r in range(rows):
        second = double_at(seconds, r)
        first = double_at(firsts, r) + step * second
        if abs(first) < FLAT:
            continue
        share = 1.0 / first
        one, other = double_at(lows, r) * share, double_at(highs, r) * share
        found = narrowed(found, x, min(one, other), max(one, other), -second * share)
    return found


@inlined
def accelerations_at(search: SearchTable, point: int, x: float) -> tuple:  # type: ignore[type-arg]
    """Which path accelerations are allowed at a point, with x there, and lead to where the end can be reached from.

    The lowest one, and of the row that says so its value at x = 0 and its slope; the same of the highest one.
    """
    step = 2.0 * (double_at(grid_of(search), point + 1) - double_at(grid_of(search), point))
    up = double_at(reached_of(search), point + 1) / step
    found = (-x / step, 0.0, -1.0 / step, up - x / step, up, -1.0 / step)
    found = by_joints(search, point, 0.0, x, found)
    found = by_joints(search, point + 1, step, x, found)
    if rows_of(search) > 0:
        found = by_rows(search, point, 0.0, x, found)
        found = by_rows(search, point + 1, step, x, found)
    return found


@kernel
def cap_by_joints(search: SearchTable, point: int) -> float:
    """The largest x of a point by the velocity limits, and by acceleration limits where only x decides."""
    n = joints_of(search)
    shape = double_row(shape_of(search), 3 * n, point)
    x: float = double_at(cap_of(search), point)
    for k in range(n):
        slope, bend = abs(double_at(shape, n + k)), abs(double_at(shape, 2 * n + k))
        speed = double_at(velocity_of(search), k)
        if slope * slope * x > speed * speed:
            x = speed * speed / (slope * slope)
        if slope < FLAT and bend * x > double_at(acceleration_of(search), k):
            x = double_at(acceleration_of(search), k) / bend
    return x


@kernel
def largest_square(search: SearchTable, point: int) -> float:
    """The largest x of a point from which the end is reached."""
    x = cap_by_joints(search, point)
    for _ in range(ROUNDS):
        low, low_value, low_slope, high, high_value, high_slope = accelerations_at(search, point, x)
        if high >= low:
            return x
        fall = low_slope - high_slope
        nearer = (high_value - low_value) / fall if fall > 0.0 else 0.0
        if not nearer < x:
            nearer = x * (1.0 - 1e-9)  # rounding alone keeps it there
        x = max(nearer, 0.0)
    return x


@entry
def find_squares(search: SearchTable) -> int:
    """Path speed squared at all points of the grid: 0 at both ends, the largest that is allowed between."""
    points, reached, squares, grid = points_of(search), reached_of(search), squares_of(search), grid_of(search)
    set_double(reached, points - 1, 0.0)
    for back in range(1, points):
        set_double(reached, points - 1 - back, largest_square(search, points - 1 - back))
    x = 0.0
    set_double(squares, 0, x)
    for i in range(points - 1):
        found = accelerations_at(search, i, x)
        x += 2.0 * (double_at(grid, i + 1) - double_at(grid, i)) * found[3]
        x = min(max(x, 0.0), double_at(reached, i + 1))
        set_double(squares, i + 1, x)
    return 0
