"""Base of the planners that move one joint at a time: their options, frozen joints, and joints that move last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import iteration_limit
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.crdt.rules import KERNELS, CrdtRules
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.planning.moves.rules import Joints, MoveRules, PerJoint, long_enough

NO_ENDING = "last_joints: they cannot go straight to the goal after all others, or would have to move too little"


class OneJointPlanner(SafePlanner):
    """Base class; a subclass implements :meth:`between`, which need not handle joints that stay or move last.

    Attributes:
        ompl_name: Name of the class in OMPL's reports.
        options: The checked options.
    """

    ompl_name: ClassVar[str]
    kernels: ClassVar[tuple[str, ...]] = (KERNELS,)
    one_joint: ClassVar[bool] = True

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        scale_by_range: bool = False,
        max_iterations: int | None = None,
        joint_costs: PerJoint | None = None,
        frozen_joints: Joints = (),
        smallest_move: PerJoint = 0.0,
        last_joints: Joints = (),
    ) -> None:
        """Make a planner; these options, in addition to those of `SafePlanner`, hold for all that move single joints.

        Args:
            scale_by_range: Whether the metric of the nearest neighbour divides each coordinate by its range.
            max_iterations: Largest number of iterations, K of [1, ch. 6.3, algorithms 9 to 11]; without limit if None.
            joint_costs: Cost of each joint's motion, greater than 0, shape (n,); a slow or risky joint costs more. The
                metric multiplies a joint's coordinate by its cost, and the joint moves only for a share of the samples,
                the lowest cost divided by its own, so that it moves less often. All equal if None.
            frozen_joints: Joints that must not move, by number (from 0) or, with a world, by name. Starts and goals
                have to agree in them exactly; those that do not are left out.
            smallest_move: Least length of each move of a path [rad or m], one number or one for each joint.
            last_joints: Joints that stay until all others have arrived, by number or name, such as the gripper's
                rotation; then they go straight to the goal, one after the other in this order. Goals for which these
                motions are not free are left out.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
            UnknownNameError: If there is no joint of a name.
        """
        super().__init__(si, self.ompl_name, world=world, seed=seed)
        self.options = OneJointOptions(
            joint_names(world),
            si.getStateDimension(),
            scale_by_range=scale_by_range,
            max_iterations=max_iterations,
            joint_costs=joint_costs,
            frozen_joints=frozen_joints,
            smallest_move=smallest_move,
            last_joints=last_joints,
        )

    def between(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """Look for a path from one of the starts to one of the goals; for subclasses.

        Args:
            starts: Start configurations, shape (s, n), that agree with the goals in the joints that stay.
            goals: Goal configurations, shape (g, n).
            checker: Checks motions.
            ptc: Returns True when it is time to stop.
        """
        raise NotImplementedError(f"{type(self).__name__} has no between()")

    def completed(self, found: SearchResult, path: Matrix) -> SearchResult:
        """Return a result whose path is extended by the last moves to ``path``, shape (k, n).

        A subclass whose statistics count moves overrides this.
        """
        return replace(found, path=path)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        starts, goals = self.options.agreeing(starts, goals)
        last = self.options.last_joints
        starts = starts[(starts[:, last] == starts[0, last]).all(axis=1)]
        endings = Endings(starts[0], goals, last, self.options.smallest_move, checker)
        if len(endings.aims) == 0:
            return SearchResult(None, reason=NO_ENDING)
        found = self.between(starts, endings.aims, checker, ptc)
        return found if found.path is None else self.completed(found, endings.completed(found.path))


class OneJointOptions(MoveRules):
    """The checked options: rules for moves, and how the trees grow.

    Args:
        names: The joints' names, empty if they are not known.
        dof: Number of joints.
        scale_by_range: See :class:`~rrtik_planners.one_joint_planner.OneJointPlanner`.
        max_iterations: See :class:`~rrtik_planners.one_joint_planner.OneJointPlanner`.
        rules: Options of `MoveRules`.

    Raises:
        InputError: If an option is out of range.
        UnknownNameError: If there is no joint of a name.
    """

    def __init__(
        self, names: Sequence[str], dof: int, *, scale_by_range: bool, max_iterations: int | None, **rules: Any
    ) -> None:
        super().__init__(names, dof=dof, **rules)
        self.scale_by_range = scale_by_range
        self.max_iterations = iteration_limit(max_iterations)
        self._names = names or [str(k) for k in range(dof)]

    def agreeing(self, starts: Matrix, goals: Matrix) -> tuple[Matrix, Matrix]:
        """Return the starts and goals that agree in the frozen joints with the first start that fits a goal.

        Raises:
            InputError: If no start agrees with a goal.
        """
        frozen = self.frozen_joints
        if not frozen:
            return starts, goals

        for start in starts:
            fitting = (goals[:, frozen] == start[frozen]).all(axis=1)
            if fitting.any():
                return starts[(starts[:, frozen] == start[frozen]).all(axis=1)], goals[fitting]

        joint = next(k for k in frozen if starts[0, k] != goals[0, k])
        raise InputError(
            f"frozen_joints: joint '{self._names[joint]}' must not move, but it is at {starts[0, joint]:.9g} at the "
            f"start and at {goals[0, joint]:.9g} at the goal; let it move or change one of them"
        )

    @property
    def staying(self) -> list[int]:
        """Indices of the joints that do not move before the last moves."""
        return [*self.frozen_joints, *self.last_joints]

    def growth(self, lower: Vector, upper: Vector, start: Vector) -> CrdtRules:
        """Return the rules by which trees grow, with the joints that stay fixed at their values in ``start``.

        Args:
            lower: Lower bounds, shape (n,).
            upper: Upper bounds, shape (n,).
            start: Start configuration, shape (n,).
        """
        scale = self.joint_costs / (upper - lower) if self.scale_by_range else self.joint_costs
        lower = lower.copy()
        upper = upper.copy()
        lower[self.staying] = upper[self.staying] = start[self.staying]
        return CrdtRules(lower, upper, scale, self.smallest_move, self.joint_costs.min() / self.joint_costs)

    def accepts(self, path: Matrix) -> bool:
        """Check that no move of a path, shape (k, n), is too short after joining successive moves of the same joint."""
        return long_enough(path, self.smallest_move)


def joint_names(world: object) -> Sequence[str]:
    """Return the joint names of a world's robot; none if it has no robot."""
    names: Sequence[str] = getattr(getattr(world, "robot", None), "joint_names", ())
    return names


class Endings:
    """The last moves to each goal: the joints that move last go straight to it, one after the other.

    Attributes:
        aims: Configurations where the last moves begin, shape (k, n): the goals whose last moves are free, with the
            last joints as at the start. Without joints that move last these are the goals themselves.

    Args:
        start: Start configuration, whose values the last joints keep until all others have arrived, shape (n,).
        goals: Goal configurations, shape (g, n).
        joints: Indices of the joints that move last, in this order.
        smallest_move: Least length of a move of each joint, shape (n,); goals that need a shorter last move are left
            out.
        checker: Checks the last moves.
    """

    def __init__(
        self, start: Vector, goals: Matrix, joints: Sequence[int], smallest_move: Vector, checker: MotionChecker
    ) -> None:
        endings = [_last_moves(start, goal, joints) for goal in goals]
        if joints:
            endings = [ending for ending in endings if long_enough(ending, smallest_move) and _free(ending, checker)]
        self._endings = endings
        self.aims: Matrix = np.array([ending[0] for ending in endings]).reshape(-1, goals.shape[1])

    def completed(self, path: Matrix) -> Matrix:
        """Return a path to one of the aims, shape (k, n), extended by the last moves to its goal."""
        reached = int((self.aims == path[-1]).all(axis=1).argmax())
        return np.vstack([path, self._endings[reached][1:]])


def _last_moves(start: Vector, goal: Vector, joints: Sequence[int]) -> Matrix:
    """Return the waypoints of the last moves, from where they begin to the goal, shape (k, n).

    Joints that are at their goal values already make no move.
    """
    row = goal.copy()
    row[list(joints)] = start[list(joints)]
    rows = [row]
    for joint in joints:
        if rows[-1][joint] != goal[joint]:
            row = rows[-1].copy()
            row[joint] = goal[joint]
            rows.append(row)
    return np.array(rows)


def _free(ending: Matrix, checker: MotionChecker) -> bool:
    if len(ending) == 1:
        return True
    return checker.valid(ending[0]) and bool(checker.motion_valid_batch(ending[:-1], ending[1:]).all())
