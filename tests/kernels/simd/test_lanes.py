"""Lanes compute what numpy computes, number by number."""

import operator

import numpy as np
import pytest

from rrtik_ompl.kernels.checks.kinematics import sine_and_cosine
from rrtik_ompl.kernels.checks.obstacle_kernels import ALL_LANES
from rrtik_ompl.kernels.simd import lanes
from rrtik_ompl.kernels.simd.compiled import WIDTH, kernel
from rrtik_ompl.kernels.tables.memory import aligned

pytestmark = pytest.mark.kernels

UNITS = np.finfo(np.float32).eps


def numbers(seed, dtype=np.float32, scale=1.0):
    return aligned((scale * np.random.default_rng(seed).normal(size=WIDTH)).astype(dtype))


def address(array):
    return array.ctypes.data


@kernel
def arithmetic(first, second, out):
    x, y = lanes.lanes_at(first, 0), lanes.lanes_at(second, 0)
    lanes.set_lanes(out, 0, x + y)
    lanes.set_lanes(out, 1, x - y)
    lanes.set_lanes(out, 2, x * y)
    lanes.set_lanes(out, 3, x / y)
    lanes.set_lanes(out, 4, -x)
    lanes.set_lanes(out, 5, np.float32(2.0) - x)
    lanes.set_lanes(out, 6, x * 0.5)


@kernel
def functions(first, second, out):
    x, y = lanes.lanes_at(first, 0), lanes.lanes_at(second, 0)
    lanes.set_lanes(out, 0, lanes.absolute(x))
    lanes.set_lanes(out, 1, lanes.floor(x))
    lanes.set_lanes(out, 2, lanes.nearest(x))
    lanes.set_lanes(out, 3, lanes.square_root(lanes.absolute(x)))
    lanes.set_lanes(out, 4, lanes.smaller(x, y))
    lanes.set_lanes(out, 5, lanes.larger(x, np.float32(0.25)))
    lanes.set_lanes(out, 6, lanes.choose(x < y, x, y * y))
    lanes.set_lanes(out, 7, lanes.spread(np.float32(1.5)))
    return lanes.lowest(x), lanes.highest(x)


@kernel
def comparisons(first, second):
    x, y = lanes.lanes_at(first, 0), lanes.lanes_at(second, 0)
    both = lanes.bits((x < y) & (x > np.float32(0.0)))
    either = lanes.bits((x < y) | (x > np.float32(0.0)))
    return lanes.bits(x < y), lanes.bits(x <= y), lanes.bits(x > y), lanes.bits(x >= y), both, either


@kernel
def truths(first, out):
    lanes.set_truths(out, 1, lanes.lanes_at(first, 0) > np.float32(0.0))


@kernel
def wide(first, out):
    x = lanes.wide_lanes_at(first, 0)
    lanes.set_wide_lanes(out, 0, (1.0 - x) * 3.0 + lanes.lane_numbers() / 7.0)
    lanes.set_wide_lanes(out, 1, lanes.spread_wide(0.1) + lanes.floor(x) * lanes.nearest(x))


@kernel
def narrowed(first, out):
    lanes.set_lanes(out, 0, lanes.single(lanes.wide_lanes_at(first, 0)))


@kernel
def scalars(floats, doubles, ints):
    lanes.set_int(ints, 1, lanes.int_at(ints, 0) - 5)
    lanes.set_double(doubles, 1, lanes.double_at(doubles, 0) + lanes.float_at(floats, 1))
    return lanes.first_bit(40), lanes.field(ints, 1)


@kernel
def circle(angles, out):
    sine, cosine = sine_and_cosine(lanes.wide_lanes_at(angles, 0))
    lanes.set_lanes(out, 0, sine)
    lanes.set_lanes(out, 1, cosine)


def test_there_are_as_many_lanes_as_the_processor_has_registers_for():
    assert WIDTH in (8, 16)
    assert ALL_LANES == 2**WIDTH - 1


@pytest.mark.parametrize("seed", range(20))
def test_arithmetic_is_that_of_numpy(seed):
    x, y, out = numbers(seed), numbers(seed + 100), aligned(np.zeros(7 * WIDTH, dtype=np.float32))
    arithmetic(address(x), address(y), address(out))
    expected = [x + y, x - y, x * y, x / y, -x, 2 - x, x * np.float32(0.5)]
    np.testing.assert_allclose(out.reshape(7, WIDTH), expected, rtol=UNITS)


@pytest.mark.parametrize("seed", range(20))
def test_functions_are_those_of_numpy(seed):
    x, y = numbers(seed, scale=3.0), numbers(seed + 100, scale=3.0)
    out = aligned(np.zeros(8 * WIDTH, dtype=np.float32))
    low, high = functions(address(x), address(y), address(out))
    chosen = np.where(x < y, x, y * y)
    expected = [np.abs(x), np.floor(x), np.rint(x), np.sqrt(np.abs(x)), np.minimum(x, y), np.maximum(x, 0.25), chosen]
    np.testing.assert_allclose(out.reshape(8, WIDTH), [*expected, np.full(WIDTH, 1.5)], rtol=UNITS)
    assert (low, high) == (x.min(), x.max())


@pytest.mark.parametrize("seed", range(20))
def test_comparisons_give_one_bit_a_lane(seed):
    x, y = numbers(seed), numbers(seed + 100)
    y[::3] = x[::3]
    found = comparisons(address(x), address(y))
    masks = [sign(x, y) for sign in (operator.lt, operator.le, operator.gt, operator.ge)]
    masks += [(x < y) & (x > 0), (x < y) | (x > 0)]
    assert list(found) == [sum(1 << k for k in np.flatnonzero(mask).tolist()) for mask in masks]


def test_masks_are_written_as_truth_values_of_numpy():
    x, out = numbers(3), np.ones(WIDTH + 2, dtype=np.bool_)
    truths(address(x), address(out))
    assert out.tolist() == [True, *(x > 0).tolist(), True]


def test_wide_lanes_compute_in_float64():
    x, out = numbers(1, np.float64, 5.0), aligned(np.zeros(2 * WIDTH))
    wide(address(x), address(out))
    expected = [(1 - x) * 3 + np.arange(WIDTH) / 7, 0.1 + np.floor(x) * np.rint(x)]
    np.testing.assert_allclose(out.reshape(2, WIDTH), expected, rtol=1e-14, atol=1e-14)


def test_wide_lanes_are_rounded_to_the_nearest_float():
    x, out = numbers(2, np.float64), aligned(np.zeros(WIDTH, dtype=np.float32))
    narrowed(address(x), address(out))
    np.testing.assert_array_equal(out, x.astype(np.float32))


def test_single_numbers_are_read_and_written():
    floats, doubles = np.array([1.0, 2.5], dtype=np.float32), np.array([0.25, 0.0])
    ints = np.array([3, 0, 7, -1], dtype=np.int32)
    place, whole = scalars(address(floats), address(doubles), address(ints))
    assert (place, whole) == (3, ints.view(np.int64)[1])
    assert (ints[1], doubles[1]) == (-2, 2.75)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 10.0, 1e4, 1e8])
def test_sines_are_right_to_float_precision_for_all_angles(scale):
    rng = np.random.default_rng(3)
    special = np.arange(-8, 8) * np.pi / 4
    worst = 0.0
    for angles in [*rng.uniform(-scale, scale, (500, WIDTH)), *special.reshape(-1, 1).repeat(WIDTH, axis=1)]:
        given, out = aligned(angles), aligned(np.zeros(2 * WIDTH, dtype=np.float32))
        circle(address(given), address(out))
        worst = max(worst, np.abs(out.reshape(2, WIDTH) - [np.sin(angles), np.cos(angles)]).max())
    assert worst < 1.5e-7
