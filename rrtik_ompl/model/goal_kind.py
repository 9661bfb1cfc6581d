"""The interface of all kinds of goals, by which planning, inverse kinematics and pictures treat them alike.

Every goal of the tip has a :class:`TaskRegion`, from which targets are drawn: poses of the tip with ranges for position
and for roll, pitch and yaw. A region is a kind of goal itself. Source: [17], with a frame w in the world, bounds of the
displacement of a frame s in w, and the pose of the tip in s. The distance of that source is the norm of the
displacement; here it is the distance of the tip from the nearest pose of the region, in metres and radians.

A new kind of goal of the tip is a :class:`GoalPart`; see ``rrtik_ompl.model.goal`` for the others, and CONTRIBUTING.md
for an example. The names of the kinds in files are defined in ``rrtik_ompl.problem_files.goal``.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import (
    TAU,
    Mask,
    Matrix,
    Vector,
    finite_array,
    frozen,
    not_negative,
    number_rows,
    positive,
    whole_number,
)
from rrtik_ompl.base.choices import FrameAxis
from rrtik_ompl.base.copies import as_value, set_fields
from rrtik_ompl.base.errors import InputError, name_of, require
from rrtik_ompl.base.poses import PoseLike, rigid, rotation_angles, rpy_matrices, turned_z, unit_vector
from rrtik_ompl.model.robot import Robot, metres_per_radian

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
SWEEPS = 3  # sweeps over roll, pitch and yaw; one sweep is exact where only one of them is free


class Goal:
    """A goal of a plan; immutable.

    The class does not use the metaclass ABCMeta, with which ``isinstance`` takes several times as long: `solve_ik` of
    one pose takes 20 microseconds and calls it often. mypy reports missing methods all the same.

    Attributes:
        oriented: Whether the orientation of the tip counts.
    """

    __slots__ = ()

    oriented: ClassVar[bool] = True

    @property
    @abstractmethod
    def title(self) -> str:
        """Short name of the kind of goal, two or three words."""
        raise NotImplementedError

    @abstractmethod
    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Compute how far each row of Q is from the goal, shape (m,) [m; rad or m for a configuration]."""
        raise NotImplementedError

    @abstractmethod
    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Return which rows of Q are at the goal, shape (m,)."""
        raise NotImplementedError

    @property
    def q(self) -> Vector | None:
        """The configuration of a joint goal, shape (dof,) [rad or m]; None for goals that many configurations reach."""
        return None

    @property
    def parts(self) -> tuple[GoalPart, ...]:
        """Its tip goals: of a single tip, any one of which is sufficient, or one for each of several tips."""
        return ()

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the links that are tips, one for each part; empty unless it is a goal of several tips."""
        return ()

    def arms(self, robot: Robot) -> list[Robot]:
        """Return one robot for each tip that has a goal, which has this tip."""
        return [robot]

    def member_at(self, robot: Robot, q: ArrayLike) -> int | None:
        """Return the index of the member that q, shape (dof,), reaches; None for none, or if there are no members."""
        del robot, q
        return None


class TipGoal(Goal):
    """A goal of the robot's own tip, reached where any of its parts is reached."""

    __slots__ = ()

    @abstractmethod
    def errors(self, robot: Robot, Q: ArrayLike) -> tuple[Vector, Vector]:
        """Compute the tip's distance [m] and angle [rad] from the nearest part for each row of Q, shape (m,) each."""
        raise NotImplementedError

    @property
    @abstractmethod
    def has_regions(self) -> bool:
        """Whether it is or contains a goal with a freedom that `rrtik_ompl.ik.targets` cannot represent in a row."""
        raise NotImplementedError

    def alone(self, number: int) -> TipGoal:
        """Return one of the parts as a goal of its own.

        Raises:
            InputError: If there is no part of that number.
        """
        return self.parts[self._place(number)]

    def _place(self, number: int) -> int:
        """Validate the index of a part."""
        place = whole_number(number, "number of a part of a goal")
        if place >= len(self.parts):
            raise InputError(f"goal: it has {len(self.parts)} parts, counted from 0, and no part {place}")
        return place


class GoalPart(TipGoal):
    """A goal of the tip that is not a set of others: a pose, a position or a region."""

    __slots__ = ()

    @property
    @abstractmethod
    def tolerances(self) -> tuple[float, float]:
        """Largest errors: distance [m] and angle [rad], 0 for a position."""
        raise NotImplementedError

    @abstractmethod
    def tip_errors(self, tips: NDArray[np.float64]) -> tuple[Vector, Vector]:
        """Compute the errors as :meth:`errors_at`, without validation of the poses, shape (m, 4, 4)."""
        raise NotImplementedError

    @abstractmethod
    def region(self) -> TaskRegion:
        """Return the region from which targets are drawn and which pictures show.

        If the goal cannot be expressed as a region exactly, it is a part of the goal.
        """
        raise NotImplementedError

    @property
    def freedom(self) -> TaskRegion | None:
        """The region from which targets are drawn; None if the goal is a :class:`Target` itself."""
        return self.region()

    @property
    def has_regions(self) -> bool:
        """Whether the goal leaves freedom."""
        return self.freedom is not None

    def freed(self, axis: FrameAxis | None, box: Vector) -> GoalPart:
        """Return the goal with a free rotation about an axis and a box of positions; only a pose is changed by it."""
        del axis, box
        return self

    @property
    def parts(self) -> tuple[GoalPart, ...]:
        """The goal itself."""
        return (self,)

    def errors_at(self, tips: ArrayLike) -> tuple[Vector, Vector]:
        """Compute distances [m] and angles [rad] of tip poses from the goal: (m, 4, 4) -> (m,) each."""
        return self.tip_errors(finite_array(tips, (None, 4, 4), "poses of the tip"))

    def errors(self, robot: Robot, Q: ArrayLike) -> tuple[Vector, Vector]:
        """Compute the tip's distance [m] and angle [rad] from the goal for each row of Q, shape (m,) each."""
        require(robot, Robot, "robot of a goal")
        return self.tip_errors(robot.fk_batch(Q))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Compute the weighted distance of the tip from the goal for each row of Q, shape (m,) [m].

        It is the position error plus the angle times half of the arm's reach. Whether the goal is reached depends on
        the tolerances of both errors: see :meth:`satisfied`.
        """
        position, angle = self.errors(robot, Q)
        return position + metres_per_radian(robot) * angle

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Return which rows of Q are at the goal, shape (m,)."""
        position, angle = self.errors(robot, Q)
        near, turned = self.tolerances
        return (position <= near) & (angle <= turned)


class Target(GoalPart):
    """A goal without freedom, as inverse kinematics requires: a pose, or a point in any orientation."""

    __slots__ = ()

    @property
    @abstractmethod
    def pose(self) -> pin.SE3:
        """T_world_tip (``pinocchio.SE3``), with the orientation of the world if the orientation does not count."""
        raise NotImplementedError

    @property
    @abstractmethod
    def point(self) -> Vector:
        """Position of the tip at the goal [m], shape (3,)."""
        raise NotImplementedError

    @abstractmethod
    def tightened(self, share: float) -> Target:
        """Return the same goal with its tolerances scaled by a share."""
        raise NotImplementedError

    @property
    def freedom(self) -> None:
        """None, as the goal leaves no freedom."""
        return None

    @property
    def has_regions(self) -> bool:
        """Always False."""
        return False


@dataclass(frozen=True, slots=True, eq=False)
class TaskRegion(GoalPart):
    """Bring the tip to any pose ``T_world_w @ D @ T_w_tip`` whose displacement D lies within bounds.

    Attributes:
        T_world_w: Pose of the region's frame w in the world.
        bounds: Lowest and highest x, y, z [m] and fixed-axis roll, pitch, yaw [rad] of D, shape (6, 2). Angles that
            are a full turn apart are the same; a range of a full turn leaves the angle free.
        T_w_tip: Pose of the tip in w if D is the identity.
        position_tolerance: Largest distance from the region [m].
        orientation_tolerance: Largest angle from the region [rad].
        frame: For path constraints, the link or attached object that is constrained; the tip if None.
        position_allowance: For path constraints, by how much motions between waypoints may exceed the position
            tolerance [m].
        orientation_allowance: For path constraints, likewise for the orientation tolerance [rad].
        from_start: Whether ``T_world_w`` is relative to the constrained frame at the start of a path; a
            :class:`rrtik_ompl.Problem` replaces such a region by one placed in the world.

    Example:
        >>> bounds = np.zeros((6, 2))
        >>> bounds[5] = -np.pi, np.pi  # the tool may turn about the z axis of the region
        >>> drill = rrtik.TaskRegion(rrtik.pose([0.4, 0.2, 0.3], rpy=[np.pi, 0.0, 0.0]), bounds)
        >>> rrtik.solve_ik(rrtik.load_robot("ur5"), drill).found
        True
    """

    T_world_w: pin.SE3
    bounds: Matrix
    T_w_tip: pin.SE3
    position_tolerance: float
    orientation_tolerance: float
    frame: str | None
    from_start: bool
    position_allowance: float
    orientation_allowance: float

    __reduce__ = as_value

    def __init__(
        self,
        T_world_w: PoseLike,
        bounds: ArrayLike,
        T_w_tip: PoseLike = (0.0, 0.0, 0.0),
        position_tolerance: float = 1e-3,
        orientation_tolerance: float = 1e-2,
        *,
        frame: str | None = None,
        from_start: bool = False,
        position_allowance: float = 0.0,
        orientation_allowance: float = 0.0,
    ) -> None:
        ranges = finite_array(bounds, (6, 2), "goal region: bounds")
        for name, bound in zip(COORDINATES, ranges, strict=True):
            _range(bound, f"goal region: {name}")

        require(frame, str | None, "frame of a region", "name a link or an attached object")
        if frame is not None:
            name_of(frame, "the frame of a region")
        require(from_start, bool, "from_start of a region")

        set_fields(
            self,
            T_world_w=rigid(T_world_w, "goal region: T_world_w"),
            bounds=frozen(ranges),
            T_w_tip=rigid(T_w_tip, "goal region: T_w_tip"),
            position_tolerance=positive(position_tolerance, "goal region: position_tolerance"),
            orientation_tolerance=positive(orientation_tolerance, "goal region: orientation_tolerance"),
            frame=frame,
            from_start=from_start,
            position_allowance=not_negative(position_allowance, "path constraint: position_allowance"),
            orientation_allowance=not_negative(orientation_allowance, "path constraint: orientation_allowance"),
        )

    @classmethod
    def about_axis(
        cls,
        T_world_tip: PoseLike,
        axis: ArrayLike,
        *,
        through: ArrayLike | None = None,
        turn: ArrayLike = (-np.pi, np.pi),
        slide: ArrayLike = (0.0, 0.0),
        position_tolerance: float = 1e-3,
        orientation_tolerance: float = 1e-2,
    ) -> TaskRegion:
        """Create the region of a pose that may be rotated about a line and moved along it, such as grasps of a bar.

        Args:
            T_world_tip: A pose of the tip at the goal.
            axis: Unit direction of the line in the world, shape (3,).
            through: A point of the line [m], shape (3,); the position of the tip if None.
            turn: Lowest and highest angle from that pose [rad], shape (2,).
            slide: Lowest and highest displacement along the axis [m], shape (2,).
            position_tolerance: Largest distance from the region [m].
            orientation_tolerance: Largest angle from the region [rad].

        Raises:
            InputError: If the axis is not of length 1, or the lower bound of a range exceeds the upper one.
        """
        tip = rigid(T_world_tip, "goal region: T_world_tip")
        direction = unit_vector(axis, "goal region: axis")
        point = tip.translation if through is None else finite_array(through, (3,), "goal region: through")
        T_world_w = pin.SE3(turned_z(direction), np.array(point))

        bounds = np.zeros((6, 2))
        bounds[2] = _range(slide, "goal region: slide")
        bounds[5] = _range(turn, "goal region: turn")
        return cls(T_world_w, bounds, T_world_w.actInv(tip), position_tolerance, orientation_tolerance)

    @property
    def title(self) -> str:
        """Short name of the kind of goal."""
        return "tip region"

    @property
    def tolerances(self) -> tuple[float, float]:
        """Largest errors: distance [m] and angle [rad]."""
        return self.position_tolerance, self.orientation_tolerance

    def region(self) -> TaskRegion:
        """Return the region itself."""
        return self

    @property
    def free(self) -> Mask:
        """Which of the six coordinates have a range, shape (6,)."""
        ranges: Mask = self.bounds[:, 0] < self.bounds[:, 1]
        return ranges

    def started_at(self, T_world_frame: PoseLike) -> TaskRegion:
        """Place a region that is ``from_start`` in the world, given the pose of its frame at the start of the path.

        Other regions are returned unchanged.
        """
        if not self.from_start:
            return self
        return replace(
            self, T_world_w=rigid(T_world_frame, "frame of a region at the start") * self.T_world_w, from_start=False
        )

    def poses(self, coordinates: Matrix) -> NDArray[np.float64]:
        """Compute T_world_tip for displacements, (m, 6) -> (m, 4, 4)."""
        coordinates = _rows(coordinates, (6,), "displacements in a region")
        poses: NDArray[np.float64] = self.T_world_w.homogeneous @ displacements(coordinates) @ self.T_w_tip.homogeneous
        return poses

    def drawn(self, count: int, rng: np.random.Generator) -> Matrix:
        """Draw displacements uniformly from the bounds, shape (count, 6)."""
        require(rng, np.random.Generator, "rng of a region", "use numpy.random.default_rng(seed)")
        whole_number(count, "count of a region")
        return rng.uniform(self.bounds[:, 0], self.bounds[:, 1], (count, 6))

    def nearest(self, tips: NDArray[np.float64]) -> Matrix:
        """Compute the displacements of the region's poses that are nearest to tip poses, (m, 4, 4) -> (m, 6).

        The nearest orientation is found first, then the nearest position for it.
        """
        tips = _rows(tips, (4, 4), "poses of the tip")
        R_w = self.T_world_w.rotation
        R_tip = self.T_w_tip.rotation

        angles = nearest_angles(R_w.T @ tips[:, :3, :3] @ R_tip.T, self.bounds[3:])
        place = (tips[:, :3, 3] - self.T_world_w.translation) @ R_w - rpy_matrices(angles) @ self.T_w_tip.translation
        return np.hstack([np.clip(place, self.bounds[:3, 0], self.bounds[:3, 1]), angles])

    def tip_errors(self, tips: NDArray[np.float64]) -> tuple[Vector, Vector]:
        """Compute distances [m] and angles [rad] of tip poses from the nearest region poses: (m, 4, 4) -> (m,) each."""
        poses = self.poses(self.nearest(tips))
        position: Vector = np.linalg.norm(tips[:, :3, 3] - poses[:, :3, 3], axis=1)
        return position, rotation_angles(np.swapaxes(poses[:, :3, :3], 1, 2) @ tips[:, :3, :3])


def displacements(coordinates: Matrix) -> NDArray[np.float64]:
    """Compute the transforms D for x, y, z [m] and roll, pitch, yaw [rad]: (m, 6) -> (m, 4, 4)."""
    D = np.zeros((len(coordinates), 4, 4))
    D[:, :3, :3] = rpy_matrices(coordinates[:, 3:])
    D[:, :3, 3] = coordinates[:, :3]
    D[:, 3, 3] = 1.0
    return D


def _rows(values: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Validate numbers of shape (m, *shape), which need not be finite, as a search may produce others."""
    rows = number_rows(values, what)
    if rows.shape[1:] != shape:
        raise InputError(f"{what}: expected shape (m, {', '.join(map(str, shape))}), got {rows.shape}")
    return rows


def _range(values: ArrayLike, what: str) -> Vector:
    low, high = bounds = finite_array(values, (2,), what)
    if low > high:
        raise InputError(f"{what} goes from {low:g} up to {high:g}; put the lower bound first")
    return bounds


def nearest_angles(rotations: NDArray[np.float64], bounds: Matrix) -> Matrix:
    """Compute roll, pitch and yaw within bounds whose rotations are near to given ones: (m, 3, 3) -> (m, 3).

    The result is exact for rotations inside the bounds, and where at most one angle has a range. Otherwise each angle
    in turn is set to its best value with the others held. This is started from both triples that describe the rotation,
    so that pitch may exceed a quarter turn, and the better result is taken.
    """
    best: Matrix = np.tile(bounds[:, 0], (len(rotations), 1))
    wide = np.flatnonzero(bounds[:, 0] < bounds[:, 1])
    if len(wide) == 0:
        return best

    likeness = np.full(len(rotations), -np.inf)
    first = roll_pitch_yaw(rotations)
    for start in (first, first * [1.0, -1.0, 1.0] + np.pi):
        angles = into_range(start, bounds[:, 0], bounds[:, 1])
        for k in np.tile(wide[::-1], 1 if len(wide) == 1 else SWEEPS):
            angles[:, k] = into_range(_best_angle(rotations, angles, int(k)), *bounds[k])
        found = np.einsum("mij,mij->m", rotations, rpy_matrices(angles))
        better = found > likeness
        best[better] = angles[better]
        likeness[better] = found[better]

    return best


def roll_pitch_yaw(R: NDArray[np.float64]) -> Matrix:
    """Compute the angles of R = Rz(yaw) Ry(pitch) Rx(roll) with pitch within a quarter turn: (m, 3, 3) -> (m, 3)."""
    pitch = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0]))
    return np.column_stack([np.arctan2(R[:, 2, 1], R[:, 2, 2]), pitch, np.arctan2(R[:, 1, 0], R[:, 0, 0])])


def _best_angle(R: NDArray[np.float64], angles: Matrix, k: int) -> Vector:
    """Compute the angle that brings the rotation nearest to R with the other two angles held.

    The trace of R^T Rz Ry Rx, which is to be maximised, is a cosine of each angle.

    Args:
        R: Rotations, shape (m, 3, 3).
        angles: Roll, pitch and yaw [rad], shape (m, 3).
        k: Index of the angle, 0 for roll, 1 for pitch, 2 for yaw.

    Returns:
        The k-th angle [rad], shape (m,).
    """
    first, second = (rpy_matrices(angles * np.eye(3)[other]) for other in range(3) if other != k)
    C = np.swapaxes(R, 1, 2)
    if k == 0:
        C = C @ (second @ first)
    elif k == 1:
        C = first @ (C @ second)
    else:
        C = (second @ first) @ C

    i = (k + 1) % 3
    j = (k + 2) % 3
    angle: Vector = np.arctan2(C[:, i, j] - C[:, j, i], C[:, i, i] + C[:, j, j])
    return angle


def into_range(angles: NDArray[np.float64], low: ArrayLike, high: ArrayLike) -> NDArray[np.float64]:
    """Shift angles by whole turns into bounds, or to the nearer bound where none fits."""
    low = np.asarray(low)
    high = np.asarray(high)
    middle = 0.5 * (low + high)
    nearest: NDArray[np.float64] = np.clip(middle + (angles - middle + np.pi) % TAU - np.pi, low, high)
    return nearest
