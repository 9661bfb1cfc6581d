"""The published tree and the arcs of intersection: published figures [3] over random states, and properties."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bench.shared.mb_rrt_tree import plot_tree
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.ik.mb_rrt.exact import arc_chains, grow_and_close, grow_on_arcs
from rrtik_ompl.ik.mb_rrt.links import Links, directions, headings_to_joints, joints_to_chain, sunflower
from rrtik_ompl.ik.mb_rrt.published import (
    VARIANTS,
    best_parents,
    grow,
    grow_in_joint_space,
    nearest,
    one_link,
    one_link_away,
    surface,
)

THREE, TEN = Links([10.0] * 3), Links([10.0] * 10)

lengths = st.lists(st.floats(0.05, 20.0), min_size=1, max_size=40)
seeds = st.integers(0, 2**32 - 1)


def reachable_goal(links, seed, share):
    """A goal at a share of the way from the hole around the base to the full reach, in a random direction."""
    rng = np.random.default_rng(seed)
    radius = links.min_span[0] + share * (links.reach - links.min_span[0])
    return radius * directions(1, links.dimension, rng)[0]


@given(lengths, st.sampled_from([2, 3]), seeds, st.floats(0.0, 1.0))
@example([1.0, 1.0, 1.0], 2, 0, 7.7e-162)  # whose square is hardly a number
@settings(deadline=None, max_examples=150)
def test_arcs_end_on_every_reachable_goal_in_one_pass_with_no_node_outside(sizes, dimension, seed, share):
    links = Links(sizes, dimension)
    run = grow_on_arcs(links, reachable_goal(links, seed, share), rng=np.random.default_rng(seed), passes=4)
    assert run.misses.max() < 1e-9 * links.reach
    assert run.outside(margin=1e-9) == 0
    assert run.edge_error() < 1e-12 * links.reach
    nodes = run.nodes[1:]
    for level, near in zip(nodes, links.min_span[1:], strict=True):
        assert (np.linalg.norm(level - run.goal, axis=1) >= near - 1e-9 * links.reach).all()


@given(st.sampled_from(sorted(VARIANTS)), st.sampled_from([2, 3]), seeds, st.floats(0.05, 0.95))
@settings(deadline=None, max_examples=40)
def test_every_edge_of_a_tree_is_as_long_as_its_link_and_leads_to_an_earlier_pass(name, dimension, seed, share):
    links = Links([3.0, 1.0, 2.0, 0.5], dimension)
    goal = reachable_goal(links, seed, share)
    run = grow(links, goal, name, tolerance=1e-9, rng=np.random.default_rng(seed), passes=100)
    assert run.edge_error() < 1e-12
    assert [len(level) for level in run.nodes] == [1, *[run.passes] * 4]
    for parents in run.parents[1:]:
        assert (parents <= np.arange(run.passes)).all()
    assert np.abs(np.linalg.norm(np.diff(run.chain, axis=0), axis=1) - links.lengths).max() < 1e-12


@given(st.integers(1, 12), seeds)
@settings(deadline=None, max_examples=60)
def test_joint_angles_of_a_chain_lead_back_to_it(count, seed):
    rng = np.random.default_rng(seed)
    links = Links(rng.uniform(0.1, 5.0, count))
    joints = rng.uniform(-np.pi, np.pi, count)
    chain = joints_to_chain(links.lengths, joints)
    again = headings_to_joints(chain)
    assert (again >= -np.pi).all()
    assert (again < np.pi).all()
    np.testing.assert_allclose(np.exp(1j * again), np.exp(1j * joints), atol=1e-9)
    np.testing.assert_allclose(joints_to_chain(links.lengths, again), chain, atol=1e-9)


@given(st.sampled_from([nearest, one_link_away]), st.integers(1, 400), st.integers(1, 60), seeds)
@settings(deadline=None, max_examples=60)
def test_a_block_of_passes_chooses_the_parents_that_single_passes_would(rule, before, count, seed):
    rng = np.random.default_rng(seed)
    nodes, samples = rng.normal(size=(before + count, 2)), rng.normal(size=(count, 2))
    expected = []
    for k, sample in enumerate(samples):
        known = nodes[: before + k + 1]
        distance = np.linalg.norm(known - sample, axis=1)
        expected.append(int(np.argmin(distance if rule is nearest else np.abs(distance - 0.7))))
    assert best_parents(nodes, samples, 0.7, rule).tolist() == expected


def test_a_run_that_goes_on_holds_the_run_that_stops():
    goal = np.array([12.0, 9.0])
    stopped = grow(THREE, goal, tolerance=0.05, rng=np.random.default_rng(4))
    whole = grow(THREE, goal, tolerance=0.05, rng=np.random.default_rng(4), passes=200, stop=False)
    assert whole.solved_in == stopped.solved_in == stopped.passes
    np.testing.assert_array_equal(whole.until(stopped.passes).nodes[-1], stopped.nodes[-1])
    np.testing.assert_array_equal(whole.chain, stopped.chain)


PRECISION = [
    *[(THREE, 35, tolerance, bound) for tolerance, bound in ((0.3, 8), (0.01, 45), (0.001, 130))],
    *[(TEN, 100, tolerance, bound) for tolerance, bound in ((1.0, 12), (0.01, 55), (0.001, 140))],
]


@pytest.mark.parametrize(("links", "count", "tolerance", "bound"), PRECISION)
def test_mb_rrt_solves_every_goal_in_the_published_number_of_passes(links, count, tolerance, bound):
    for seed in range(2):
        rng = np.random.default_rng(seed)
        runs = [grow(links, goal, tolerance=tolerance, rng=rng) for goal in sunflower(links, count)]
        assert all(run.solved_in for run in runs)
        assert np.mean([run.solved_in for run in runs]) <= bound
        assert max(run.solved_in for run in runs) <= 1500


def test_rule_a_is_trapped_where_rule_b_is_not():
    rng = np.random.default_rng(0)
    solved = {
        name: np.mean([grow(THREE, g, name, tolerance=0.3, rng=rng, passes=300).solved_in > 0 for g in goals])
        for name, goals in dict.fromkeys(("surface-a", "surface-b"), sunflower(THREE, 105)).items()
    }
    assert solved["surface-b"] == 1.0
    assert 0.10 <= solved["surface-a"] <= 0.50


def test_uniform_b_star_needs_the_passes_that_the_ring_around_the_goal_predicts():
    rng = np.random.default_rng(0)
    for links, tolerance, low, high in ((THREE, 0.3, 55, 130), (TEN, 1.0, 230, 400)):
        runs = [grow(links, g, "uniform-b-star", tolerance=tolerance, rng=rng) for g in sunflower(links, 70)]
        assert low <= np.mean([run.solved_in for run in runs]) <= high


def test_the_share_of_nodes_outside_falls_from_uniform_over_surface_to_none():
    rng, goals = np.random.default_rng(0), sunflower(THREE, 6)
    rho = {
        name: np.mean([grow(THREE, g, name, tolerance=0.3, rng=rng, passes=1500, stop=False).rho() for g in goals])
        for name in ("uniform-b", "surface-a", "surface-b")
    }
    assert rho["uniform-b"] >= 0.55
    assert rho["surface-b"] < rho["surface-a"] < 0.5 * rho["uniform-b"]
    assert np.mean([grow_on_arcs(THREE, g, rng=rng, passes=1500).rho(1e-9) for g in goals]) == 0.0


def test_surface_samples_follow_the_arcsine_law_and_a_third_of_the_first_nodes_is_outside():
    links, goal, count = Links([10.0] * 4), np.array([20.0, 30.0]), 100_000
    rng = np.random.default_rng(0)
    nodes = one_link(np.zeros((count, 2)), surface(links, goal, 1, count, rng), 10.0, rng)
    angle = np.sort(np.arctan2(nodes[:, 1], nodes[:, 0]) - np.arctan2(30.0, 20.0))
    law = 0.5 + np.arcsin(np.clip(np.hypot(20.0, 30.0) * np.sin(angle) / 30.0, -1.0, 1.0)) / np.pi
    assert np.abs(law - (np.arange(count) + 0.5) / count).max() < 0.01
    assert np.mean(np.linalg.norm(nodes - goal, axis=1) > 30.0) == pytest.approx(1 / 3, abs=0.01)


def test_arcs_have_no_peaks_at_the_ends_of_the_region():
    links, goal = Links([10.0] * 4), np.array([20.0, 30.0])
    first = grow_on_arcs(links, goal, rng=np.random.default_rng(0), passes=50_000).nodes[1]
    angle = np.arctan2(first[:, 1], first[:, 0]) - np.arctan2(30.0, 20.0)
    edge = np.arccos((1300.0 + 100.0 - 900.0) / (2.0 * np.sqrt(1300.0) * 10.0))
    shares = np.histogram(angle, bins=10, range=(-edge, edge))[0] / len(first)
    np.testing.assert_allclose(shares, 0.1, atol=0.01)


def test_arcs_take_many_goals_at_once_and_a_hundred_links():
    links = Links(np.linspace(0.5, 3.0, 100), 3)
    goals = sunflower(links, 200)
    goals = goals[links.shortfall(goals) == 0.0]
    chains = arc_chains(links, goals, np.random.default_rng(0))
    assert chains.shape == (len(goals), 101, 3)
    assert np.linalg.norm(chains[:, -1] - goals, axis=1).max() < 1e-9 * links.reach


def test_two_links_closed_exactly_end_on_the_goal():
    rng = np.random.default_rng(0)
    for links in (THREE, TEN, Links([2.0, 1.0])):
        for goal in sunflower(links, 10):
            if links.shortfall(goal[None])[0] > 0.0:
                continue
            chain, passes = grow_and_close(links, goal, rng=rng)
            assert passes < 200
            np.testing.assert_allclose(np.linalg.norm(np.diff(chain, axis=0), axis=1), links.lengths, rtol=1e-9)
            np.testing.assert_array_equal(chain[-1], goal)


def test_the_joint_space_tree_takes_steps_and_counts_each_vertex_as_an_iteration():
    goal = np.array([12.0, 9.0])
    run = grow_in_joint_space(THREE, goal, tolerance=0.5, rng=np.random.default_rng(0))
    assert run.solved_in == run.passes
    assert run.edge_error() < 1e-9
    assert np.linalg.norm(run.chain[-1] - goal) < 0.5
    assert 0.3 < grow_in_joint_space(THREE, goal, tolerance=1e-9, rng=np.random.default_rng(0), passes=2000).rho() < 0.9


@given(st.lists(st.floats(0.05, 20.0), min_size=1, max_size=6), st.floats(1e-6, 5.0), st.booleans())
@settings(deadline=None, max_examples=60)
def test_goals_out_of_reach_are_refused_with_by_how_much(sizes, off, beyond):
    links = Links(sizes)
    radius = links.reach + off if beyond else links.min_span[0] - off
    if radius < 0.0:
        return
    short = float(links.shortfall([[0.0, radius]])[0])
    assert short == pytest.approx(off, rel=1e-6)
    for search in (
        lambda: grow(links, [0.0, radius], tolerance=0.1, rng=np.random.default_rng(0)),
        lambda: grow_on_arcs(links, [0.0, radius], rng=np.random.default_rng(0)),
        lambda: grow_in_joint_space(links, [0.0, radius], tolerance=0.1, rng=np.random.default_rng(0)),
    ):
        with pytest.raises(InputError, match=rf"out of reach by {short:.4g}".replace("+", r"\+")):
            search()


def test_bad_input_is_refused_in_one_line():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"lengths.*0"):
        Links([1.0, 0.0])
    with pytest.raises(InputError, match="dimension must be 2 or 3"):
        Links([1.0], 4)
    with pytest.raises(UnknownNameError, match=r"'surface'.*surface-a"):
        grow(THREE, [1.0, 1.0], "surface", tolerance=0.1, rng=rng)
    with pytest.raises(InputError, match=r"goal.*finite"):
        grow_on_arcs(THREE, [np.nan, 0.0], rng=rng)
    with pytest.raises(InputError, match="needs a planar chain"):
        grow_in_joint_space(Links([1.0], 3), [0.0, 0.0, 1.0], tolerance=0.1, rng=rng)


@pytest.mark.parametrize("ending", [".png", ".svg"])
def test_the_picture_of_a_tree_is_the_same_every_time(tmp_path, ending):
    run = grow(Links([10.0] * 4), [20.0, 30.0], tolerance=0.5, rng=np.random.default_rng(1))
    for name in ("one", "two"):
        plot_tree(run, tmp_path / (name + ending))
    assert (tmp_path / ("one" + ending)).read_bytes() == (tmp_path / ("two" + ending)).read_bytes()
    space = grow_on_arcs(Links([1.0, 1.0], 3), [1.0, 0.0, 0.5], rng=np.random.default_rng(0))
    with pytest.raises(InputError, match="only planar ones are drawn"):
        plot_tree(space, tmp_path / "three.png")
