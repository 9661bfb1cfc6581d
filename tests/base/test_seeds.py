"""Whatever draws random numbers takes seed=: 0 if nothing is said, and None to draw one."""

import inspect
import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import seed_of
from rrtik_ompl.base.lazy import public_values

RECORDS = {"Plan", "replanning.ReplanRun"}  # they name the seed that was used
OF_OMPL = {"ompl.SafePlanner"}  # draws from OMPL's generator, whose seed is OMPL's to fix
OF_GYMNASIUM = {"gym.PickPlace.reset", "gym.Reach.reset"}  # as gymnasium has it: None goes on with what is there
ASK_FOR_ONE = {"ompl.SafePlanner.reseed"}  # nothing is drawn there

ROBOT = rrtik.load_robot("planar3")
WORLD = rrtik.World(ROBOT)
START, END = [0.0, 0.0, 0.0], [0.5, 0.2, 0.0]
PROBLEM = rrtik.Problem(WORLD, START, END)
PATH = rrtik.JointPath.of(ROBOT, [START, END])
POINT = rrtik.PositionGoal([1.0, 1.0, 0.0], 0.01)
MARK = rrtik.Problem(WORLD, START, POINT)
ARM = rrtik.World(rrtik.load_robot("ur5"))
POSTURE = [0.0, -1.2, 1.5, -0.3, 1.6, 0.0]
TIP = ARM.robot.fk(POSTURE)
TURNED = rrtik.pose([0.0, 0.0, 0.0], rpy=[0.0, 0.0, 0.1]) * TIP
NEAR, NEARER, ABOVE = (TIP.translation + np.array(by) for by in ([0.1, 0.0, 0.0], [0.05, 0.02, 0.0], [0.0, 0.0, 0.05]))

BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.02), [0.5, 0.0, 0.4])
GRASPING = rrtik.World(rrtik.load_robot("panda_primitives"), rrtik.Scene([BALL]))

TASK = rrtik.Task([rrtik.MoveTo(END)], WORLD, START)
RANDOM = rrtik.Task([rrtik.MoveTo(END)], WORLD, START, random=rrtik.demos.Randomness(start=np.zeros((3, 2))))


def recorded(seed: Any) -> rrtik.demos.Recording:
    with tempfile.TemporaryDirectory() as folder:
        return rrtik.demos.record(RANDOM, 1, folder, seed=seed, jobs=1)


CALLS = {
    "Roadmap": lambda seed: rrtik.Roadmap(WORLD, vertices=3, seed=seed),
    "Task.plan_many": lambda seed: TASK.plan_many([rrtik.Variation()], seed=seed),
    "Task.plan": lambda seed: rrtik.Task([rrtik.MoveTo(END)]).plan(WORLD, START, seed=seed),
    "grasps": lambda seed: rrtik.grasps(GRASPING, "ball", count=1, seed=seed),
    "ik.reach_map": lambda seed: rrtik.ik.reach_map(ROBOT, samples=50, seed=seed),
    "ik.solve_trajectory": lambda seed: rrtik.ik.solve_trajectory(ARM.robot, [TIP.homogeneous] * 2, seed=seed),
    "ompl.GoalSampler": lambda seed: rrtik.ompl.GoalSampler(MARK, seed=seed),
    "ompl.simple_setup": lambda seed: rrtik.ompl.simple_setup(MARK, seed=seed),
    "plan": lambda seed: rrtik.plan(PROBLEM, seed=seed),
    "demos.record": lambda seed: recorded(seed),
    "plan_many": lambda seed: rrtik.plan_many(WORLD, [START], [END], seed=seed),
    "replan": lambda seed: rrtik.replan(PROBLEM, step=0.2, rate=20.0, seconds=0.2, seed=seed),
    "replanning.Scenario.run": lambda seed: rrtik.replanning.Scenario.load("replan_walls").run(seconds=0.1, seed=seed),
    "replanning.plan_in_time": lambda seed: rrtik.replanning.plan_in_time(PROBLEM, rate=5.0, speed=1.0, seed=seed),
    "shorten": lambda seed: rrtik.shorten(PATH, PROBLEM, seed=seed),
    "solve_ik": lambda seed: rrtik.solve_ik(ROBOT, POINT, seed=seed),
    "solve_ik_many": lambda seed: rrtik.solve_ik_many(ARM.robot, [TIP.homogeneous] * 2, seed=seed),
    "tip.arc": lambda seed: rrtik.tip.arc(ARM, POSTURE, NEARER, NEAR, seed=seed),
    "tip.follow": lambda seed: rrtik.tip.follow(ARM, POSTURE, [ABOVE], seed=seed),
    "tip.screw": lambda seed: rrtik.tip.screw(ARM, POSTURE, TURNED, seed=seed),
    "tip.straight": lambda seed: rrtik.tip.straight(ARM, POSTURE, ABOVE, seed=seed),
}


def with_a_seed() -> Iterator[tuple[str, inspect.Parameter]]:
    """Public functions, classes and methods that take a seed."""
    for name, value in public_values(rrtik).items():
        callables: dict[str, Any] = {name: value}
        if inspect.isclass(value):
            callables |= {f"{name}.{key}": each for key, each in vars(value).items() if not key.startswith("_")}
        for each, function in callables.items():
            if callable(function) and not inspect.ismodule(function):
                parameter = inspect.signature(function).parameters.get("seed")
                if parameter is not None:
                    yield each, parameter


TAKE_ONE = {name: parameter for name, parameter in with_a_seed() if name not in OF_GYMNASIUM}


def test_what_takes_a_seed_is_called_here():
    assert TAKE_ONE.keys() - RECORDS - ASK_FOR_ONE - OF_OMPL <= CALLS.keys()
    assert TAKE_ONE.keys() >= RECORDS | OF_OMPL | ASK_FOR_ONE


@pytest.mark.parametrize("name", sorted(TAKE_ONE.keys() - RECORDS - ASK_FOR_ONE))
def test_it_is_0_unless_something_is_said(name):
    parameter = TAKE_ONE[name]
    assert parameter.annotation == "int | None"
    assert parameter.default == (None if name in OF_OMPL else 0)


@pytest.mark.kernels
@pytest.mark.parametrize("name", sorted(TAKE_ONE.keys() - RECORDS - ASK_FOR_ONE - OF_OMPL))
def test_none_draws_one(name):
    CALLS[name](None)
    for bad in (-1, 0.5, True, "one"):
        with pytest.raises(rrtik.InputError, match=r"seed must be a whole number of at least 0, got "):
            CALLS[name](bad)


def test_drawn_seeds_differ_and_can_be_given_again():
    drawn = [seed_of(None) for _ in range(8)]
    assert len(set(drawn)) == 8
    assert [seed_of(seed) for seed in drawn] == drawn
    assert type(seed_of(np.int32(3))) is int


def test_results_name_the_seed_that_was_drawn():
    first, second = (rrtik.plan(PROBLEM, seed=None).seed for _ in range(2))
    assert first != second
