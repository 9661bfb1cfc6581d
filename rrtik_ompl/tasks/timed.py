"""Time a whole task as one motion, with stops where the gripper works and objects are taken or put down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, not_negative
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory, time_parameterize
from rrtik_ompl.motion.trajectory.checks import proof_of_pieces
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.contact_life import MotionContact, world_from
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.world.world import World

BLEND = 0.05  # [rad] or [m] default blend of corners
PAUSE = 1.0  # [s] default rest for a gripper or an object
ROUNDED = (1.0, 0.3, 0.1, 0.03)  # shares of the blend that are tried until things that parted stay apart
LOOKS = 1000  # samples of a motion among which the place is found at which two things have parted


@dataclass(frozen=True, slots=True, eq=False)
class TimedTask:
    """A task over time.

    Attributes:
        trajectory: All motions one after the other; the arm rests where something is done.
        begins: Time at which each motion of the plan begins [s], shape (k,).
        pauses: Times at which each rest for a gripper or an object begins and ends [s], shape (p, 2).

    Example:
        >>> task = rrtik.Task.load("titan4_drawer")
        >>> timed = rrtik.time_task(task.plan(seed=1))
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
    """Time a whole task: each motion as :func:`time_parameterize` times it, from rest to rest.

    Args:
        plan: The plan of a task, which was found.
        limits: Limits of the joints; None for those of the robot.
        blend: See :func:`time_parameterize`; rounded corners are checked in the world of their motion, and keep the
            constraints of their stage.
        pause: How long the arm rests where a gripper opens or closes and where an object is taken or put down [s].
        **options: Further options of :func:`time_parameterize`: ``clearance``, ``tip_speed``, ``payload``, ...

    Raises:
        InputError: If there is no motion, or an option is not valid.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> task = rrtik.Task.load("titan4_drawer")
        >>> timed = rrtik.time_task(task.plan(seed=1))
        >>> len(timed.begins), bool(timed.trajectory.duration > timed.begins[-1])
        (4, True)
    """
    require(plan, TaskPlan, "plan of a task", "use Task(stages).plan(world, start)")
    rest = not_negative(pause, "pause")
    radius = not_negative(blend, "blend")
    if not any(path.length > 0.0 for path in plan.paths):
        raise InputError("task plan to time: it has no motion" + (f": {plan.reason}" if plan.reason else ""))

    rate_limits = RateLimits.of(plan.worlds[0].robot) if limits is None else limits
    parts: list[Trajectory] = []
    rests_before: list[float] = []  # [s] rest before each part
    begins: list[float] = []
    pauses: list[tuple[float, float]] = []
    now = 0.0
    rest_so_far = 0.0  # [s] rest since the last part that moves

    for number, (path, world, stage) in enumerate(zip(plan.paths, plan.worlds, plan.stages, strict=True)):
        if number and rest and _changed(plan.worlds[number - 1], world):
            pauses.append((now, now + rest))
            rest_so_far += rest
            now += rest
        begins.append(now)
        if path.length == 0.0:
            continue

        motion_world = world_of_motion(path, world, stage)
        part = _timed(path, motion_world, plan.contacts[number] if plan.contacts else (), rate_limits, radius, options)
        parts.append(part)
        rests_before.append(rest_so_far)
        rest_so_far = 0.0
        now += part.duration

    return TimedTask(_joined(parts, rests_before), frozen(begins), frozen(np.reshape(pauses, (-1, 2))))


def _timed(
    path: JointPath,
    world: World,
    contacts: tuple[MotionContact, ...],
    limits: RateLimits,
    blend: float,
    options: dict[str, Any],
) -> Trajectory:
    """Time a motion, with corners that are rounded less if things that have parted would touch again."""
    parting_waypoints = sorted({contact.until for contact in contacts if contact.until is not None})
    passed_with_world = [(path.waypoints[until], world_from(world, contacts, until)) for until in parting_waypoints]
    for share in ROUNDED:
        trajectory = time_parameterize(path, limits, blend=share * blend, world=world, **options)
        if all(_free_from(trajectory, q, world_after) for q, world_after in passed_with_world):
            return trajectory
    return time_parameterize(path, limits, blend=0.0, world=world, **options)


def _free_from(motion: Trajectory, q: Vector, world: World) -> bool:
    """Check whether a motion is proven free in a world from where it passes q, shape (dof,), to its end."""
    clock = np.linspace(0.0, motion.duration, LOOKS)
    passed = clock[np.linalg.norm(motion(clock).positions - q, axis=1).argmin()]
    first = min(int(np.searchsorted(motion.times, passed)), len(motion.times) - 2)
    return proof_of_pieces(motion.cubics, world, 0.0, first, len(motion.times) - 1).proven


def _changed(before: World, after: World) -> bool:
    """Check whether the arm holds other objects than before, or holds its fingers differently."""
    attached = [{(item.name, item.link) for item in world.scene.attached} for world in (before, after)]
    return attached[0] != attached[1] or before.robot.source != after.robot.source


def _joined(parts: list[Trajectory], rests_before: list[float]) -> Trajectory:
    """Join motions, each of which begins at rest where the one before ends, with a rest [s] before each."""
    times = []
    rows: dict[str, list[Matrix]] = {"positions": [], "velocities": [], "accelerations": []}
    now = 0.0

    for part, rest in zip(parts, rests_before, strict=True):
        values = {name: getattr(part, name) for name in rows}
        if rest > 0.0:
            times.append(np.array([now]))
            for name, columns in rows.items():
                # Velocities and accelerations are 0 during a rest.
                columns.append(values[name][:1] * (name == "positions"))

        now += rest
        # The last knot of a part is omitted, as the next part begins with it.
        last = -1 if part is not parts[-1] else len(part.times)
        times.append(now + part.times[:last])
        for name, columns in rows.items():
            columns.append(values[name][:last])
        now += part.duration

    first = parts[0]
    return Trajectory(
        np.concatenate(times),
        *(np.concatenate(rows[name]) for name in ("positions", "velocities", "accelerations")),
        joint_names=first.joint_names,
        prismatic=first.prismatic,
        robot_name=first.robot_name,
    )
