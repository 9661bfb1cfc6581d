"""Limit the tip and the torques along a motion: give the search along a curve its constraints, and measure motions.

Both limits are linear in the path acceleration u and the path speed squared x, as in [19]: torques by rigid-body
dynamics (Pinocchio [56]), the acceleration of the tip by its components in the plane in which it can lie.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, dimensions, finite_array, not_negative, positive
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import working_memory
from rrtik_ompl.kernels.reference.timing import Rows
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.trajectory.curve import Samples
from rrtik_ompl.motion.trajectory.fastest import MOST, Bounds

DIRECTIONS = 12  # directions in which the tip's acceleration is bounded; the polygon loses 0.9 % of the circle
ANGLES = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
# Distance of the polygon's sides from the centre, with its corners on the unit circle.
INSIDE = float(np.cos(0.5 * np.pi / DIRECTIONS))
LEAST_SPEED = 1e-12  # [m] per unit of the path; a slower tip has no defined direction
FASTEST_TIP = 20.0  # [m/s] A larger limit is taken for a mistake, such as one in millimetres.
HARDEST_TIP = 200.0  # [m/s^2] likewise for the acceleration


class Measured(NamedTuple):
    """What is measured of the arm in k states.

    Attributes:
        tip_velocities, tip_accelerations: Velocity and acceleration of the tip's origin, shape (k, 3) [m/s, m/s^2].
        torques: Torques or forces of the actuated joints by inverse dynamics, shape (k, n) [N m or N].
        holding: Torques or forces that hold the arm still in these configurations, shape (k, n) [N m or N].
    """

    tip_velocities: Matrix
    tip_accelerations: Matrix
    torques: Matrix
    holding: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class DynamicLimits:
    """Limits that depend on the configuration of the arm.

    Attributes:
        robot: The arm.
        tip_speed, tip_acceleration: Limits of the tip's origin [m/s, m/s^2]; inf for none.
        torque: Limits of the actuated joints, shape (n,) [N m or N]; inf for none.
        model: Pinocchio's model, with the payload.
    """

    robot: Robot
    tip_speed: float
    tip_acceleration: float
    torque: Vector
    model: Any

    @classmethod
    def of(
        cls,
        robot: Robot | None,
        *,
        tip_speed: float | None = None,
        tip_acceleration: float | None = None,
        torque: ArrayLike | bool | None = None,
        payload: float = 0.0,
    ) -> DynamicLimits | None:
        """Return the limits of an arm; None if nothing is limited.

        Args:
            robot: The arm.
            tip_speed: Largest speed of the tip's origin [m/s].
            tip_acceleration: Largest acceleration of the tip's origin [m/s^2].
            torque: One number, or one per joint [N m or N]; True for the efforts of the robot's description.
            payload: Mass at the tip's origin that the torques have to carry too [kg].

        Raises:
            InputError: If a limit is no number greater than 0, the robot has no inertias or no efforts, or a payload
                comes without torques.
        """
        if not isinstance(robot, Robot):
            raise InputError("limits of the tip and of torques need a robot: pass it as limits, or pass world=...")
        mass = not_negative(payload, "payload")
        limits = np.full(robot.dof, np.inf) if torque is None or torque is False else _torques(robot, torque)

        limits_torques = bool(np.isfinite(limits).any())
        if mass > 0.0 and not limits_torques:
            raise InputError("payload: it counts only for torques; give torque=True, or their limits")
        if not limits_torques and tip_speed is None and tip_acceleration is None:
            return None

        speed = _of_tip(tip_speed, "tip speed", "m/s", FASTEST_TIP)
        push = _of_tip(tip_acceleration, "tip acceleration", "m/s^2", HARDEST_TIP)
        return cls(robot, speed, push, limits, _loaded(robot, mass))

    @property
    def moves_torques(self) -> bool:
        """Return whether torques are limited."""
        return bool(np.isfinite(self.torque).any())

    def bounds(self, samples: Samples) -> Bounds:
        """Return the limits as constraints at places of a curve.

        Args:
            samples: Positions and derivatives of the curve at m places.

        Raises:
            InputError: If the torques do not suffice to hold the arm still somewhere.
        """
        unit = self.measured(samples.positions, samples.slopes, samples.bends)
        speeds = np.linalg.norm(unit.tip_velocities, axis=1)
        limits = Bounds.capped((self.tip_speed / np.maximum(speeds, LEAST_SPEED)) ** 2)
        if np.isfinite(self.tip_acceleration):
            limits = limits.and_also(self._tip_rows(unit))
        if self.moves_torques:
            slope_torques = self.measured(samples.positions, np.zeros_like(samples.slopes), samples.slopes).torques
            limits = limits.and_also(self._torque_rows(unit, slope_torques - unit.holding))
        return limits

    def slowing(self, positions: Matrix, velocities: Matrix, accelerations: Matrix) -> float:
        """Return the factor, 1 or more, by which a motion must be slowed to keep the limits at given states.

        Args:
            positions: Joint positions, shape (k, n).
            velocities: Joint velocities, shape (k, n).
            accelerations: Joint accelerations, shape (k, n).
        """
        state = self.measured(positions, velocities, accelerations)
        shares = [
            np.linalg.norm(state.tip_velocities, axis=1).max() / self.tip_speed,
            np.sqrt(np.linalg.norm(state.tip_accelerations, axis=1).max() / self.tip_acceleration),
        ]

        if self.moves_torques:
            moving_torques = state.torques - state.holding
            available_torques = np.where(moving_torques > 0.0, self.torque - state.holding, self.torque + state.holding)
            shares.append(np.sqrt(max((np.abs(moving_torques) / np.maximum(available_torques, 1e-300)).max(), 0.0)))

        factor = float(max(shares))
        return factor * (1.0 + 1e-12) if factor > 1.0 else 1.0

    def measured(self, positions: Matrix, velocities: Matrix, accelerations: Matrix) -> Measured:
        """Measure the tip and the torques in states of shape (k, n) each; torques are 0 unless they are limited."""
        rows = list(self._states(positions, velocities, accelerations))
        return Measured(*(np.array(column) for column in zip(*rows, strict=True)))

    def _states(self, *states: Matrix) -> Iterator[tuple[Vector, Vector, Vector, Vector]]:
        """Yield the tip's velocity and acceleration, the torques and the holding torques for each state."""
        model = self.model
        gain = self.robot.chain.gain
        data = working_memory(model)
        tip = model.getFrameId(self.robot.tip)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        no_torques = np.zeros(self.robot.dof)
        zero_rates = np.zeros(model.nv)
        configurations = self.robot.pinocchio_configuration(states[0])

        for q, v, a in zip(configurations, states[1] @ gain.T, states[2] @ gain.T, strict=True):
            torques = holding = no_torques
            if self.moves_torques:
                holding = gain.T @ pin.rnea(model, data, q, zero_rates, zero_rates)
                torques = gain.T @ pin.rnea(model, data, q, v, a)
            pin.forwardKinematics(model, data, q, v, a)
            pin.updateFramePlacement(model, data, tip)
            speed = pin.getFrameVelocity(model, data, tip, axes).linear.copy()
            push = pin.getFrameClassicalAcceleration(model, data, tip, axes).linear.copy()
            yield speed, push, torques, holding

    def _tip_rows(self, unit: Measured) -> Bounds:
        """Return the limit of the tip's acceleration as constraints.

        The acceleration p' u + p'' x of the tip lies in the plane of p' and p''. Its component in each of
        ``DIRECTIONS`` directions of that plane is bounded, so that it lies in a polygon inside the circle.

        Args:
            unit: Measured with joint velocities p' and accelerations p'' of the curve, so that the tip's velocity is
                its derivative.
        """
        slopes = unit.tip_velocities
        bends = unit.tip_accelerations
        slope_norms = np.linalg.norm(slopes, axis=1)
        directions = slopes / np.maximum(slope_norms, LEAST_SPEED)[:, None]
        along_bend = (bends * directions).sum(axis=1)
        across_bend = np.linalg.norm(bends - along_bend[:, None] * directions, axis=1)

        first = np.outer(slope_norms, np.cos(ANGLES))
        second = np.outer(along_bend, np.cos(ANGLES)) + np.outer(across_bend, np.sin(ANGLES))
        limit = np.full_like(first, INSIDE * self.tip_acceleration)

        cap = self.tip_acceleration / np.maximum(np.where(slope_norms < LEAST_SPEED, across_bend, 0.0), 1e-200)
        return Bounds(Rows(first, second, -limit, limit), np.minimum(cap, MOST))

    def _torque_rows(self, unit: Measured, along: Matrix) -> Bounds:
        """Return the torque limits as constraints; ``along`` has the torques per path acceleration, shape (m, n)."""
        high = self.torque - unit.holding
        low = -self.torque - unit.holding
        if (high <= 0.0).any() or (low >= 0.0).any():
            joint = int(((high <= 0.0) | (low >= 0.0)).any(axis=0).argmax())
            name = self.robot.joint_names[joint]
            need = np.abs(unit.holding[:, joint]).max()
            newtons = "N" if self.robot.prismatic[joint] else "N m"
            raise InputError(
                f"torque limits: joint '{name}' needs {need:.3g} {newtons} to hold the arm still on this path, its "
                f"limit is {self.torque[joint]:.3g} {newtons}; carry less, or choose another path"
            )

        is_limited = np.isfinite(self.torque)
        rows = Rows(*(part[:, is_limited] for part in (along, unit.torques - unit.holding, low, high)))
        return Bounds(rows, np.full(len(along), MOST))


def _of_tip(given: float | None, what: str, unit: str, most: float) -> float:
    """Check a limit of the tip and return it; inf if it is None."""
    if given is None:
        return np.inf
    number = positive(given, what)
    if number > most:
        raise InputError(
            f"{what}: {number:g} {unit} is beyond the {most:g} {unit} that an arm can reach; "
            f"for {number:g} mm{unit[1:]} give {number / 1e3:g}"
        )
    return number


def _torques(robot: Robot, torque: ArrayLike | bool) -> Vector:
    """Return the torque limits as one number per joint, shape (dof,), checked."""
    if sum(inertia.mass for inertia in robot.model.inertias) <= 0.0:
        raise InputError(f"torque limits: robot '{robot.name}' has no inertias; its description must give them")
    if torque is True:
        velocity_indices = [robot.model.joints[robot.model.getJointId(name)].idx_v for name in robot.joint_names]
        efforts: Vector = np.array(robot.model.upperEffortLimit, dtype=np.float64)[velocity_indices]
        if not np.isfinite(efforts).any():
            raise InputError(
                f"torque limits: robot '{robot.name}' states no efforts; its URDF needs them, or give torque=[...]"
            )
        return efforts

    written: Any = torque
    row = finite_array(
        written, () if dimensions(written) == 0 else (robot.dof,), f"torque limits of robot '{robot.name}'"
    )
    if (row <= 0.0).any():
        raise InputError(f"torque limits: expected numbers greater than 0, got {np.min(row):g}")
    return np.broadcast_to(row, (robot.dof,)).astype(np.float64)


def _loaded(robot: Robot, mass: float) -> pin.Model:
    """Return Pinocchio's model with a point mass [kg] added at the tip's origin."""
    if mass == 0.0:
        return robot.model
    model = robot.model.copy()
    tip = model.frames[model.getFrameId(robot.tip)]
    load = pin.Inertia(mass, tip.placement.translation, np.zeros((3, 3)))
    model.inertias[tip.parentJoint] = model.inertias[tip.parentJoint] + load
    return model
