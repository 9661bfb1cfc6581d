"""The parts of the search kernels against slow, obvious computations."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.record import Doubles, Floats, Record
from rrtik_ompl.kernels.search import tree_kernels as trees
from rrtik_ompl.kernels.search import tree_layout as layout
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration
from rrtik_ompl.kernels.search.tree_memory import grow, inverse_bases, tree_table
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry
from rrtik_ompl.kernels.simd.random_kernels import next_point, next_share, start_points
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.tables.memory import packed, whole_lanes

pytestmark = pytest.mark.kernels


class Random(Record):
    """A sequence of points."""

    random: int
    point: Doubles
    bases: Doubles


@entry
def nearest(tree: layout.TreeTable, query: Floats) -> int:
    return trees.nearest_vertex(tree, query)


def planted(rows, parents, capacity=None):
    """A tree with these vertices."""
    tree = tree_table(rows.shape[1], 0, capacity or WIDTH * -(-len(rows) // WIDTH))
    add(tree, rows, parents)
    return tree


def add(tree, rows, parents):
    for row, parent in zip(rows, parents, strict=True):
        kept = np.array(row).view(Configuration)
        trees.add_vertex(tree, kept, kept, int(parent), layout.CERTAIN, 1e30)


def ask(tree, query):
    single = np.array(query, dtype=np.float32).view(Floats)
    return nearest(tree, single)


@pytest.mark.parametrize("dof", [1, 2, 3, 6, 7, 13, 50])
@pytest.mark.parametrize("count", [1, 2, WIDTH - 1, WIDTH, WIDTH + 1, 5 * WIDTH + 3])
def test_the_nearest_vertex_is_the_one_of_numpy(dof, count):
    rng = np.random.default_rng(100 * dof + count)
    rows = rng.uniform(-3, 3, (count, dof))
    tree = planted(rows, np.full(count, -1))
    for query in rng.uniform(-3, 3, (50, dof)):
        gaps = np.linalg.norm(rows - query, axis=1)
        assert gaps[ask(tree, query)] <= gaps.min() + 1e-5


def test_of_equally_near_vertices_the_first_one_is_taken():
    rows = np.zeros((3 * WIDTH, 2))
    assert ask(planted(rows, np.full(len(rows), -1)), [1.0, 1.0]) == 0


def test_a_branch_that_was_cut_off_is_never_the_nearest_again():
    rng = np.random.default_rng(5)
    count = 4 * WIDTH
    rows = rng.uniform(-1, 1, (count, 3))
    parents = np.array([-1, *(int(rng.integers(k)) for k in range(1, count))])
    tree = planted(rows, parents)
    doomed = {7}
    for vertex in range(8, count):
        if parents[vertex] in doomed:
            doomed.add(vertex)
    left = trees.cut_branch(tree, 7)
    alive = np.array([v for v in range(count) if v not in doomed])
    assert left == len(alive) == tree.live
    assert trees.cut_branch(tree, 7) == left
    for query in rng.uniform(-1, 1, (200, 3)):
        assert ask(tree, query) == alive[np.linalg.norm(rows[alive] - query, axis=1).argmin()]


def test_a_tree_that_grows_keeps_its_vertices_and_its_address():
    rng = np.random.default_rng(6)
    rows = rng.uniform(-1, 1, (8 * WIDTH, 4))
    tree = planted(rows[:WIDTH], np.full(WIDTH, -1))
    address = tree.address
    for size in (1, 2, 4):
        grow(tree)
        add(tree, rows[size * WIDTH : 2 * size * WIDTH], np.zeros(size * WIDTH))
    assert tree.address == address
    assert tree.size == len(rows)
    np.testing.assert_array_equal(tree.rows.reshape(-1, 4)[: len(rows)], rows)
    for query in rng.uniform(-1, 1, (50, 4)):
        assert ask(tree, query) == np.linalg.norm(rows - query, axis=1).argmin()


@entry
def shares(random: Random, count: int) -> int:
    for k in range(count):
        start_points(random, row_at(random.point, 1, k), 1)
    return count


def uniform(seed, count):
    random = packed(Random, random=seed, point=np.zeros(count))
    shares(random, count)
    return random.point


def test_shares_are_those_of_splitmix64():
    def reference(state):
        while True:
            state = (state + 0x9E3779B97F4A7C15) % 2**64
            z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
            yield ((z ^ (z >> 31)) >> 11) * 2.0**-53

    for seed in (0, 1, 2**62 + 12345):
        wanted = reference(seed)
        assert uniform(seed, 20).tolist() == [next(wanted) for _ in range(20)]


@entry
def second_share(random: Random) -> int:
    if next_share(random) < 1.0:
        return int(next_share(random) * 2.0**53)
    return -1


def test_a_second_share_in_one_kernel_is_the_next_of_the_stream():
    for seed in (0, 1, 2**62 + 12345):
        assert second_share(packed(Random, random=seed)) == uniform(seed, 2)[1] * 2.0**53


def points(dimensions, count, start=None, seed=3):
    first = np.zeros(dimensions) if start is None else np.array(start)
    bases = whole_lanes(np.array(inverse_bases(dimensions)))
    random = packed(Random, random=seed, point=whole_lanes(first), bases=bases)
    if start is None:
        start_points(random, random.point.view(Doubles), dimensions)
    rows = np.empty((count, dimensions))
    for row in rows:
        next_point(random, random.point.view(Doubles), random.bases.view(Doubles), dimensions)
        row[:] = random.point[:dimensions]
    return rows


def test_points_from_the_origin_are_halton_s():
    def inverse(index, base):
        total, digit = 0.0, 1.0 / base
        while index:
            total += index % base * digit
            index, digit = index // base, digit / base
        return total

    wanted = [[inverse(k, base) for base in (2, 3, 5)] for k in range(1, 300)]
    np.testing.assert_allclose(points(3, 299, start=[0.0, 0.0, 0.0]), wanted, atol=1e-12)


@pytest.mark.parametrize("dimensions", [1, 7, 12, 13, 50])
def test_points_stay_in_the_box_and_cover_it(dimensions):
    rows = points(dimensions, 4000)
    assert rows.min() >= 0.0
    assert rows.max() < 1.0
    np.testing.assert_allclose(rows.mean(axis=0), 0.5, atol=0.03)
    low, high = np.quantile(rows, [0.1, 0.9], axis=0)
    np.testing.assert_allclose(low, 0.1, atol=0.04)
    np.testing.assert_allclose(high, 0.9, atol=0.04)


def test_halton_points_cover_a_box_more_evenly_than_random_ones():
    def emptiest(rows):
        return min(np.histogramdd(rows, bins=4, range=[(0, 1)] * 3)[0].ravel())

    assert emptiest(points(3, 640)) > emptiest(np.random.default_rng(0).random((640, 3)))


def test_lengths_are_drawn_from_the_box_or_taken_as_given():
    lower, upper = np.full(7, -3.0), np.full(7, 3.0)
    range_, domain = connect_lengths(lower, upper, None, None, turning=np.ones(7, dtype=bool))
    assert 0.5 < range_ < 2.0
    assert domain > range_
    assert connect_lengths(lower, upper, 0.3, 7.0, turning=None) == (0.3, 7.0)
    assert connect_lengths(lower, lower, None, None, turning=None)[0] > 0.0


def test_a_range_is_a_share_of_the_box_but_a_joint_that_turns_counts_no_more_than_a_turn():
    lower, upper = np.zeros(3), np.array([1.0, 2.0, 50.0])
    for unit in (1e-3, 1e3):
        plain = connect_lengths(unit * lower, unit * upper, None, None, turning=None)
        assert np.divide(plain, unit) == pytest.approx(connect_lengths(lower, upper, None, None, turning=None))
    turning = np.array([True, True, True])
    wide, wider = (connect_lengths(lower, box, None, None, turning=turning)[0] for box in (upper, 2.0 * upper))
    assert wide < wider < 2.0 * wide
    sliding = connect_lengths(lower, upper, None, None, turning=np.array([True, True, False]))[0]
    assert sliding == pytest.approx(0.08 * np.linalg.norm(upper))


def test_a_domain_is_somewhat_narrower_than_two_random_configurations_are_apart():
    rng, upper = np.random.default_rng(0), np.array([1.0, 4.0 * np.pi, 12.0])
    pairs = rng.uniform(0.0, upper, (2, 20000, 3))
    apart = np.sqrt(np.mean(np.sum((pairs[0] - pairs[1]) ** 2, axis=1)))
    assert connect_lengths(np.zeros(3), upper, None, None, turning=None)[1] == pytest.approx(0.8 * apart, rel=0.02)
    assert (
        connect_lengths(np.zeros(3), upper, 30.0, None, turning=None)[1] == 30.0
    )  # a range reaches no farther than its domain


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_lengths_that_are_none_are_refused(bad):
    with pytest.raises(InputError, match="range"):
        connect_lengths(np.zeros(2), np.ones(2), bad, None, turning=None)
    with pytest.raises(InputError, match="domain"):
        connect_lengths(np.zeros(2), np.ones(2), None, bad, turning=None)


def test_a_share_is_below_one_even_where_all_bits_are_set():
    random = packed(Random)
    assert 0.0 <= next_share(random) < 1.0
