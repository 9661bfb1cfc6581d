"""Statistics of repeated measurements reproduce the published ones."""

import numpy as np
import pytest

from rrtik_bench.sensing.precision import Series, series_of
from rrtik_ompl.base.errors import InputError


def test_statistics_reproduce_the_published_ones():
    first = Series(100, 505.9640, 505.6400, 505.7898, 0.0671)
    last = Series(100, 2041.1300, 2029.8200, 2035.0656, 2.1142)
    assert first.mean_deviation == pytest.approx(0.0067, abs=5e-5)
    assert last.mean_deviation == pytest.approx(0.2114, abs=5e-5)
    assert first.largest_deviation == pytest.approx(0.1742, abs=5e-5)
    assert last.largest_deviation == pytest.approx(6.0644, abs=5e-5)


@pytest.mark.parametrize(
    ("largest", "smallest", "mean", "printed", "bound", "possible"),
    [
        (1963.3162, 1962.3938, 1962.9328, 0.5261, 0.464, False),
        (2134.1887, 2131.7919, 2132.7625, 1.2301, 1.204, False),
        (2407.2225, 2398.0351, 2402.7820, 5.3397, 4.617, False),
        (2791.8982, 2777.4443, 2784.6694, 5.5185, 7.263, True),
    ],
)
def test_an_impossible_deviation_is_flagged(largest, smallest, mean, printed, bound, possible):
    series = Series(100, largest, smallest, mean, printed)
    assert series.largest_possible_deviation == pytest.approx(bound, abs=2e-3)
    assert series.possible is possible


@pytest.mark.parametrize(
    ("mean", "percent"), [(299.1255, -0.2915), (300.3340, 0.1113), (300.8539, 0.2846), (302.9160, 0.9720)]
)
def test_errors_in_percent_are_the_published_ones(mean, percent):
    assert Series(100, mean, mean, mean, 0.0).error_percent(300.0) == pytest.approx(percent, abs=1e-4)


def test_a_series_of_values_is_summed_up():
    values = np.random.default_rng(0).normal(5.0, 2.0, 100_000)
    series = series_of(values)
    assert series.deviation == pytest.approx(2.0, rel=0.02)
    assert series.robust_deviation == pytest.approx(2.0, rel=0.02)
    assert series.possible
    with pytest.raises(InputError, match="at least two"):
        series_of([1.0])
