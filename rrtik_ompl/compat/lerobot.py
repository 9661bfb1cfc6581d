"""LeRobot's ``RobotKinematics`` (github.com/huggingface/lerobot) without placo: kinematics in degrees.

``from lerobot.model.kinematics import RobotKinematics`` becomes
``from rrtik_ompl.compat.lerobot import RobotKinematics``; docs/compat.md says what differs.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, finite_array, not_negative
from rrtik_ompl.base.choices import FrameAxis
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.lazy import guided
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.compat.joints import Joints, joints_of
from rrtik_ompl.files.kinds import FilePath
from rrtik_ompl.files.text import file_name
from rrtik_ompl.model.robot import pinocchio_rows

__all__ = ["RobotKinematics"]

AXES = {"x": 0, "y": 1, "z": 2}
MOST_STEPS = 60
LARGEST_STEP = 0.5  # [rad or m] of a joint; the nearest solution is wanted, not one behind a leap
CONVERGED = 1e-7  # [rad or m] step below which the search ends
DAMPING = 1e-9  # share of the largest diagonal element
MOST_DAMPING = 1e6


class RobotKinematics:
    """LeRobot's kinematics of an arm: the frame of its gripper for motor positions in degrees, and back.

    Angles are in degrees, sliding joints in metres, poses are matrices, shape (4, 4), relative to the base of the URDF.

    Attributes:
        target_frame_name: The frame, a link of the URDF.
        joint_names: Names of the joints, in the order of all arguments and results.

    Args:
        urdf_path: The arm's URDF.
        target_frame_name: Name of the frame.
        joint_names: Names of the joints; all that move and follow no other, in the order of the tree, if None.
        free_axis: "x", "y" or "z": the axis of the frame about which its orientation does not matter, for arms of five
            joints; None if all of it matters.

    Raises:
        InputError: If the file cannot be read.
        UnknownNameError: If it has no such joint or frame.

    Example:
        >>> from importlib.resources import files
        >>> from rrtik_ompl.compat.lerobot import RobotKinematics
        >>> arm = RobotKinematics(files("rrtik_robots.titan4") / "titan4.urdf", "grip_point")
        >>> there = arm.forward_kinematics(np.array([10.0, 20.0, -80.0, 60.0, 5.0, 7.0]))
        >>> arm.inverse_kinematics([0.0, 15.0, -70.0, 50.0, 0.0, 0.0], there).round(3).tolist()
        [10.0, 20.0, -80.0, 60.0, 5.0, 7.0]
    """

    def __init__(
        self,
        urdf_path: FilePath,
        target_frame_name: str = "gripper_frame_link",
        joint_names: Sequence[str] | None = None,
        *,
        free_axis: FrameAxis | None = None,
    ) -> None:
        file = file_name(urdf_path)
        if not os.path.isfile(file):
            raise InputError(f"kinematics: there is no file {file}")
        if free_axis is not None and free_axis not in AXES:
            raise UnknownNameError("axis of a frame", str(free_axis), AXES)
        joints: Joints = joints_of(file, None, "", tuple(joint_names or ()), ())
        if target_frame_name not in joints.links:
            raise UnknownNameError("link", target_frame_name, joints.links, where=str(file))

        self.target_frame_name = target_frame_name
        own = [name for name in joints.names if name not in joints.followers]
        self.joint_names = own if joint_names is None else list(joint_names)
        for name in self.joint_names:
            if name in joints.followers:
                source = joints.followers[name].source
                raise InputError(f"kinematics: joint '{name}' follows '{source}'; name that one in joint_names")

        robot = joints.whole
        self.robot = robot
        self._free_axis = None if free_axis is None else AXES[free_axis]
        self._columns = np.array([robot.joint_names.index(name) for name in self.joint_names])
        self._rest = np.where((robot.lower <= 0.0) & (robot.upper >= 0.0), 0.0, robot.clamp(np.zeros(robot.dof)))
        self._lower = robot.lower[self._columns]
        self._upper = robot.upper[self._columns]
        self._per_unit = np.where(robot.prismatic[self._columns], 1.0, np.pi / 180.0)
        self._gain = np.ascontiguousarray(robot.chain.gain[:, self._columns])
        self._data = robot.model.createData()
        self._frame = robot.model.getFrameId(target_frame_name, pin.FrameType.BODY)

    def forward_kinematics(self, joint_pos_deg: ArrayLike) -> Matrix:
        """Return T_base_frame, shape (4, 4), for positions [deg or m], shape (n or more,); what follows is ignored.

        Raises:
            InputError: If there are too few numbers, or one is not finite.
        """
        q, _ = self._positions(joint_pos_deg, "joint_pos_deg")
        return np.array(self._pose(q).homogeneous)

    def inverse_kinematics(
        self,
        current_joint_pos: ArrayLike,
        desired_ee_pose: ArrayLike,
        position_weight: float = 1.0,
        orientation_weight: float = 0.01,
    ) -> Vector:
        """Find the positions near the current ones at which the frame is as near as can be to a pose, by least squares.

        Where the pose can be reached, the weights make no difference; where it cannot, they say what matters more: the
        sum of the squared distance [m] and the squared angle [rad], each times its weight, is least within the limits.

        Args:
            current_joint_pos: Current positions [deg or m], shape (n or more,).
            desired_ee_pose: Wanted T_base_frame, shape (4, 4).
            position_weight: Weight of the position.
            orientation_weight: Weight of the orientation; 0 for the position alone.

        Returns:
            Positions [deg or m]; numbers behind the first n, such as the gripper's, are those that were given.

        Raises:
            InputError: If a number is not finite or negative, there are too few, or the pose is none.
        """
        start, given = self._positions(current_joint_pos, "current_joint_pos")
        goal = rigid(desired_ee_pose, "desired_ee_pose")
        weights = [
            not_negative(position_weight, "position_weight"),
            not_negative(orientation_weight, "orientation_weight"),
        ]
        q = self._nearest(np.minimum(np.maximum(start, self._lower), self._upper), goal, np.sqrt(weights))
        result: Vector = given.copy()
        result[: len(q)] = q / self._per_unit
        return result

    def _nearest(self, q: Vector, goal: pin.SE3, scales: Vector) -> Vector:
        """Minimise the weighted errors from q, within the limits, by damped Gauss-Newton steps of the free joints."""
        error, jacobian = self._errors(q, goal, scales)
        cost = float(error @ error)
        damping = DAMPING
        for _ in range(MOST_STEPS):
            pull = jacobian.T @ error
            free = ~self._at_limit(q, pull)
            square = jacobian[:, free].T @ jacobian[:, free]
            largest = float(square.diagonal().max(initial=0.0))
            if largest == 0.0:
                break
            square[np.diag_indices_from(square)] += damping * largest
            step = np.zeros(len(q))
            step[free] = np.linalg.solve(square, pull[free])
            step *= min(1.0, LARGEST_STEP / max(float(np.abs(step).max()), 1e-300))

            candidate = np.minimum(np.maximum(q + step, self._lower), self._upper)
            moved = float(np.abs(candidate - q).max())
            new_error, new_jacobian = self._errors(candidate, goal, scales)
            new_cost = float(new_error @ new_error)
            if new_cost <= cost:
                q = candidate
                error = new_error
                jacobian = new_jacobian
                cost = new_cost
                damping = max(0.1 * damping, DAMPING)
                if moved < CONVERGED:
                    break
            elif damping > MOST_DAMPING or moved < CONVERGED:
                break
            else:
                damping = max(10.0 * damping, 1e-4)
        return q

    def _at_limit(self, q: Vector, pull: Vector) -> Mask:
        """Return which joints are at a limit and pulled beyond it, shape (n,)."""
        outside: Mask = ((q <= self._lower) & (pull < 0.0)) | ((q >= self._upper) & (pull > 0.0))
        return outside

    def _errors(self, q: Vector, goal: pin.SE3, scales: Vector) -> tuple[Vector, Matrix]:
        """Return the weighted errors of position and orientation in world axes, shape (6,), and what reduces them.

        The second value is the Jacobian of the frame, weighted likewise, shape (6, n).
        """
        pose = self._pose(q)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self.robot.model, self._data, self._full, self._frame, axes) @ self._gain
        if self._free_axis is None:
            turn = pin.log3(goal.rotation @ pose.rotation.T)
        else:
            turn = _turn_between(pose.rotation[:, self._free_axis], goal.rotation[:, self._free_axis])
            axis = pose.rotation[:, self._free_axis]
            jacobian[3:] -= np.outer(axis, axis @ jacobian[3:])
        jacobian[:3] *= scales[0]
        jacobian[3:] *= scales[1]
        return np.concatenate([scales[0] * (goal.translation - pose.translation), scales[1] * turn]), jacobian

    def _pose(self, q: Vector) -> pin.SE3:
        """Return T_base_frame for positions [rad or m], shape (n,)."""
        values = self._rest.copy()
        values[self._columns] = q
        self._full = pinocchio_rows(self.robot, values[None])[0]
        pin.forwardKinematics(self.robot.model, self._data, self._full)
        return pin.updateFramePlacement(self.robot.model, self._data, self._frame)

    def _positions(self, given: ArrayLike, what: str) -> tuple[Vector, Vector]:
        """Return positions of the joints [rad or m], shape (n,), and all numbers that were given."""
        values = finite_array(given, (None,), what)
        count = len(self.joint_names)
        if len(values) < count:
            raise InputError(f"{what}: expected {count} numbers ({', '.join(self.joint_names)}), got {len(values)}")
        return values[:count] * self._per_unit, values


def _turn_between(current: Vector, wanted: Vector) -> Vector:
    """Return the least turn from one unit vector to another as a rotation vector [rad], shape (3,)."""
    normal = np.cross(current, wanted)
    sine = float(np.linalg.norm(normal))
    cosine = float(current @ wanted)
    if sine < 1e-12:
        if cosine > 0.0:
            return np.zeros(3)
        normal = np.cross(current, np.eye(3)[int(np.argmin(np.abs(current)))])  # opposite: any axis across it
        sine = float(np.linalg.norm(normal))
        return np.asarray(np.pi * normal / sine)
    return np.asarray(np.arctan2(sine, cosine) * normal / sine)


guided(RobotKinematics)
