"""The plan of a task as a run that the page replays: the arm's motions, and objects where they are carried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector, frozen
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.errors import InputError
from rrtik_ompl.poses import pose_row
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.tasks import MoveTo, TaskPlan
from rrtik_ompl.tasks.timed import time_task
from rrtik_ompl.viewer.fingers import fingers_of
from rrtik_ompl.viewer.subject import Showable, Subject, subject_of_run
from rrtik_ompl.world import World

TASK = "task"  # the planner of a run that shows one
RATE = 25.0  # ticks per second


def subject_of_task(shown: Showable, plan: TaskPlan) -> Subject:
    """What a page shows of a plan: its run, the regions that are kept on the way, and the gripper at work.

    Raises:
        InputError: If there is no plan to show, or it does not fit what is shown.
    """
    rows = _timed(plan)
    subject = subject_of_run(shown, _run(plan, rows))
    assert subject.robot is not None, "a run has one"
    at = np.array([number + share for number, _, share in rows])
    return replace(subject, held=held_in(plan), fingers=fingers_of(plan, subject.robot, at))


def run_of(plan: TaskPlan) -> ReplanRun:
    """The run that shows a plan as :func:`time_task` times it: at the robot's own limits, with rests between motions.

    Raises:
        InputError: If there is no plan to show.
    """
    return _run(plan, _timed(plan))


def _run(plan: TaskPlan, rows: list[tuple[int, Vector, float]]) -> ReplanRun:
    robot = plan.worlds[0].robot
    held_first = {item.name for item in plan.worlds[0].scene.attached}
    ticks: list[Tick] = []
    for number, q, _ in rows:
        path, world = plan.paths[number], plan.worlds[number]
        text = f"motion {number + 1} of {len(plan.paths)}: {plan.stages[number]}"
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


def held_in(plan: TaskPlan) -> tuple[tuple[HeldRegion, Vector], ...]:
    """The regions of the path constraints of all motions, and where each motion begins, shape (dof,)."""
    found: list[tuple[HeldRegion, Vector]] = []
    for path, world, stage in zip(plan.paths, plan.worlds, plan.stages, strict=True):
        if isinstance(stage, MoveTo):
            held = held_regions(world.robot, world.scene, stage.constraints, path.start)
            found += [(region, path.start) for region in held.regions]
    return tuple(found)


def _timed(plan: TaskPlan) -> list[tuple[int, Vector, float]]:
    """Number of the motion, configuration and share of the rest before the next motion that is over, tick after tick.

    A motion that leads nowhere has a tick too.

    Raises:
        InputError: If there is no motion.
    """
    if not plan.paths:
        raise InputError("task plan to show: it has no motion" + (f": {plan.reason}" if plan.reason else ""))
    if not any(path.length > 0.0 for path in plan.paths):
        return [(number, path.start, 0.0) for number, path in enumerate(plan.paths)]
    timed = time_task(plan)
    clock, states = timed.trajectory.sampled(RATE)
    numbers = np.searchsorted(timed.begins, clock, side="right") - 1
    missing = np.setdiff1d(np.arange(len(plan.paths)), numbers).tolist()  # what leads nowhere takes no time
    rests = [_share_of_rest(timed.pauses, time) for time in clock.tolist()]
    rows = [*zip(numbers.tolist(), states.positions, rests, strict=True)]
    rows += [(k, plan.paths[k].start, 0.0) for k in missing]
    return [(number, frozen(q), share) for number, q, share in sorted(rows, key=lambda row: row[0])]


def _share_of_rest(pauses: Matrix, time: float) -> float:
    """How much is over of the rest, of some rests (begin, end), in which a time lies; 0 between them."""
    resting = pauses[(pauses[:, 0] < time) & (time < pauses[:, 1])]
    return float((time - resting[0, 0]) / (resting[0, 1] - resting[0, 0])) if len(resting) else 0.0


def _poses(world: World, q: Vector) -> dict[str, Vector]:
    """Where obstacles and what is held are: x, y, z and quaternion x, y, z, w."""
    places = {item.name: world.robot.fk(q, item.link) * item.pose for item in world.scene.attached}
    places |= {item.name: item.pose for item in world.scene.obstacles}
    return {name: pose_row(pose) for name, pose in places.items()}
