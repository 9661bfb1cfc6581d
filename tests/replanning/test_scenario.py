"""Scenario files, and `rrtik replan`."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.cli.app import run as rrtik
from rrtik_ompl.description.catalog import find_problem, list_problems, load_robot
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene
from rrtik_ompl.model.shapes import HalfSpace
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.run_story import run_story
from rrtik_ompl.viewer.subject import subject_of_run
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.run_judge import judged

SCENARIOS = [name for name in list_problems() if name.startswith("replan_")]
BOX = "{name: lift, box: [3, 3, 1], pose: {xyz: [10, 16, 0]}, motion: {velocity: [0, -3, 0]}}"
TEXT = f"""version: 1
robot: {{point2d: {{radius: 0.0, bounds: [[0, 20], [0, 20]]}}}}
scene: {{obstacles: [{BOX}]}}
start: {{joints: [1, 10]}}
goal: {{joints: [19, 10]}}
motion_resolution: 0.05
run: {{step: 0.5, rate: 10, max_edge: 1.0, velocity: [1000]}}
"""


@pytest.fixture
def crossing(tmp_path):
    """A scenario file."""
    file = tmp_path / "crossing.yaml"
    file.write_text(TEXT)
    return file


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_shipped_scenario_is_run_to_its_goal_without_contact(name):
    scenario = Scenario.load(name)
    run = scenario.run(seed=1, repair_budget=30.0)
    assert run.found, run.summary()
    if scenario.problem.robot.name != "point2d":  # a point has no room around it to keep
        judged(run, scenario.problem)


def test_the_scenes_of_the_paper_are_shipped():
    assert {"replan_pockets", "replan_triangles", "replan_planar_arm", "replan_ur5", "replan_titan4"} <= set(SCENARIOS)


def test_a_goal_that_moves_is_read_from_the_file(crossing):
    moving = "goal: [{time: 0, joints: [19, 10]}, {time: 2, joints: [19, 14]}]"
    crossing.write_text(TEXT.replace("velocity: [1000]", f"velocity: [1000], {moving}"))
    scenario = Scenario.load(crossing)
    assert scenario.goal_feed(1.0) == pytest.approx([19.0, 12.0])
    assert scenario.run(repair_budget=30.0).configurations[-1] == pytest.approx([19.0, 14.0])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rate: 10", "rate: 0", r"crossing.yaml:7: run.rate: must be greater than 0"),
        ("step: 0.5, ", "", r"run.step: missing"),
        ("run: {", "motoin_resolution: {", "unknown key 'motoin_resolution'"),
        ("velocity: [1000]", "velocity: [1, 2, 3]", r"run: .*2 joints, but got 3"),
        ("velocity: [1000]", "goal: [{time: 1, joints: [1, 1]}, {time: 0, joints: [1, 2]}]", "times must increase"),
        ("velocity: [1000]", "goal: [{time: 2, joints: [19, 30]}]", r"run: goal at 2 s: joint 'y' is at 30 m, outside"),
        (TEXT[TEXT.index("run:") :], "", "needs the key 'run'"),
    ],
)
def test_what_is_wrong_with_a_scenario_is_said_in_one_line(crossing, old, new, words):
    crossing.write_text(TEXT.replace(old, new))
    with pytest.raises(InputError, match=words) as caught:
        Scenario.load(crossing)
    assert "\n" not in str(caught.value)


def test_the_command_writes_a_record_and_a_page_that_replays_it(crossing, tmp_path, capsys):
    record, html = tmp_path / "run.json", tmp_path / "run.html"
    assert rrtik(["replan", str(crossing), "--seed", "3", "--record", str(record), "--html", str(html)]) == 0
    said = capsys.readouterr().out
    assert "crossing: arrived after" in said
    assert f"wrote {record}" in said
    run = ReplanRun.load(record)
    story = json.loads(re.search(r'id="story" type="application/json">\n(.*?)\n</script>', html.read_text(), re.S)[1])
    assert len(story["run"]["line"]) == len(run.ticks) == len(story["times"])
    assert list(story["run"]["moving"]) == [node_name("lift")]
    assert sum(group["count"] for group in story["run"]["groups"]) == len(run.ticks)
    assert any(group["event"] == "repair" for group in story["run"]["groups"])
    again = tmp_path / "again.html"
    assert rrtik(["replan", str(crossing), "--replay", str(record), "--html", str(again)]) == 0
    assert again.read_text() == html.read_text()


def test_the_command_says_numbers_and_that_the_goal_was_not_reached(crossing, capsys):
    assert rrtik(["replan", str(crossing), "--seconds", "0.5", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["outcome"] == "out of time"


def test_the_command_refuses_a_problem_that_is_no_scenario(capsys):
    assert rrtik(["replan", "env_e"]) == 2
    assert "needs the key 'run'" in capsys.readouterr().err


def test_where_a_run_was_given_up_is_not_shown_as_its_goal(crossing):
    scenario = Scenario.load(crossing)
    shown = subject_of_run(scenario.problem, scenario.run(seconds=0.3))
    assert (shown.end == scenario.problem.goal.q).all()


def test_a_floor_that_moves_is_replayed_as_it_lies():
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, 20], [0, 20]]})
    floor = Obstacle("floor", HalfSpace([0, 1, 0], -2.0), pose(), ConstantVelocity([0.0, 0.1, 0.0]))
    problem = Problem(World(robot, Scene([floor])), [1, 10], [19, 10])
    run = replan(problem, step=0.5, rate=10.0, seconds=0.3)
    subject = subject_of_run(problem, run)
    told = run_story(run, robot, subject.scene, draw(subject)[1])["moving"][node_name("floor")]
    plate = np.reshape(told["placement"], (4, 4))
    assert plate[:3, 2] == pytest.approx([0, 1, 0])
    assert plate[1, 3] == pytest.approx(-2.0, abs=0.2)
    assert np.array(told["poses"])[:, 1] == pytest.approx([0.0, 0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    ("option", "value"), [("--record", "other.json"), ("--seconds", "3"), ("--lookahead-ticks", "2")]
)
def test_what_only_a_new_run_can_heed_is_refused_beside_a_replay(option, value, capsys):
    assert rrtik(["replan", "replan_walls", "--replay", "run.json", option, value]) == 2
    assert f"leave out {option}" in capsys.readouterr().err


def test_the_command_replays_no_run_of_another_scenario(crossing, tmp_path, capsys):
    Scenario.load(crossing).run(seconds=0.3, record=tmp_path / "run.json")
    assert rrtik(["replan", "replan_walls", "--replay", str(tmp_path / "run.json")]) == 2
    assert "a run of 'crossing', not of 'replan_walls'" in capsys.readouterr().err


def test_a_run_is_not_shown_with_another_robot(crossing):
    run = Scenario.load(crossing).run(seconds=0.3)
    with pytest.raises(InputError, match=r"'point2d'.*joints"):
        page(load_problem("replan_planar_arm"), run=run)


def test_a_record_of_another_problem_is_refused(crossing):
    run = Scenario.load(crossing).run(repair_budget=30.0)
    with pytest.raises(InputError, match="one of 'crossing', which has another start"):
        page(load_problem("env_e"), run=run)


def test_a_scenario_is_a_problem_too():
    assert load_problem("replan_ur5").start == pytest.approx(Scenario.load("replan_ur5").problem.start)
    assert find_problem("replan_ur5").is_file()
