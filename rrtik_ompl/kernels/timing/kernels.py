"""The kernels for timing: places on a curve through rounded corners, and reachability along it.

Source of the search: [19], algorithm 1; the constraints of a point are asked for at the next point too, which [19]
calls the interpolation scheme. Of the two linear programs of its backward pass one is needed here, for standing still
is always allowed; it has two unknowns and is solved by Newton's method on a concave function of one of them, which
is linear in pieces, so that it ends after a few rounds.
"""

from __future__ import annotations

from collections.abc import Callable

from rrtik_ompl.kernels.layout import DoubleArray
from rrtik_ompl.kernels.simd.access import double_row, field_reader
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, set_double
from rrtik_ompl.kernels.timing import layout
from rrtik_ompl.kernels.timing.layout import FLAT, MOST, ROUNDS, CurveTable, SearchTable

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
lines_of: Callable[[SearchTable], DoubleArray] = field_reader(layout.LINES)


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
def set_line(lines: DoubleArray, number: int, low: float, high: float, slope: float) -> None:
    """Line ``number`` says ``low <= u - slope x <= high``."""
    set_double(lines, 3 * number, low)
    set_double(lines, 3 * number + 1, high)
    set_double(lines, 3 * number + 2, slope)


@inlined
def joint_lines(search: SearchTable, point: int, step: float, count: int) -> int:
    """Add lines for the acceleration limits of a point, ``0.5 * step`` ahead of the one where x holds; their number."""
    n, lines = joints_of(search), lines_of(search)
    shape = double_row(shape_of(search), 3 * n, point)
    for k in range(n):
        second = double_at(shape, 2 * n + k)
        first = double_at(shape, n + k) + step * second
        if abs(first) < FLAT:
            continue
        share = 1.0 / first
        most = double_at(acceleration_of(search), k) * abs(share)
        set_line(lines, count, -most, most, -second * share)
        count += 1
    return count


@inlined
def row_lines(search: SearchTable, point: int, step: float, count: int) -> int:
    """The same for the further rows of a point."""
    rows, lines = rows_of(search), lines_of(search)
    firsts, seconds = double_row(first_of(search), rows, point), double_row(second_of(search), rows, point)
    lows, highs = double_row(low_of(search), rows, point), double_row(high_of(search), rows, point)
    for r in range(rows):
        second = double_at(seconds, r)
        first = double_at(firsts, r) + step * second
        if abs(first) < FLAT:
            continue
        share = 1.0 / first
        one, other = double_at(lows, r) * share, double_at(highs, r) * share
        set_line(lines, count, min(one, other), max(one, other), -second * share)
        count += 1
    return count


@kernel
def lines_at(search: SearchTable, point: int) -> int:
    """Write down which path accelerations are allowed at a point and lead to where the end can be reached from.

    Gives the number of lines. The first of them is about the next point, its x between 0 and what is reached there.
    """
    step = 2.0 * (double_at(grid_of(search), point + 1) - double_at(grid_of(search), point))
    set_line(lines_of(search), 0, 0.0, double_at(reached_of(search), point + 1) / step, -1.0 / step)
    count = joint_lines(search, point, 0.0, 1)
    count = joint_lines(search, point + 1, step, count)
    if rows_of(search) > 0:
        count = row_lines(search, point, 0.0, count)
        count = row_lines(search, point + 1, step, count)
    return count


@inlined
def highest(lines: DoubleArray, count: int, x: float) -> tuple:  # type: ignore[type-arg]
    """The lowest and the highest path acceleration that are allowed with x, and the lines that say so."""
    least, most, below, above = -MOST, MOST, 0, 0
    for k in range(count):
        part = double_at(lines, 3 * k + 2) * x
        low, high = double_at(lines, 3 * k) + part, double_at(lines, 3 * k + 1) + part
        if low > least:
            least, below = low, k
        if high < most:
            most, above = high, k
    return least, most, below, above


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
    x, lines = cap_by_joints(search, point), lines_of(search)
    count = lines_at(search, point)
    for _ in range(ROUNDS):
        low, high, below, above = highest(lines, count, x)
        if high >= low:
            return x
        fall = double_at(lines, 3 * below + 2) - double_at(lines, 3 * above + 2)
        gap = double_at(lines, 3 * above + 1) - double_at(lines, 3 * below)
        nearer = gap / fall if fall > 0.0 else 0.0
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
        found = highest(lines_of(search), lines_at(search, i), x)
        x += 2.0 * (double_at(grid, i + 1) - double_at(grid, i)) * found[1]
        x = min(max(x, 0.0), double_at(reached, i + 1))
        set_double(squares, i + 1, x)
    return 0
