"""The kernels for timing give what their twins in numpy give, and write nowhere else."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.arrays import BLOCK_ROWS
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.reference import timing as reference
from rrtik_ompl.kernels.reference.timing import Rows
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.kernels.timing.layout import KERNELS, LINE, CurveTable, SearchTable, line_count
from rrtik_ompl.kernels.timing.run_layout import MOST_PIECES, RunTable
from rrtik_ompl.motion.trajectory import cubics, runs
from rrtik_ompl.motion.trajectory.corners import Polyline
from rrtik_ompl.motion.trajectory.cubics import Cubics
from rrtik_ompl.motion.trajectory.curve import Curve
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.motion.trajectory.runs import along_curve, along_lines

pytestmark = pytest.mark.kernels
seeds = st.integers(0, 2**32 - 1)


def random_curve(rng, n, count):
    vertices = np.cumsum(rng.normal(size=(count, n)), axis=0)
    edges = np.diff(vertices, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    radii = np.concatenate([[0.0], rng.uniform(0.01, 2.0, count - 2), [0.0]])
    return vertices, along, edges / lengths[:, None], radii


@settings(max_examples=30)
@given(seeds, st.integers(1, 8), st.integers(2, 9))
def test_places_on_a_curve(seed, n, count):
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, n, count)
    at = np.sort(np.append(rng.uniform(0.0, curve[1][-1], 50), curve[1]))
    given = dict(zip(("vertices", "along", "directions", "radii"), curve, strict=True))
    counts = {"dof": n, "vertex_count": count, "place_count": len(at)}
    task = packed(CurveTable, **given, at=at, values=np.empty((len(at), 3 * n)), widest=curve[3].max(), **counts)
    library(KERNELS).sample_curve(task.address)
    assert task.intact()
    wanted = reference.sample_curve(*curve, at)
    assert np.allclose(task.values.reshape(wanted.shape), wanted, rtol=1e-9, atol=1e-9)


@settings(max_examples=30)
@given(seeds, st.integers(1, 7), st.integers(0, 4))
@example(3475, 4, 1)
def test_the_fastest_motion(seed, n, extra):
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, n, 4)
    grid = np.linspace(0.0, curve[1][-1], 60)
    shape = reference.sample_curve(*curve, grid)
    first, second = rng.normal(size=(2, 60, extra))
    rows = Rows(first, second, -rng.uniform(0.5, 2.0, (60, extra)), rng.uniform(0.5, 2.0, (60, extra)))
    velocity, acceleration = rng.uniform(0.5, 3.0, (2, n))
    cap = rng.uniform(0.5, 5.0, 60)
    task = packed(
        SearchTable,
        shape=shape,
        velocity=velocity,
        acceleration=acceleration,
        **rows._asdict(),
        cap=cap,
        grid=grid,
        squares=np.zeros(60),
        reached=np.zeros(60),
        lines=np.zeros(LINE * line_count(n, extra)),
        joints=n,
        rows=extra,
        points=60,
    )
    library(KERNELS).find_squares(task.address)
    assert task.intact()
    squares = task.squares
    every, most = reference.all_rows(shape, velocity, acceleration, rows, cap)
    given_up = (
        60 * 1e-9 * squares.max()
    )  # where rounding decides, either may lower a square by 1e-9 of it, point by point
    assert np.allclose(squares, reference.find_squares(every, most, grid), rtol=1e-6, atol=given_up)
    u = 0.5 * np.diff(squares) / np.diff(grid)
    for at, x in ((slice(None, -1), squares[:-1]), (slice(1, None), squares[1:])):
        value = every.first[at] * u[:, None] + every.second[at] * x[:, None]
        assert (value <= every.high[at] + 1e-6).all()
        assert (value >= every.low[at] - 1e-6).all()
    assert (squares <= most * (1 + 1e-9)).all()
    assert squares[0] == squares[-1] == 0.0


@settings(max_examples=15)
@given(seeds, st.integers(1, 7), st.integers(3, 6), st.sampled_from([20.0, 200.0, np.inf]))
def test_a_run_is_timed_as_step_by_step(seed, n, count, jerk):
    rng = np.random.default_rng(seed)
    vertices = np.cumsum(rng.normal(size=(count, n)), axis=0)
    curve = Curve.of(Polyline.of(vertices), rng.uniform(0.05, 0.3, count - 2))
    limits = RateLimits(*rng.uniform(0.5, 4.0, (2, n)), jerk)
    nearest = rng.uniform(0.001, 0.05)
    found = along_curve(curve, limits, max_deviation=nearest, begin=0.5)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(runs, "_timed", lambda *_: None)
        wanted = along_curve(curve, limits, max_deviation=nearest, begin=0.5)
    assert found.duration == pytest.approx(wanted.duration, rel=1e-6)
    assert len(found.places) == len(wanted.places)
    for one, other in zip((*found.pieces, found.places), (*wanted.pieces, wanted.places), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.deviations, wanted.deviations, atol=1e-7)
    assert (found.on_path != wanted.on_path).mean() < 0.05


@settings(max_examples=25)
@given(seeds, st.integers(1, 7), st.integers(3, 40), st.floats(0.02, 3.0))
def test_the_grid_is_that_of_numpy(seed, n, count, radius):
    rng = np.random.default_rng(seed)
    line = Polyline.of(np.cumsum(rng.normal(size=(count, n)), axis=0))
    curve = Curve.of(line, radius * rng.uniform(0.05, 1.0, count - 2))
    made = []

    class Watched(RunTable):
        def __init__(self, memory):
            super().__init__(memory)
            made.append(self)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(runs, "RunTable", Watched)
        runs._spare_runs.cache_clear()
        runs.along_curve(curve, RateLimits(1.0, 2.0, 20.0))
    runs._spare_runs.cache_clear()
    run = made[-1]
    grid, tightest = curve.grid()
    points = run.search.points
    assert run.search.grid[:points].tolist() == grid.tolist()
    bends = np.linalg.norm(curve.at(grid).bends, axis=1)
    np.testing.assert_allclose(run.most[:points], runs.SMOOTHED_SHARE * tightest / np.maximum(bends, 1e-300), rtol=1e-9)
    assert all(each.intact() and each.curve.intact() and each.search.intact() for each in made)


@settings(max_examples=30)
@given(seeds, st.integers(1, 9), st.integers(2, 30), st.sampled_from([0.3, 20.0, 1e4, np.inf]))
def test_straight_motions_are_those_of_numpy(seed, n, count, jerk):
    rng = np.random.default_rng(seed)
    rows = np.cumsum(rng.normal(size=(count, n)) * 10.0 ** rng.uniform(-3, 0, (count, 1)), axis=0)
    line = Polyline.of(rows)
    limits = RateLimits(*rng.uniform(0.5, 4.0, (2, n)), jerk * rng.uniform(0.5, 1.0, n))
    found = along_lines(line, limits, begin=0.5)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(runs, "library", lambda _: None)
        wanted = along_lines(line, limits, begin=0.5)
    assert len(found.places) == len(wanted.places)
    for one, other in zip((*found.pieces, found.places), (*wanted.pieces, wanted.places), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14)


def test_a_straight_motion_that_is_impossible_is_named_alike_without_kernels(monkeypatch):
    line = Polyline.of(np.array([[0.0], [1.0], [3.0]]))
    limits = RateLimits(1e308, 1e308)
    said = []
    for kernels in (runs.library, lambda _: None):
        monkeypatch.setattr(runs, "library", kernels)
        with pytest.raises(InputError, match="no motion of 1 rad or m within velocity 1e") as error:
            along_lines(line, limits)
        said.append(str(error.value))
    assert said[0] == said[1]


@settings(max_examples=30)
@given(seeds, st.integers(1, 8), st.integers(2, 30))
def test_states_and_pushes_of_cubics_are_those_of_numpy(seed, n, knots):
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.001, 0.3, knots - 1))])
    motion = Cubics(times, *rng.normal(size=(3, knots, n)))
    weights = rng.uniform(0.0, 2.0, n)
    clock = rng.permutation(np.concatenate([times, rng.uniform(-0.1, times[-1] + 0.1, 50)]))
    states = motion.states(clock)
    pushes = motion.greatest_pushes(weights)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(cubics, "library", lambda _: None)
        for one, other in zip(states, motion.states(clock), strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_allclose(pushes, motion.greatest_pushes(weights), rtol=1e-12)
    strided = Cubics(*(np.repeat(rows, 2, axis=0)[::2] for rows in (times, *(motion.positions,) * 3)))
    np.testing.assert_array_equal(strided.states(clock).positions[0], strided.states(clock[:1]).positions[0])
    many = np.tile(clock, BLOCK_ROWS // len(clock) + 2)  # more than one call
    np.testing.assert_array_equal(motion.states(many).velocities[-len(clock) :], states.velocities)


def test_a_run_of_the_largest_size_stays_in_its_memory(monkeypatch):
    made = []

    class Watched(RunTable):
        def __init__(self, memory):
            super().__init__(memory)
            made.append(self)

    monkeypatch.setattr(runs, "RunTable", Watched)
    runs._spare_runs.cache_clear()
    slow = RateLimits([0.01, 0.01], 1.0, 1e3)  # so slow that all pieces and parts there may be are used
    line = Polyline.of(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]))
    run = along_curve(Curve.of(line, np.array([0.2])), slow)
    assert len(run.places) >= MOST_PIECES
    assert all(each.intact() and each.curve.intact() and each.search.intact() for each in made)
    assert made


@settings(max_examples=20)
@given(seeds, st.integers(1, 7), st.integers(2, 20), st.booleans())
def test_peaks_are_those_of_numpy(seed, n, knots, smooth):
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.001, 0.3, knots - 1))])
    velocities, accelerations = rng.normal(size=(2, knots, n))
    if smooth:  # pieces of constant jerk, from rest to rest
        accelerations[[0, -1]] = 0.0
        rise = 0.5 * np.diff(times)[:, None] * (accelerations[1:] + accelerations[:-1])
        velocities = np.concatenate([np.zeros((1, n)), np.cumsum(rise, axis=0)])
    wanted = reference.peaks(times, velocities, accelerations)
    found = Cubics(times, velocities, velocities, accelerations).peaks()
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    assert np.isfinite(found.jerk).all() == smooth
