"""Arms in pairs: both hands to poses of their own among balls, and both paths judged by Pinocchio and coal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.shared.clocks import least
from bench.tip_motion.judge import Judge
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.robot import Robot

TIPS = {"two_titan4": ("left_grip_point", "right_grip_point"), "baxter": ("left_gripper", "right_gripper")}
REACH = {"two_titan4": 1.6, "baxter": 1.0}  # [m] of the box in which the balls are
BALLS, ROUNDS = 6, 3
MOST_SCENES = 40  # that are drawn for one problem
LIMIT, LONG = 5.0, 10.0  # [s]
NEAR, TURNED = 1e-3, 1e-2  # [m], [rad] of a tip from its goal


@dataclass(frozen=True)
class Pair:
    """Of one scene.

    Attributes:
        found: Whether there is a path within the limit.
        solvable: Whether there is one, by a long search if need be.
        seconds: Processor time of `plan()`, the smallest of some calls [s].
        proven: Whether the path is proven.
        faults: Motions that touch something, and tips that are not at their goals, by the judge.
    """

    found: bool
    solvable: bool
    seconds: float
    proven: bool
    faults: int


def pair(name: str, number: int) -> Pair:
    """One scene of a robot."""
    problem, wanted = _problem(name, number)
    rrtik.plan(problem, seconds=LIMIT, seed=number)  # kernels and the tables of the world
    seconds, plan = least(lambda: rrtik.plan(problem, seconds=LIMIT, seed=number), ROUNDS)
    solvable = plan.found or rrtik.plan(problem, seconds=LONG, seed=number + 1).found
    if plan.path is None:
        return Pair(False, solvable, seconds, False, 0)
    faults = int(Judge(problem.world).cuts(plan.path.waypoints) > 0.0)
    for tip, pose in wanted.items():
        away = pose.actInv(_place(problem.robot, plan.path.end, tip))
        faults += int(np.linalg.norm(away.translation) > NEAR or np.linalg.norm(pin.log3(away.rotation)) > TURNED)
    return Pair(True, solvable, seconds, bool(plan.proven), int(faults))


@cache
def _robot(name: str) -> Robot:
    return rrtik.load_robot(name)


def _problem(name: str, number: int) -> tuple[rrtik.Problem, dict[str, pin.SE3]]:
    """Start and goal are free; the goal is the poses of both tips in a free configuration."""
    robot, rng, reach = _robot(name), np.random.default_rng([9, number]), REACH[name]
    for _ in range(MOST_SCENES):
        balls = [
            rrtik.Obstacle(
                f"ball{k}",
                rrtik.Sphere(rng.uniform(0.05, 0.12)),
                reach * rng.uniform([0.25, -0.6, -0.1], [1, 0.6, 0.6]),
            )
            for k in range(BALLS)
        ]
        world = rrtik.World(robot, rrtik.Scene(tuple(balls)))
        rows = rng.uniform(*robot.finite_range(), (60, robot.dof))
        rows = rows[world.valid_batch(rows)]
        rows = rows[world.certify(rows)]
        if len(rows) > 1:
            wanted = {tip: _place(robot, rows[1], tip) for tip in TIPS[name]}
            goal = rrtik.MultiGoal({tip: rrtik.PoseGoal(pose) for tip, pose in wanted.items()})
            return rrtik.Problem(world, rows[0], goal, name=f"{name} {number}"), wanted
    raise SystemExit(f"{name} {number}: no two free configurations in {MOST_SCENES} scenes")


def _place(robot: Robot, q: Vector, frame: str) -> pin.SE3:
    """Pose of a frame, by Pinocchio alone (SE3)."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(q)[0])
    return data.oMf[robot.model.getFrameId(frame)].copy()
