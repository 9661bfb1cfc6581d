"""Steer the tip by its velocity: joint rates for a twist, within limits, away from obstacles, proven free.

The rates are those of damped least squares [22]; the remaining freedom serves a secondary task. Near obstacles the rate
of approach decreases with the distance (a velocity damper): the secondary task yields first, then all joints are slowed
together, so that the tip keeps its direction. A step that cannot be proven free is shortened.
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
DAMPED_BELOW = 0.05  # smallest singular value of the Jacobian [m or 1] below which rates are damped
STEP = 1e-3  # [rad] or [m] step of difference quotients; not smaller, as distances have single precision
SLOPE_VALID_WITHIN = 0.03  # [rad] or [m] that a joint may move before the gradient of the volume is computed again
SHARES = np.array([0.5, 0.25, 0.1])  # shares of a step; the first one that is proven free is taken
REACTION_SECONDS = 0.1  # [s] No joint is so fast that it would reach its limit sooner than this.


@dataclass(frozen=True, slots=True)
class Secondary:
    """Gains of the secondary tasks, which use the rates that do not move the tip.

    Attributes:
        centring: How fast joints move to the middle of their range [1/s].
        manipulability: How fast the arm increases the volume of the Jacobian's ellipsoid.
    """

    centring: float = 0.0
    manipulability: float = 0.0


class Servo:
    """Computes joint rates for velocities of the tip.

    Args:
        world: Robot and obstacles; used by one thread only.
        method: "scaled" slows all joints together, so that the tip keeps its direction; "clipped" limits each joint by
            itself, so that the tip goes as far as it can.
        centring: Secondary task: how fast joints move to the middle of their range [1/s].
        manipulability: Secondary task: how fast the arm moves away from singular configurations.
        near: Distance below which the arm approaches obstacles more slowly [m].
        kept: Distance from obstacles that is kept [m].
        slide: Whether the arm gives way along obstacles instead of slowing down; the tip then leaves its direction.

    Raises:
        InputError: If an option is not valid, or ``kept`` is not less than ``near``.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("panda")
        >>> servo = rrtik.following.Servo(rrtik.World(robot), centring=0.5)
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
        self._slowdown_distance = positive(near, "near")
        self._min_distance = not_negative(kept, "kept")
        if self._min_distance >= self._slowdown_distance:
            raise InputError(
                f"kept must be less than near, got {self._min_distance:g} and {self._slowdown_distance:g} m"
            )
        require(slide, bool, "slide")
        self._slide = slide

        self._data = working_memory(self._robot.model)
        self._tip = self._robot.model.getFrameId(self._robot.tip)
        self._max_rates = np.where(np.isfinite(self._robot.velocity), self._robot.velocity, 1.0)
        low = self._robot.lower
        high = self._robot.upper
        self._mid_range = np.where(np.isfinite(low + high), 0.5 * (low + high), np.nan)
        self._joint_steps = np.eye(self._robot.dof) * STEP  # for difference quotients: one joint moved in each row
        # Configuration at which the gradient of the volume was computed last, and that gradient.
        self._volume_slope_at: tuple[Vector, Vector] | None = None

    def step(self, q: ArrayLike, twist: ArrayLike, dt: float) -> Vector:
        """Return joint rates to be held for a time step, shape (dof,) [rad/s or m/s].

        Args:
            q: The current configuration, shape (dof,); if it is not free, the rates are 0.
            twist: Velocity of the tip in the axes of the world, shape (6,): linear [m/s], then angular [rad/s].
            dt: The time step [s].

        Raises:
            InputError: If an argument is not finite or has another shape.
        """
        configuration = finite_array(q, (self._robot.dof,), "configuration of a servo")
        tip_velocity = finite_array(twist, (6,), "twist of a servo")
        seconds = positive(dt, "time step of a servo")

        rates = self._damped_approach(configuration, *self._rates_for_twist(configuration, tip_velocity), seconds)
        return self._proven_free(configuration, self._within_limits(configuration, rates, seconds), seconds)

    def _rates_for_twist(self, q: Vector, twist: Vector) -> tuple[Vector, Vector]:
        """Compute rates that move the tip, by damped least squares, and rates of the secondary tasks in the null space.

        Args:
            q: The configuration, shape (dof,).
            twist: Velocity of the tip, shape (6,).

        Returns:
            Both of shape (dof,); the second ones do not move the tip.
        """
        U, singular_values, Vt = np.linalg.svd(self._jacobian(q), full_matrices=False)
        smallest = float(singular_values[-1])
        damping = (1.0 - (smallest / DAMPED_BELOW) ** 2) * DAMPED_BELOW**2 if smallest < DAMPED_BELOW else 0.0
        # The 1e-18 avoids a division by 0 where the Jacobian vanishes.
        rates = Vt.T @ ((singular_values / (singular_values**2 + damping + 1e-18)) * (U.T @ twist))

        secondary = self._secondary_rates(q)
        return rates, secondary - Vt.T @ (Vt @ secondary)

    def _jacobian(self, q: Vector) -> Matrix:
        """Return the Jacobian of the tip in the axes of the world, shape (6, dof)."""
        robot = self._robot
        pin.computeJointJacobians(robot.model, self._data, robot.pinocchio_configuration(q)[0])
        model_jacobian = pin.getFrameJacobian(
            robot.model, self._data, self._tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        jacobian: Matrix = model_jacobian @ robot.chain.gain
        return jacobian

    def _secondary_rates(self, q: Vector) -> Vector:
        """Return the rates of the secondary tasks, shape (dof,), before they are projected into the null space."""
        centring = self._tasks.centring
        manipulability = self._tasks.manipulability
        if centring == 0.0 and manipulability == 0.0:
            return np.zeros_like(q)

        rates: Vector = np.nan_to_num(centring * (self._mid_range - q), nan=0.0)
        if manipulability > 0.0:
            rates = rates + manipulability * self._volume_slope(q)
        return rates

    def _volume_slope(self, q: Vector) -> Vector:
        """Return the gradient of the volume of the Jacobian's ellipsoid, shape (dof,).

        It is computed by difference quotients, and reused while the arm has hardly moved.
        """
        if self._volume_slope_at is None or np.abs(q - self._volume_slope_at[0]).max() > SLOPE_VALID_WITHIN:
            slope = (np.array([self._volume(q + step) for step in self._joint_steps]) - self._volume(q)) / STEP
            self._volume_slope_at = (q.copy(), slope)
        return self._volume_slope_at[1]

    def _volume(self, q: Vector) -> float:
        """Return the volume of the Jacobian's ellipsoid at a configuration: the product of its singular values."""
        jacobian = self._jacobian(q)
        rows = jacobian @ jacobian.T if len(self._joint_steps) >= 6 else jacobian.T @ jacobian
        return float(np.sqrt(max(np.linalg.det(rows), 0.0)))

    def _damped_approach(self, q: Vector, rates: Vector, secondary: Vector, seconds: float) -> Vector:
        """Limit rates by a velocity damper: the approach to the nearest body becomes slower as the distance decreases.

        The distance is a lower bound, and its gradient comes from difference quotients. Near obstacles the secondary
        task is reduced first; if the distance still decreases too fast, all rates are scaled or, with ``slide``, the
        approaching part is removed.

        Args:
            q: The configuration, shape (dof,).
            rates: Rates that move the tip, shape (dof,).
            secondary: Rates of the secondary tasks, shape (dof,).
            seconds: The time step [s].

        Returns:
            The rates, shape (dof,).
        """
        tables = self._world.checks.checker.fast  # in numpy where there are no kernels
        combined = rates + secondary
        if not combined.any():
            return combined

        rows = np.vstack([q, q + self._joint_steps])
        lower_bounds = tables.clearance(self._robot.joint_values(rows)).lower
        distance = float(lower_bounds[0])
        if not distance < self._slowdown_distance or not np.isfinite(lower_bounds).all():
            return combined

        gradient = (lower_bounds[1:] - distance) / STEP
        speed_share = max(distance - self._min_distance, 0.0) / (self._slowdown_distance - self._min_distance)
        if gradient @ secondary < 0.0:
            # The secondary task fades out in the outer half of the zone; in the inner half only the tip's task remains.
            combined = rates + max(2.0 * speed_share - 1.0, 0.0) * secondary

        half_way_a_step = 0.5 * max(distance - self._min_distance, 0.0) / seconds
        min_distance_rate = -min(speed_share * self._tip_speed(combined), half_way_a_step)
        distance_rate = float(gradient @ combined)
        if distance_rate >= min_distance_rate:
            return combined

        if self._slide:
            combined = combined + gradient * (
                (min_distance_rate - distance_rate) / max(float(gradient @ gradient), 1e-12)
            )
        else:
            combined = combined * (min_distance_rate / distance_rate)
        limited: Vector = combined
        return limited

    def _tip_speed(self, rates: Vector) -> float:
        """Return a bound on the speed of any point of the arm [m/s]."""
        return float(np.abs(rates) @ self._world.weights)

    def _within_limits(self, q: Vector, rates: Vector, seconds: float) -> Vector:
        """Limit rates to the velocity limits, and such that no joint leaves its range."""
        robot = self._robot
        braking_seconds = max(REACTION_SECONDS, seconds)
        upper = np.minimum(self._max_rates, np.maximum(robot.upper - q, 0.0) / braking_seconds)
        lower = np.maximum(-self._max_rates, np.minimum(robot.lower - q, 0.0) / braking_seconds)

        if self._method == "clipped":
            return np.clip(rates, lower, upper)
        bound = np.where(rates > 0.0, upper, -lower)
        scale = np.min(np.divide(bound, np.abs(rates), out=np.ones_like(rates), where=np.abs(rates) > bound))
        scaled: Vector = rates * scale
        return scaled

    def _proven_free(self, q: Vector, rates: Vector, seconds: float) -> Vector:
        """Return the rates, or the largest share of them for which the step is proven free; zeros if there is none."""
        if not rates.any():
            return rates
        if self._world.motion_proven(q, q + seconds * rates):
            return rates

        ends = q + seconds * np.outer(SHARES, rates)
        is_proven = self._world.motions_proven(np.broadcast_to(q, ends.shape), ends)
        return rates * float(SHARES[is_proven.argmax()]) if is_proven.any() else np.zeros_like(rates)
