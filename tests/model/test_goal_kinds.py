"""What every kind of goal answers agrees with how it is solved, written and drawn; a new one needs no more."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import GoalPart, Target, TipGoal
from rrtik_ompl.problem_files.goal import goal_data

ARM = rrtik.load_robot("planar3")
Q = np.array([0.3, 0.4, -0.5])
TIP = ARM.fk(Q)
TURNED = np.zeros((6, 2))
TURNED[5] = -0.5, 0.5
PARTS = [rrtik.PoseGoal(TIP), rrtik.PositionGoal(TIP.translation), rrtik.TaskRegion(TIP, TURNED)]
OF_TIP = [*PARTS, rrtik.GoalSet(PARTS), rrtik.GoalSet([TIP], "z"), rrtik.GoalSet([TIP], "z", [0.1, 0.0, 0.0])]
ALL = [*OF_TIP, rrtik.JointGoal(Q), rrtik.MultiGoal({ARM.tip: TIP})]


@dataclass(frozen=True, eq=False)
class Circle(GoalPart):
    """Somebody else's kind of goal: the tip at a distance from the origin, in the plane."""

    radius: float

    title = "tip circle"
    oriented = False
    tolerances = 1e-3, 0.0

    def tip_errors(self, tips):
        return np.abs(np.hypot(*tips[:, :2, 3].T) - self.radius), np.zeros(len(tips))

    def region(self):
        bounds = np.zeros((6, 2))
        bounds[5] = -np.pi, np.pi  # the tip points outwards, by a turn about the origin
        return rrtik.TaskRegion(rrtik.pose([0.0, 0.0, 0.0]), bounds, rrtik.pose([self.radius, 0.0, 0.0]))


def _name(goal):
    return type(goal).__name__


@pytest.mark.parametrize("goal", ALL, ids=_name)
def test_a_goal_is_reached_where_it_says_and_nowhere_far_away(goal):
    rows = np.array([Q, Q])
    rows[1, 0] += 1.0
    assert goal.satisfied(ARM, rows).tolist() == [True, False]
    assert goal.distance(ARM, rows)[0] == pytest.approx(0.0, abs=1e-6)
    assert goal.title


@pytest.mark.parametrize("goal", ALL, ids=_name)
def test_a_goal_is_a_configuration_or_has_parts(goal):
    assert (goal.q is None) == bool(goal.parts)
    assert len(goal.frames) in (0, len(goal.parts))
    assert [arm.tip for arm in goal.arms(ARM)] == [*(goal.frames or (ARM.tip,))]


@pytest.mark.parametrize("goal", OF_TIP, ids=_name)
def test_the_error_of_a_goal_of_the_tip_is_that_of_its_nearest_part(goal):
    rows = np.random.default_rng(0).uniform(*ARM.finite_range(), (20, ARM.dof))
    of_goal = np.array(goal.errors(ARM, rows))
    of_parts = np.array([part.errors(ARM, rows) for part in goal.parts])
    assert (of_goal == of_parts).all(axis=1).any(axis=0).all()


@pytest.mark.parametrize("goal", OF_TIP, ids=_name)
def test_a_part_alone_is_reached_where_the_part_is(goal):
    for number, part in enumerate(goal.parts):
        assert goal.alone(number).satisfied(ARM, Q[None]) == part.satisfied(ARM, Q[None])
        assert isinstance(goal.alone(number), TipGoal)


@pytest.mark.parametrize("part", PARTS, ids=_name)
def test_targets_and_the_region_of_a_part_are_within_it(part):
    assert (part.freedom is None) == isinstance(part, Target)
    for target in targets(part, 8, np.random.default_rng(1)):
        tips = target.pose.homogeneous[None]
        errors = np.array([part.errors_at(tips), part.region().errors_at(tips), target.errors_at(tips)])
        assert (errors < 1e-6).all()


@pytest.mark.parametrize("goal", ALL, ids=_name)
def test_a_goal_answers_the_same_when_it_was_pickled_and_has_words_for_a_file(goal):
    again = pickle.loads(pickle.dumps(goal))
    assert (again.title, again.oriented, again.frames) == (goal.title, goal.oriented, goal.frames)
    assert goal_data(again) == goal_data(goal)


def test_a_kind_of_somebody_else_is_solved_planned_to_and_drawn(tmp_path):
    goal = Circle(1.5)
    world = rrtik.World(ARM)
    assert rrtik.solve_ik(ARM, goal, seed=1).found
    assert rrtik.solve_ik(ARM, rrtik.GoalSet([goal, TIP], "z"), seed=1).found
    problem = rrtik.Problem(world, [0.0, 0.0, 0.0], goal)
    plan = rrtik.plan(problem, seed=1)
    assert plan.found, plan.reason
    assert problem.reached(plan.path.end)
    rrtik.view(problem, plan.path, html=tmp_path / "page.html")
    assert "tip circle" in (tmp_path / "page.html").read_text()
    with pytest.raises(InputError, match="no words for a Circle"):
        goal_data(goal)
