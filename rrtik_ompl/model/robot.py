"""The arm: a Pinocchio [56] model with its geometry, limits, named postures and tip frame. It is immutable.

Methods of :class:`Robot` validate their arguments. Code inside the library calls the functions of this module and the
methods of :class:`Chain`, which expect valid rows: float64, shape (m, dof).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from threading import get_ident
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, allocated, finite_array, finite_number, in_blocks, number_rows
from rrtik_ompl.base.copies import as_value, itself
from rrtik_ompl.base.errors import InputError, PathWarning, UnknownNameError, require
from rrtik_ompl.base.kept import Keeper, kept_with
from rrtik_ompl.base.poses import MOST_MOVING, PoseLike, cross_products, joint_motions
from rrtik_ompl.base.units import shown_unit
from rrtik_ompl.files.kinds import FilePath, read

FEW = 16  # number of configurations up to which Pinocchio is faster than numpy
PER_RADIAN = 0.5  # [reach/rad] weight of rotations in tip distances: two radians count as much as the whole reach
LIMIT_TOLERANCE = 1e-5  # [rad] or [m] tolerance of joint limits, as URDF files often write pi with six digits


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """The kinematic tree as plain arrays, one row per Pinocchio joint 1..n, parents first.

    Attributes:
        parent: Row of the parent joint, -1 for the world, shape (n,).
        placement: Fixed transform from the parent joint's frame to this joint's frame at zero, shape (n, 4, 4).
        axis: Unit axis in the joint's own frame, shape (n, 3).
        prismatic: True for prismatic joints, shape (n,).
        gain: Joint value of the model = gain @ q + offset (mimic joints have a gain other than 1), shape (n, dof).
        offset: See ``gain``, shape (n,).
    """

    parent: NDArray[np.int64]
    placement: NDArray[np.float64]
    axis: Matrix
    prismatic: Mask
    gain: Matrix
    offset: Vector

    __reduce__ = as_value

    def joint_values(self, rows: Matrix) -> Matrix:
        """Compute the values of all joints, including mimic joints, for configurations: (m, dof) -> (m, n)."""
        return np.asarray(rows @ self.gain.T + self.offset)

    def joint_frames(self, rows: Matrix) -> NDArray[np.float64]:
        """Compute the poses of all joint frames, world first, for configurations: (m, dof) -> (m, n + 1, 4, 4)."""
        motions = joint_motions(self.axis, self.prismatic, self.joint_values(rows))
        frames = allocated((len(rows), len(self.parent) + 1, 4, 4))
        frames[:, 0] = np.eye(4)
        for k, parent in enumerate(self.parent):
            frames[:, k + 1] = frames[:, parent + 1] @ self.placement[k] @ motions[:, k]
        return frames

    def whole_turns(self) -> Mask:
        """Return which actuated joints leave all links where they are if they turn by a whole turn, shape (dof,)."""
        turning = ~self.prismatic[:, None] & (self.gain == np.rint(self.gain))
        return np.asarray((turning | (self.gain == 0.0)).all(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Robot(Keeper):
    """An immutable arm. A configuration ``q`` has one number per actuated joint: radians, or metres if prismatic.

    Continuous joints have infinite limits and any real number as a value. The values q and q + 2 pi are the same
    posture (mimic joints of such a joint make whole turns too), and a straight motion between two values turns by their
    difference.

    Attributes:
        name: Name used in messages and files.
        joint_names: Names of the actuated joints, in the order of q.
        movable: Names of all joints of the description that are not fixed: actuated, mimic and locked ones.
        lower, upper: Position limits [rad or m], shape (dof,), -inf and +inf for continuous joints.
        velocity, acceleration, jerk: Limits [rad/s, rad/s^2, rad/s^3 or m], shape (dof,), inf where unknown.
        prismatic, continuous: Which joints are prismatic, and which revolute without limits, shape (dof,).
        tip: Name of the frame that goals refer to.
        tips: The tips of all arms that move, ``tip`` first; a `MultiGoal` has a goal for each that it names.
        postures: Named configurations, shape (dof,) each.
        allowed_collisions: Pairs of link names that are never checked against each other.
        checked_collisions: Pairs of link names that are checked although a joint connects them.
        unchecked_solids: Pairs of names of solids of ``collision`` that are never checked against each other.
        model, collision: Pinocchio's model and geometry; do not change them.
        looks: Loads ``visual``.
        closed_form: The robot's own inverse kinematics, if it has one.
        gripper: The joints that open and close its gripper, `rrtik_ompl.model.gripper.GripperJoints`, or None.
        padding, joint_weights: By name; options of :func:`rrtik_ompl.load_robot`.

    Example:
        >>> robot = rrtik.load_robot("planar3")
        >>> robot.dof, robot.fk([0.0, 0.0, 0.0]).translation
        (3, array([3., 0., 0.]))
    """

    name: str
    joint_names: tuple[str, ...]
    movable: frozenset[str]
    lower: Vector
    upper: Vector
    velocity: Vector
    acceleration: Vector
    jerk: Vector
    prismatic: Mask
    continuous: Mask
    tip: str
    postures: Mapping[str, Vector]
    allowed_collisions: frozenset[frozenset[str]]
    model: Any
    collision: Any
    looks: Callable[[], pin.GeometryModel]
    chain: Chain
    self_collision: bool = True
    checked_collisions: frozenset[frozenset[str]] = frozenset()
    unchecked_solids: frozenset[frozenset[str]] = frozenset()
    closed_form: Callable[..., Any] | None = None
    gripper: Any = None
    planar: bool = False
    tips: tuple[str, ...] = ()
    padding: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    joint_weights: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    source: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    __deepcopy__ = itself

    def __repr__(self) -> str:
        return f"Robot('{self.name}', {self.dof} joints: {', '.join(self.joint_names)}; tip '{self.tip}')"

    @staticmethod
    def load(
        file: FilePath,
        *,
        tip: str | None = None,
        group: str | None = None,
        joints: Iterable[str] | None = None,
        locked: Mapping[str, float] | None = None,
        gripper: Mapping[str, Mapping[str, float]] | None = None,
        base_pose: PoseLike | Mapping[str, Sequence[float]] | None = None,
        padding: float | Mapping[str, float] | None = None,
        scale: Mapping[str, float] | None = None,
        joint_ranges: Mapping[str, Sequence[float]] | None = None,
        joint_weights: Mapping[str, float] | None = None,
        srdf: FilePath | None = None,
        urdf: FilePath | None = None,
        joint_limits: FilePath | None = None,
        packages: FilePath | Iterable[FilePath] | None = None,
        strict: bool = False,
        xacro_args: Mapping[str, object] | None = None,
        xacro_limits: Mapping[str, float] | None = None,
        trust_xacro: bool = False,
        parameters: Mapping[str, object] | None = None,
    ) -> Robot:
        """Load a robot from a file, or by name, as `load_robot` does.

        Args:
            file: A name from `list_robots`; or the path of a URDF (``.urdf``, ``.xml``; ``.xacro`` needs the package
                xacro), of an MJCF (``.xml``, ``.mjcf``), of a DH table (``.yaml``), or of a MoveIt folder.
            tip: Link that goals refer to; that of the group, or of the first arm, if None.
            group: Group of the SRDF whose joints are actuated.
            joints: Actuated joints, in the order wanted; those of the group, or those that move a tip, if None.
            locked: Values of joints that are held fixed [rad or m]; by default 0, moved into the limits.
            gripper: Joint values at which it is open and closed [rad or m]: ``{"open": {joint: 1}, "closed": {..}}``;
                by default those of the SRDF, or else what follows from the shape of the fingers.
            base_pose: T_world_base: a ``pinocchio.SE3``, or ``{"xyz": [..], "quat_xyzw": [..]}``.
            padding: How much thicker links are than their geometry [m]: one number for all, or by name of link.
            scale: Factors by which the solids of links are larger about their own middles, by name of link.
            joint_ranges: Narrower limits of joints, by name [rad or m].
            joint_weights: How much joints count in the length of a path, by name; 1 if not named.
            srdf: SRDF beside a URDF, or in place of that of a folder; one named ``.xacro`` is expanded.
            urdf: URDF in place of that of a MoveIt folder.
            joint_limits: File in the format of MoveIt's ``joint_limits.yaml``.
            packages: Folders in which ``package://`` names are sought first.
            strict: Whether a URDF, folder or MJCF is refused if it would otherwise give a `DescriptionWarning`: because
                a name in it does not exist, a posture is outside the limits, or something in it is not read.
            xacro_args: Arguments of macros, by name.
            xacro_limits: Limits for the expansion of macros: ``{"seconds": 10, "gigabytes": 1}``, or one of these.
            trust_xacro: Whether macros are evaluated by xacro's own evaluator, which can run any code, and may read
                files anywhere. Otherwise expressions that are not on a list of allowed ones are refused.
            parameters: What a shipped robot has of its own, such as ``{"limits": "envelope"}`` of titan4.

        Raises:
            UnknownNameError: If there is no robot of that name.
            InputError: If the robot does not take an option, or a file or value cannot be used.
        """
        return read(
            Robot, file, tip=tip, group=group, joints=joints, locked=locked, gripper=gripper, base_pose=base_pose,
            padding=padding, scale=scale, joint_ranges=joint_ranges, joint_weights=joint_weights, srdf=srdf, urdf=urdf,
            joint_limits=joint_limits, packages=packages, strict=strict, xacro_args=xacro_args,
            xacro_limits=xacro_limits, trust_xacro=trust_xacro, parameters=parameters,
        )  # fmt: skip

    @property
    def dof(self) -> int:
        """Number of actuated joints."""
        return len(self.joint_names)

    @property
    def visual(self) -> pin.GeometryModel:
        """Pinocchio's visual geometry, loaded on first use; an `InputError` if a mesh cannot be read."""
        return self.looks()

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of all links (bodies), base first."""
        return _link_names(self)

    def link_of(self, geometry: pin.GeometryObject) -> str:
        """Return the link name of a geometry object of Pinocchio, such as one of ``collision.geometryObjects``."""
        require(geometry, pin.GeometryObject, "geometry of a link", "take it from robot.collision.geometryObjects")
        return str(self.model.frames[geometry.parentFrame].name)

    def configuration(self, values: ArrayLike, what: str = "configuration") -> Vector:
        """Validate a configuration given by a user: right length, finite numbers. Shape (dof,).

        ``what`` names it in messages.

        Raises:
            InputError: If the number of values is not ``dof`` or one of them is not finite.
        """
        array = np.asarray(values, dtype=object) if isinstance(values, (list, tuple)) else values

        if isinstance(array, np.ndarray) and array.ndim == 1 and len(array) != self.dof:
            joints = f"robot '{self.name}' has {self.dof} joints ({', '.join(self.joint_names)})"
            hint = "; a position of the tip: PositionGoal([x, y, z])" if str(what) == "goal" and len(array) == 3 else ""
            raise InputError(f"{what}: {joints}, but {len(array)} values were given{hint}")
        return finite_array(values, (self.dof,), what).copy()

    def configuration_deg(self, values: ArrayLike, what: str = "configuration") -> Vector:
        """Validate a configuration in degrees (m for prismatic joints), as :meth:`configuration`; in rad or m."""
        q = self.configuration(values, what)
        return np.where(self.prismatic, q, np.radians(q))

    def posture(self, name: str) -> Vector:
        """Return a named configuration, shape (dof,).

        Raises:
            UnknownNameError: If there is no posture of that name.
        """
        require(name, str, f"posture of robot '{self.name}'")
        if name not in self.postures:
            raise UnknownNameError(f"posture of robot '{self.name}'", name, self.postures)
        return self.postures[name]

    def within_limits(self, Q: ArrayLike, tolerance: float = LIMIT_TOLERANCE) -> Mask:
        """Return which configurations Q, shape (m, dof), lie inside the limits, shape (m,)."""
        return inside_limits(self, self._rows(Q), finite_number(tolerance, "tolerance of limits"))

    def finite_range(self) -> tuple[Vector, Vector]:
        """Return finite bounds from which configurations can be drawn, shape (dof,) each.

        They are the limits; where a joint has none, the bounds reach half a turn (3.14 m) from 0 or from its other
        limit.
        """
        lower = np.where(np.isfinite(self.lower), self.lower, np.minimum(self.upper, 0.0) - np.pi)
        upper = np.where(np.isfinite(self.upper), self.upper, np.maximum(self.lower, 0.0) + np.pi)
        return lower, upper

    def limit_fault(self, q: Vector) -> str:
        """Return a line that names the first joint of q outside its limits; "" if there is none.

        Values in it are in degrees, or metres for prismatic joints.
        """
        if not (outside := np.flatnonzero(self.onto_limits(q) != self.clamp(q))).size:
            return ""
        if np.shape(q) != (self.dof,):
            raise InputError(f"configuration of robot '{self.name}': expected shape ({self.dof},), got {np.shape(q)}")

        joint = int(outside[0])
        factor, unit = shown_unit(self.prismatic[joint])
        value, near, *ends = (factor * float(x[joint]) for x in (q, self.clamp(q), self.lower, self.upper))

        shown = (n for n in range(6, 18) if f"{value:.{n}g}" != f"{near:.{n}g}")
        digits = next(shown, 6)  # as many digits as show the difference; 6 for NaN
        limits = " .. ".join(f"{end:.{digits}g}" for end in ends)
        return f"joint '{self.joint_names[joint]}' is at {value:.{digits}g} {unit}, outside its limits {limits} {unit}"

    def onto_limits(self, Q: Matrix) -> Matrix:
        """Return Q with values up to ``LIMIT_TOLERANCE`` outside a limit moved onto it, and others unchanged.

        The shape is that of Q, (dof,) or (m, dof).
        """
        clamped = self.clamp(Q)
        lower, upper = _widened_limits(self, LIMIT_TOLERANCE)
        return np.where((lower <= Q) & (upper >= Q), clamped, Q)

    def clamp(self, q: Vector) -> Vector:
        """Return q with values outside a limit moved onto it, however far they are; the shape is that of q.

        Raises:
            InputError: If q does not consist of rows of ``dof`` numbers.
        """
        try:
            return np.asarray(np.minimum(np.maximum(q, self.lower), self.upper))
        except (TypeError, ValueError, OverflowError, MemoryError):
            raise InputError(f"values of robot '{self.name}': expected {self.dof} numbers, or rows of them") from None

    def joint_values(self, Q: ArrayLike) -> Matrix:
        """Compute the values of all joints of the chain, including mimic joints: (m, dof) or (dof,) -> (m, joints)."""
        return self.chain.joint_values(self._rows(Q))

    def pinocchio_configuration(self, Q: ArrayLike) -> Matrix:
        """Convert configurations, shape (m, dof) or (dof,), to Pinocchio's vectors, shape (m, nq).

        These contain mimic joints, and (cos, sin) in place of the angle of a continuous joint.
        """
        return pinocchio_rows(self, self._rows(Q))

    def joint_frames(self, Q: ArrayLike) -> NDArray[np.float64]:
        """Compute the poses of all Pinocchio joint frames in the world, world first, shape (m, joints + 1, 4, 4)."""
        rows = self._rows(Q)
        if self.model.nv > MOST_MOVING or not 0 < len(rows) <= FEW:
            return self.chain.joint_frames(rows)

        data = _data_of(self, get_ident())
        frames = np.empty((len(rows), len(data.oMi), 4, 4))
        for k, full in enumerate(pinocchio_rows(self, rows)):
            pin.forwardKinematics(self.model, data, full)
            frames[k] = [pose.homogeneous for pose in data.oMi]
        return frames

    def fk_batch(self, Q: ArrayLike, frame: str | None = None) -> NDArray[np.float64]:
        """Compute T_world_tip, or the pose of another frame or link, for Q: (m, dof) -> (m, 4, 4)."""
        self._require_frame(frame)
        return poses(self, self._rows(Q), frame)

    def fk(self, q: ArrayLike, frame: str | None = None) -> pin.SE3:
        """Compute T_world_tip, or the pose of another frame or link, for q, shape (dof,), as ``pinocchio.SE3``."""
        row = self.configuration(q)[None]
        self._require_frame(frame)
        return pin.SE3(poses(self, row, frame)[0])

    def jacobian(self, q: ArrayLike, frame: str | None = None) -> Matrix:
        """Compute the geometric Jacobian at the tip in world axes, rows (linear; angular), shape (6, dof)."""
        row = self.configuration(q)[None]
        self._require_frame(frame)
        if self.model.nv > MOST_MOVING:
            return np.asarray(jacobians(self, row, frame)[0])

        full = pinocchio_rows(self, row)[0]
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        number = _frame_number(self, frame)
        jacobian = pin.computeFrameJacobian(self.model, self.model.createData(), full, number, axes)
        # For a single joint Pinocchio returns a vector.
        return np.asarray(np.reshape(jacobian, (6, -1)) @ self.chain.gain)

    def jacobian_batch(self, Q: ArrayLike, frame: str | None = None) -> NDArray[np.float64]:
        """Compute the geometric Jacobians of configurations, as :meth:`jacobian`: (m, dof) -> (m, 6, dof)."""
        rows = self._rows(Q)
        self._require_frame(frame)
        return jacobians(self, rows, frame)

    def fk_jacobian_batch(self, Q: ArrayLike, frame: str | None = None) -> tuple[Matrix, Matrix]:
        """Compute :meth:`fk_batch` and :meth:`jacobian_batch` at once, for Q of shape (m, dof).

        Returns:
            Poses, shape (m, 4, 4), and Jacobians, shape (m, 6, dof).
        """
        rows = self._rows(Q)
        self._require_frame(frame)
        return poses_and_jacobians(self, rows, frame)

    def _rows(self, Q: ArrayLike) -> Matrix:
        """Validate one configuration or several and return them as rows, shape (m, dof)."""
        rows = number_rows(Q, f"configurations of robot '{self.name}'")
        if rows.ndim != 2 or rows.shape[1] != self.dof:
            raise InputError(f"configurations of robot '{self.name}': expected shape (m, {self.dof}), got {rows.shape}")
        return rows

    def _require_frame(self, frame: str | None) -> None:
        require(frame, str | None, f"frame of robot '{self.name}'")


def inside_limits(robot: Robot, rows: Matrix, tolerance: float = LIMIT_TOLERANCE) -> Mask:
    """Return which configurations, shape (m, dof), lie inside the limits widened by a tolerance, shape (m,)."""
    lower, upper = _widened_limits(robot, tolerance)
    return np.asarray(np.logical_and.reduce((rows >= lower) & (upper >= rows), axis=1))


def all_inside_limits(robot: Robot, rows: Matrix, tolerance: float = LIMIT_TOLERANCE) -> bool:
    """Check whether all configurations, shape (m, dof), lie inside the limits widened by a tolerance.

    To know this of all takes less time than to know it of each.
    """
    lower, upper = _widened_limits(robot, tolerance)
    inside = rows >= lower
    inside &= upper >= rows
    return bool(np.logical_and.reduce(inside, axis=None))


def pinocchio_rows(robot: Robot, rows: Matrix) -> Matrix:
    """Convert configurations to Pinocchio's vectors, (m, dof) -> (m, nq); see :meth:`Robot.pinocchio_configuration`."""
    values = robot.chain.joint_values(rows)
    if robot.model.nq == len(robot.chain.parent):
        return values

    full = np.empty((len(rows), robot.model.nq))
    joints, places, turning, cosines = _places_of(robot)
    angles = values[:, turning]
    full[:, places] = values[:, joints]
    full[:, cosines] = np.cos(angles)
    full[:, cosines + 1] = np.sin(angles)
    return full


def poses(robot: Robot, rows: Matrix, frame: str | None = None) -> NDArray[np.float64]:
    """Compute T_world_tip, or the pose of another frame, for configurations: (m, dof) -> (m, 4, 4)."""
    return in_blocks(partial(_poses, robot, _frame_number(robot, frame)), rows)


def jacobians(robot: Robot, rows: Matrix, frame: str | None = None) -> NDArray[np.float64]:
    """Compute geometric Jacobians at the tip, or at another frame, for configurations: (m, dof) -> (m, 6, dof)."""
    return in_blocks(lambda block: poses_and_jacobians(robot, block, frame)[1], rows)


def poses_and_jacobians(robot: Robot, rows: Matrix, frame: str | None = None) -> tuple[Matrix, Matrix]:
    """Compute :func:`poses` and :func:`jacobians` at once.

    Returns:
        Poses, shape (m, 4, 4), and Jacobians in world axes, rows (linear; angular), shape (m, 6, dof).
    """
    number = _frame_number(robot, frame)
    chain = robot.chain
    frames = chain.joint_frames(rows)
    placed = _poses(robot, number, rows, frames)
    columns = np.zeros((len(frames), 6, len(chain.parent)))

    joint = robot.model.frames[number].parentJoint - 1
    while joint >= 0:  # only joints between the base and the frame move it
        axis = frames[:, joint + 1, :3, :3] @ chain.axis[joint]
        if chain.prismatic[joint]:
            columns[:, :3, joint] = axis
        else:
            columns[:, :3, joint] = cross_products(axis, placed[:, :3, 3] - frames[:, joint + 1, :3, 3])
            columns[:, 3:, joint] = axis
        joint = int(chain.parent[joint])

    return placed, np.asarray(columns @ chain.gain)


def _poses(
    robot: Robot, number: int, rows: Matrix, joint_frames: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Compute the poses of a frame for configurations, a few by Pinocchio, many by numpy.

    Args:
        robot: The arm.
        number: Pinocchio's index of the frame.
        rows: Configurations, shape (m, dof).
        joint_frames: Frames of all joints there, shape (m, joints + 1, 4, 4), if known.

    Returns:
        The poses, shape (m, 4, 4).
    """
    if robot.model.nv > MOST_MOVING or not 0 < len(rows) <= FEW:
        target = robot.model.frames[number]
        frames = robot.chain.joint_frames(rows) if joint_frames is None else joint_frames
        return np.asarray(frames[:, target.parentJoint] @ target.placement.homogeneous)

    data = _data_of(robot, get_ident())
    placed = np.empty((len(rows), 4, 4))
    for k, full in enumerate(pinocchio_rows(robot, rows)):
        pin.forwardKinematics(robot.model, data, full)
        placed[k] = pin.updateFramePlacement(robot.model, data, number).homogeneous
    return placed


@kept_with
def reach_of(robot: Robot) -> float:
    """Return the characteristic length of an arm [m]: the sum of all offsets between consecutive joints."""
    return float(np.linalg.norm(robot.chain.placement[:, :3, 3], axis=1).sum()) or 1.0


def metres_per_radian(robot: Robot) -> float:
    """Return the weight of the tip's rotation in tip distances [m/rad]."""
    return PER_RADIAN * reach_of(robot)


def unnamed_joints(count: int) -> tuple[str, ...]:
    """Return default joint names: ``joint1, joint2, ...``."""
    return tuple(f"joint{k + 1}" for k in range(count))


def require_joints(robot: Robot, names: Sequence[str], what: str) -> None:
    """Refuse a path or motion whose joints are not those of a robot, in the same order.

    Args:
        robot: The robot.
        names: Names of the joints that it moves; the names of :func:`unnamed_joints` fit every robot.
        what: What is refused, such as "path".

    Raises:
        InputError: If the names, or their number, are not those of the robot's actuated joints.
    """
    if len(names) == robot.dof and tuple(names) in (robot.joint_names, unnamed_joints(robot.dof)):
        return

    remedy = "put its columns in that order" if set(names) == set(robot.joint_names) else "it is another robot's"
    own = ", ".join(names)
    wanted = ", ".join(robot.joint_names)
    raise InputError(f"the {what} moves {own}, but robot '{robot.name}' has the joints {wanted}; {remedy}")


def joint_order(robot: Robot, names: Sequence[str], what: str) -> list[int]:
    """Return in which order the columns of a path or motion are those of a robot; a warning says if it is another one.

    Args:
        robot: The robot.
        names: Names of the joints of the columns, as of :func:`require_joints`.
        what: What has these columns, for the error message.

    Raises:
        InputError: If the names, or their number, are not those of the robot's actuated joints.
    """
    if tuple(names) != robot.joint_names and sorted(names) == sorted(robot.joint_names):
        warnings.warn(f"{what}: its joints are in another order; they are sorted by name", PathWarning, stacklevel=4)
        return [tuple(names).index(name) for name in robot.joint_names]
    require_joints(robot, names, what)
    return list(range(robot.dof))


@kept_with
def _widened_limits(robot: Robot, tolerance: float) -> tuple[Vector, Vector]:
    return robot.lower - tolerance, robot.upper + tolerance


@kept_with
def _link_names(robot: Robot) -> tuple[str, ...]:
    return tuple(f.name for f in robot.model.frames if f.type == pin.FrameType.BODY)


@kept_with
def _frame_number(robot: Robot, frame: str | None) -> int:
    """Return Pinocchio's index of a frame, of the tip if None.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    name = robot.tip if frame is None else frame
    if not name.isprintable() or not robot.model.existFrame(name):
        raise UnknownNameError(f"frame of robot '{robot.name}'", name, (f.name for f in robot.model.frames))
    return int(robot.model.getFrameId(name))


@kept_with
def _places_of(robot: Robot) -> tuple[NDArray[np.int64], ...]:
    """Return where the joints stand in Pinocchio's vectors, in which continuous joints have two numbers.

    Returns:
        Indices of the joints with one number and of these numbers; indices of the joints with two numbers and of the
        first of these, the cosine.
    """
    starts = np.array(robot.model.idx_qs.tolist()[1:])
    sizes = np.array(robot.model.nqs.tolist()[1:])
    single = np.flatnonzero(sizes == 1)
    double = np.flatnonzero(sizes != 1)
    return single, starts[single], double, starts[double]


@kept_with
def _data_of(robot: Robot, _thread: int) -> pin.Data:
    """Return Pinocchio's working memory for a robot; each thread has its own."""
    return robot.model.createData()
