"""A tip that is steered by its velocity: joint rates for a twist, within limits, away from obstacles, proven free.

The rates are those of damped least squares [22]; what they leave free serves a secondary task. Near obstacles the rate
of approach falls with the distance (a velocity damper): the secondary task yields first, then all joints become slower
together, so that the tip keeps its direction. A step that cannot be proven free is made shorter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, not_negative, positive
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.poses import working_memory
from rrtik_ompl.world.world import World

METHODS = ("scaled", "clipped")
LEAST_SINGULAR = 0.05  # of the Jacobian [m or 1]; below it rates are damped
STEP = 1e-3  # [rad] or [m] of difference quotients; distances come in single precision
HARDLY = 0.03  # [rad] or [m] that joints may move until the slope of the volume is found anew
SHARES = np.array([0.5, 0.25, 0.1])  # of a step, the first that is proven free is taken
REACTION_SECONDS = 0.1  # in which a joint comes to rest before its limit


@dataclass(frozen=True, slots=True)
class Secondary:
    """What the rates that do not move the tip are used for, as rates of descent and ascent [1/s].

    Attributes:
        centring: Of joints to the middle of their range.
        manipulability: Of the volume of the Jacobian's ellipsoid.
    """

    centring: float = 0.0
    manipulability: float = 0.0


class Servo:
    """Joint rates for velocities of the tip.

    Args:
        world: Robot and obstacles; of one thread, as it is.
        method: "scaled" slows all joints together, so that the tip keeps its direction; "clipped" stops each joint at
            its own limit, so that the tip goes as far as it can.
        centring: Secondary task: how fast joints go to the middle of their range [1/s].
        manipulability: Secondary task: how fast the arm moves away from singular postures.
        near: Distance from which the arm approaches obstacles more slowly [m].
        kept: Distance that it does not go below [m].
        slide: Whether the arm, instead of slowing down, gives way along obstacles: the tip leaves its direction then.

    Raises:
        InputError: If an option is none, or ``kept`` is not less than ``near``.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("panda")
        >>> servo = rrtik.Servo(rrtik.World(robot), centring=0.5)
        >>> q = robot.posture("default")
        >>> for _ in range(10):
        ...     q = q + 0.01 * servo.step(q, [0.0, 0.0, 0.1, 0.0, 0.0, 0.0], 0.01)
    """

    def __init__(
        self,
        world: World,
        method: str = "scaled",
        *,
        centring: float = 0.0,
        manipulability: float = 0.0,
        near: float = 0.05,
        kept: float = 0.005,
        slide: bool = False,
    ) -> None:
        require(world, World, "world of a servo")
        self._world = world
        self._robot = world.robot
        self._method = one_of(METHODS, method, "method of a servo")
        self._tasks = Secondary(not_negative(centring, "centring"), not_negative(manipulability, "manipulability"))
        self._near = positive(near, "near")
        self._kept = not_negative(kept, "kept")
        if self._kept >= self._near:
            raise InputError(f"kept must be less than near, got {self._kept:g} and {self._near:g} m")
        require(slide, bool, "slide")
        self._slide = slide

        self._data = working_memory(self._robot.model)
        self._tip = self._robot.model.getFrameId(self._robot.tip)
        self._speed = np.where(np.isfinite(self._robot.velocity), self._robot.velocity, 1.0)
        low = self._robot.lower
        high = self._robot.upper
        self._middle = np.where(np.isfinite(low + high), 0.5 * (low + high), np.nan)
        self._ramp = np.eye(self._robot.dof) * STEP  # one joint moved a row
        self._slope: tuple[Vector, Vector] | None = None  # of the volume, and where

    def step(self, q: ArrayLike, twist: ArrayLike, dt: float) -> Vector:
        """Joint rates, shape (dof,) [rad/s or m/s], to be held for a time step.

        Args:
            q: The configuration now, shape (dof,); free, or the rates are 0.
            twist: Of the tip, in the axes of the world: linear [m/s], then angular [rad/s], shape (6,).
            dt: The time step [s].

        Raises:
            InputError: If one of them is not finite, or has another shape.
        """
        here = finite_array(q, (self._robot.dof,), "configuration of a servo")
        wanted = finite_array(twist, (6,), "twist of a servo")
        seconds = positive(dt, "time step of a servo")

        rates = self._apart(here, *self._for_twist(here, wanted), seconds)
        return self._proven(here, self._within_limits(here, rates, seconds), seconds)

    def _for_twist(self, q: Vector, twist: Vector) -> tuple[Vector, Vector]:
        """Rates that move the tip, and those of the secondary tasks that leave it where it is, shape (dof,) each."""
        left, sizes, right = np.linalg.svd(self._jacobian(q), full_matrices=False)
        low = float(sizes[-1])
        damping = (1.0 - (low / LEAST_SINGULAR) ** 2) * LEAST_SINGULAR**2 if low < LEAST_SINGULAR else 0.0
        # 1e-18, so that nothing is divided by 0 where the Jacobian vanishes
        rates = right.T @ ((sizes / (sizes**2 + damping + 1e-18)) * (left.T @ twist))

        wish = self._wish(q)
        return rates, wish - right.T @ (right @ wish)

    def _jacobian(self, q: Vector) -> Matrix:
        robot = self._robot
        pin.computeJointJacobians(robot.model, self._data, robot.pinocchio_configuration(q)[0])
        full = pin.getFrameJacobian(robot.model, self._data, self._tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        found: Matrix = full @ robot.chain.gain
        return found

    def _wish(self, q: Vector) -> Vector:
        """Rates of the secondary tasks, shape (dof,)."""
        centring = self._tasks.centring
        volume = self._tasks.manipulability
        if centring == 0.0 and volume == 0.0:
            return np.zeros_like(q)

        wish: Vector = np.nan_to_num(centring * (self._middle - q), nan=0.0)
        if volume > 0.0:
            wish = wish + volume * self._volume_slope(q)
        return wish

    def _volume_slope(self, q: Vector) -> Vector:
        """How the volume grows with each joint, shape (dof,); kept while the arm has hardly moved."""
        if self._slope is None or np.abs(q - self._slope[0]).max() > HARDLY:
            slope = (np.array([self._volume(q + step) for step in self._ramp]) - self._volume(q)) / STEP
            self._slope = (q.copy(), slope)
        return self._slope[1]

    def _volume(self, q: Vector) -> float:
        jacobian = self._jacobian(q)
        rows = jacobian @ jacobian.T if len(self._ramp) >= 6 else jacobian.T @ jacobian
        return float(np.sqrt(max(np.linalg.det(rows), 0.0)))

    def _apart(self, q: Vector, rates: Vector, wish: Vector, seconds: float) -> Vector:
        """Rates whose approach to the nearest body falls with the distance; the distance is a lower bound of it."""
        fast = self._world.fast
        whole = rates + wish
        if fast is None or not whole.any():
            return whole

        rows = np.vstack([q, q + self._ramp])
        lower = fast.clearance(self._robot.joint_values(rows)).lower
        here = float(lower[0])
        if not here < self._near or not np.isfinite(lower).all():
            return whole

        slope = (lower[1:] - here) / STEP
        share = max(here - self._kept, 0.0) / (self._near - self._kept)
        if slope @ wish < 0.0:  # the secondary task fades out in the outer half, and leaves the inner one to the tip
            whole = rates + max(2.0 * share - 1.0, 0.0) * wish

        allowed = -min(share * self._tip_speed(whole), 0.5 * max(here - self._kept, 0.0) / seconds)
        approach = float(slope @ whole)
        if approach >= allowed:
            return whole

        if self._slide:
            whole = whole + slope * ((allowed - approach) / max(float(slope @ slope), 1e-12))
        else:
            whole = whole * (allowed / approach)
        found: Vector = whole
        return found

    def _tip_speed(self, rates: Vector) -> float:
        return float(np.abs(rates) @ self._world.weights)

    def _within_limits(self, q: Vector, rates: Vector, seconds: float) -> Vector:
        """Rates within velocity limits, and such that no joint passes its range."""
        robot = self._robot
        brake = max(REACTION_SECONDS, seconds)
        most = np.minimum(self._speed, np.maximum(robot.upper - q, 0.0) / brake)
        least = np.maximum(-self._speed, np.minimum(robot.lower - q, 0.0) / brake)

        if self._method == "clipped":
            return np.clip(rates, least, most)
        bound = np.where(rates > 0.0, most, -least)
        share = np.min(np.divide(bound, np.abs(rates), out=np.ones_like(rates), where=np.abs(rates) > bound))
        scaled: Vector = rates * share
        return scaled

    def _proven(self, q: Vector, rates: Vector, seconds: float) -> Vector:
        """The rates, or the largest share of them with which the step is proven free; 0 if none is."""
        if not rates.any():
            return rates
        if self._world.motion_proven(q, q + seconds * rates):
            return rates

        ends = q + seconds * np.outer(SHARES, rates)
        proven = self._world.motions_proven(np.broadcast_to(q, ends.shape), ends)
        return rates * float(SHARES[proven.argmax()]) if proven.any() else np.zeros_like(rates)
