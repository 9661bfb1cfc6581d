"""Rules for lists of single-joint moves, shared by planners and shortening."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, dimensions, finite_array, whole_number
from rrtik_ompl.base.errors import InputError, UnknownNameError, at_most, listed, name_of, require
from rrtik_ompl.description.joint_weights import weights_as_costs
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.transitions import merge_moves

MOST_JOINTS = 1_000  # largest number of joints of an arm
OPTIONS = ("joint_costs", "frozen_joints", "last_joints", "smallest_move")  # of planners, as of MoveRules

Joints: TypeAlias = Iterable[int | str]
PerJoint: TypeAlias = ArrayLike  # one number for all joints, or one for each


class MoveRules:
    """The options of planners of single-joint moves, for code that processes their routes.

    Attributes:
        joint_costs: Cost of each joint's travel, shape (n,).
        frozen_joints: Indices of the joints that must not move.
        last_joints: Indices of the joints that move once each, after all others have arrived.
        smallest_move: Least change of each joint in one move, shape (n,) [rad or m].

    Args:
        names: Names of the n joints; if they have none, an empty list, and ``dof`` is needed.
        joint_costs: One number greater than 0, or one for each joint; all 1 if None.
        frozen_joints: By index, from 0, or by name.
        last_joints: By index, from 0, or by name.
        smallest_move: One number of at least 0, or one for each joint.
        dof: Number of joints; the number of names if None.

    Raises:
        InputError: If a number is out of range.
        UnknownNameError: If there is no joint of a name.

    Example:
        >>> rules = rrtik.MoveRules(["base", "elbow", "wrist"], last_joints=["wrist"], joint_costs=[3.0, 2.0, 1.0])
        >>> list(rules.last_joints)
        [2]
    """

    def __init__(
        self,
        names: Iterable[str],
        *,
        joint_costs: PerJoint | None = None,
        frozen_joints: Joints = (),
        last_joints: Joints = (),
        smallest_move: PerJoint = 0.0,
        dof: int | None = None,
    ) -> None:
        names = tuple(name_of(name, "a joint") for name in listed(names, "names of joints"))
        dof = len(names) if dof is None else whole_number(dof, "dof")
        at_most(dof, MOST_JOINTS, "dof")

        self.joint_costs = costs_of_joints(joint_costs, dof)
        self.frozen_joints = joint_numbers(frozen_joints, names, dof, "frozen_joints")
        self.last_joints = joint_numbers(last_joints, names, dof, "last_joints")
        self.smallest_move = smallest_moves(smallest_move, dof)

    @classmethod
    def of_robot(
        cls,
        robot: Robot,
        *,
        joint_costs: PerJoint | None = None,
        frozen_joints: Joints = (),
        last_joints: Joints = (),
        smallest_move: PerJoint = 0.0,
    ) -> MoveRules:
        """Return the rules for a robot; weights of its joints are their costs unless ``joint_costs`` is given."""
        require(robot, Robot, "robot")
        return cls(
            robot.joint_names,
            joint_costs=weights_as_costs(robot).get("joint_costs") if joint_costs is None else joint_costs,
            frozen_joints=frozen_joints,
            last_joints=last_joints,
            smallest_move=smallest_move,
        )

    def kept_by(self, route: Matrix) -> bool:
        """Check whether a route of single-joint moves, shape (k, n), keeps all rules.

        Raises:
            InputError: If it is no route of n joints, or has no row.
        """
        route = self._route(route)

        last_moves = np.diff(route[self.head(route) - 1 :], axis=0)
        moves_of_others = np.delete(last_moves, self.last_joints, axis=1)
        # Number of moves of each joint.
        move_counts = np.count_nonzero(np.diff(merge_moves(route, tolerance=0.0), axis=0), axis=0)
        last_joints_move_once = (move_counts[self.last_joints] <= 1).all()
        frozen_joints_rest = (route[:, self.frozen_joints] == route[0, self.frozen_joints]).all()

        if not frozen_joints_rest or not last_joints_move_once or moves_of_others.any():
            return False
        return long_enough(route, self.smallest_move)

    def head(self, route: Matrix) -> int:
        """Return how many waypoints of a route, shape (k, n), come before the last joints begin to move.

        Raises:
            InputError: For the reasons of :meth:`kept_by`.
        """
        route = self._route(route)
        waiting = (route[:, self.last_joints] == route[0, self.last_joints]).all(axis=1)
        return len(route) if waiting.all() else int(waiting.argmin())

    def _route(self, given: Matrix) -> Matrix:
        """Return a route as an array, shape (k, n), checked to have at least one row."""
        route = finite_array(given, (None, len(self.joint_costs)), "route")
        if len(route) == 0:
            raise InputError("route: needs at least one row")
        return route


def long_enough(route: Matrix, smallest_move: Vector) -> bool:
    """Check whether all moves of a route, shape (k, n), are long enough, with consecutive moves of a joint merged."""
    if not smallest_move.any():
        return True
    moves = np.abs(np.diff(merge_moves(route, tolerance=0.0), axis=0))
    return bool(((moves == 0.0) | (moves >= smallest_move)).all())


def costs_of_joints(costs: PerJoint | None, dof: int) -> Vector:
    """Return checked costs of travel, shape (dof,), from one number for all joints or one for each.

    Raises:
        InputError: If one is not greater than 0.
    """
    found = _per_joint(1.0 if costs is None else costs, dof, "joint_costs")
    if not (found > 0.0).all():
        raise InputError(f"joint_costs: expected numbers greater than 0, got {costs!r}")
    return found


def smallest_moves(size: PerJoint, dof: int) -> Vector:
    """Return checked smallest moves, shape (dof,) [rad or m], from one number for all joints or one for each.

    Raises:
        InputError: If one is negative.
    """
    found = _per_joint(size, dof, "smallest_move")
    if not (found >= 0.0).all():
        raise InputError(f"smallest_move: expected 0 or more, got {size!r}")
    return found


def _per_joint(value: PerJoint, dof: int, what: str) -> Vector:
    """Return one number for each joint, shape (dof,), from one number for all joints or one for each."""
    shape = () if dimensions(value) == 0 else (dof,)
    return np.broadcast_to(finite_array(value, shape, what), dof).astype(np.float64)


def joint_numbers(joints: Joints, names: Sequence[str], dof: int, option: str) -> list[int]:
    """Return the indices of joints that are given by index or name, without repetition.

    Raises:
        InputError: If they are not a list of joint numbers.
        UnknownNameError: If there is no joint of a name.
    """
    numbers = {}
    for joint in listed(joints, f"{option}: joints"):
        if isinstance(joint, str):
            if joint not in names:
                raise UnknownNameError(f"{option}: joint", joint, names)
            numbers[list(names).index(joint)] = True
        elif isinstance(joint, bool) or not isinstance(joint, int | np.integer) or not 0 <= joint < dof:
            raise InputError(f"{option}: expected joint numbers from 0 to {dof - 1}, got {joint!r}")
        else:
            numbers[int(joint)] = True
    return list(numbers)
