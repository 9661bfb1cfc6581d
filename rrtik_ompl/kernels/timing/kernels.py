"""The kernels for timing: places on a curve through rounded corners, and reachability along it.

Source of the search: [19], algorithm 1; the constraints of a point are asked for at the next point too, which [19]
calls the interpolation scheme. Of the two linear programs of its backward pass one is needed here, for standing still
is always allowed; it has two unknowns and is solved by Newton's method on a concave function of one of them, which
is linear in pieces, so that it ends after a few rounds.
"""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.timing.layout import FLAT, MOST, ROUNDS, CurveTable, SearchTable


@kernel
def place_on_edge(curve: CurveTable, edge: int, at: float, sink: Doubles) -> None:
    """What the path itself is at a place of an edge."""
    dof = curve.dof
    ahead = at - curve.along[edge]
    vertex = row_at(curve.vertices, dof, edge)
    direction = row_at(curve.directions, dof, edge)
    for k in range(dof):
        slope = direction[k]
        sink[k] = vertex[k] + ahead * slope
        sink[dof + k] = slope
        sink[2 * dof + k] = 0.0


@kernel
def add_rounding(curve: CurveTable, corner: int, gap: float, sink: Doubles) -> None:
    """Add what the rounding of a corner makes of a place ``gap`` behind it: a ramp instead of a bend."""
    dof = curve.dof
    radius = curve.radii[corner]
    inside = radius - abs(gap)
    bend = inside / (radius * radius)
    slope = 0.5 * bend * inside
    lift = slope * inside / 3.0
    if gap >= 0.0:
        slope = -slope
    before = row_at(curve.directions, dof, corner - 1)
    after = row_at(curve.directions, dof, corner)
    for k in range(dof):
        turn = after[k] - before[k]
        sink[k] += lift * turn
        sink[dof + k] += slope * turn
        sink[2 * dof + k] += bend * turn


@entry
def sample_curve(curve: CurveTable) -> int:
    """Position and derivatives at all places."""
    along = curve.along
    widest = curve.widest
    last = curve.vertex_count - 2
    edge = 0
    first = 1  # corner whose rounding may reach here
    for i in range(curve.place_count):
        at = curve.at[i]
        sink = row_at(curve.values, 3 * curve.dof, i)
        while edge < last and at >= along[edge + 1]:
            edge += 1
        place_on_edge(curve, edge, at, sink)

        while first <= last and along[first] <= at - widest:
            first += 1
        corner = first
        while corner <= last and along[corner] < at + widest:
            gap = at - along[corner]
            if abs(gap) < curve.radii[corner]:
                add_rounding(curve, corner, gap, sink)
            corner += 1
    return 0


@inlined
def set_line(lines: Doubles, number: int, low: float, high: float, slope: float) -> None:
    """Line ``number`` says ``low <= u - slope x <= high``."""
    lines[3 * number] = low
    lines[3 * number + 1] = high
    lines[3 * number + 2] = slope


@inlined
def joint_lines(search: SearchTable, point: int, step: float, count: int) -> int:
    """Add lines for the acceleration limits of a point, ``0.5 * step`` ahead of the one where x holds; their number."""
    n = search.joints
    shape = row_at(search.shape, 3 * n, point)
    for k in range(n):
        second = shape[2 * n + k]
        first = shape[n + k] + step * second
        if abs(first) < FLAT:
            continue
        share = 1.0 / first
        most = search.acceleration[k] * abs(share)
        set_line(search.lines, count, -most, most, -second * share)
        count += 1
    return count


@inlined
def row_lines(search: SearchTable, point: int, step: float, count: int) -> int:
    """The same for the further rows of a point."""
    rows = search.rows
    firsts = row_at(search.first, rows, point)
    seconds = row_at(search.second, rows, point)
    lows = row_at(search.low, rows, point)
    highs = row_at(search.high, rows, point)
    for r in range(rows):
        second = seconds[r]
        first = firsts[r] + step * second
        if abs(first) < FLAT:
            continue
        share = 1.0 / first
        one = lows[r] * share
        other = highs[r] * share
        set_line(search.lines, count, min(one, other), max(one, other), -second * share)
        count += 1
    return count


@kernel
def lines_at(search: SearchTable, point: int) -> int:
    """Write down which path accelerations are allowed at a point and lead to where the end can be reached from.

    Gives the number of lines. The first of them is about the next point, its x between 0 and what is reached there.
    """
    step = 2.0 * (search.grid[point + 1] - search.grid[point])
    set_line(search.lines, 0, 0.0, search.reached[point + 1] / step, -1.0 / step)
    count = joint_lines(search, point, 0.0, 1)
    count = joint_lines(search, point + 1, step, count)
    if search.rows > 0:
        count = row_lines(search, point, 0.0, count)
        count = row_lines(search, point + 1, step, count)
    return count


@inlined
def highest(lines: Doubles, count: int, x: float) -> tuple:  # type: ignore[type-arg]
    """The lowest and the highest path acceleration that are allowed with x, and the lines that say so."""
    least = -MOST
    most = MOST
    below = 0
    above = 0
    for k in range(count):
        part = lines[3 * k + 2] * x
        low = lines[3 * k] + part
        high = lines[3 * k + 1] + part
        if low > least:
            least = low
            below = k
        if high < most:
            most = high
            above = k
    return least, most, below, above


@kernel
def cap_by_joints(search: SearchTable, point: int) -> float:
    """The largest x of a point by the velocity limits, and by acceleration limits where only x decides."""
    n = search.joints
    shape = row_at(search.shape, 3 * n, point)
    x: float = search.cap[point]
    for k in range(n):
        slope = abs(shape[n + k])
        bend = abs(shape[2 * n + k])
        speed = search.velocity[k]
        if slope * slope * x > speed * speed:
            x = speed * speed / (slope * slope)
        if slope < FLAT and bend * x > search.acceleration[k]:
            x = search.acceleration[k] / bend
    return x


@kernel
def largest_square(search: SearchTable, point: int) -> float:
    """The largest x of a point from which the end is reached."""
    lines = search.lines
    x = cap_by_joints(search, point)
    count = lines_at(search, point)
    for _ in range(ROUNDS):
        low, high, below, above = highest(lines, count, x)
        if high >= low:
            return x
        # the two lines that leave no room cross where x is less
        fall = lines[3 * below + 2] - lines[3 * above + 2]
        gap = lines[3 * above + 1] - lines[3 * below]
        nearer = gap / fall if fall > 0.0 else 0.0
        if not nearer < x:
            nearer = x * (1.0 - 1e-9)  # rounding alone keeps it there
        x = max(nearer, 0.0)
    return x


@entry
def find_squares(search: SearchTable) -> int:
    """Path speed squared at all points of the grid: 0 at both ends, the largest that is allowed between."""
    last = search.points - 1
    search.reached[last] = 0.0
    for point in range(last - 1, -1, -1):
        search.reached[point] = largest_square(search, point)

    x = 0.0
    search.squares[0] = x
    for point in range(last):
        _, most, _, _ = highest(search.lines, lines_at(search, point), x)
        x += 2.0 * (search.grid[point + 1] - search.grid[point]) * most
        x = min(max(x, 0.0), search.reached[point + 1])
        search.squares[point + 1] = x
    return 0
