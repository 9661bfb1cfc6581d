"""What is said to be proven among obstacles that move says, once, that they stand as at time 0."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import run

pytestmark = pytest.mark.kernels

CLAUSE = "as they stand at time 0 (replan and plan_in_time go by their motion)"
START, GOAL = [0.0, -1.2, 1.4, -0.2, 1.6, 0.0], [1.6, -1.2, 1.4, -0.2, 1.6, 0.0]


@pytest.fixture(scope="module", params=["moving", "still"])
def files(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A folder with a problem, a path, a motion and plans of tasks; how often the clause belongs into what is said."""
    folder = tmp_path_factory.mktemp(request.param)
    moves = request.param == "moving"
    motion = rrtik.replanning.ConstantVelocity([0.0, 0.0, -0.5]) if moves else None
    robot = rrtik.load_robot("ur5")
    high = robot.fk(np.array([0.8, *START[1:]])).translation + np.array([0.0, 0.0, 1.0])
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.15), rrtik.pose(high), motion)
    problem = rrtik.Problem(rrtik.World(robot, rrtik.Scene([ball])), START, GOAL, name="passing")
    problem.save(folder / "problem.yaml")
    path = rrtik.plan(problem, seed=1).path
    assert path is not None
    path.save(folder / "path.json", proof=True)
    rrtik.JointPath(path.waypoints, path.joint_names).save(folder / "bare.json")
    rrtik.time_parameterize(path, rrtik.RateLimits.of(robot)).save(folder / "motion.json")
    plan = rrtik.Task([rrtik.MoveTo(GOAL)]).plan(problem.world, START, seed=1)
    plan.save(folder / "task_plan.json")
    task = yaml.safe_load((folder / "problem.yaml").read_text())
    task.pop("goal")
    task["task"] = [{"move_to": {"joints": GOAL}}]
    (folder / "task.yaml").write_text(yaml.safe_dump(task))
    return folder, int(moves)


COMMANDS = {
    "plan": ["plan", "problem.yaml", "--seed", "1"],
    "check a path": ["check", "problem.yaml", "bare.json"],
    "check a motion": ["check", "problem.yaml", "motion.json"],
    "check a certificate": ["check", "problem.yaml", "bare.json", "--certificate", "path.json"],
    "check the plan of a task": ["check", "task_plan.json"],
    "task": ["task", "task.yaml"],
    "straight": ["straight", "problem.yaml", "--by", "0", "0", "0.02"],
}


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_a_command_says_of_moving_obstacles_when_they_stand_so(
    words: list[str], files: tuple[Path, int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, times = files
    monkeypatch.chdir(folder)
    assert run(words) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "proven free" in said
    assert said.count(CLAUSE) == times


def test_a_plan_that_is_not_proven_says_so_and_its_copy_too(files: tuple[Path, int]) -> None:
    folder, times = files
    problem = rrtik.load_problem(folder / "problem.yaml")
    gap = 0.5 * (np.array(START) + np.array(GOAL))
    near = rrtik.Obstacle("dust", rrtik.Sphere(0.01), rrtik.pose(problem.robot.fk(gap).translation))
    obstacles = (*problem.world.scene.obstacles, near)
    blocked = rrtik.Problem(problem.world.with_scene(rrtik.Scene(obstacles)), START, GOAL)
    path = rrtik.JointPath.of(blocked.robot, [START, GOAL]).proved(blocked.world)
    plan = rrtik.Plan(True, path, "", 0.0, "none", 0, {}, problem=blocked)
    assert plan.reason.startswith("not proven free: motion 0")
    assert plan.reason.count(CLAUSE) == times
    assert pickle.loads(pickle.dumps(plan)).reason == plan.reason
