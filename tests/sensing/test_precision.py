"""Statistics of repeated measurements reproduce the published ones."""

from dataclasses import replace

import numpy as np
import pytest

from rrtik_bench.sensing.precision import Series, series_of
from rrtik_bench.sensing.tables import GRIPPER
from rrtik_ompl.base.errors import InputError


def test_statistics_reproduce_the_published_ones():
    first = Series(100, 505.9640, 505.6400, 505.7898, 0.0671)
    last = Series(100, 2041.1300, 2029.8200, 2035.0656, 2.1142)
    assert first.mean_deviation == pytest.approx(0.0067, abs=5e-5)
    assert last.mean_deviation == pytest.approx(0.2114, abs=5e-5)
    assert first.largest_deviation == pytest.approx(0.1742, abs=5e-5)
    assert last.largest_deviation == pytest.approx(6.0644, abs=5e-5)


@pytest.mark.parametrize(
    ("distance", "by_range", "by_mean", "by_quartiles"),
    [(500, 0.464, 0.457, 0.351), (1000, 1.204, 1.182, 0.898), (1500, 4.617, 4.614, 3.607), (2000, 7.263, 7.263, 5.362)],
)
def test_an_impossible_deviation_is_flagged(distance, by_range, by_mean, by_quartiles):
    series = GRIPPER[distance]
    assert series.possible_deviations == pytest.approx(
        {"range": by_range, "mean": by_mean, "quartiles": by_quartiles}, abs=1e-3
    )
    assert not series.possible
    assert replace(series, quartiles=None).possible is (distance == 2000)


@pytest.mark.parametrize("method", ["inverted_cdf", "hazen", "weibull", "linear", "median_unbiased", "higher", "lower"])
def test_no_sample_deviates_by_more_than_its_statistics_allow(method):
    rng, nearest = np.random.default_rng(0), {"range": 0.0, "mean": 0.0, "quartiles": 0.0}
    for _ in range(2000):
        count = 4 * int(rng.integers(1, 30))
        values = rng.beta(*rng.uniform(0.02, 2.0, 2), count) + rng.integers(-1, 2, count) * rng.integers(0, 2)
        quartiles = tuple(np.quantile(values, [0.25, 0.5, 0.75], method=method))
        mean, deviation = values.mean(), values.std(ddof=1)
        series = Series(count, values.max(), values.min(), mean, deviation, quartiles)
        for known, bound in series.possible_deviations.items():
            assert deviation <= bound + 1e-12
            nearest[known] = max(nearest[known], deviation / max(bound, 1e-12))
    assert min(nearest.values()) > 0.95  # and some come near each bound


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
