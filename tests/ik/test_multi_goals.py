"""Inverse kinematics of several tips at once."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import MultiGoal, PoseGoal, PositionGoal
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.world.world import World

TIPS = ("left_grip_point", "right_grip_point")


@pytest.fixture(scope="module")
def arms():
    return load_robot("two_titan4")


@pytest.fixture(scope="module")
def goal(arms):
    q = 0.7 * arms.posture("ready") + 0.1
    return MultiGoal({tip: PoseGoal(arms.fk(q, tip)) for tip in TIPS})


def test_all_tips_are_at_their_goals_by_forward_kinematics(arms, goal):
    found = solve_ik(arms, goal, seed=1)
    assert found.solutions.shape == (1, arms.dof)
    assert found.method == "projection"
    distances = []
    for tip, part in zip(goal.frames, goal.parts, strict=True):
        away = part.T_world_tip.actInv(arms.fk(found.solutions[0], tip))
        distances.append(np.linalg.norm(away.translation))
        assert distances[-1] <= part.position_tolerance
    # which tip is the farthest is told by its angle, too
    assert np.abs(found.residuals[0, 0] - distances).min() < 1e-12
    again = solve_ik(arms, goal, seed=1)
    assert (again.solutions == found.solutions).all()


def test_of_all_solutions_the_nearest_stands_first(arms, goal):
    near = arms.posture("ready")
    many = solve_ik(arms, goal, near=near, all=True, seed=2)
    away = np.linalg.norm(many.solutions - near, axis=1)
    assert len(many.solutions) > 1
    assert (np.diff(away) >= 0.0).all()
    assert goal.satisfied(arms, many.solutions).all()
    assert (solve_ik(arms, goal, near=near, seed=2).solutions == many.solutions[:1]).all()


def test_what_touches_is_left_out_and_said(arms, goal):
    ball = Obstacle("ball", Sphere(0.05), goal.parts[0].T_world_tip.translation)
    found = solve_ik(arms, goal, world=World(arms, Scene([ball])), seconds=0.0)
    assert (found.found, found.reason) == (False, "collision")
    assert "all in collision" in found.detail


def test_out_of_reach_names_the_tips(arms):
    far = MultiGoal({tip: PositionGoal([9.0, 0.0, 0.0]) for tip in TIPS})
    found = solve_ik(arms, far, seconds=0.0)
    assert (found.found, found.reason) == (False, "time")
    assert "'left_grip_point' and 'right_grip_point'" in found.detail


def test_methods_for_one_tip_and_unknown_tips_are_refused(arms, goal):
    with pytest.raises(InputError, match=r"'numeric'.*use projection"):
        solve_ik(arms, goal, method="numeric")
    with pytest.raises(UnknownNameError, match="method 'fast'"):
        solve_ik(arms, goal, method="fast")
    with pytest.raises(UnknownNameError, match="left_grp"):
        solve_ik(arms, MultiGoal({"left_grp": PositionGoal([1.0, 0.0, 0.0])}))


def test_a_posture_outside_the_limits_is_no_solution_though_it_is_at_the_goals():
    panda = load_robot("panda")
    near = panda.posture("default").copy()
    near[3] = 0.3  # its limit is -0.07
    goal = MultiGoal({panda.tip: PoseGoal(panda.fk(near))})
    found = solve_ik(panda, goal, near=near, all=True, seconds=0.0)
    assert panda.within_limits(found.solutions).all()
