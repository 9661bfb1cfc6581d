"""Define how fast joints may move: limits of velocity, acceleration and jerk, from the robot or given."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, dimensions, finite_array, frozen, number_rows, whole_number
from rrtik_ompl.base.copies import as_value, changed, in_one_line
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.model.robot import Robot

DEFAULT_TURN_RATE = 0.5  # [rad/s] of a joint without a velocity limit: slow enough to watch
DEFAULT_SLIDE_RATE = 0.1  # [m/s] likewise for a sliding joint
RAMP_SECONDS = 0.5  # time in which a joint without an acceleration limit reaches its full velocity
ONSET_SECONDS = 0.1  # time in which a joint without a jerk limit reaches its full acceleration

ROUNDING_MARGIN = 1.0 + 1e-12  # so that a motion slowed to a limit does not exceed it by rounding


@dataclass(frozen=True, slots=True, eq=False)
class RateLimits:
    """Largest velocity, acceleration and jerk of each joint, shape (n,) each.

    Attributes:
        velocity: Velocity limits [rad/s or m/s], finite.
        acceleration: Acceleration limits [rad/s^2 or m/s^2], finite.
        jerk: Jerk limits [rad/s^3 or m/s^3]; inf for none.

    Example:
        >>> limits = rrtik.RateLimits.of(rrtik.load_robot("panda"), share=0.5)
        >>> limits.velocity.shape
        (7,)
    """

    velocity: Vector
    acceleration: Vector
    jerk: Vector

    __reduce__ = as_value
    __repr__ = in_one_line

    def __init__(self, velocity: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike = np.inf) -> None:
        """Make limits from one number per joint, or from a single number for all joints.

        Raises:
            InputError: If a limit is not greater than 0, or the numbers of limits differ.
        """
        rows = [_row(v, name) for v, name in ((velocity, "velocity"), (acceleration, "acceleration"), (jerk, "jerk"))]
        count = max(len(row) for row in rows)
        for row, name in zip(rows, ("velocity", "acceleration", "jerk"), strict=True):
            if len(row) not in (1, count):
                raise InputError(f"{name} limits: expected {count} numbers, one per joint, got {len(row)}")
            if name != "jerk" and np.isinf(row).any():
                raise InputError(f"{name} limits: must be finite")
            object.__setattr__(self, name, frozen(np.broadcast_to(row, (count,))))

    @classmethod
    def of(
        cls,
        robot: Robot,
        *,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        jerk: ArrayLike | None = None,
        share: float = 1.0,
    ) -> RateLimits:
        """Return the limits of a robot, or those that are given instead.

        Limits that neither the robot nor the caller gives have defaults: a velocity of 0.5 rad/s or 0.1 m/s, the
        acceleration that reaches the velocity in 0.5 s, and the jerk that reaches the acceleration in 0.1 s.

        Args:
            robot: The robot.
            velocity: Limits instead of the robot's, one number or one per joint [rad/s or m/s].
            acceleration: Likewise for accelerations [rad/s^2 or m/s^2].
            jerk: Likewise for jerks [rad/s^3 or m/s^3]; inf for no limit.
            share: Factor of all limits, greater than 0 and at most 1: 0.5 moves at half the speed.

        Raises:
            InputError: If a limit is not greater than 0, or their number is not that of the joints.
        """
        require(robot, Robot, "robot of rate limits", "use load_robot(name)")
        part = float(finite_array(share, (), "share of the limits"))
        if not 0.0 < part <= 1.0:
            raise InputError(f"share of the limits must be greater than 0 and at most 1, got {part:g}")

        plain = np.where(robot.prismatic, DEFAULT_SLIDE_RATE, DEFAULT_TURN_RATE)
        v = _of_robot(robot, velocity, "velocity", robot.velocity, plain)
        a = _of_robot(robot, acceleration, "acceleration", robot.acceleration, v / RAMP_SECONDS)
        j = _of_robot(robot, jerk, "jerk", robot.jerk, a / ONSET_SECONDS)
        return cls(part * v, part * a, part * j)

    def along(self, directions: Matrix) -> tuple[Vector, Vector, Vector]:
        """Return the limits of speed, acceleration and jerk along straight lines.

        Args:
            directions: Directions of the lines in configuration space, shape (m, n).

        Returns:
            Largest speed, acceleration and jerk along each direction, shape (m,) each; inf where nothing limits them.

        Raises:
            InputError: If the directions are not finite rows of numbers, or for another number of joints.
        """
        directions = finite_array(directions, (None, None), "directions")
        self._fits(directions.shape[1])
        with np.errstate(divide="ignore", over="ignore"):
            steep = 1.0 / np.abs(directions)
            v, a, j = (
                (row * steep).min(axis=1, initial=np.inf) for row in (self.velocity, self.acceleration, self.jerk)
            )
        return v, a, j

    def _fits(self, count: int) -> None:
        """Raise an error unless the limits are for this number of joints."""
        if len(self.velocity) not in (1, count):
            given = len(self.velocity)
            raise InputError(f"limits: there are {count} joints, but limits for {given}; give one, or one a joint")

    def for_joints(self, count: int) -> RateLimits:
        """Return the same limits for a number of joints; limits of one number each apply to all joints.

        Raises:
            InputError: If they are for another number of joints.
        """
        joints = whole_number(count, "number of joints", 1)
        if joints == len(self.velocity) == len(self.acceleration) == len(self.jerk):
            return self
        self._fits(joints)
        rows = {"velocity": self.velocity, "acceleration": self.acceleration, "jerk": self.jerk}
        return changed(self, **{name: frozen(np.broadcast_to(row, (joints,))) for name, row in rows.items()})

    def slowing(self, velocity: Vector, acceleration: Vector, jerk: Vector | None = None) -> float:
        """Return the factor, 1 or more, by which a motion with these peaks must be slowed to keep the limits.

        Args:
            velocity: Largest velocity of each joint, shape (n,).
            acceleration: Largest acceleration of each joint, shape (n,).
            jerk: Largest jerk of each joint, shape (n,); None if it is not limited.

        Raises:
            InputError: If these are not one number per joint.
        """
        rows: list[Vector | None] = []
        peaks = {"velocity": velocity, "acceleration": acceleration, "jerk": jerk}
        for (name, peak), limit in zip(peaks.items(), (self.velocity, self.acceleration, self.jerk), strict=True):
            if peak is None and name == "jerk":
                rows.append(None)
                continue
            row = number_rows(np.nan if peak is None else peak, f"peaks of {name}").reshape(-1)
            self._fits(len(row))
            finite_array(np.where(np.isfinite(limit), row, 0.0), (None,), f"peaks of {name}")
            rows.append(row)
        return slowing_of(self, *rows)


def slowing_of(limits: RateLimits, *peaks: Vector | None) -> float:
    """Return :meth:`RateLimits.slowing` for largest velocities, accelerations and jerks that are known to be finite.

    Jerks may be infinite where they are not limited.
    """
    shares = []
    for row, limit in zip(peaks, (limits.velocity, limits.acceleration, limits.jerk), strict=True):
        if row is not None:
            limited = np.where(np.isfinite(limit), row, 0.0)
            shares.append(float((limited / limit).max(initial=0.0)))
    if max(shares) <= 1.0:
        return 1.0
    factors: list[float] = [share ** (1.0 / power) for power, share in enumerate(shares, start=1)]
    return ROUNDING_MARGIN * max(factors)


def default_words(robot: Robot, given: Collection[str] = ()) -> str:
    """Return a line that says which limits of a robot are defaults, except those ``given`` by name; or ""."""
    rules = {
        "velocity": f"{DEFAULT_TURN_RATE:g} rad/s or {DEFAULT_SLIDE_RATE:g} m/s",
        "acceleration": f"full speed after {RAMP_SECONDS:g} s",
        "jerk": f"full acceleration after {ONSET_SECONDS:g} s",
    }
    said = []
    for name, rule in rules.items():
        unknown = ~np.isfinite(getattr(robot, name))
        if name not in given and unknown.any():
            which = "all joints" if unknown.all() else ", ".join(np.array(robot.joint_names)[unknown])
            said.append(f"{name} of {which} ({rule})")
    return f"limits by default, not stated by '{robot.name}': {'; '.join(said)}" if said else ""


def _row(values: ArrayLike, name: str) -> Vector:
    """Check that limits are positive numbers, infinity allowed, and return them, shape (n,) or (1,)."""
    row: Vector = number_rows(values, f"{name} limits").reshape(-1)
    if dimensions(values) > 1 or row.size == 0 or not (row > 0.0).all():
        shown = str(row[:20].tolist())[:60]
        raise InputError(f"{name} limits: expected numbers greater than 0, one per joint, got {shown}")
    return row


def _of_robot(robot: Robot, given: ArrayLike | None, name: str, own: Vector, default: Vector) -> Vector:
    """Return the given limits or, for None, those of the robot with defaults where it has none, shape (dof,)."""
    if given is None:
        return np.where(np.isfinite(own), own, default)
    row = _row(given, name)
    if len(row) not in (1, robot.dof):
        raise InputError(f"{name} limits: robot '{robot.name}' has {robot.dof} joints, but got {len(row)} numbers")
    return np.broadcast_to(row, (robot.dof,)).astype(np.float64)


@kept_with
def limits_of(robot: Robot) -> RateLimits:
    """Return the limits of a robot as :meth:`RateLimits.of` does."""
    return RateLimits.of(robot)
