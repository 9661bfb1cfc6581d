"""Rules of moves - frozen joints, joints that move last, the smallest move - hold for plans and shortenings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening import MoveRules, shorten
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_planners import FewestMoves

RULES = (
    ("titan4_prisms", {"frozen_joints": ["shoulder_pitch", 5], "joint_costs": [2.0, 1.0, 1.0, 1.0, 1.0, 1.0]}),
    ("titan4_sdu", {"last_joints": ["wrist_rotate", "azimuth"]}),
    ("titan4_sdu", {"smallest_move": 0.2}),
)


@pytest.mark.parametrize(("name", "options"), RULES, ids=["frozen", "last", "smallest"])
@pytest.mark.parametrize("planner", ["bicrdt", "fewest-moves"])
def test_shortening_keeps_to_the_rules_of_the_plan(planner: str, name: str, options: dict[str, object]) -> None:
    problem = load_problem(name)
    rules = MoveRules(problem.robot.joint_names, **options)
    found = plan(problem, planner, seed=2, seconds=60.0, parameters=options, shorten=False)
    assert found.path is not None
    assert rules.kept_by(found.path.waypoints)
    for method in ("fewest-moves", "axis"):
        shorter = shorten(found.path, problem, method=method, rules=rules)
        assert rules.kept_by(shorter.waypoints)
        assert shorter.one_joint_at_a_time
        assert shorter.transitions <= found.path.transitions
        np.testing.assert_array_equal(shorter.waypoints[[0, -1]], found.path.waypoints[[0, -1]])


def test_the_bound_of_a_plan_counts_the_last_moves_too() -> None:
    found = plan(
        load_problem("titan4_sdu"), FewestMoves, seed=1, seconds=60.0, parameters={"last_joints": [4]}, shorten=False
    )
    assert found.path is not None
    assert found.path.transitions == found.statistics["lower_bound"] + found.statistics["gap"]
    assert [int((a != b).argmax()) for a, b in pairwise(found.path.waypoints)].index(4) == len(found.path.waypoints) - 2


def test_each_rule_is_judged() -> None:
    route = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 2.0, 0.5]])
    names = ("a", "b", "c")
    for options, kept in (
        ({}, True),
        ({"frozen_joints": ["c"]}, False),
        ({"last_joints": ["c"]}, True),
        ({"last_joints": ["c", "b"]}, True),
        ({"last_joints": ["b"]}, False),
        ({"smallest_move": 0.5}, True),
        ({"smallest_move": [0.0, 0.0, 0.6]}, False),
    ):
        assert MoveRules(names, **options).kept_by(route) == kept, options
    returns = np.vstack([route, [1.0, 1.5, 0.5]])
    assert not MoveRules(names, last_joints=["b", "c"]).kept_by(returns)  # b does not go straight to the goal


def test_a_path_that_breaks_the_rules_is_not_shortened_by_them() -> None:
    problem = load_problem("titan4_sdu")
    path = plan(problem, "bicrdt", seed=1, shorten=False).path
    assert path is not None
    with pytest.raises(InputError, match="rules"):
        shorten(path, problem, rules=MoveRules(problem.robot.joint_names, frozen_joints=["azimuth"]))
