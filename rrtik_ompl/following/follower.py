"""An arm that follows a trajectory: set points at a control rate, pause and resume, a pace, a stop within limits."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock

import numpy as np

from rrtik_ompl.arrays import Vector, finite_number, positive
from rrtik_ompl.errors import InputError, require
from rrtik_ompl.following.links import RobotLink
from rrtik_ompl.following.pace import Pace
from rrtik_ompl.trajectory import RateLimits, Trajectory

AGAIN_SECONDS = 0.02  # after which a change of pace is tried again that has kept no limits
NEAR = 0.05  # [rad] or [m] by which an arm may be elsewhere than it was told, unless said otherwise


@dataclass(frozen=True, slots=True)
class Followed:
    """How following ended.

    Attributes:
        arrived: Whether at the end of the trajectory.
        reason: Why not; "" if it arrived.
        place: How far it came, of the trajectory's own time [s].
        seconds: How long it took [s].
    """

    arrived: bool
    reason: str
    place: float
    seconds: float


class Follower:
    """Follows a trajectory by set points.

    The arm stays on the path of the trajectory, whatever its pace, so what was proven of it holds. ``pause``,
    ``resume``, ``stop`` and ``pace`` may be called from other threads; each takes effect within the limits, on the
    trajectory: where it brakes at its limit already, a little later.

    Args:
        trajectory: The motion.
        link: The arm.
        limits: That changes of pace keep; None for the peaks of the trajectory itself.
        rate: Set points a second.
        tolerance: By how much the arm may be elsewhere than it was told; then it is stopped [rad or m].

    Raises:
        InputError: If the arm is not where the trajectory begins, has another number of joints, or an option is none.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("planar3")
        >>> path = rrtik.JointPath.of(robot, [[0, 0, 0], [1, 0, 0]])
        >>> motion = rrtik.time_parameterize(path, robot)
        >>> follower = rrtik.Follower(motion, rrtik.SimulatedLink(robot, path.start))
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
        self._motion, self._link = trajectory, link
        self._step, self._tolerance = 1.0 / positive(rate, "rate of a follower"), positive(tolerance, "tolerance")
        self._limits = _peaks(trajectory) if limits is None else limits.for_joints(len(trajectory.joint_names))
        self._lock = Lock()
        self._wanted, self._paused, self._stopping, self._reason = 1.0, False, False, ""
        self._pace, self._again = Pace(), 0.0
        self._ended = False
        self._check_begin(trajectory.positions[0])

    @property
    def ended(self) -> bool:
        """Whether the arm has come to its end, or to its stop."""
        return self._ended

    @property
    def place(self) -> float:
        """Where on the trajectory the arm is told to be, in the trajectory's own time [s]."""
        return self._pace.place

    @property
    def result(self) -> Followed:
        """How far it is, and how it ended."""
        arrived = self._pace.place >= self._motion.duration
        return Followed(arrived, "" if arrived else self._reason or "on its way", self._pace.place, self._pace.now)

    def pause(self) -> None:
        """Come to rest on the trajectory, until ``resume``."""
        self._paused = True

    def resume(self) -> None:
        """Go on."""
        self._paused = False

    def stop(self, reason: str = "stopped") -> None:
        """Come to rest on the trajectory, for good."""
        with self._lock:
            self._stopping, self._reason = True, self._reason or reason

    def pace(self, pace: float) -> None:
        """Play the motion at a share of its speed, from above 0 to 1.

        Raises:
            InputError: If the share is another one.
        """
        share = finite_number(pace, "pace")
        if not 0.0 < share <= 1.0:
            raise InputError(f"pace must be greater than 0 and at most 1, got {share:g}")
        self._wanted = share

    def step(self, seconds: float) -> None:
        """Advance by a time [s] and command the set point then.

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
        """Follow to the end, or to a stop; Ctrl-C stops within limits.

        Args:
            clock: Tells the time [s].
            sleep: Waits for a time [s].
        """
        before = clock()
        while not self._ended:
            try:
                sleep(max(0.0, before + self._step - clock()))
                told = self._motion(self._pace.place).positions
                now = clock()
                if away := self._away(self._link.positions(), told):
                    self.stop(f"{away} away from where it was told to be")
                self.step(max(now - before, 1e-6))
                before = now
            except KeyboardInterrupt:
                self.stop("interrupted")
        return self.result

    def _advance(self, seconds: float) -> None:
        """Go on at the pace of the moment; decide on another pace if one is wanted."""
        target = 0.0 if self._paused or self._stopping else self._wanted
        pace = self._pace
        if target != pace.end and pace.now >= self._again and not pace.turn_to(target, self._motion, self._limits):
            self._again = pace.now + AGAIN_SECONDS
        pace.advance(seconds)
        pace.place = min(pace.place, self._motion.duration)

    def _check_begin(self, told: Vector) -> None:
        here = np.asarray(self._link.positions(), dtype=np.float64)
        if here.shape != told.shape:
            raise InputError(f"the arm has {here.size} joints, the trajectory moves {told.size}: it is another robot's")
        if away := self._away(here, told):
            raise InputError(f"the trajectory begins elsewhere: {away} rad or m away; move the arm there first")

    def _away(self, here: Vector, told: Vector) -> str:
        """Which joint is farthest from where it was told to be, and how far; "" if all are near enough."""
        apart = np.abs(here - told)
        if (apart <= self._tolerance).all():
            return ""
        name = self._motion.joint_names[int(np.nan_to_num(apart, nan=np.inf).argmax())]
        return f"joint '{name}' is {apart.max():.3g}"


def _peaks(motion: Trajectory) -> RateLimits:
    """The peaks of a motion as limits; joints that stand still have those of the others."""
    peaks = motion.peaks()
    rows = (np.where(row > 0.0, row, row.max()) for row in peaks)
    return RateLimits(*(np.maximum(row, 1e-9) for row in rows))
