"""The problems of the IKURT report: the examples of [1, ch. 5.1] as acceptance wants them, and generated ones."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_bench.ikurt import EXAMPLES
from rrtik_ompl.base.errors import ProblemError
from rrtik_ompl.ik.ikurt.metric import reach
from rrtik_ompl.model.goal import JointGoal, PoseGoal
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

TITAN = ("titan4_regular", "titan4_wrist", "titan4_axis1", "titan4_p_axis1")  # the last three are singular
ARMS = ("ur5", "panda", "titan4")
OBSTACLES = 8
TRIES = 1000


def examples() -> dict[str, Any]:
    """Every published example by its name, as shipped."""
    return {name: rrtik.load_problem(name) for name in EXAMPLES}


def blocked() -> Any:
    """PUMA with a ball around the goal: every configuration that reaches it is in collision."""
    problem = rrtik.load_problem("puma_pose")
    assert isinstance(problem.goal, PoseGoal)
    ball = rrtik.Obstacle("ball", Sphere(0.06), pin.SE3(np.eye(3), problem.goal.T_world_tip.translation))
    return rrtik.Problem(rrtik.World(problem.robot, rrtik.Scene((ball,))), problem.start, problem.goal, name="blocked")


def generated(arm: str, count: int) -> Iterator[Any]:
    """Arms among balls, from a random posture to the pose of another one; whether there is a way is not known."""
    robot = rrtik.load_robot(arm)
    rng = np.random.default_rng(list(arm.encode()))
    made = 0
    for _ in range(TRIES * count):
        if made == count:
            return
        balls = [_ball(f"ball{k}", reach(robot), rng) for k in range(OBSTACLES)]
        start, end = rng.uniform(*robot.finite_range(), (2, robot.dof))
        world = rrtik.World(robot, rrtik.Scene(tuple(balls)))
        if not world.valid_batch(np.array([start, end])).all():
            continue
        try:
            yield rrtik.Problem(world, start, PoseGoal(robot.fk(end)), name=f"{arm} {made}")
        except ProblemError:
            continue
        made += 1


def _ball(name: str, size: float, rng: np.random.Generator) -> Any:
    away = rng.normal(size=3)
    away *= size * rng.uniform(0.3, 0.9) / np.linalg.norm(away)
    return rrtik.Obstacle(name, Sphere(size * rng.uniform(0.05, 0.12)), pin.SE3(np.eye(3), away))


def panda_problems(folder: Path, count: int) -> Iterator[Any]:
    """MotionBenchMaker problems, evenly from every family, their goal turned into the pose of its tip."""
    families = sorted(path for path in (folder / "problems").glob("*") if path.is_dir())
    each = max(1, count // len(families))
    for family in families:
        scenes = sorted(family.glob("scene*.yaml"))
        for scene in scenes[:: max(1, len(scenes) // each)][:each]:
            problem = load_motion_bench_maker(scene, robot=folder / "panda.urdf")
            if isinstance(problem.goal, JointGoal):
                goal = PoseGoal(problem.robot.fk(problem.goal.q))
                yield rrtik.Problem(problem.world, problem.start, goal, name=f"{family.name} {scene.stem}")
