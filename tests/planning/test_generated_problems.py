"""Generated problems are worth planning, solvable, and the same every time."""

import numpy as np
import pytest

from rrtik_ompl import World, load_robot, plan
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.planning.generated_problems import FAMILIES, generated_problem, obstacles
from rrtik_ompl.planning.moves.staircase import staircase_orders

TITAN = load_robot("titan4")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_generated_problem_is_solvable_and_not_trivial(family):
    problem = generated_problem(TITAN, family, 1)
    world, start, goal = problem.world, problem.start, problem.goal.q
    assert world.valid_batch(np.array([start, goal])).all()
    assert not world.motion_valid(start, goal)
    assert staircase_orders(start, goal, world.motion_valid_batch) == []
    assert not World(TITAN).contacts(goal)  # it is the scene that makes it hard
    assert plan(problem, "fastrrtconnect", seconds=20.0, seed=3).found


def test_the_same_arguments_give_the_same_problem_and_other_seeds_others():
    first, again, other = (generated_problem(TITAN, "clutter", seed) for seed in (4, 4, 5))
    for problem, same in ((again, True), (other, False)):
        assert np.array_equal(first.start, problem.start) == same
        assert np.array_equal(first.goal.q, problem.goal.q) == same
        places = [[o.pose.homogeneous for o in p.world.scene.obstacles] for p in (first, problem)]
        assert np.array_equal(*places) == same
    assert (first.name, other.name) == ("titan4/clutter/4", "titan4/clutter/5")


@pytest.mark.parametrize("name", ["puma560", "planar3"])
def test_any_arm_can_be_asked_for(name):
    robot = load_robot(name)
    problem = generated_problem(robot, "slot_across", 0, motion_resolution=0.02)
    assert problem.robot is robot
    assert problem.world.motion_resolution == 0.02


def test_sizes_are_shares_of_the_reach_and_room_is_made_for_thick_arms():
    place = World(TITAN).robot.fk(np.zeros(6))
    small, large = (obstacles("slot_along", np.random.default_rng(0), place, reach) for reach in (1.0, 2.0))
    roomy = obstacles("slot_along", np.random.default_rng(0), place, 1.0, 1.5)
    np.testing.assert_allclose(large[0].shape.size, 2.0 * small[0].shape.size)
    gaps = [np.linalg.norm(plates[0].pose.translation - plates[1].pose.translation) for plates in (small, roomy)]
    assert gaps[1] > 1.2 * gaps[0]


def test_requests_that_make_no_sense_are_refused_in_one_line():
    for request, kind, words in (
        (lambda: generated_problem(TITAN, "cave", 0), UnknownNameError, "slot_along"),
        (lambda: generated_problem(TITAN, "panel", -1), InputError, "seed"),
        (lambda: generated_problem(TITAN, "panel", True), InputError, "seed"),
        (lambda: generated_problem("titan4", "panel", 0), InputError, "load_robot"),
    ):
        with pytest.raises(kind, match=words) as caught:
            request()
        assert "\n" not in str(caught.value)
