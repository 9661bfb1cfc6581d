"""Time the runs of a path from stop to stop, straight ones and curves through rounded corners, as separate motions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.reference import timing as reference
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of
from rrtik_ompl.kernels.timing.run_layout import (
    CONTROLS,
    KERNELS,
    KNOTS,
    LEAST_STEPS,
    MIN_PHASE_SECONDS,
    MOST_PIECES,
    PHASES,
    SPEEDS,
    STEPS_PER_RADIUS,
    LinesTable,
    RunTable,
)
from rrtik_ompl.motion.trajectory.corners import COINCIDENCE, Polyline
from rrtik_ompl.motion.trajectory.cubics import Pieces
from rrtik_ompl.motion.trajectory.curve import Curve, Samples, curve_table
from rrtik_ompl.motion.trajectory.dynamics import DynamicLimits
from rrtik_ompl.motion.trajectory.fastest import Bounds, fastest, search_table
from rrtik_ompl.motion.trajectory.limits import ROUNDING_MARGIN, RateLimits
from rrtik_ompl.motion.trajectory.smoothing import WIDTHS, Spline, smoothed, steps_for, widest_window

PERIOD = 1e-3  # [s] shortest piece of a curve: the control period of a fast drive
# Share by which a speed may exceed the cruising speed while the acceleration changes its sign.
CRUISE_SLACK = 1e-3
SHORT_WINDOW = 0.02  # [s] A smoothing window as short as this costs hardly any time.
MAX_SLOWINGS = 3  # most times a spline is slowed for limits of tip or torques; apart from rounding two would do
# Share of a corner's radius by which smoothing over time may leave the rounded corner.
SMOOTHED_SHARE = 0.12


class Attempt(NamedTuple):
    """One way to smooth a motion.

    Attributes:
        window: Largest smoothing window, as a share of the widest one that the jerk limits may need.
        cruises: Whether the speed is to stay constant, between rising and falling, for at least as long as the window.
            Then a shorter window is enough.
    """

    window: float
    cruises: bool = False


ATTEMPTS = (Attempt(1.0), Attempt(0.7, cruises=True), Attempt(0.35))


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A motion from rest to rest.

    Attributes:
        pieces: The m cubics of the motion.
        places: Where on the path each piece begins, as distance from the path's beginning, shape (m,) [rad or m].
        deviations: Distance of the motion from the path at these places, shape (m,) [rad or m].
        on_path: Mask of the pieces that do not leave the path, shape (m,).
    """

    pieces: Pieces
    places: Vector
    deviations: Vector
    on_path: Mask

    @property
    def duration(self) -> float:
        """Return the duration of all pieces together [s]."""
        return float(self.pieces.durations.sum())


def runs(
    line: Polyline,
    radii: Vector,
    limits: RateLimits,
    *,
    max_deviation: float = np.inf,
    more: DynamicLimits | None = None,
) -> list[Run]:
    """Time the runs of a path from stop to stop, each as fast as the limits allow.

    Args:
        line: The path.
        radii: Distance from each inner vertex at which its rounding begins, shape (k - 2,) [rad or m]; 0 for a stop.
        limits: Limits of the n joints.
        max_deviation: Largest distance of the motion from the path [rad or m]; kept if one of the attempts keeps it.
        more: Limits of the tip or of torques; None if there are none.

    Returns:
        The runs in order: one for each section of the path between two stops, or for several straight ones.
    """
    if more is None and not radii.any():
        return [along_lines(line, limits)]

    stops = [0, *(np.flatnonzero(radii == 0.0) + 1).tolist(), len(line.vertices) - 1]
    motions = []
    for first, last in pairwise(stops):
        part = line if last - first == len(line.lengths) else line.part(first, last)
        begin = float(line.along[first])
        if last == first + 1 and more is None:
            motions.append(along_lines(part, limits, begin=begin))
        else:
            curve = Curve.of(part, radii[first : last - 1])
            motions.append(along_curve(curve, limits, max_deviation=max_deviation, more=more, begin=begin))
    return motions


def along_curve(
    curve: Curve,
    limits: RateLimits,
    *,
    max_deviation: float = np.inf,
    more: DynamicLimits | None = None,
    begin: float = 0.0,
) -> Run:
    """Compute the motion along a curve from rest to rest.

    The curve is timed under velocity and acceleration limits and then smoothed over time to keep the jerk limits, so
    that the motion passes bends on their inner side. Several window widths are tried; of those within ``max_deviation``
    the fastest motion is taken.

    Args:
        curve: The curve.
        limits: Limits of its joints.
        max_deviation: Largest distance of the motion from the path [rad or m]; kept if one of the windows keeps it.
        more: Limits of the tip or of torques; None if there are none.
        begin: Distance of the curve's beginning from that of the whole path [rad or m].

    Raises:
        InputError: If the limits are too extreme for floating-point numbers.
    """
    timed = None if more is not None else _timed(curve, limits, max_deviation, begin)
    if timed is not None:
        return timed

    grid, tightest = curve.grid()
    samples = curve.at(grid)
    extra = None if more is None else more.bounds(samples)
    bends = _lengths(samples.bends)
    max_squares = SMOOTHED_SHARE * tightest / np.maximum(bends, 1e-300)

    splines = (_smooth(curve, (grid, samples, extra), max_squares, limits, attempt) for attempt in _attempts(limits))
    motions = [_along(curve, spline if more is None else _slowed(spline, more), begin) for spline in splines]
    return min(motions, key=lambda run: (run.deviations.max() > max_deviation, run.duration))


def _timed(curve: Curve, limits: RateLimits, max_deviation: float, begin: float) -> Run | None:
    """Return a run by a kernel; None without kernels or if there is no motion. Arguments as of :func:`along_curve`."""
    kernels = library(KERNELS)
    if kernels is None:
        return None
    vertices, n = curve.vertices.shape
    points = LEAST_STEPS + STEPS_PER_RADIUS * vertices
    count = -points
    found = None
    while count < 0:  # the grid takes so many points
        spare = _spare_runs(_room(vertices), _room(-count), n, _attempts(limits))
        try:
            run = spare.pop()
        except IndexError:  # none was made yet, or all are in use
            run = _run_table(_room(vertices), _room(-count), n, _attempts(limits))
        curve.put_into(run.curve)
        run.classes[:vertices] = curve.classes()
        run.search.velocity[:] = limits.velocity
        run.search.acceleration[:] = limits.acceleration
        run.jerk[:] = limits.jerk
        run.window = widest_window(limits)
        run.max_deviation = max_deviation
        count = kernels.time_run(run.address)
        found = _found(run, count, n, begin) if count > 0 else None
        spare.append(run)
    return found


def _found(run: RunTable, count: int, n: int, begin: float) -> Run:
    """Return a copy of the run that a kernel has found; it has so many pieces."""
    rows = (run.positions, run.velocities, run.accelerations)
    positions, velocities, accelerations = (row[: count * n].reshape(count, n).copy() for row in rows)
    pieces = Pieces(np.full(count, run.found_step), positions, velocities, accelerations)
    return Run(pieces, begin + run.begins[:count], run.gaps[:count].copy(), run.on_path.view(np.int32)[:count] != 0)


def _room(count: int) -> int:
    """Return for how many vertices or points of a grid there is memory: a power of two, so that few sizes are kept."""
    return 1 << (count - 1).bit_length()


@lru_cache(maxsize=16)
def _spare_runs(vertices: int, points: int, n: int, attempts: tuple[Attempt, ...]) -> list[RunTable]:
    """Return the list of tables of this size that are not in use, so that two threads never share one."""
    del vertices, points, n, attempts
    return []


def _run_table(vertices: int, points: int, n: int, attempts: tuple[Attempt, ...]) -> RunTable:
    """Return a table with room for so many vertices of n coordinates and points of the grid."""
    run = RunTable(PlannedTable(_plan(vertices, points, n, len(attempts))))
    run.put(
        curve=curve_table(vertices, n, max(points, MOST_PIECES + 1)),
        search=search_table(points, n),
    )
    run.shares[:] = [each.window for each in attempts]
    run.cruises.view(np.int32)[: len(attempts)] = [each.cruises for each in attempts]
    run.widths[:] = WIDTHS[::-1]
    return run


@lru_cache(maxsize=64)
def _plan(vertices: int, points: int, n: int, attempts: int) -> TablePlan:
    """Return the memory layout of a run with n coordinates on a grid of so many points; cached."""
    return sizes_of(
        RunTable,
        room=points,
        classes=vertices,
        share=SMOOTHED_SHARE,
        most=points,
        jerk=n,
        shares=attempts,
        cruises=attempts,
        widths=len(WIDTHS),
        positions=n * CONTROLS,
        velocities=n * CONTROLS,
        accelerations=n * CONTROLS,
        begins=CONTROLS,
        gaps=CONTROLS,
        on_path=CONTROLS,
        knots=KNOTS * vertices,
        tightest=KNOTS * vertices,
        times=points,
        rows=(n + 1) * CONTROLS,
        sums=(n + 1) * CONTROLS,
        trial=(n + 1) * CONTROLS,
        controls=(n + 1) * CONTROLS,
        cut=SPEEDS,
        middles=SPEEDS,
        lows=SPEEDS,
        attempts=attempts,
        width_count=len(WIDTHS),
        period=PERIOD,
        slack=CRUISE_SLACK,
        margin=ROUNDING_MARGIN,
        coincidence=COINCIDENCE,
    )


def _attempts(limits: RateLimits) -> tuple[Attempt, ...]:
    """Return the ways of smoothing to try; only one if the window is so short that it costs nothing."""
    return ATTEMPTS if widest_window(limits) > SHORT_WINDOW else (Attempt(1.0),)


def _smooth(
    curve: Curve,
    grid_samples: tuple[Vector, Samples, Bounds | None],
    max_squares: Vector,
    limits: RateLimits,
    attempt: Attempt,
) -> Spline:
    """Compute the fastest motion along a curve that stays near it after smoothing with the windows of an attempt.

    Smoothing moves the motion off the curve by about a twenty-fourth of the window squared times the acceleration
    across the curve, which is the path speed squared times the curvature. Therefore the path speed squared, times a
    twenty-fourth of the window squared, is bounded by ``max_squares``.

    Args:
        curve: The curve.
        grid_samples: Places on the curve, shape (m,), the curve there, and further bounds or None.
        max_squares: Largest product of the path speed squared and a twenty-fourth of the window squared at each place,
            shape (m,).
        limits: Limits of the joints.
        attempt: The largest window, and whether to cruise.

    Returns:
        The spline in the joints' coordinates and the place on the path, n + 1 columns.
    """
    window = attempt.window * widest_window(limits)
    grid, samples, extra = grid_samples

    bounds = Bounds.capped(2.0 * max_squares / (window**2 / 12.0 + PERIOD**2 / 3.0))
    bounds = bounds if extra is None else bounds.and_also(extra)
    timing = fastest(grid, samples, limits, bounds)
    if not np.isfinite(timing.duration) or timing.duration <= 0.0:
        raise InputError(
            f"no motion along {curve.length:.3g} rad or m could be calculated; choose limits of an ordinary size"
        )

    if attempt.cruises:
        cap = np.square((1.0 + CRUISE_SLACK) * timing.cruising(window))
        timing = fastest(grid, samples, limits, bounds.and_also(Bounds.capped(cap)))

    step, count, window_steps = steps_for(timing.duration, window, PERIOD)
    places = timing.places(np.linspace(0.0, timing.duration, count + 1))
    return smoothed(np.column_stack([curve.at(places).positions, places]), step, window_steps, limits)


def _slowed(spline: Spline, more: DynamicLimits) -> Spline:
    """Slow a spline down until it keeps the limits of the tip and of torques at its knots and midway between them."""
    n = more.robot.dof
    for _ in range(MAX_SLOWINGS):
        factor = more.slowing(*(rows[:, :n] for rows in spline.states()))
        if factor == 1.0:
            break
        spline = spline.slowed(factor)
    return spline


def _along(curve: Curve, spline: Spline, begin: float) -> Run:
    """Convert a spline in joint values and place on the path, n + 1 columns, to a run.

    Args:
        curve: The curve that the spline follows.
        spline: The spline.
        begin: Distance of the curve's beginning from that of the whole path [rad or m].
    """
    positions, velocities, accelerations = (rows[:-1] for rows in spline.knots())
    n = curve.vertices.shape[1]
    deviations = _lengths(positions[:, :n] - curve.path_at(positions[:, n]))

    # A piece lies in the hull of its four control points, so it is on an edge if all of them are.
    controls = spline.controls[:, :n]
    control_places = spline.controls[:, n]
    on_path_controls = _lengths(controls - curve.path_at(control_places)) <= COINCIDENCE
    edge_of_control = curve.edges(control_places)
    count = len(positions)
    one_edge = edge_of_control[:count] == edge_of_control[3 : 3 + count]
    on_path = one_edge & np.logical_and.reduce([on_path_controls[k : k + count] for k in range(4)])

    pieces = Pieces(np.full(count, spline.step), positions[:, :n], velocities[:, :n], accelerations[:, :n])
    return Run(pieces, begin + positions[:, n], deviations, on_path)


def _lengths(rows: Matrix) -> Vector:
    """Return the Euclidean norm of each row, shape (m,)."""
    lengths: Vector = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    return lengths


def along_lines(line: Polyline, limits: RateLimits, *, begin: float = 0.0) -> Run:
    """Compute the fastest straight motions from rest at each vertex to rest at the next one.

    Each motion has at most seven phases of constant jerk, in closed form [21, for rest at both ends]. All joints follow
    the same profile, so that the motion stays on the line; for a single moving joint it is the joint's fastest motion.
    Without a jerk limit the profile is the trapezoid of velocity, which is the fastest one on a line.

    Args:
        line: The path.
        limits: Limits of the n joints.
        begin: Distance of its beginning from that of the whole path [rad or m].

    Returns:
        All motions, one behind the other; phases without duration are left out.

    Raises:
        InputError: If the limits are too small or too large for floating-point numbers.
    """
    kernels = library(KERNELS)
    if kernels is None:
        v, a, j = limits.along(line.directions)
        phases, pushes = reference.phases_of_lines(line.lengths, v, a, j)
        durations = phases.sum(axis=1)
        usual = np.isfinite(durations) & (durations > 2.0 * MIN_PHASE_SECONDS)
        if not usual.all():
            raise _impossible(line, limits, int(np.argmin(usual)))
        found = reference.time_lines(line.vertices, line.directions, line.along, phases, pushes, np.isfinite(j))
        seconds, positions, velocities, accelerations, places = found
    else:
        edges, n = line.directions.shape
        table = LinesTable(PlannedTable(_lines_plan(_room(edges), n)))
        table.edges = edges
        table.vertices[: (edges + 1) * n] = line.vertices.ravel()
        table.lengths[:edges] = line.lengths
        table.directions[: edges * n] = line.directions.ravel()
        table.along[: edges + 1] = line.along
        table.velocity[:] = limits.velocity
        table.acceleration[:] = limits.acceleration
        table.jerk[:] = limits.jerk
        count = kernels.time_lines(table.address)
        if count < 0:
            raise _impossible(line, limits, -count - 1)
        rows = (table.positions, table.velocities, table.accelerations)
        positions, velocities, accelerations = (row[: count * n].reshape(count, n) for row in rows)
        seconds = table.durations[:count]
        places = table.begins[:count]

    pieces = Pieces(seconds, positions, velocities, accelerations)
    return Run(pieces, begin + places, np.zeros(len(places)), np.ones(len(places), dtype=bool))


@lru_cache(maxsize=64)
def _lines_plan(edges: int, n: int) -> TablePlan:
    """Return the memory layout of straight motions along up to so many edges in n coordinates; cached."""
    return sizes_of(
        LinesTable,
        vertices=(edges + 1) * n,
        lengths=edges,
        directions=edges * n,
        along=edges + 1,
        velocity=n,
        acceleration=n,
        jerk=n,
        durations=PHASES * edges,
        positions=PHASES * edges * n,
        velocities=PHASES * edges * n,
        accelerations=PHASES * edges * n,
        begins=PHASES * edges,
        phases=PHASES,
        pushes=PHASES,
        dof=n,
    )


def _impossible(line: Polyline, limits: RateLimits, edge: int) -> InputError:
    """Return the error of an edge along which no motion can be calculated."""
    v, a, j = (float(rate[0]) for rate in limits.along(line.directions[edge : edge + 1]))
    return InputError(
        f"no motion of {line.lengths[edge]:.3g} rad or m within velocity {v:.3g}, acceleration {a:.3g} and jerk "
        f"{j:.3g} could be calculated; choose limits of an ordinary size"
    )
