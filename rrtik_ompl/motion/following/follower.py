"""Follow a trajectory with an arm: set points at a control rate, pauses, changes of pace, and stops within limits."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, finite_number, positive
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.following.pace import Pace
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory

RETRY_SECONDS = 0.02  # [s] until a change of pace that could not keep the limits is tried again
NEAR = 0.05  # [rad] or [m] default tolerance of a joint's deviation from its set point
MOST_PERIODS = 3.0  # largest step of run(), in control periods, however late a tick is
SLACK = 1e-6  # share of a limit by which a trajectory may exceed it
AT_REST = 1e-6  # share of a joint's largest velocity below which it counts as at rest


@runtime_checkable
class RobotLink(Protocol):
    """An arm that takes set points of its joints at a control rate.

    Example:
        >>> arm = rrtik.following.SimulatedLink(rrtik.load_robot("planar3"), np.zeros(3))
        >>> isinstance(arm, rrtik.following.RobotLink)
        True
    """

    def positions(self) -> Vector:
        """Return the joint values now, shape (n,) [rad or m]."""

    def command(self, q: Vector, t: float) -> None:
        """Take a set point, shape (n,) [rad or m], for the time t since the motion began [s]."""


class SimulatedLink:
    """A simulated arm that is always exactly at its last set point.

    Attributes:
        sent: Times [s] and set points, shape (dof,), that were commanded so far.

    Example:
        >>> path = rrtik.JointPath([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]])
        >>> motion = rrtik.time_parameterize(path, rrtik.RateLimits(2.0, 20.0))
        >>> arm = rrtik.following.SimulatedLink(rrtik.load_robot("planar3"), np.zeros(3))
        >>> rrtik.following.Follower(motion, arm).run().arrived
        True
    """

    def __init__(self, robot: Robot, start: ArrayLike) -> None:
        """Begin at a configuration, shape (dof,).

        Raises:
            InputError: If it does not fit the robot, or there is none.
        """
        require(robot, Robot, "robot of a link", "use load_robot(name)")
        self._q = robot.configuration(start, "start")
        self.sent: list[tuple[float, Vector]] = []

    def positions(self) -> Vector:
        """Return the joint values now, shape (n,)."""
        return self._q.copy()

    def command(self, q: Vector, t: float) -> None:
        """Move to a set point at once.

        Raises:
            InputError: If the set point is not one finite number per joint, or the time is not a finite number.
        """
        place = finite_array(q, self._q.shape, "set point").copy()
        time = finite_number(t, "time of a set point")
        self._q = place
        self.sent.append((time, place))


@dataclass(frozen=True, slots=True)
class Followed:
    """How following a trajectory ended.

    Attributes:
        arrived: Whether the arm is at the end of the trajectory.
        reason: Why the arm did not arrive; "" if it arrived. If a stop came too late for the arm to rest before the
            end, the reason says so although the arm arrived.
        place: How far the motion came, in the trajectory's own time [s].
        seconds: How long it took, without delays by late ticks [s].
        late: By how much the motion was delayed because ticks were late, in addition to ``seconds`` [s].

    Example:
        >>> path = rrtik.JointPath([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]])
        >>> motion = rrtik.time_parameterize(path, rrtik.RateLimits(2.0, 20.0))
        >>> arm = rrtik.following.SimulatedLink(rrtik.load_robot("planar3"), np.zeros(3))
        >>> rrtik.following.Follower(motion, arm).run().arrived
        True
    """

    arrived: bool
    reason: str
    place: float
    seconds: float
    late: float = 0.0


class Follower:
    """Follows a trajectory by sending set points to an arm.

    The arm stays on the path of the trajectory at any pace, so what was proven of the path holds. ``pause``,
    ``resume``, ``stop`` and ``pace`` may be called from other threads. Each takes effect within the limits: where the
    trajectory brakes at its limit already, this is a little later, and at the latest the arm rests at the end of the
    motion.

    Args:
        trajectory: The motion, from rest to rest.
        link: The arm.
        limits: Limits that the trajectory and all changes of pace must keep; None for the trajectory's own peaks.
        rate: Number of set points per second.
        tolerance: Largest deviation of a joint from its set point [rad or m]; beyond it, the arm is stopped.

    Raises:
        InputError: If the trajectory exceeds the limits or is not at rest at its ends, if the arm is not at its start
            or has another number of joints, or if an option is not valid.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("planar3")
        >>> path = rrtik.JointPath.of(robot, [[0, 0, 0], [1, 0, 0]])
        >>> motion = rrtik.time_parameterize(path, robot)
        >>> follower = rrtik.following.Follower(motion, rrtik.following.SimulatedLink(robot, path.start))
        >>> while not follower.ended:
        ...     follower.step(0.01)
        >>> follower.result.arrived
        True
    """

    def __init__(
        self,
        trajectory: Trajectory,
        link: RobotLink,
        *,
        limits: RateLimits | None = None,
        rate: float = 125.0,
        tolerance: float = NEAR,
    ) -> None:
        require(trajectory, Trajectory, "trajectory to follow", "use time_parameterize(path, limits)")
        require(limits, RateLimits | None, "limits of a follower", "use RateLimits.of(robot)")
        if isinstance(link, type) or not isinstance(link, RobotLink):
            raise InputError(
                "arm of a follower: it needs positions() and command(q, t), as SimulatedLink(robot, start) has them, "
                f"got {repr(link)[:40]}"
            )

        self._motion = trajectory
        self._link = link
        self._period = 1.0 / positive(rate, "rate of a follower")
        self._tolerance = positive(tolerance, "tolerance")
        _check_rest(trajectory)
        self._pace = Pace(trajectory.cubics, _limits_to_keep(trajectory, limits))

        self._lock = Lock()
        self._target_pace = 1.0  # pace to reach, unless the motion is paused or stopping
        self._paused = False
        self._stopping = False
        self._reason = ""  # reason of a stop; "" if there was none
        self._retry_time = 0.0  # [s] time on the motion's clock before which no other pace is tried
        self._lateness = 0.0  # [s]
        self._ended = False

        self._check_begin(trajectory.positions[0])

    @property
    def ended(self) -> bool:
        """Return whether the arm has reached its end or come to a stop."""
        return self._ended

    @property
    def place(self) -> float:
        """Return the place on the trajectory of the last set point, in the trajectory's own time [s]."""
        return self._pace.place

    @property
    def result(self) -> Followed:
        """Return how far the motion is and how it ended."""
        pace = self._pace
        reason = self._reason
        arrived = pace.place >= self._motion.duration
        if not arrived:
            reason = reason or "on its way"
        elif reason:
            reason = f"{reason}: too late for a rest before the end"
        return Followed(arrived, reason, pace.place, pace.now, self._lateness)

    def pause(self) -> None:
        """Bring the arm to rest on the trajectory, until ``resume``."""
        self._paused = True

    def resume(self) -> None:
        """Continue after ``pause``; a stop is final."""
        self._paused = False

    def stop(self, reason: str = "stopped") -> None:
        """Bring the arm to rest on the trajectory, finally."""
        with self._lock:
            self._stopping = True
            self._reason = self._reason or reason

    def pace(self, pace: float) -> None:
        """Play the motion at a share of its timed speed, above 0 and at most 1.

        Raises:
            InputError: If the share is another one.
        """
        share = finite_number(pace, "pace")
        if not 0.0 < share <= 1.0:
            raise InputError(f"pace must be greater than 0 and at most 1, got {share:g}")
        self._target_pace = share

    def step(self, seconds: float) -> None:
        """Advance by a time [s] and send the set point for the new time.

        Raises:
            InputError: If the time is not greater than 0.
        """
        if self._ended:
            return
        self._advance(positive(seconds, "seconds of a step"))
        q = self._motion(self._pace.place).positions
        self._link.command(q, self._pace.now)
        if self._pace.place >= self._motion.duration or (self._stopping and self._pace.steady == 0.0):
            self._ended = True

    def run(
        self, *, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], object] = time.sleep
    ) -> Followed:
        """Follow the trajectory to its end or to a stop; Ctrl-C stops it within the limits.

        After a late tick the motion continues from where it was, by a few periods at most: it falls behind the clock,
        but the arm is never told to jump. If the arm deviates too much from its set point, or its position cannot be
        read, it is stopped within the limits. An error raised by ``command`` ends following at once.

        Args:
            clock: Returns the time [s].
            sleep: Waits for a time [s].
        """
        last_tick = clock()
        while not self._ended:
            try:
                sleep(max(0.0, last_tick + self._period - clock()))
                commanded = self._motion(self._pace.place).positions
                now = clock()
                if fault := self._fault(commanded):
                    self.stop(fault)

                elapsed = max(now - last_tick, 1e-6)
                last_tick = now
                step_seconds = min(elapsed, MOST_PERIODS * self._period)
                self._lateness += elapsed - step_seconds
                self.step(step_seconds)
            except KeyboardInterrupt:
                self.stop("interrupted")
        return self.result

    def _advance(self, seconds: float) -> None:
        """Decide on a change of pace if another pace is wanted, and advance the motion by a time [s]."""
        target = 0.0 if self._paused or self._stopping else self._target_pace
        pace = self._pace
        if target != pace.end and pace.now >= self._retry_time:
            pace.turn_to(target)
            self._retry_time = pace.now + RETRY_SECONDS

        pace.advance(seconds)
        pace.place = min(pace.place, self._motion.duration)

    def _check_begin(self, first_position: Vector) -> None:
        positions = finite_array(self._link.positions(), (None,), "positions of the arm")
        if positions.shape != first_position.shape:
            has = positions.size
            moves = first_position.size
            raise InputError(f"the arm has {has} joints, the trajectory moves {moves}: it is another robot's")
        if deviation := self._deviation_in_words(positions, first_position):
            raise InputError(f"the trajectory begins elsewhere: {deviation} rad or m away; move the arm there first")

    def _fault(self, commanded: Vector) -> str:
        """Return why an arm whose set point is ``commanded``, shape (dof,), has to stop; "" if it need not.

        All errors of reading the position are caught, so that the remaining set points can bring the arm to rest.
        """
        try:
            positions = finite_array(self._link.positions(), commanded.shape, "positions of the arm")
        except Exception as error:
            return f"where the arm is cannot be read: {' '.join(str(error).split()) or type(error).__name__}"
        deviation = self._deviation_in_words(positions, commanded)
        return deviation and f"{deviation} away from where it was told to be"

    def _deviation_in_words(self, positions: Vector, commanded: Vector) -> str:
        """Return which joint deviates most from its set point and by how much; "" if all are within the tolerance."""
        deviation = np.abs(positions - commanded)
        if (deviation <= self._tolerance).all():
            return ""
        name = self._motion.joint_names[int(np.nan_to_num(deviation, nan=np.inf).argmax())]
        return f"joint '{name}' is {deviation.max():.3g}"


def _check_rest(motion: Trajectory) -> None:
    """Raise an error if a motion does not begin and end at rest.

    An arm at rest could not follow it, and no change of pace would bring the arm to rest at its end.
    """
    end_speeds = np.abs(motion.velocities[[0, -1]])
    if (end_speeds > AT_REST * motion.peaks().velocity).any():
        end, joint = np.unravel_index(int(end_speeds.argmax()), end_speeds.shape)
        end_name = ("start", "end")[int(end)]
        raise InputError(
            f"trajectory to follow: at its {end_name} joint '{motion.joint_names[int(joint)]}' moves at "
            f"{end_speeds[end, joint]:.3g} rad/s or m/s; it must begin and end at rest, as time_parameterize() has it"
        )


def _limits_to_keep(motion: Trajectory, limits: RateLimits | None) -> RateLimits:
    """Return the limits that changes of pace must keep: those given, or the peaks of the motion if there are none.

    A limit that the motion exceeds by rounding is raised to the motion's peak.

    Raises:
        InputError: If the motion exceeds the limits: then no change of pace could keep them.
    """
    peaks = motion.peaks()
    # A joint that does not move has peaks of 0, so the largest peaks of the other joints are used for it.
    if limits is None:
        return RateLimits(*(np.maximum(np.where(row > 0.0, row, row.max()), 1e-9) for row in peaks))

    bounds = limits.for_joints(len(motion.joint_names))
    for name, unit in (("velocity", ""), ("acceleration", "^2"), ("jerk", "^3")):
        peak = getattr(peaks, name)
        bound = getattr(bounds, name)
        exceeds = peak > bound * (1.0 + SLACK)
        if exceeds.any():
            joint = int(np.argmax(np.where(exceeds, peak / bound, 0.0)))
            raise InputError(
                f"limits of a follower: joint '{motion.joint_names[joint]}' has a {name} of {peak[joint]:.4g} in the "
                f"trajectory, its limit is {bound[joint]:.4g} rad/s{unit} or m/s{unit}; time the path anew with these "
                "limits, or slow the trajectory down by slowed()"
            )

    pairs = zip((bounds.velocity, bounds.acceleration, bounds.jerk), peaks, strict=True)
    return RateLimits(*(np.maximum(bound, peak) for bound, peak in pairs))
