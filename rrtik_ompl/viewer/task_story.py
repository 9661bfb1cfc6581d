"""The plan of a task as a run that the page replays: the arm's motions, and objects where they are carried."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector, frozen
from rrtik_ompl.errors import InputError
from rrtik_ompl.poses import quaternion_xyzw
from rrtik_ompl.replanning.record import ReplanRun, Tick
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.world import World

TASK = "task"  # the planner of a run that shows one
RATE = 25.0  # ticks per second
SPEED = np.deg2rad(40.0)  # [rad/s] or [m/s] of the joint that travels farthest
LEAST_TICKS = 8  # of a motion


def run_of(plan: TaskPlan) -> ReplanRun:
    """The run that shows a plan; its times are for display.

    Raises:
        InputError: If there is no plan to show.
    """
    if not plan.paths:
        raise InputError("task plan to show: it has no motion" + (f": {plan.reason}" if plan.reason else ""))
    robot = plan.worlds[0].robot
    ticks: list[Tick] = []
    held_first = {item.name for item in plan.worlds[0].scene.attached}
    for number, (path, world) in enumerate(zip(plan.paths, plan.worlds, strict=True)):
        text = f"motion {number + 1} of {len(plan.paths)}: {plan.stages[number]}"
        rows = _spread(path.waypoints)
        last = number == len(plan.paths) - 1
        for q in rows if last else rows[:-1]:
            poses = {name: pose for name, pose in _poses(world, q).items() if name not in held_first}
            ticks.append(Tick(len(ticks) / RATE, q, "walk", path.waypoints, poses, {}, reason=text))
    return ReplanRun(
        problem=robot.name,
        robot=robot.name,
        joint_names=robot.joint_names,
        planner=TASK,
        seed=0,
        step=1.0,
        rate=RATE,
        margin=0.0,
        speed_bound=None,
        ticks=ticks,
        outcome="arrived",
    )


def _spread(waypoints: Matrix) -> Matrix:
    """Configurations of a motion at the rate of the ticks, shape (k, dof)."""
    seconds = np.abs(np.diff(waypoints, axis=0)).max(axis=1) / SPEED
    times = np.append(0.0, np.cumsum(np.maximum(seconds, 1e-9)))
    count = max(int(np.ceil(times[-1] * RATE)), LEAST_TICKS)
    wanted = np.linspace(0.0, times[-1], count + 1)
    return frozen(np.stack([np.interp(wanted, times, column) for column in waypoints.T], axis=1))


def _poses(world: World, q: Vector) -> dict[str, Vector]:
    """Where obstacles and what is held are: x, y, z and quaternion x, y, z, w."""
    places = {item.name: world.robot.fk(q, item.link) * item.pose for item in world.scene.attached}
    places |= {item.name: item.pose for item in world.scene.obstacles}
    return {name: np.concatenate([pose.translation, quaternion_xyzw(pose)]) for name, pose in places.items()}
