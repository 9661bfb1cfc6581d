"""`rrtik check` of a timed motion: valid, through an obstacle, too fast, to another goal."""

from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import run

pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def problem() -> rrtik.Problem:
    return rrtik.load_problem("ur5_table")


@pytest.fixture(scope="module")
def path(problem: rrtik.Problem) -> rrtik.JointPath:
    path = rrtik.plan(problem, "RRTConnect", seed=1, shorten=False).path
    assert path is not None
    return path


def checked(motion: rrtik.Trajectory, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    motion.save(folder / "motion.json")
    code = run(["check", "ur5_table", str(folder / "motion.json")])
    return code, capsys.readouterr().out


def test_a_motion_is_proven_at_every_time(problem, path, tmp_path, capsys):
    code, said = checked(rrtik.time_parameterize(path, problem.robot), tmp_path, capsys)
    assert code == 0
    assert "start is free" in said
    assert "valid, proven free at every time" in said


def test_a_motion_through_an_obstacle_is_told_with_its_time(problem, path, tmp_path, capsys):
    straight = rrtik.JointPath.of(problem.robot, np.array([path.start, path.end]))
    assert straight.violations(problem.world)
    code, said = checked(rrtik.time_parameterize(straight, problem.robot), tmp_path, capsys)
    assert code == 1
    assert "after " in said
    assert " s: " in said


def test_a_motion_that_is_too_fast_names_the_joint(problem, path, tmp_path, capsys):
    code, said = checked(rrtik.time_parameterize(path, problem.robot).slowed(0.1), tmp_path, capsys)
    assert code == 1
    assert "its limit is" in said


def test_a_motion_to_elsewhere_does_not_reach_the_goal(problem, path, tmp_path, capsys):
    back = rrtik.JointPath.of(problem.robot, path.waypoints[::-1])
    code, said = checked(rrtik.time_parameterize(back, problem.robot), tmp_path, capsys)
    assert code == 1
    assert "does not end at the goal" in said
