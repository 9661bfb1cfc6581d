"""Every public name of the library shows an example that runs."""

import doctest
import inspect

import numpy as np
import pytest

import rrtik_ompl as rrtik

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
# Their modules are as long as modules may be.
WITHOUT = {
    *("AttachedObject", "ConstantVelocity", "Obstacle", "Scene", "TimedPoses"),
    *("GoalSet", "IkResult", "IkTrajectory", "JointGoal", "JointPath", "PoseGoal", "PositionGoal", "Robot"),
    *("Trajectory", "World", "list_methods", "list_problems", "list_robots", "load_path", "load_robot"),
    *("solve_ik", "solve_trajectory"),
}
NAMES = [name for name in dir(rrtik) if name[0] != "_" and not inspect.ismodule(getattr(rrtik, name))]


def examples(name):
    text = inspect.getdoc(getattr(rrtik, name)) or ""
    return doctest.DocTestParser().get_doctest(text, {"np": np, "rrtik": rrtik}, name, name, 0)


@pytest.mark.parametrize("name", sorted({*NAMES} - WITHOUT))
def test_the_example_of_a_public_name_runs(name, tmp_path, monkeypatch):
    example = examples(name)
    assert example.examples
    monkeypatch.chdir(tmp_path)
    said = []
    doctest.DocTestRunner(optionflags=FLAGS).run(example, out=said.append)
    assert not said, "".join(said)


def test_names_without_an_example_are_counted():
    assert {name for name in NAMES if not examples(name).examples} == WITHOUT
