"""Lead the tip over the last centimetres to a target by what the camera sees of it, until the tip is there.

With "position", the tip moves straight to the pose that the target's markers give. With "image", points of the gripper
move straight to their goals in the picture, by the interaction matrix; calibration errors that shift both in the same
way cancel. The camera is fixed to the arm's base. The arm stops if the target is no longer seen, or jumps.
Source: [1, ch. 2.2].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, positive
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.poses import apart, rigid
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.following.servo import Servo

ServoMethod: TypeAlias = Literal["position", "image"]
ServoState: TypeAlias = Literal["moving", "done", "lost", "jumped", "blocked"]
HALF_SIDE = 0.05  # [m] half the side of the square of points at the tip that "image" uses
MIN_DEPTH = 0.05  # [m] Points nearer to the camera than this are not visible.
STILL = 1e-4  # [rad/s or m/s] An arm whose joints are all slower than this counts as standing.


@dataclass(frozen=True, slots=True, eq=False)
class ServoStep:
    """The command for one time step.

    Attributes:
        rates: Joint rates, shape (dof,) [rad/s or m/s].
        state: "moving", "done", or why the arm stands: "lost", "jumped", "blocked".
        away: Distance of the tip from its goal, by the last sighting [m]; inf if there was none.
        turned: Angle of the rotation to the goal [rad]; inf if there was no sighting.
    """

    rates: Vector
    state: ServoState
    away: float
    turned: float


def interaction_matrix(points: ArrayLike, depths: ArrayLike) -> Matrix:
    """Return the matrix L by which points in a picture move with the camera: ``d points = L @ twist``.

    Args:
        points: Image coordinates x / z and y / z in the frame of the camera, shape (n, 2).
        depths: Depth z of each point, above 0, shape (n,) [m].

    Returns:
        Matrix of shape (2 n, 6); rows 2 k and 2 k + 1 belong to point k. Its columns are for a twist of the camera in
        its own frame: linear [m/s], then angular [rad/s].

    Raises:
        InputError: If shapes do not fit, or a depth is not above 0.

    Example:
        >>> interaction_matrix([[0.0, 0.0]], [2.0])[0].tolist()
        [-0.5, 0.0, 0.0, 0.0, -1.0, 0.0]
    """
    image_points = finite_array(points, (None, 2), "points")
    z = finite_array(depths, (len(image_points),), "depths")
    if (z <= 0.0).any():
        raise InputError(f"depths must be above 0, got {z.min():g}")
    x, y = image_points.T
    zeros = np.zeros(len(image_points))
    across = np.stack([-1.0 / z, zeros, x / z, x * y, -(1.0 + x * x), y], axis=1)
    down = np.stack([zeros, -1.0 / z, y / z, 1.0 + y * y, -x * y, -x], axis=1)
    return np.stack([across, down], axis=1).reshape(-1, 6)


class VisualServo:
    """Leads the tip to a target that the camera sees.

    Args:
        servo: Converts velocities of the tip to joint rates: within limits, away from obstacles, proven free.
        robot: The arm.
        method: "position" or "image", see the head of this module.
        T_base_camera: Pose of the camera; required for "image".
        gain: Share of the error that is removed per second [1/s].
        speed: Largest speed of the tip [m/s].
        turn: Largest angular speed of the tip [rad/s].
        patience: How long the arm continues to the last seen goal without a sighting [s].

    Raises:
        InputError: If an option is not valid, or "image" has no camera.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("panda")
        >>> servo = rrtik.following.Servo(rrtik.World(robot))
        >>> q, leading = robot.posture("default"), rrtik.following.VisualServo(servo, robot)
        >>> seen = robot.fk(q) * rrtik.pose([0.0, 0.0, 0.02])
        >>> for _ in range(200):
        ...     q = q + 0.02 * leading.step(q, seen, 0.02).rates
        >>> leading.step(q, seen, 0.02).state
        'done'
    """

    def __init__(
        self,
        servo: Servo,
        robot: Robot,
        method: str = "position",
        *,
        T_base_camera: ArrayLike | pin.SE3 | None = None,
        gain: float = 2.0,
        speed: float = 0.05,
        turn: float = 0.5,
        patience: float = 0.15,
    ) -> None:
        require(servo, Servo, "servo")
        self._servo = servo
        self._robot = robot
        self._method = one_of(get_args(ServoMethod), method, "method of visual servoing")
        if self._method == "image" and T_base_camera is None:
            raise InputError("visual servoing by 'image' needs T_base_camera, the pose of the camera")
        self._camera = None if T_base_camera is None else rigid(T_base_camera, "pose of the camera")

        self._gain = positive(gain, "gain")
        self._speed = positive(speed, "speed")
        self._turn = positive(turn, "turn")
        self._patience = positive(patience, "patience")

        self.near = 5e-4  # [m] distance within which the tip has arrived
        self.aligned = np.deg2rad(0.1)  # [rad] angle within which the tip has arrived
        self.jump = 0.03  # [m] largest change from one sighting to the next; more is taken for an error

        self._goal: pin.SE3 | None = None  # goal of the tip by the last sighting
        self._unseen = 0.0  # [s] time since the last sighting

    def go_on_with(self, servo: Servo) -> None:
        """Continue to the same target with another servo, after the world has changed; the last sighting is kept."""
        require(servo, Servo, "servo")
        self._servo = servo

    def step(self, q: ArrayLike, seen: ArrayLike | pin.SE3 | None, dt: float) -> ServoStep:
        """Return the joint rates for a time step.

        Args:
            q: The current configuration, shape (dof,).
            seen: Goal pose of the tip by the current picture, ``T_base_tip``; None if the target is not in it.
            dt: The time step [s].

        Raises:
            InputError: If one of them is not valid.
        """
        configuration = self._robot.configuration(q, "configuration")
        seconds = positive(dt, "time step")
        state = self._take_sighting(None if seen is None else rigid(seen, "where the tip shall be"), seconds)
        tip = self._robot.fk(configuration)
        goal = self._goal
        no_rates = np.zeros(self._robot.dof)

        if goal is None:
            return ServoStep(no_rates, "lost", np.inf, np.inf)
        away, turned = apart(tip, goal)
        if state != "moving":
            return ServoStep(no_rates, state, away, turned)
        if away <= self.near and turned <= self.aligned:
            return ServoStep(no_rates, "done", away, turned)

        rates = self._servo.step(configuration, self._within_speeds(self._twist(tip, goal)), seconds)
        return ServoStep(rates, "moving" if np.abs(rates).max() > STILL else "blocked", away, turned)

    def _take_sighting(self, seen: pin.SE3 | None, seconds: float) -> ServoState:
        """Record a sighting, or that there was none.

        Returns:
            "moving" while the goal is known, otherwise why the arm must stand.
        """
        if seen is None:
            self._unseen += seconds
            return "moving" if self._unseen <= self._patience else "lost"

        last_goal = self._goal
        self._unseen = 0.0
        if last_goal is not None and np.linalg.norm(seen.translation - last_goal.translation) > self.jump:
            return "jumped"
        self._goal = seen
        return "moving"

    def _twist(self, tip: pin.SE3, goal: pin.SE3) -> Vector:
        """Return the velocity of the tip in the axes of the base, shape (6,): linear [m/s], then angular [rad/s]."""
        if self._method == "position" or self._camera is None:
            turning = tip.rotation @ pin.log3(tip.rotation.T @ goal.rotation)
            return self._gain * np.concatenate([goal.translation - tip.translation, turning])

        camera = self._camera
        tip_corners, goal_corners = (_square(camera.actInv(T)) for T in (tip, goal))
        if min(tip_corners[:, 2].min(), goal_corners[:, 2].min()) < MIN_DEPTH:
            return np.zeros(6)
        error = (tip_corners[:, :2] / tip_corners[:, 2:] - goal_corners[:, :2] / goal_corners[:, 2:]).ravel()
        matrix_at_tip, matrix_at_goal = (
            interaction_matrix(corners[:, :2] / corners[:, 2:], corners[:, 2])
            for corners in (tip_corners, goal_corners)
        )
        # A twist of the gripper moves its points by -L, so the error is not negated.
        camera_twist = self._gain * np.linalg.lstsq(0.5 * (matrix_at_tip + matrix_at_goal), error, rcond=None)[0]

        angular = camera_twist[3:]
        velocity = camera_twist[:3] + np.cross(angular, camera.actInv(tip).translation)
        return np.concatenate([camera.rotation @ velocity, camera.rotation @ angular])

    def _within_speeds(self, twist: Vector) -> Vector:
        """Scale a twist down, in the same direction, to keep the speed limits of the tip."""
        linear = float(np.linalg.norm(twist[:3])) / self._speed
        angular = float(np.linalg.norm(twist[3:])) / self._turn
        return twist / max(linear, angular, 1.0)


def _square(T: pin.SE3) -> Matrix:
    """Return four points at the tip in the frame of the camera, shape (4, 3) [m]."""
    corners = HALF_SIDE * np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    return np.asarray(corners @ T.rotation.T + T.translation)
