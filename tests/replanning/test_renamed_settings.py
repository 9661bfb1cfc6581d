"""Settings of replanning that have another name now are answered with it, in one line."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.app import run as rrtik
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.replanning import ReplanSettings, replan, replan_with
from rrtik_ompl.replanning.scenario import Scenario, load_scenario
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

NAMES = {"eps": "max_edge", "slot": "repair_budget", "predict": "lookahead_ticks"}
TEXT = """version: 1
robot: {point2d: {radius: 0.0, bounds: [[0, 20], [0, 20]]}}
start: {joints: [1, 10]}
goal: {joints: [1.1, 10]}
run: {step: 0.5, rate: 10, %s}
"""


def empty_plane():
    return Problem(World(load_robot("point2d", bounds=[[0, 20], [0, 20]])), [1.0, 10.0], [3.0, 10.0])


@pytest.mark.parametrize(("old", "new"), NAMES.items())
def test_an_old_argument_is_answered_with_the_new_one(old, new):
    with pytest.raises(InputError, match=f"'{old}' is now called '{new}'") as caught:
        replan(empty_plane(), step=0.5, rate=10.0, **{old: 1})
    assert "\n" not in str(caught.value)
    scenario = Scenario(empty_plane(), ReplanSettings(step=0.5, rate=10.0))
    with pytest.raises(InputError, match=f"'{old}' is now called '{new}'"):
        scenario.run(**{old: 1})


@pytest.mark.parametrize(("old", "new"), NAMES.items())
def test_an_old_key_of_a_file_is_answered_with_file_line_and_the_new_one(old, new, tmp_path):
    file = tmp_path / "old.yaml"
    file.write_text(TEXT % f"{old}: 1")
    for load in (load_problem, load_scenario):
        with pytest.raises(InputError, match=rf"old.yaml:5: run.{old}: .*'{new}'") as caught:
            load(file)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("new", NAMES.values())
def test_a_key_by_its_new_name_is_taken(new, tmp_path):
    file = tmp_path / "new.yaml"
    file.write_text(TEXT % f"{new}: 1")
    assert getattr(load_scenario(file).settings, new) == 1


def test_an_old_option_is_answered_with_the_new_one(capsys):
    assert rrtik(["replan", "replan_walls", "--predict", "2"]) == 2
    assert "--predict is now called --lookahead-ticks" in capsys.readouterr().err


def test_a_name_that_never_was_is_no_setting():
    for call in (
        lambda: replan(empty_plane(), step=0.5, rate=10.0, speed=1),
        lambda: load_scenario("replan_walls").run(x=1),
    ):
        with pytest.raises(TypeError, match="unexpected keyword"):
            call()


def test_a_file_and_the_arguments_make_the_same_settings(tmp_path):
    file = tmp_path / "new.yaml"
    file.write_text(TEXT % "max_edge: 1.5, lookahead_ticks: 2, margin: 0.1, seconds: 3, repair_budget: 20")
    scenario = load_scenario(file)
    made = ReplanSettings(step=0.5, rate=10, max_edge=1.5, lookahead_ticks=2, margin=0.1, seconds=3, repair_budget=20)
    for name in ReplanSettings.__dataclass_fields__:
        assert getattr(scenario.settings, name) == getattr(made, name)
    one, other = scenario.run(seed=1), replan_with(made, scenario.problem)
    assert one.arrived
    assert np.array_equal(one.configurations, other.configurations)
