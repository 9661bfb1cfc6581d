"""The genetic algorithm with range reduction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rrtik_ompl as rrtik
from rrtik_bench.genetic.published import INCH, curve
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.genetic.options import HISTORICAL, STANDARD, GeneticOptions
from rrtik_ompl.ik.genetic.population import (
    LARGEST,
    Window,
    around,
    children,
    from_gray,
    random_genes,
    to_gray,
    whole_range,
)
from rrtik_ompl.ik.genetic.search import follow_targets, manipulability, score
from rrtik_ompl.model.robot import reach_of

TOLERANCE = 0.002 * INCH
EVERY_NUMBER = np.arange(LARGEST + 1, dtype=np.uint16)


def goals(number, count=251):
    return [rrtik.PositionGoal(point, TOLERANCE) for point in curve(number)[:count] * INCH]


def everything(Q):
    return np.ones(len(Q), dtype=bool)


def follow(robot, number, options, seed=0, **more):
    return follow_targets(robot, goals(number), options, np.random.default_rng(seed), **more)


def test_gray_codes_of_all_numbers_come_back_and_neighbours_differ_in_one_bit():
    codes = to_gray(EVERY_NUMBER)
    assert (from_gray(codes) == EVERY_NUMBER).all()
    changed = codes[1:] ^ codes[:-1]
    assert (changed & (changed - 1) == 0).all()
    assert (changed > 0).all()


def test_all_codes_decode_into_the_window_and_its_ends_are_reached():
    window = Window(np.array([1.0]), np.array([0.5]))
    q = window.decode(to_gray(EVERY_NUMBER)[:, None])
    assert q[0, 0] == pytest.approx(0.75)
    assert q[-1, 0] == pytest.approx(1.25)
    np.testing.assert_allclose(np.diff(q[:, 0]), 0.5 / 65535, rtol=1e-6)


def test_the_published_resolution_is_that_of_the_whole_range():
    robot = rrtik.load_robot("puma560_5dof")
    resolution = np.degrees(whole_range(robot).width) / LARGEST
    np.testing.assert_allclose(resolution, [0.005188, 0.004120, 0.004959, 0.004120, 0.003052], atol=1e-6)


@given(st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3), st.floats(1e-3, 8.0))
def test_a_window_never_leaves_the_limits(centre, width):
    robot = rrtik.load_robot("puma560_3dof")
    window = around(robot, np.array(centre), width)
    genes = random_genes(np.random.default_rng(0), 20, 3)
    genes[0], genes[1] = to_gray(np.uint16([0])), to_gray(np.uint16([LARGEST]))
    assert robot.within_limits(window.decode(genes), 1e-12).all()


def test_encoding_is_the_inverse_of_decoding():
    window = Window(np.array([0.3, -1.0]), np.array([2.0, 0.1]))
    genes = random_genes(np.random.default_rng(3), 50, 2)
    assert (window.encode(window.decode(genes)) == genes).all()


def test_without_mutation_every_bit_of_a_child_is_a_bit_of_the_population():
    genes = np.array([[0b0011], [0b0101]] * 5, dtype=np.uint16)
    options = GeneticOptions(population=10, tournament=1, bit_mutation=0.0)
    brood = children(np.random.default_rng(0), genes, np.zeros(10), options)
    assert brood.shape == genes.shape
    assert (brood & ~np.uint16(0b0111) == 0).all()
    assert (brood & 1 == 1).all()


@pytest.mark.parametrize(
    ("preset", "wanted"), [(STANDARD, 0.01 * 16), (HISTORICAL, 0.007)], ids=["standard", "historical"]
)
def test_as_many_bits_a_gene_are_flipped_as_the_preset_says(preset, wanted):
    genes = np.zeros((100, 5), dtype=np.uint16)
    rng = np.random.default_rng(0)
    flipped = [int(np.unpackbits(children(rng, genes, np.zeros(100), preset).view(np.uint8)).sum()) for _ in range(200)]
    assert np.mean(flipped) / genes.size == pytest.approx(wanted, rel=0.15)


def test_a_great_tournament_lets_only_the_best_breed():
    genes = np.arange(100, dtype=np.uint16)[:, None]
    options = GeneticOptions(tournament=2000, bit_mutation=0.0)
    brood = children(np.random.default_rng(0), genes, np.abs(np.arange(100) - 42.0), options)
    assert (brood == 42).all()


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_three_joints_follow_the_published_trajectories_on_one_branch(number):
    robot = rrtik.load_robot("puma560_3dof")
    branches = solutions(robot, curve(number) * INCH).branches
    for seed in range(3):
        run = follow(robot, number, STANDARD, seed)
        assert len(run.q) == 251
        assert run.generations <= 2500
        assert run.cost_of_point.sum() == run.generations or run.attempts > 1
        assert robot.within_limits(run.q, 0.0).all()
        assert np.degrees(np.abs(np.diff(run.q, axis=0)).max()) < 1.0
        assert max(goal.distance(robot, q)[0] for goal, q in zip(goals(number), run.q, strict=True)) < TOLERANCE
        away = np.degrees(np.abs(wrapped(branches - run.q[:, None])).max(axis=(0, 2)).min())
        assert away < 0.03


def test_range_reduction_saves_three_quarters_of_the_generations():
    robot = rrtik.load_robot("puma560_3dof")
    bare, reduced = follow(robot, 3, replace(STANDARD, window=None)), follow(robot, 3, STANDARD)
    assert len(bare.q) == len(reduced.q) == 251
    assert bare.generations > 4 * reduced.generations


def test_with_historical_mutation_the_first_point_takes_hundreds_of_generations():
    robot = rrtik.load_robot("puma560_3dof")
    first = [
        follow_targets(robot, goals(1, 1), HISTORICAL, np.random.default_rng(seed)).generations for seed in range(5)
    ]
    quick = [follow_targets(robot, goals(1, 1), STANDARD, np.random.default_rng(seed)).generations for seed in range(5)]
    assert 150 < np.median(first) < 900
    assert np.median(quick) < 100


def test_five_joints_complete_without_extrapolation_and_run_away_with_it():
    robot = rrtik.load_robot("puma560_5dof")
    calm = follow(robot, 1, STANDARD)  # more joints than the task has dimensions: gain 0
    assert len(calm.q) == 251
    assert np.degrees(np.abs(np.diff(calm.q, axis=0)).max()) <= 5.0
    wild = follow(robot, 1, replace(STANDARD, gain=1.0, generations=3000, start_over=None))
    assert len(wild.q) < 251
    assert np.degrees(np.abs(np.diff(wild.q, axis=0)).max()) > 5.0


def test_joints_move_less_if_motion_counts():
    robot = rrtik.load_robot("puma560_5dof", parameters={"lengths": {"d7": 4.0 * INCH}})
    options = replace(STANDARD, motion_weight=0.05 * INCH * 180.0 / np.pi)
    travel = [
        np.median([np.abs(np.diff(follow(robot, 1, each, seed).q, axis=0)).sum() for seed in range(2)])
        for each in (STANDARD, options)
    ]
    assert travel[1] < 0.6 * travel[0]


def test_manipulability_counts_in_favour_of_a_posture():
    robot = rrtik.load_robot("puma560_5dof")
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (50, 5))
    goal, weighted = rrtik.PositionGoal([0.5, 0.1, 0.2]), replace(STANDARD, singularity_weight=0.7)
    plain, counted = (score(robot, goal, Q, None, each, everything).cost for each in (STANDARD, weighted))
    J = robot.jacobian_batch(Q)[:, :3] / reach_of(robot)
    wanted = np.sqrt(np.linalg.det(J @ J.transpose(0, 2, 1)))
    np.testing.assert_allclose(plain - counted, 0.7 * wanted, atol=1e-9)
    np.testing.assert_allclose(manipulability(robot, Q, True), wanted, atol=1e-9)


def test_who_will_not_do_costs_the_reach_more_and_is_not_there():
    robot = rrtik.load_robot("puma560_3dof")
    q = np.zeros((1, 3))
    goal = rrtik.PositionGoal(robot.fk(q[0]).translation)
    good, bad = (score(robot, goal, q, None, STANDARD, lambda Q, v=v: np.full(len(Q), v)) for v in (True, False))
    assert (good.reached[0], bad.reached[0]) == (True, False)
    assert bad.cost[0] - good.cost[0] == pytest.approx(reach_of(robot))


def test_the_same_seed_gives_the_same_run_and_another_one_another():
    robot = rrtik.load_robot("puma560_3dof")
    first, again, other = (follow(robot, 1, STANDARD, seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first.q, again.q)
    assert first.generations == again.generations
    assert not np.array_equal(first.q, other.q)


def test_a_point_that_will_not_do_is_not_taken():
    robot = rrtik.load_robot("puma560_3dof")
    run = follow(robot, 1, STANDARD, accept=lambda Q: Q[:, 0] < 0.0)
    assert len(run.q) == 251
    assert (run.q[:, 0] < 0.0).all()


def test_no_step_is_longer_than_wanted_where_the_extrapolation_would_run_away():
    robot = rrtik.load_robot("puma560_5dof")
    most = np.radians(3.0)
    options = replace(STANDARD, gain=1.0, generations=3000, largest_step=most)
    run = follow(robot, 1, options)
    assert len(run.q) > 5
    assert np.abs(np.diff(run.q, axis=0)).max() <= most


def test_the_generations_end_where_the_options_say():
    robot = rrtik.load_robot("puma560_3dof")
    far = [rrtik.PositionGoal([3.0, 0.0, 0.0], TOLERANCE)]
    run = follow_targets(robot, far, replace(STANDARD, generations=200), np.random.default_rng(0))
    assert run.generations == len(run.distances) == 200
    assert run.q.shape == (0, 3)
    assert run.fresh > 0
    assert far[0].distance(robot, run.nearest)[0] < 2.2


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("population", 7),
        ("population", 0),
        ("tournament", 0),
        ("bit_mutation", 1.5),
        ("window", -1.0),
        ("stall", 0),
        ("population", 10.0),
        ("generations", 1.5),
        ("stall", np.inf),
        ("refined", 2.5),
    ],
)
def test_settings_that_make_no_sense_are_refused(field, value):
    with pytest.raises(InputError, match=field):
        GeneticOptions(**{field: value})


def test_an_unknown_preset_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match="historical, refined, standard"):
        rrtik.ik.solve_trajectory(rrtik.load_robot("puma560_3dof"), curve(1) * INCH, method="genetic", options="modern")


@pytest.mark.parametrize("gray", [True, False])
def test_configurations_come_back_from_both_codes(gray):
    robot = rrtik.load_robot("puma560_3dof")
    window = whole_range(robot, gray=gray)
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (50, 3))
    np.testing.assert_allclose(window.decode(window.encode(Q)), Q, atol=1e-4)
    assert around(robot, Q[0], 0.1, gray=gray).gray is gray


def test_natural_binary_stands_still_where_gray_code_goes_on():
    robot = rrtik.load_robot("puma560_3dof")
    few = replace(STANDARD, generations=300, stall=None, start_over=None)
    gained = [len(follow(robot, 1, replace(few, gray=gray), seed=2).q) for gray in (True, False)]
    assert gained[0] > 50 > gained[1]
