"""What a plan has to reach: joint values, an end-effector pose, a position, a region of poses, or any of several."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Vector, finite_array, frozen, positive, rows_of
from rrtik_ompl.base.choices import FrameAxis
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.base.poses import rigid, rotation_angles
from rrtik_ompl.base.units import wrapped
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.task_region import HasTipErrors, TaskRegion, WithinTolerances
from rrtik_ompl.model.tip_distance import metres_per_radian

JOINT_TOLERANCE = 1e-6  # [rad] or [m]
NO_BOX, MOST = frozen([0.0, 0.0, 0.0]), 100_000  # goals of a set


def joint_difference(robot: Robot, Q: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """``Q - q`` per joint, continuous joints the short way round (into [-pi, pi]). Shape of Q."""
    difference: NDArray[np.float64] = np.asarray(Q, dtype=np.float64) - np.asarray(q, dtype=np.float64)
    if not has_continuous(robot):
        return difference
    turned = wrapped(difference)
    shortest: NDArray[np.float64] = np.where(robot.continuous, turned, difference)
    return shortest


def _with_poses(part: AnyPart) -> GoalPart:
    matrix = isinstance(part, np.ndarray) and part.ndim > 1  # a row may be a configuration
    return PoseGoal(part) if matrix or isinstance(part, pin.SE3) else part  # type: ignore[return-value]


@lru_cache(maxsize=64)
def has_continuous(robot: Robot) -> bool:
    """Whether a joint of a robot turns without limits."""
    return bool(robot.continuous.any())


@dataclass(frozen=True, slots=True, eq=False)
class JointGoal:
    """Reach this configuration. ``q``: shape (dof,), rad or m."""

    q: Vector
    tolerance: float = JOINT_TOLERANCE

    __reduce__ = as_value

    def __init__(self, q: ArrayLike, tolerance: float = JOINT_TOLERANCE) -> None:
        object.__setattr__(self, "q", frozen(finite_array(q, (None,), "goal joints")))
        object.__setattr__(self, "tolerance", positive(tolerance, "goal tolerance"))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Largest joint error of each row of Q, shape (m,) [rad or m]."""
        require(robot, Robot, "robot of a goal")
        rows = rows_of(Q, len(self.q), "configurations")
        return np.asarray(np.abs(joint_difference(robot, rows, self.q)).max(axis=1))

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        return self.distance(robot, Q) <= self.tolerance


@dataclass(frozen=True, slots=True, eq=False)
class PositionGoal(HasTipErrors):
    """Bring the tip to a point of the world [m], orientation free. ``tolerance`` [m]."""

    position: Vector
    tolerance: float = 1e-3

    __reduce__ = as_value

    def __init__(self, position: ArrayLike, tolerance: float = 1e-3) -> None:
        object.__setattr__(self, "position", frozen(finite_array(position, (3,), "goal position")))
        object.__setattr__(self, "tolerance", positive(tolerance, "goal tolerance"))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Distance of the tip from the point for each row of Q, shape (m,) [m]."""
        return self.errors(robot, Q)[0]

    def _errors_at(self, tips: NDArray[np.float64]) -> tuple[Vector, Vector]:
        """Distance [m] of poses of the tip, shape (m, 4, 4), and an angle of 0, shapes (m,)."""
        return np.linalg.norm(tips[:, :3, 3] - self.position, axis=1), np.zeros(len(tips))

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        return self.distance(robot, Q) <= self.tolerance


@dataclass(frozen=True, slots=True, eq=False)
class PoseGoal(WithinTolerances):
    """Bring the tip frame to T_world_tip, within ``position_tolerance`` [m] and ``orientation_tolerance`` [rad]."""

    T_world_tip: Any
    position_tolerance: float = 1e-3
    orientation_tolerance: float = 1e-2

    __reduce__ = as_value

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_tip", rigid(self.T_world_tip, "goal pose"))
        positive(self.position_tolerance, "goal position_tolerance")
        positive(self.orientation_tolerance, "goal orientation_tolerance")

    def _errors_at(self, tips: NDArray[np.float64]) -> tuple[Vector, Vector]:
        """Position error [m] and rotation angle [rad] of poses of the tip, shape (m, 4, 4), shapes (m,)."""
        return pose_errors(tips, self.T_world_tip)


GoalPart: TypeAlias = PoseGoal | PositionGoal | TaskRegion
AnyPart: TypeAlias = GoalPart | pin.SE3 | NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class GoalSet:
    """Any of several goals: a grasp set. Poses may be given freedom: a turn about an axis, a box of positions.

    Attributes:
        members: Goals of which one is enough; a pose (``pinocchio.SE3`` or a matrix) counts as a :class:`PoseGoal`.
        free_rotation_axis: "x", "y" or "z" of the goal frame about which poses may be turned, or None.
        box: Full side lengths [m], in the goal frame, within which the position of poses is free, shape (3,).
        parts: The members, poses that have freedom as task-space regions.
    """

    members: tuple[GoalPart, ...]
    free_rotation_axis: FrameAxis | None = None
    box: Vector = field(default_factory=lambda: NO_BOX)
    parts: tuple[GoalPart, ...] = ()

    __reduce__ = as_value

    def __init__(
        self, members: Iterable[AnyPart], free_rotation_axis: FrameAxis | None = None, box: ArrayLike = NO_BOX
    ) -> None:
        goals = tuple(map(_with_poses, listed(members, "goal set", MOST))) if isinstance(members, Iterable) else ()
        if not goals or not all(isinstance(goal, PoseGoal | PositionGoal | TaskRegion) for goal in goals):
            kinds = "a list of at least one pose or position or region of the tip"
            raise InputError(f"goal: a set is {kinds}; of configurations plan to each, or take PoseGoal(robot.fk(q))")
        if free_rotation_axis is not None and str(free_rotation_axis) not in ("x", "y", "z"):
            raise InputError(f"goal free_rotation_axis must be x, y or z, got {free_rotation_axis!r}; or a TaskRegion")
        sides = finite_array(box, (3,), "goal box")
        if (sides < 0.0).any():
            raise InputError(f"goal box must not have negative sides, got {sides.tolist()}")
        freed = free_rotation_axis is not None or bool(sides.any())
        parts = (_freed(g, free_rotation_axis, sides) if freed and isinstance(g, PoseGoal) else g for g in goals)
        object.__setattr__(self, "members", goals)
        object.__setattr__(self, "free_rotation_axis", free_rotation_axis)
        object.__setattr__(self, "box", frozen(sides))
        object.__setattr__(self, "parts", tuple(parts))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Distance to the nearest part, shape (m,) [m]: the way of the tip, and its turn at half the arm's reach.

        Positions and poses are measured alike; of a position the turn is free. Tolerances do not count.
        """
        each = self.member_errors(robot, Q)
        return np.asarray((each[..., 0] + metres_per_radian(robot) * each[..., 1]).min(axis=0))

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at one of the parts, shape (m,)."""
        most = np.array([tolerances(part) for part in self.parts])[:, None]
        return np.asarray((self.member_errors(robot, Q) <= most).all(axis=2).any(axis=0))

    def member_at(self, robot: Robot, q: ArrayLike) -> int | None:
        """Number of the member that a configuration, shape (dof,), reaches, from 0, the nearest of several; or None."""
        require(robot, Robot, "robot of a goal")
        each = self.member_errors(robot, robot.configuration(q)[None])[:, 0]
        reached = [bool((errors <= tolerances(part)).all()) for errors, part in zip(each, self.parts, strict=True)]
        away = np.where(reached, each[:, 0] + metres_per_radian(robot) * each[:, 1], np.inf)
        return int(away.argmin()) if any(reached) else None

    def member_errors(self, robot: Robot, Q: ArrayLike) -> NDArray[np.float64]:
        """Distance [m] and angle [rad] (0 for a position) of each row of Q from each member, shape (k, m, 2).

        Of what lies inside the box, and of what the free rotation can remove, nothing counts.
        """
        require(robot, Robot, "robot of a goal")
        tips = robot.fk_batch(Q)  # once for all of them
        return np.array([part.errors_at(tips) for part in self.parts]).transpose(0, 2, 1)


@dataclass(frozen=True, slots=True, eq=False)
class MultiGoal:
    """Goals of several tips, all of them at once: an arm with two hands.

    Attributes:
        frames: Names of the links that are tips.
        parts: The goal of each, in their order; a pose counts as in a :class:`GoalSet`.

    Example:
        >>> left, right = (rrtik.PositionGoal([1.2, y, 0.1]) for y in (0.4, -0.4))
        >>> goal = rrtik.MultiGoal({"left_grip_point": left, "right_grip_point": right})
        >>> rrtik.plan(rrtik.Problem(rrtik.World(rrtik.load_robot("two_titan4")), "ready", goal), seed=1).found
        True
    """

    frames: tuple[str, ...]
    parts: tuple[GoalPart, ...]

    def __init__(self, goals: Mapping[str, AnyPart]) -> None:
        if not isinstance(goals, Mapping) or not goals:
            raise InputError("goal: MultiGoal needs a goal for each tip: MultiGoal({link: PoseGoal(...), ...})")
        parts = {name: _with_poses(part) for name, part in goals.items()}
        for name, part in parts.items():
            require(name, str, "tip of a MultiGoal", "name a link")
            require(part, GoalPart, f"goal of '{name}'", "use a PoseGoal, a PositionGoal or a TaskRegion")
        object.__setattr__(self, "frames", tuple(parts))
        object.__setattr__(self, "parts", tuple(parts.values()))

    def __reduce__(self) -> tuple[type[MultiGoal], tuple[dict[str, GoalPart]]]:
        return MultiGoal, (dict(zip(self.frames, self.parts, strict=True)),)

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Distances of all tips together for each row of Q, shape (m,) [m]; see :meth:`GoalSet.distance`."""
        return np.asarray(np.sum([part.distance(arm, Q) for arm, part in self.each(robot)], axis=0))

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """In which rows of Q all tips are at their goals, shape (m,)."""
        there: Mask = np.all([part.satisfied(arm, Q) for arm, part in self.each(robot)], axis=0)
        return there

    def each(self, robot: Robot) -> list[tuple[Robot, GoalPart]]:
        """The goal of each tip, with the robot that has this tip."""
        require(robot, Robot, "robot of a goal")
        return [(_with_tip(robot, frame), part) for frame, part in zip(self.frames, self.parts, strict=True)]


@lru_cache(maxsize=64)
def _with_tip(robot: Robot, frame: str) -> Robot:
    """The same robot, another of its links being the one that goals refer to."""
    return replace(robot, tip=frame, closed_form=None)


TipGoal: TypeAlias = PoseGoal | PositionGoal | TaskRegion | GoalSet
Goal: TypeAlias = JointGoal | TipGoal | MultiGoal


def parts_of(goal: TipGoal | MultiGoal) -> tuple[GoalPart, ...]:
    """The goals of which one is enough: those of a region, or the goal alone. Of several tips all of them."""
    return goal.parts if isinstance(goal, GoalSet | MultiGoal) else (goal,)


def tolerances(part: GoalPart) -> tuple[float, float]:
    """What the errors of a goal may be at most: distance [m] and angle [rad] (0 for a position)."""
    if isinstance(part, PositionGoal):
        return part.tolerance, 0.0
    return part.position_tolerance, part.orientation_tolerance


def has_task_regions(goal: TipGoal) -> bool:
    """Whether a goal is a task-space region or has one among its members."""
    if isinstance(goal, PoseGoal | PositionGoal):
        return False
    members = goal.members if isinstance(goal, GoalSet) else (goal,)
    return any(isinstance(member, TaskRegion) for member in members)


def as_task_region(part: GoalPart) -> TaskRegion:
    """A pose as a region without freedom, a position as one of any orientation; a region as it is."""
    if isinstance(part, TaskRegion):
        return part
    if isinstance(part, PoseGoal):
        return _freed(part, None, NO_BOX)
    everywhere = np.outer([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], [-np.pi, np.pi])
    place = pin.SE3(np.eye(3), np.array(part.position))
    return TaskRegion(place, everywhere, position_tolerance=part.tolerance)


def tip_errors(goal: TipGoal, robot: Robot, Q: ArrayLike) -> tuple[Vector, Vector]:
    """Distance [m] and angle [rad] of the tip from the nearest part of a goal, for each row of Q, shapes (m,)."""
    if not isinstance(goal, GoalSet):
        return goal.errors(robot, Q)
    each = goal.member_errors(robot, Q)
    best = np.argmin(each[..., 0] + metres_per_radian(robot) * each[..., 1], axis=0)
    position, angle = each[best, np.arange(each.shape[1])].T
    return position, angle


def pose_errors(tips: NDArray[np.float64], target: pin.SE3) -> tuple[Vector, Vector]:
    """Distance [m] and rotation angle [rad] between poses, shape (m, 4, 4), and one target pose."""
    away = tips[:, :3, 3] - target.translation
    position: Vector = np.hypot.reduce(away, axis=1)
    return position, rotation_angles(target.rotation.T @ tips[:, :3, :3])


def _freed(goal: PoseGoal, free_rotation_axis: FrameAxis | None, box: Vector) -> TaskRegion:
    bounds = np.zeros((6, 2))
    bounds[:3] = np.outer(box, [-0.5, 0.5])
    if free_rotation_axis is not None:
        bounds[3 + "xyz".index(free_rotation_axis)] = -np.pi, np.pi
    return TaskRegion(goal.T_world_tip, bounds, pin.SE3.Identity(), *tolerances(goal))
