"""Grippers: their joints, and the commands that they are given over the time of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, finite_number, not_negative
from rrtik_ompl.base.copies import set_fields
from rrtik_ompl.base.errors import InputError, UnknownNameError, listed, require
from rrtik_ompl.base.units import joint_units

STATES = ("open", "closed")
UNITS = ("rad", "m")


@dataclass(frozen=True, slots=True)
class GripperJoints:
    """The joints of a gripper, and how far it opens.

    The methods return joint values that `rrtik_ompl.load_robot` takes as ``locked``.

    Attributes:
        joints: Names of the joints, without those that mimic them.
        opened, closed: Their values in the open and in the closed state [rad or m].
        width: Distance between the fingers in the open state minus that in the closed state [m]; in between, it is
            taken as proportional; 0 if it is not known.
        name: Name of the gripper: that of its group in an SRDF, or else of its first joint.
        prismatic: Which of the joints slide; empty if none does.
        velocity: Velocity limits of the joints [rad/s or m/s]; empty if they are not known.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> hand = rrtik.load_robot("panda").gripper
        >>> hand.close_on(0.05)
        {'panda_finger_joint1': 0.025}
        >>> holding = rrtik.load_robot("panda", locked=hand.close_on(0.05))
    """

    joints: tuple[str, ...]
    opened: tuple[float, ...]
    closed: tuple[float, ...]
    width: float
    name: str = ""
    prismatic: tuple[bool, ...] = ()
    velocity: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        set_fields(self, name=self.name or self.joints[0])

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint, "rad" or "m"."""
        return tuple(joint_units(self.prismatic or (False,) * len(self.joints)))

    def posture(self, state: str) -> dict[str, float]:
        """Return the joint values by name in the state "open" or "closed" ("close" is the same).

        Raises:
            UnknownNameError: If the state is another one.
        """
        if state not in (*STATES, "close"):
            raise UnknownNameError("state of a gripper", state, STATES)
        return dict(zip(self.joints, self.opened if state == "open" else self.closed, strict=True))

    def close_on(self, width: float) -> dict[str, float]:
        """Return the joint values by name at which the fingers are a width [m] apart.

        Raises:
            InputError: If the gripper does not open so far.
        """
        wanted = finite_number(width, "width of a gripper")
        if self.width == 0.0:
            raise InputError("width of a gripper: how far this one opens is not known; use its states open and closed")
        if not 0.0 <= wanted <= self.width:
            raise InputError(f"width of a gripper: it opens from 0 to {self.width:g} m, got {wanted:g}")

        return self.at(wanted / self.width)

    def at(self, share: float) -> dict[str, float]:
        """Return the joint values by name at which the gripper is open by a share, from 0 (closed) to 1 (open).

        Raises:
            InputError: If the share is not within 0 and 1.
        """
        wanted = finite_number(share, "share of a gripper's opening")
        if not 0.0 <= wanted <= 1.0:
            raise InputError(f"share of a gripper's opening: expected 0 to 1, got {wanted:g}")
        values = (shut + wanted * (wide - shut) for shut, wide in zip(self.closed, self.opened, strict=True))
        return dict(zip(self.joints, values, strict=True))

    def share(self, positions: ArrayLike) -> Matrix:
        """Return how far the gripper is open, 0 to 1 between its two states, shape (k,), for positions, shape (k, g).

        Example:
            >>> rrtik.load_robot("so101").gripper.share([[-0.174533], [1.74533]])
            array([0., 1.])
        """
        rows = finite_array(positions, (None, len(self.joints)), f"positions of gripper '{self.name}'")
        closed = np.array(self.closed)
        way = np.array(self.opened) - closed
        shares: Matrix = (rows - closed) @ way / (way @ way)
        return shares

    def seconds(self, before: Sequence[float], after: Sequence[float]) -> float:
        """Return how long its joints need from some values to others at their velocity limits [s]; 0 if unknown."""
        if not self.velocity:
            return 0.0
        return float(np.max(np.abs(np.subtract(after, before)) / np.array(self.velocity)))

    def event(self, time: float, positions: Sequence[float], seconds: float = 0.0) -> GripperEvent:
        """Return the command to go to positions of its joints at a time [s], for which they take some seconds."""
        opening = float(self.share([positions])[0]) * self.width if self.width else None
        return GripperEvent(time, self.joints, tuple(positions), self.name, self.units, seconds, opening)


@dataclass(frozen=True, slots=True)
class GripperEvent:
    """A command to a gripper at a time of a motion: the positions to which its joints shall go.

    Attributes:
        time: When it is given [s], from the beginning of the motion.
        joints: Names of the joints of the gripper, without those that mimic them.
        positions: Where they shall go [rad or m].
        gripper: Name of the gripper; by default that of its first joint.
        units: Unit of each joint, "rad" or "m"; by default "rad".
        seconds: How long the joints take for it [s]: they go evenly, and the arm waits for them; 0 if it is not known.
        width: Distance between the fingers then [m], if it is known.
        effort: Largest torque or force of its joints [N m or N]; None leaves it to the gripper's controller.

    Example:
        >>> from rrtik_ompl.model.gripper import GripperEvent
        >>> GripperEvent(1.5, ["finger"], [0.02], units=["m"]).positions
        (0.02,)
    """

    time: float
    joints: tuple[str, ...]
    positions: tuple[float, ...]
    gripper: str = ""
    units: tuple[str, ...] = ()
    seconds: float = 0.0
    width: float | None = None
    effort: float | None = None

    def __post_init__(self) -> None:
        what = "command to a gripper"
        names = listed(self.joints, f"joints of a {what}")
        if not names or len(set(names)) < len(names):
            raise InputError(f"{what}: expected names of joints, each once, got {list(names)}")
        for name in names:
            require(name, str, f"joint of a {what}")
        units = listed(self.units, f"units of a {what}") or ("rad",) * len(names)
        if len(units) != len(names) or not set(units) <= set(UNITS):
            raise InputError(f"{what}: units: expected 'rad' or 'm' for each joint, got {list(units)}")
        require(self.gripper, str, f"name of the gripper of a {what}")

        values = {
            "time": not_negative(self.time, f"time of a {what}"),
            "joints": names,
            "positions": tuple(finite_array(self.positions, (len(names),), f"positions of a {what}").tolist()),
            "gripper": self.gripper or names[0],
            "units": units,
            "seconds": not_negative(self.seconds, f"seconds of a {what}"),
        }
        for key in ("width", "effort"):
            given = getattr(self, key)
            values[key] = None if given is None else not_negative(given, f"{key} of a {what}")
        set_fields(self, **values)


Events: TypeAlias = tuple[GripperEvent, ...]


def checked_events(events: object, duration: float) -> Events:
    """Check the commands to the gripper of a motion, and return them in the order of their times.

    The first of them, at 0, says where the gripper is at the beginning.

    Args:
        events: The commands.
        duration: Time at which the motion ends [s].

    Raises:
        InputError: If they are for several grippers, two are at the same time, none is at 0, or one is after the end.
    """
    row = listed(events, "commands to the gripper of a trajectory")
    for event in row:
        require(event, GripperEvent, "each command to the gripper of a trajectory")
    if not row:
        return ()
    row = tuple(sorted(row, key=lambda event: event.time))

    what = "commands to the gripper of a trajectory"
    if len({(event.gripper, event.joints, event.units) for event in row}) > 1:
        raise InputError(f"{what}: they are for several grippers; a trajectory has those of one")
    times = [event.time for event in row]
    if times[0] != 0.0 or len(set(times)) < len(times):
        raise InputError(f"{what}: expected the first at 0 s and no two at the same time, got {times}")
    if times[-1] > duration:
        raise InputError(f"{what}: one is at {times[-1]:g} s, after the end of the motion, {duration:g} s")
    return row


def slowed_events(events: Events, factor: float) -> Events:
    """Return the same commands in a motion that is ``factor`` times as long."""
    return tuple(replace(each, time=factor * each.time, seconds=factor * each.seconds) for each in events)


def targets_at(events: Events, times: ArrayLike) -> Matrix:
    """Return the positions that a gripper has been told to go to at some times [s]: (k,) -> (k, g)."""
    return np.array([event.positions for event in events])[_given(events, finite_array(times, (None,), "times"))]


def states_at(events: Events, times: ArrayLike) -> tuple[Matrix, Matrix]:
    """Return positions and velocities of a gripper's joints at some times [s], (k,) -> (k, g) each.

    Each command is followed evenly. The first one says where the joints are at the beginning; from where they are when
    the next one comes, they follow that.
    """
    clock = finite_array(times, (None,), "times")
    begins = [np.array(events[0].positions)]
    for event, following in pairwise(events):
        begins.append(_followed(event, begins[-1], np.array([following.time]))[0][0])

    given = _given(events, clock)
    positions = np.empty((len(clock), len(begins[0])))
    velocities = np.empty_like(positions)
    for k, event in enumerate(events):
        held = given == k
        positions[held], velocities[held] = _followed(event, begins[k], clock[held])
    return positions, velocities


def _given(events: Events, clock: Vector) -> NDArray[np.int64]:
    """Return the index of the command that holds at each time, shape (k,)."""
    return np.maximum(np.searchsorted([event.time for event in events], clock, side="right") - 1, 0)


def _followed(event: GripperEvent, begin: Vector, clock: Vector) -> tuple[Matrix, Matrix]:
    """Return the states at times at which a command holds, from the positions of the joints when it came."""
    way = np.array(event.positions) - begin
    if event.seconds == 0.0:
        return np.tile(begin + way, (len(clock), 1)), np.zeros((len(clock), len(way)))
    shares = (clock[:, None] - event.time) / event.seconds
    return begin + np.clip(shares, 0.0, 1.0) * way, np.where(shares < 1.0, way / event.seconds, 0.0)
