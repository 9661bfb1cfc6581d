"""A whole task as one timed motion, with stops where the gripper works and objects are taken and put down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Vector, frozen, not_negative
from rrtik_ompl.copies import in_one_line
from rrtik_ompl.errors import InputError, require
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.trajectory import RateLimits, Trajectory, time_parameterize
from rrtik_ompl.world import World

BLEND = 0.05  # [rad] or [m]
PAUSE = 1.0  # [s]


@dataclass(frozen=True, slots=True, eq=False)
class TimedTask:
    """A task over time.

    Attributes:
        trajectory: All of its motions one after the other; the arm rests where something is done.
        begins: When each motion of the plan begins [s], shape (k,).
        pauses: When the arm begins to rest for a gripper or an object, and when it goes on [s], shape (p, 2).

    Example:
        >>> loaded = rrtik.load_task("titan4_drawer")
        >>> timed = rrtik.time_task(loaded.task.plan(loaded.world, loaded.start, seed=1))
        >>> bool(timed.begins[0] == 0.0)
        True
    """

    trajectory: Trajectory
    begins: Vector
    pauses: Vector

    __repr__ = in_one_line


def time_task(
    plan: TaskPlan,
    limits: RateLimits | None = None,
    *,
    blend: float = BLEND,
    pause: float = PAUSE,
    **options: Any,
) -> TimedTask:
    """Give a whole task its times: each motion as :func:`time_parameterize` has it, from rest to rest.

    Args:
        plan: Of a task that is found.
        limits: Of the joints; those of the robot if None.
        blend: See :func:`time_parameterize`; rounded corners are checked in the world of their motion, and keep the
            constraints of their stage.
        pause: How long the arm rests where a gripper opens or closes and where an object is taken or put down [s].
        **options: Further options of :func:`time_parameterize`: ``clearance``, ``tip_speed``, ``payload``, ...

    Raises:
        InputError: If there is no motion, or an option makes no sense.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> loaded = rrtik.load_task("titan4_drawer")
        >>> timed = rrtik.time_task(loaded.task.plan(loaded.world, loaded.start, seed=1))
        >>> len(timed.begins), bool(timed.trajectory.duration > timed.begins[-1])
        (4, True)
    """
    require(plan, TaskPlan, "plan of a task", "use Task(stages).plan(world, start)")
    rest = not_negative(pause, "pause")
    if not any(path.length > 0.0 for path in plan.paths):
        raise InputError("task plan to time: it has no motion" + (f": {plan.reason}" if plan.reason else ""))
    used = RateLimits.of(plan.worlds[0].robot) if limits is None else limits
    parts: list[Trajectory] = []
    gaps: list[float] = []  # [s] of rest before each part
    begins: list[float] = []
    now = waiting = 0.0
    pauses: list[tuple[float, float]] = []
    for number, (path, world, stage) in enumerate(zip(plan.paths, plan.worlds, plan.stages, strict=True)):
        if number and rest and _changed(plan.worlds[number - 1], world):
            pauses.append((now, now + rest))
            waiting, now = waiting + rest, now + rest
        begins.append(now)
        if path.length == 0.0:
            continue
        part = time_parameterize(path, used, blend=blend, world=world_of_motion(path, world, stage), **options)
        parts.append(part)
        gaps.append(waiting)
        waiting, now = 0.0, now + part.duration
    return TimedTask(_joined(parts, gaps), frozen(begins), frozen(np.reshape(pauses, (-1, 2))))


def _changed(before: World, after: World) -> bool:
    """Whether the arm holds other things than before, or its fingers otherwise."""
    held = [{(item.name, item.link) for item in world.scene.attached} for world in (before, after)]
    return held[0] != held[1] or before.robot.source != after.robot.source


def _joined(parts: list[Trajectory], gaps: list[float]) -> Trajectory:
    """Motions that begin where the one before ends, at rest, with a rest [s] before each."""
    times, rows = [], {"positions": [], "velocities": [], "accelerations": []}  # type: ignore[var-annotated]
    now = 0.0
    for part, gap in zip(parts, gaps, strict=True):
        values = {name: getattr(part, name) for name in rows}
        if gap > 0.0:
            times.append(np.array([now]))
            for name, kept in rows.items():
                kept.append(values[name][:1] * (name == "positions"))
        now += gap
        last = -1 if part is not parts[-1] else len(part.times)
        times.append(now + part.times[:last])
        for name, kept in rows.items():
            kept.append(values[name][:last])
        now += part.duration
    first = parts[0]
    return Trajectory(
        np.concatenate(times),
        *(np.concatenate(rows[name]) for name in ("positions", "velocities", "accelerations")),
        joint_names=first.joint_names,
        prismatic=first.prismatic,
        robot_name=first.robot_name,
    )
