"""A file and the arguments of a call make the same settings of replanning."""

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.replanning.replanner import replan, replan_with
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

NAMES = ("max_edge", "repair_budget", "lookahead_ticks")
TEXT = """version: 1
robot: {point2d: {radius: 0.0, bounds: [[0, 20], [0, 20]]}}
start: {joints: [1, 10]}
goal: {joints: [1.1, 10]}
run: {step: 0.5, rate: 10, %s}
"""


def empty_plane():
    return Problem(World(load_robot("point2d", parameters={"bounds": [[0, 20], [0, 20]]})), [1.0, 10.0], [3.0, 10.0])


@pytest.mark.parametrize("new", NAMES)
def test_a_key_of_a_file_is_a_setting(new, tmp_path):
    file = tmp_path / "new.yaml"
    file.write_text(TEXT % f"{new}: 1")
    assert getattr(Scenario.load(file).settings, new) == 1


def test_a_name_that_never_was_is_no_setting():
    for call in (
        lambda: replan(empty_plane(), step=0.5, rate=10.0, speed=1),
        lambda: Scenario.load("replan_walls").run(x=1),
    ):
        with pytest.raises(TypeError, match="unexpected keyword"):
            call()


def test_a_file_and_the_arguments_make_the_same_settings(tmp_path):
    file = tmp_path / "new.yaml"
    file.write_text(TEXT % "max_edge: 1.5, lookahead_ticks: 2, margin: 0.1, seconds: 3, repair_budget: 20")
    scenario = Scenario.load(file)
    made = ReplanSettings(step=0.5, rate=10, max_edge=1.5, lookahead_ticks=2, margin=0.1, seconds=3, repair_budget=20)
    for name in ReplanSettings.__dataclass_fields__:
        assert getattr(scenario.settings, name) == getattr(made, name)
    one, other = scenario.run(seed=1), replan_with(made, scenario.problem)
    assert one.found
    assert np.array_equal(one.configurations, other.configurations)
