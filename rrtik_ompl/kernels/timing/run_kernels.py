"""The kernels that time runs: one through rounded corners, and straight ones between stops.

The first tries several ways of smoothing, of which the fastest is kept. It does in one call what
:mod:`rrtik_ompl.motion.trajectory.runs` does step by step, and says why. There is no motion if a number is not finite.
"""

from __future__ import annotations

import math

from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.timing.kernels import find_squares, sample_curve
from rrtik_ompl.kernels.timing.layout import CurveTable
from rrtik_ompl.kernels.timing.run_layout import (
    CRUISE_PARTS,
    JUMP_SHARE,
    KNOTS,
    LEAST_PIECES,
    LEAST_STEPS,
    MIN_PHASE_SECONDS,
    MOST_PARTS,
    MOST_PIECES,
    MOST_STEPS,
    PHASES,
    ROUNDING,
    SAME_PLACE,
    STEPS_PER_LINE,
    STEPS_PER_RADIUS,
    LinesTable,
    RunTable,
)

NONE = 1e300  # more than any duration
UNBOUNDED = 1e200  # path speed squared where there is no bound


@kernel
def find_knots(run: RunTable) -> int:
    """Write the places where roundings begin, are at their corner or end, ascending and each once; how many."""
    curve = run.curve
    knots = run.knots
    count = 0
    for vertex in range(curve.vertex_count):
        for side in range(KNOTS):
            place = curve.along[vertex] + float(side - 1) * curve.radii[vertex]
            k = count
            while k > 0 and knots[k - 1] > place:  # they are almost in order
                knots[k] = knots[k - 1]
                k -= 1
            knots[k] = place
            count += 1

    length = curve.along[curve.vertex_count - 1]
    kept = 1
    before = knots[0]
    for k in range(1, count):
        place = knots[k]
        if place - before > SAME_PLACE * length:
            knots[kept] = place
            kept += 1
        before = place
    knots[kept - 1] = length
    return kept


@kernel
def find_tightest(run: RunTable, stretches: int) -> None:
    """Write for each stretch between two knots the smallest class of the corners in whose rounding it lies, or inf."""
    curve = run.curve
    knots = run.knots
    for k in range(stretches):
        run.tightest[k] = math.inf

    first = 0  # stretch that begins behind the beginning of a rounding, by their middles
    for corner in range(1, curve.vertex_count - 1):
        begin = curve.along[corner] - curve.radii[corner]
        end = curve.along[corner] + curve.radii[corner]
        while first > 0 and 0.5 * (knots[first] + knots[first - 1]) > begin:
            first -= 1
        while first < stretches and 0.5 * (knots[first + 1] + knots[first]) <= begin:
            first += 1
        k = first
        while k < stretches and 0.5 * (knots[k + 1] + knots[k]) <= end:
            run.tightest[k] = min(run.tightest[k], run.classes[corner])
            k += 1


@inlined
def steps_of(run: RunTable, stretch: int, longest: float) -> float:
    """Into how many steps a stretch of the grid is divided."""
    width = run.knots[stretch + 1] - run.knots[stretch]
    tightest = run.tightest[stretch]
    step = width / float(STEPS_PER_LINE) if math.isinf(tightest) else tightest / float(STEPS_PER_RADIUS)
    steps: float = max(math.ceil(width / min(step, longest)), 1.0)
    return steps


@kernel
def lay_grid(run: RunTable) -> int:
    """Lay the grid along the curve, closely where it bends; how many points it has.

    Writes them if there is room, and by how much smoothing may leave the curve at each.
    """
    stretches = find_knots(run) - 1
    find_tightest(run, stretches)
    longest = run.knots[stretches] / float(LEAST_STEPS)
    total = 1.0
    for stretch in range(stretches):
        total += steps_of(run, stretch, longest)
    points = int(total)
    if points > run.room:
        return points

    search = run.search
    point = 0
    for stretch in range(stretches):
        begin = run.knots[stretch]
        width = run.knots[stretch + 1] - begin
        steps = steps_of(run, stretch, longest)
        most = run.share * run.tightest[stretch]
        for part in range(int(steps)):
            search.grid[point] = begin + float(part) / steps * width
            run.most[point] = most
            point += 1
    search.grid[point] = run.knots[stretches]
    run.most[point] = math.inf
    search.points = points
    return points


@inlined
def width_of(run: RunTable, number: int, most_steps: int) -> int:
    """One of the windows that are tried, in steps."""
    width: int = math.ceil(run.widths[number] * float(most_steps))
    return width


@kernel
def search_times(run: RunTable) -> float:
    """Search for the fastest motion; sets when it is at the points of the grid, returns its duration."""
    search = run.search
    find_squares(search)
    run.times[0] = 0.0
    for k in range(search.points - 1):
        speeds = math.sqrt(search.squares[k + 1]) + math.sqrt(search.squares[k])
        run.times[k + 1] = run.times[k] + 2.0 * (search.grid[k + 1] - search.grid[k]) / speeds
    duration: float = run.times[search.points - 1]
    return duration


@kernel
def set_places(run: RunTable, count: int, duration: float, sink: Doubles) -> None:
    """Write where the motion is at the ends of so many even parts of its duration."""
    search = run.search
    grid = search.grid
    last = search.points - 2
    k = 0
    before = grid[0]
    for part in range(count + 1):
        moment = duration if part == count else float(part) * (duration / float(count))
        while k < last and run.times[k + 1] <= moment:
            k += 1
        elapsed = moment - run.times[k]
        push = (search.squares[k + 1] - search.squares[k]) / (2.0 * (grid[k + 1] - grid[k]))
        place = grid[k] + elapsed * (math.sqrt(search.squares[k]) + 0.5 * elapsed * push)
        before = max(before, min(max(place, grid[0]), grid[last + 1]))
        sink[part] = before


@kernel
def cut_peaks(run: RunTable, count: int, width: int) -> None:
    """Cut peaks off speeds that are narrower than a window: the largest of the least speeds of windows."""
    for k in range(count + width - 1):  # a window that ends with part k; the arm stands still before and after
        least = 0.0
        if width - 1 <= k < count:
            least = run.cut[k]
            for back in range(1, width):
                least = min(least, run.cut[k - back])
        run.lows[k] = least
    for k in range(count):
        most = run.lows[k]
        for ahead in range(1, width):
            most = max(most, run.lows[k + ahead])
        run.cut[k] = most


@kernel
def cap_cruising(run: RunTable, window: float, duration: float) -> None:
    """Bound speeds by those without peaks that last for less than a window, or a third of the motion."""
    seconds = min(window, duration / 3.0)
    count = int(min(max(math.ceil(CRUISE_PARTS * duration / seconds), 1.0), float(MOST_PARTS)))
    set_places(run, count, duration, run.middles)
    for k in range(count):
        run.cut[k] = (run.middles[k + 1] - run.middles[k]) * (float(count) / duration)
        run.middles[k] = 0.5 * (run.middles[k + 1] + run.middles[k])
    cut_peaks(run, count, 1 + int(seconds * float(count) / duration))

    search = run.search
    k = 0
    for point in range(search.points):
        place = search.grid[point]
        while k < count - 1 and run.middles[k + 1] <= place:
            k += 1
        speed = run.cut[k]
        if k < count - 1 and place > run.middles[k]:
            share = (place - run.middles[k]) / (run.middles[k + 1] - run.middles[k])
            speed += share * (run.cut[k + 1] - run.cut[k])
        speed *= 1.0 + run.slack
        search.cap[point] = min(search.cap[point], speed * speed)


@kernel
def fill_rows(run: RunTable, count: int, duration: float) -> None:
    """Write the joint values and the place of the motion at the ends of even parts."""
    curve = run.curve
    n = curve.dof
    set_places(run, count, duration, curve.at)
    curve.place_count = count + 1
    sample_curve(curve)
    for k in range(count + 1):
        source = row_at(curve.values, 3 * n, k)
        sink = row_at(run.rows, n + 1, k)
        for joint in range(n):
            sink[joint] = source[joint]
        sink[n] = curve.at[k]


@kernel
def write_means(run: RunTable, rows: int, width: int) -> int:
    """Write the control points of the spline of a window, from the sums over it; how many."""
    columns = run.curve.dof + 1
    end = rows + width - 1
    for k in range(end):
        source = row_at(run.sums, columns, k)
        sink = row_at(run.trial, columns, k + 2)
        for column in range(columns):
            sink[column] = run.rows[column] + source[column] / float(width)
    for column in range(columns):
        first = run.trial[2 * columns + column]
        last = run.trial[(end + 1) * columns + column]
        run.trial[column] = first
        run.trial[columns + column] = first
        run.trial[(end + 2) * columns + column] = last
        run.trial[(end + 3) * columns + column] = last
    return end + 4


@kernel
def slowing(run: RunTable, controls: int, step: float) -> float:
    """The factor, 1 or more, by which the spline must be slowed to keep the limits."""
    n = run.curve.dof
    columns = n + 1
    speed = 0.0
    push = 0.0
    jolt = 0.0
    for joint in range(n):
        most = 0.0
        most_push = 0.0
        most_jolt = 0.0
        a = run.trial[joint]
        b = run.trial[columns + joint]
        c = run.trial[2 * columns + joint]
        for k in range(3, controls):
            d = run.trial[k * columns + joint]
            most = max(most, abs(d - c))
            most_push = max(most_push, abs((d - c) - (c - b)))
            most_jolt = max(most_jolt, abs(((d - c) - (c - b)) - ((c - b) - (b - a))))
            a = b
            b = c
            c = d
        speed = max(speed, most / step / run.search.velocity[joint])
        push = max(push, most_push / step**2 / run.search.acceleration[joint])
        jolt = max(jolt, most_jolt / step**3 / run.jerk[joint])
    factor: float = max(1.0, max(speed, math.sqrt(push), jolt ** (1.0 / 3.0)) * run.margin)
    return factor


@kernel
def smooth(run: RunTable, rows: int, step: float, most_steps: int) -> float:
    """Keep the shortest of the splines of several windows that keeps the limits; its duration.

    Sets its control points, their number less three as ``pieces``, and its step.
    """
    columns = run.curve.dof + 1
    for k in range((rows + most_steps - 1) * columns):
        run.sums[k] = 0.0
    best = NONE
    number = 0
    for width in range(1, most_steps + 1):
        end = row_at(run.sums, columns, rows + width - 2)
        last = row_at(run.rows, columns, rows - 1)
        for column in range(columns):
            end[column] = float(width - 1) * (last[column] - run.rows[column])
        for k in range(rows):
            source = row_at(run.rows, columns, k)
            sink = row_at(run.sums, columns, k + width - 1)
            for column in range(columns):
                sink[column] += source[column] - run.rows[column]

        if width != width_of(run, number, most_steps):
            continue
        while number < run.width_count - 1 and width_of(run, number, most_steps) == width:
            number += 1
        controls = write_means(run, rows, width)
        slower = step * slowing(run, controls, step)
        if slower * float(controls - 3) < best:
            best = slower * float(controls - 3)
            run.pieces = controls - 3
            run.step = slower
            for k in range(controls * columns):
                run.controls[k] = run.trial[k]
    return best


@inlined
def edge_at(curve: CurveTable, place: float, edge: int) -> int:
    """The edge on which a place lies, not before another."""
    while edge < curve.vertex_count - 2 and place >= curve.along[edge + 1]:
        edge += 1
    return edge


@kernel
def gap_to(curve: CurveTable, point: Doubles, place: float, edge: int) -> float:
    """Distance of a point from the path at a place."""
    n = curve.dof
    vertex = row_at(curve.vertices, n, edge)
    direction = row_at(curve.directions, n, edge)
    ahead = place - curve.along[edge]
    total = 0.0
    for joint in range(n):
        gap = point[joint] - (vertex[joint] + ahead * direction[joint])
        total += gap * gap
    return math.sqrt(total)


@kernel
def write_pieces(run: RunTable) -> None:
    """Write the cubics of the spline, how far from the path each begins, and whether it stays on the path."""
    curve = run.curve
    n = curve.dof
    columns = n + 1
    step = run.step
    ahead = 0  # of the last control point of a piece
    behind = 0  # of its first one
    here = 0
    good = 0  # control points in a row that are on the path
    for k in range(3):
        control = row_at(run.controls, columns, k)
        ahead = edge_at(curve, control[n], ahead)
        good = good + 1 if gap_to(curve, control, control[n], ahead) <= run.coincidence else 0

    for piece in range(run.pieces):
        a = row_at(run.controls, columns, piece)
        b = row_at(run.controls, columns, piece + 1)
        c = row_at(run.controls, columns, piece + 2)
        d = row_at(run.controls, columns, piece + 3)
        position = row_at(run.positions, n, piece)
        for joint in range(n):
            bend = c[joint] - 2.0 * b[joint] + a[joint]
            position[joint] = b[joint] + bend / 6.0
            run.velocities[piece * n + joint] = (c[joint] - a[joint]) / (2.0 * step)
            run.accelerations[piece * n + joint] = bend / (step * step)
        place = b[n] + (c[n] - 2.0 * b[n] + a[n]) / 6.0
        here = edge_at(curve, place, here)
        run.begins[piece] = place
        run.gaps[piece] = gap_to(curve, position, place, here)

        ahead = edge_at(curve, d[n], ahead)
        behind = edge_at(curve, a[n], behind)
        good = good + 1 if gap_to(curve, d, d[n], ahead) <= run.coincidence else 0
        run.on_path[piece] = 1 if good >= 4 and ahead == behind else 0


@kernel
def widest(run: RunTable) -> float:
    """How far from the path the spline gets at its knots."""
    curve = run.curve
    n = curve.dof
    columns = n + 1
    edge = 0
    most = 0.0
    for piece in range(run.pieces):
        a = row_at(run.controls, columns, piece)
        b = row_at(run.controls, columns, piece + 1)
        c = row_at(run.controls, columns, piece + 2)
        for joint in range(columns):
            run.trial[joint] = b[joint] + (c[joint] - 2.0 * b[joint] + a[joint]) / 6.0
        edge = edge_at(curve, run.trial[n], edge)
        most = max(most, gap_to(curve, run.trial, run.trial[n], edge))
    return most


@kernel
def attempt(run: RunTable, number: int) -> float:
    """Time and smooth the run in one way; its duration, or NONE."""
    search = run.search
    window = run.shares[number] * run.window
    shift = window * window / 12.0 + run.period * run.period / 3.0
    for k in range(search.points):
        search.cap[k] = min(2.0 * run.most[k] / shift, UNBOUNDED)
    duration = search_times(run)
    if not 0.0 < duration < NONE:
        return NONE
    if run.cruises[number] != 0:
        cap_cruising(run, window, duration)
        duration = search_times(run)
        if not 0.0 < duration < NONE:
            return NONE

    least = max(run.period, window / float(MOST_STEPS), duration / float(MOST_PIECES))
    count = min(max(int(duration / least), LEAST_PIECES), MOST_PIECES)
    step = max(duration / float(count), run.period)
    most_steps = max(1, int(min(math.ceil(window / step), float(MOST_STEPS))))
    fill_rows(run, count, duration)
    return smooth(run, count + 1, step, most_steps)


@entry
def time_run(run: RunTable) -> int:
    """Time the run in several ways and keep the fastest of those that stay near to the path.

    Gives the number of its pieces, 0 if there is no motion. If the grid takes more room than there is, nothing is done,
    and the answer is its number of points as a negative number.
    """
    curve = run.curve
    search = run.search
    n = curve.dof
    points = lay_grid(run)
    if points > run.room:
        return -points

    curve.place_count = search.points
    for k in range(search.points):
        curve.at[k] = search.grid[k]
    sample_curve(curve)
    for k in range(search.points):
        source = row_at(curve.values, 3 * n, k)
        sink = row_at(search.shape, 3 * n, k)
        bend = 0.0
        for column in range(3 * n):
            sink[column] = source[column]
        for joint in range(n):
            bend += source[2 * n + joint] * source[2 * n + joint]
        run.most[k] /= max(math.sqrt(bend), 1e-300)

    best = NONE
    best_gap = NONE
    for number in range(run.attempts):
        duration = attempt(run, number)
        if duration >= NONE:
            return 0
        gap = widest(run)
        bad = gap > run.max_deviation
        best_bad = best_gap > run.max_deviation
        if (best_bad and not bad) or (bad == best_bad and duration < best):
            best = duration
            best_gap = gap
            write_pieces(run)
            run.found_step = run.step
            run.found_pieces = run.pieces
    return run.found_pieces


@inlined
def root3(x: float) -> float:
    """The cube root of a number that is not negative."""
    root: float = x ** (1.0 / 3.0)
    if 0.0 < root < NONE:
        root -= (root * root * root - x) / (3.0 * root * root)  # one step of Newton's, as a third is rounded
    return root


@kernel
def set_phases(lines: LinesTable, length: float, v: float, a: float, j: float) -> float:
    """Write the seven phases of the fastest motion over a length, from rest to rest; the duration of all of them.

    Args:
        lines: Where they are written.
        length: The length.
        v: Limit of the speed along the line.
        a: Limit of the acceleration.
        j: Limit of the jerk, may be infinite.
    """
    onset = a / j  # time until the acceleration reaches its limit
    ramp = v / a + onset if v >= a * onset else 2.0 * math.sqrt(v / j)  # time until the speed reaches its limit
    cruise = length / v - ramp
    limit = a * onset
    if cruise < 0.0:
        if length < 2.0 * limit * onset:  # neither limit is reached
            ramp = 2.0 * root3(length / (2.0 * j))
        else:
            peak = 0.5 * (math.sqrt(limit * limit + 4.0 * a * length) - limit)  # speed if there is no cruise
            ramp = peak / a + onset
    onset = min(onset, 0.5 * ramp)
    hold = ramp - 2.0 * onset
    push = a if math.isinf(j) else j * onset

    phases = lines.phases
    pushes = lines.pushes
    for k in range(PHASES):
        phases[k] = onset
        pushes[k] = 0.0
    phases[1] = hold
    phases[3] = max(cruise, 0.0)
    phases[5] = hold
    pushes[1] = push
    pushes[2] = push
    pushes[5] = -push
    pushes[6] = -push
    duration = 0.0
    for k in range(PHASES):
        duration += phases[k]
    return duration


@kernel
def write_phases(lines: LinesTable, edge: int, piece: int, smooth: bool) -> int:
    """Write the pieces of a straight motion behind those that are there; how many there are then.

    Args:
        lines: The phases, and where pieces are written.
        edge: Number of the edge.
        piece: How many pieces there are.
        smooth: Whether the jerk is limited.
    """
    n = lines.dof
    start = row_at(lines.vertices, n, edge)
    direction = row_at(lines.directions, n, edge)
    speed = 0.0
    travelled = 0.0
    for k in range(PHASES):
        h = lines.phases[k]
        push = lines.pushes[k]
        after = lines.pushes[k + 1] if k + 1 < PHASES else 0.0
        jerk = (after - push) / h if smooth and h > MIN_PHASE_SECONDS else 0.0
        if h > MIN_PHASE_SECONDS:
            lines.durations[piece] = h
            lines.begins[piece] = lines.along[edge] + travelled
            for joint in range(n):
                slope = direction[joint]
                lines.positions[piece * n + joint] = start[joint] + travelled * slope
                lines.velocities[piece * n + joint] = speed * slope
                lines.accelerations[piece * n + joint] = push * slope
            piece += 1
        travelled += h * (speed + h * (0.5 * push + h * jerk / 6.0))
        speed += h * (push + 0.5 * h * jerk)
    return piece


@entry
def time_lines(lines: LinesTable) -> int:
    """Time straight motions between vertices, all joints of each by the same profile.

    Gives the number of pieces of all of them; if one cannot be calculated, the number of its edge, from 1, as a
    negative number.
    """
    n = lines.dof
    pieces = 0
    for edge in range(lines.edges):
        direction = row_at(lines.directions, n, edge)
        v = math.inf
        a = math.inf
        j = math.inf
        for joint in range(n):
            steep = 1.0 / abs(direction[joint])
            v = min(v, lines.velocity[joint] * steep)
            a = min(a, lines.acceleration[joint] * steep)
            j = min(j, lines.jerk[joint] * steep)
        duration = set_phases(lines, lines.lengths[edge], v, a, j)
        if not 2.0 * MIN_PHASE_SECONDS < duration < math.inf:
            return -(edge + 1)
        pieces = write_phases(lines, edge, pieces, not math.isinf(j))
    return pieces


@inlined
def piece_of(times: Doubles, velocities: Doubles, accelerations: Doubles, joints: int, piece: int, joint: int) -> tuple:  # type: ignore[type-arg]
    """Of a joint on a piece: its duration, acceleration at the beginning and at the end, and the jerk."""
    h = times[piece + 1] - times[piece]
    push = accelerations[piece * joints + joint]
    rise = velocities[(piece + 1) * joints + joint] - velocities[piece * joints + joint]
    jerk = 2.0 * (rise - h * push) / (h * h)
    return h, push, push + h * jerk, jerk


@entry
def find_pushes(
    times: Doubles,
    velocities: Doubles,
    accelerations: Doubles,
    weights: Doubles,
    knots: int,
    joints: int,
    sink: Doubles,
) -> int:
    """Write for each piece the weighted sum of the joints' largest accelerations."""
    for piece in range(knots - 1):
        total = 0.0
        for joint in range(joints):
            _, push, end, _ = piece_of(times, velocities, accelerations, joints, piece, joint)
            total += weights[joint] * max(abs(push), abs(end))
        sink[piece] = total
    return 0


@entry
def sample_cubics(
    times: Doubles,
    positions: Doubles,
    velocities: Doubles,
    accelerations: Doubles,
    knots: int,
    joints: int,
    clock: Doubles,
    count: int,
    places: Doubles,
    speeds: Doubles,
    pushes: Doubles,
) -> int:
    """Write position, velocity and acceleration at times, in rows of ``joints``; before and after it all is at rest."""
    last = knots - 1
    duration = times[last]
    piece = 0
    for k in range(count):
        inside = min(max(clock[k], 0.0), duration)
        if inside < times[piece]:
            piece = 0
        while piece < last - 1 and times[piece + 1] <= inside:
            piece += 1
        x = inside - times[piece]
        moving = clock[k] == inside
        for joint in range(joints):
            _, push, _, jerk = piece_of(times, velocities, accelerations, joints, piece, joint)
            q = positions[piece * joints + joint]
            v = velocities[piece * joints + joint]
            sink = k * joints + joint
            places[sink] = q + x * (v + x * (push / 2.0 + x * jerk / 6.0))
            if inside == duration:  # without the rounding of the cubic
                places[sink] = positions[last * joints + joint]
            speeds[sink] = v + x * (push + x * jerk / 2.0) if moving else 0.0
            pushes[sink] = push + x * jerk if moving else 0.0
    return 0


@entry
def find_peaks(
    times: Doubles, velocities: Doubles, accelerations: Doubles, knots: int, joints: int, sink: Doubles
) -> int:
    """Write the largest velocity, acceleration and jerk of each joint; see `rrtik_ompl.kernels.reference.timing`.

    ``sink`` has a fourth row, to compute in.
    """
    fastest = 0.0
    strongest = 0.0
    for k in range(knots * joints):
        fastest = max(fastest, abs(velocities[k]))
        strongest = max(strongest, abs(accelerations[k]))
    reach = ROUNDING * (fastest + times[knots - 1] * strongest)

    jumps = row_at(sink, joints, 3)  # that are more than rounding
    for joint in range(joints):
        sink[joint] = abs(velocities[(knots - 1) * joints + joint])
        sink[joints + joint] = abs(accelerations[(knots - 1) * joints + joint])
        sink[2 * joints + joint] = 0.0
        jumps[joint] = 0.0

    for piece in range(knots - 1):
        for joint in range(joints):
            h, push, end, jerk = piece_of(times, velocities, accelerations, joints, piece, joint)
            before = velocities[piece * joints + joint]
            after = accelerations[(piece + 1) * joints + joint]
            sink[joint] = max(sink[joint], abs(before))
            sink[joints + joint] = max(sink[joints + joint], abs(push))
            sink[2 * joints + joint] = max(sink[2 * joints + joint], abs(after - push) / h)
            if push * jerk < 0.0:  # the acceleration may change its sign
                turn = -push / jerk
                if turn < h:
                    sink[joint] = max(sink[joint], abs(before + 0.5 * turn * push))
            size = abs(end - after)
            if size * h > reach:
                sink[joints + joint] = max(sink[joints + joint], abs(end))
                jumps[joint] = max(jumps[joint], size)

    largest = 0.0
    for joint in range(joints):
        largest = max(largest, sink[joints + joint])
    jump = JUMP_SHARE * largest
    for joint in range(joints):
        begin = abs(accelerations[joint])
        end = abs(accelerations[(knots - 1) * joints + joint])
        if max(jumps[joint], begin, end) > jump:
            sink[2 * joints + joint] = math.inf
    return 0
