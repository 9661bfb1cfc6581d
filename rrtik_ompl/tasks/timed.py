"""Time a whole task as one motion, with stops where the gripper works and objects are taken or put down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, not_negative
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.gripper import GripperJoints
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory, time_parameterize
from rrtik_ompl.motion.trajectory.checks import proof_of_pieces
from rrtik_ompl.motion.trajectory.corners import row_lengths
from rrtik_ompl.motion.trajectory.cubics import Cubics
from rrtik_ompl.motion.trajectory.motion import motion_along
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.contact_life import MotionContact, world_from
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.world.world import World

ROUNDED = (1.0, 0.3, 0.1, 0.03)  # shares of the blend that are tried until things that parted stay apart
LOOKS = 1000  # samples of a motion among which the place is found at which two things have parted


@dataclass(frozen=True, slots=True, eq=False)
class TimedTask:
    """A task over time.

    Attributes:
        trajectory: All motions one after the other; the arm rests where something is done. Its commands to the gripper
            come where these rests begin; that at 0 says how the fingers are held on the first motion.
        begins: Time at which each motion of the plan begins [s], shape (k,).
        pauses: Times at which each rest for a gripper or an object begins and ends [s], shape (p, 2).
    """

    trajectory: Trajectory
    begins: Vector
    pauses: Vector

    __repr__ = in_one_line


def timed_task(
    plan: TaskPlan,
    limits: RateLimits | Robot | None,
    *,
    blend: float,
    pause: float,
    clearance: float | None,
    tip_speed: float | None,
    tip_acceleration: float | None,
    torque: ArrayLike | bool | None,
    payload: float,
) -> TimedTask:
    """Time the plan of a task; see :meth:`TaskPlan.time_parameterize`."""
    least_rest = not_negative(pause, "pause")
    radius = not_negative(blend, "blend")
    if not any(path.length > 0.0 for path in plan.paths):
        raise InputError("task plan to time: it has no motion" + (f": {plan.reason}" if plan.reason else ""))

    timing = partial(
        time_parameterize,
        limits=plan.worlds[0].robot if limits is None else limits,
        clearance=clearance,
        tip_speed=tip_speed,
        tip_acceleration=tip_acceleration,
        torque=torque,
        payload=payload,
    )
    schedule = _Schedule(plan.worlds[0], least_rest)

    for number, (path, world, stage) in enumerate(zip(plan.paths, plan.worlds, plan.stages, strict=True)):
        if number:
            schedule.rest(plan.worlds[number - 1], world)
        schedule.begins.append(schedule.now)
        if path.length > 0.0:
            contacts = plan.contacts[number] if plan.contacts else ()
            schedule.move(_timed(path, world_of_motion(path, world, stage), contacts, timing, radius))

    if plan.end is not None:
        schedule.rest(plan.worlds[-1], plan.end)
    return TimedTask(schedule.trajectory(), frozen(schedule.begins), frozen(np.reshape(schedule.pauses, (-1, 2))))


class _Schedule:
    """Motions and rests, which are added one after the other.

    Attributes:
        now: Time at which the last of them ends [s].
        parts: The motions.
        rests: The rest before each of them, and that since the last one [s].
        begins, pauses: As in :class:`TimedTask`.
        events: Commands to the gripper.
    """

    def __init__(self, world: World, least_rest: float) -> None:
        self._least_rest = least_rest
        self.now = 0.0
        self.parts: list[Trajectory] = []
        self.rests = [0.0]
        self.begins: list[float] = []
        self.pauses: list[tuple[float, float]] = []
        gripper = world.robot.gripper
        self.events = [] if gripper is None else [gripper.event(0.0, _held(gripper, world.robot))]

    def rest(self, before: World, after: World) -> None:
        """Rest if something is taken or put down, and if the fingers move, for as long as they take."""
        if not _changed(before, after):
            return
        rest = self._least_rest
        gripper = before.robot.gripper
        if gripper is not None:
            held = _held(gripper, before.robot)
            wanted = _held(gripper, after.robot)
            seconds = gripper.seconds(held, wanted) or rest
            if held != wanted:
                rest = max(rest, seconds)
                self.events.append(gripper.event(self.now, wanted, seconds))
        if rest > 0.0:
            self.pauses.append((self.now, self.now + rest))
            self.rests[-1] += rest
            self.now += rest

    def move(self, part: Trajectory) -> None:
        """Add a motion."""
        self.parts.append(part)
        self.rests.append(0.0)
        self.now += part.duration

    def trajectory(self) -> Trajectory:
        """Join the motions, each of which begins at rest where the one before ends."""
        names = ("positions", "velocities", "accelerations")
        times: list[Vector] = []
        rows: dict[str, list[Matrix]] = {name: [] for name in names}
        now = 0.0

        def add(clock: Vector, part: Trajectory, knots: slice, *, still: bool = False) -> None:
            times.append(clock)
            for name, columns in rows.items():
                # Velocities and accelerations are 0 during a rest.
                columns.append(getattr(part, name)[knots] * (name == "positions" or not still))

        for part, rest in zip(self.parts, self.rests, strict=False):
            if rest > 0.0:
                add(np.array([now]), part, slice(1), still=True)
            now += rest
            # The last knot of a part is omitted, as the next part begins with it.
            add(now + part.times[:-1], part, slice(-1))
            now += part.duration

        end = self.parts[-1]
        rest = self.rests[-1]
        if rest > 0.0:
            add(np.array([now]), end, slice(-1, None), still=True)
        add(np.array([now + rest]), end, slice(-1, None), still=rest > 0.0)

        clock = np.concatenate(times)
        motion = Cubics(clock, *(np.concatenate(rows[name]) for name in names))
        commands = [replace(event, time=min(event.time, float(clock[-1]))) for event in self.events]
        return motion_along(self.parts[0], motion, commands)


def _held(gripper: GripperJoints, robot: Robot) -> tuple[float, ...]:
    """Return the values of a gripper's joints at which a robot holds them [rad or m]."""
    held = robot.source.get("locked", {})
    ends = zip(gripper.joints, gripper.opened, gripper.closed, strict=True)
    return tuple(float(held.get(name, np.clip(0.0, min(a, b), max(a, b)))) for name, a, b in ends)


def _timed(
    path: JointPath,
    world: World,
    contacts: tuple[MotionContact, ...],
    timing: Callable[..., Trajectory],
    blend: float,
) -> Trajectory:
    """Time a motion, with corners that are rounded less if things that have parted would touch again.

    Args:
        path: The path of the motion.
        world: The world of the motion.
        contacts: The contacts on which it depends.
        timing: :func:`time_parameterize` with the limits; it takes a path, a blend and a world.
        blend: The largest blend to try [rad or m].
    """
    parting_waypoints = sorted({contact.until for contact in contacts if contact.until is not None})
    passed_with_world = [(path.waypoints[until], world_from(world, contacts, until)) for until in parting_waypoints]
    for share in ROUNDED:
        trajectory = timing(path, blend=share * blend, world=world)
        if all(_free_from(trajectory, q, world_after) for q, world_after in passed_with_world):
            return trajectory
    return timing(path, blend=0.0, world=world)


def _free_from(motion: Trajectory, q: Vector, world: World) -> bool:
    """Check whether a motion is proven free in a world from where it passes q, shape (dof,), to its end."""
    clock = np.linspace(0.0, motion.duration, LOOKS)
    passed = clock[row_lengths(motion.cubics.states(clock).positions - q).argmin()]
    first = min(int(np.searchsorted(motion.times, passed)), len(motion.times) - 2)
    return proof_of_pieces(motion.cubics, world, 0.0, np.arange(first, len(motion.times) - 1)).proven


def _changed(before: World, after: World) -> bool:
    """Check whether the arm holds other objects than before, or holds its fingers differently."""
    attached = [{(item.name, item.link) for item in world.scene.attached} for world in (before, after)]
    return attached[0] != attached[1] or before.robot.source != after.robot.source
