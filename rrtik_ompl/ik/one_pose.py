"""`solve_ik` for the usual case, a pose without a world: one call of a kernel, in memory that is kept between calls.

The kernel places the tip by forward kinematics, so that what it answers is verified. It leaves to the long way what it
does not know: poses that are no rigid motions, and singular ones; and where its closed form comes only within the
tolerances of a pose, the long way comes nearer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from time import monotonic
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.ik.analytic.branches import UNBOUNDED_ANGLE, tip_fault
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form
from rrtik_ompl.ik.analytic.parallel_arm import parallel_arm
from rrtik_ompl.ik.kernel_tables import call_table, seeded_limb_of
from rrtik_ompl.ik.method_interface import EXACT, SLACK_SHARE, IkResult, mid_range_configuration
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS
from rrtik_ompl.ik.residual import SHARE
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.branch_layout import MATRIX_SIDE
from rrtik_ompl.kernels.ik.ik_layout import CHORD_TOLERANCE, FREE_TURN, NO_TURN, POSITION_TOLERANCE
from rrtik_ompl.kernels.ik.pose_layout import (
    ANSWER_NUMBERS,
    KERNELS,
    LANES,
    MOST_JOINTS,
    STEPS_UNIT,
    ArmTable,
    PoseTable,
)
from rrtik_ompl.kernels.record import WORD
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot

IN_FAMILY = ("parallel_arm", "parallel_axes")  # kernels of closed forms whose arms the kernel of one pose knows
DEFAULT_TOLERANCES = PoseGoal(np.eye(4)).tolerances

SolveSlowly = Callable[..., IkResult]


def solve_one_pose(
    robot: Robot, goal: object, near: object, every: bool, seconds: float, seed: int | None, slowly: SolveSlowly
) -> IkResult | None:
    """Find configurations at a pose as `solve_ik` does without a world; None if that is to go the long way.

    Args:
        robot: The arm.
        goal: A pose as ``PoseGoal``, ``pinocchio.SE3`` or array; all else goes the long way.
        near: As for `solve_ik`, an array or None; all else goes the long way.
        every: Whether all solutions are wanted.
        seconds: As for `solve_ik`.
        seed: As for `solve_ik`.
        slowly: The long way, which finds the reason of a failure once somebody reads it.
    """
    begin = monotonic()
    hint = near if type(near) is np.ndarray and near.dtype == float else None
    usual = (
        type(robot) is Robot
        and type(seconds) is float
        and 0.0 <= seconds < inf
        and (seed is None or (type(seed) is int and seed >= 0))
        and (near is None or (hint is not None and hint.shape == (robot.dof,)))
    )
    if not usual:
        return None
    tolerances = DEFAULT_TOLERANCES
    pose: Matrix  # T_world_tip, shape (4, 4)
    if type(goal) is PoseGoal:
        pose = goal.T_world_tip.homogeneous
        tolerances = goal.position_tolerance, goal.orientation_tolerance
    elif isinstance(goal, pin.SE3):
        pose = goal.homogeneous
    elif type(goal) is np.ndarray and goal.shape == (MATRIX_SIDE, MATRIX_SIDE) and goal.dtype == float:
        pose = goal
    else:
        return None

    arm = _arm_of(robot)
    if arm is None or (every and not arm.knows_all):
        return None
    spare = arm.spare if hint is None else arm.spare_near
    try:  # The call is taken out of the list while it is used, so that two threads never share it.
        call = spare.pop()
    except IndexError:
        call = _Call(arm)
    call.pose[...] = pose
    if hint is not None:
        call.near[...] = hint
    if call.tolerances != tolerances:
        call.set_tolerances(tolerances)

    answer = arm.every(call.address) if every else arm.one(call.address)
    if answer < 0:
        spare.append(call)
        return None
    count = answer % STEPS_UNIT
    if count and arm.knows_all and max(call.numbers[count * robot.dof : count * (robot.dof + 2)]) > EXACT:
        spare.append(call)
        return None
    if count:
        data = call.answers[: count * arm.stride].tobytes()
        spare.append(call)
        return IkResult.later(_found, data, count, robot.dof, answer // STEPS_UNIT, arm.method, monotonic() - begin)

    asked = slowly, robot, call.pose.copy(), tolerances, None if hint is None else hint.copy(), every, seconds, seed
    spare.append(call)
    return IkResult.later(_failed, asked, robot.dof, answer // STEPS_UNIT, arm.method, monotonic() - begin)


def _found(
    name: str, data: bytes, count: int, dof: int, iterations: int, method: IkMethod, seconds: float
) -> dict[str, Any]:
    """Return all fields of a result from the numbers that the kernel has written."""
    del name
    return {
        "solutions": np.ndarray((count, dof), np.float64, data),  # read-only, since bytes are
        "residuals": np.ndarray((count, 2), np.float64, data, WORD * count * dof),
        "reason": "",
        "detail": "",
        "iterations": iterations,
        "method": method,
        "seconds": seconds,
    }


def _failed(
    name: str, asked: tuple[Any, ...], dof: int, iterations: int, method: IkMethod, seconds: float
) -> dict[str, Any]:
    """Return fields of a result without solutions: the reason with its detail, if that is asked for, or the rest."""
    if name not in ("reason", "detail"):
        return {
            "solutions": frozen(np.zeros((0, dof))),
            "residuals": frozen(np.zeros((0, 2))),
            "iterations": iterations,
            "method": method,
            "seconds": seconds,
        }
    slowly, robot, pose, tolerances, near, every, limit, seed = asked
    result = slowly(robot, PoseGoal(pose, *tolerances), near=near, all=every, seconds=limit, seed=seed)
    return {"reason": result.reason, "detail": result.detail}


@dataclass(frozen=True, slots=True, eq=False)
class _Arm:
    """What is known of an arm.

    Attributes:
        robot: The arm.
        table: What the kernels know of it.
        one: Kernel that finds one solution: the nearest, or the first.
        every: Kernel that finds all of them, if the method knows all.
        knows_all: Whether it does.
        method: Name of their method.
        stride: Bytes of a configuration and its residuals.
        spare: Calls near the middle of the limits that are not in use.
        spare_near: The same, near anything.
    """

    robot: Robot
    table: ArmTable
    one: Callable[[int], int]
    every: Callable[[int], int]
    knows_all: bool
    method: IkMethod
    stride: int
    spare: list[_Call] = field(default_factory=list)
    spare_near: list[_Call] = field(default_factory=list)


@kept_with
def _arm_of(robot: Robot) -> _Arm | None:
    """Return what is known of an arm; None if its method is none of the kernels'."""
    limb = seeded_limb_of(robot)
    kernels = library(KERNELS)
    closed = has_closed_form(robot) and not tip_fault(robot, form_of(robot))
    if limb is None or kernels is None or robot.dof > MOST_JOINTS:
        return None
    if closed and form_of(robot).kernel not in IN_FAMILY:
        return None

    family = parallel_arm(robot, robot.tip) if closed else None
    numbers = {} if family is None else {"numbers": np.array(family.in_world(robot).numbers)}
    table = packed(
        ArmTable,
        lowest=np.maximum(robot.lower - LIMIT_TOLERANCE, -UNBOUNDED_ANGLE),
        highest=np.minimum(robot.upper + LIMIT_TOLERANCE, UNBOUNDED_ANGLE),
        weights=np.array(weights_of(robot) if robot.joint_weights else np.ones(robot.dof)),
        turning=((robot.lower < -np.pi) | (robot.upper > np.pi)).astype(np.int32),
        endless=robot.continuous.astype(np.int32),
        limb=limb,
        **numbers,
    )
    stride = WORD * (robot.dof + 2)
    if closed:
        return _Arm(robot, table, kernels.nearest_branch, kernels.all_branches, True, "closed-form", stride)
    return _Arm(robot, table, kernels.walk_to_pose, kernels.walk_to_pose, False, "numeric", stride)


class _Call:
    """Memory of one call.

    Attributes:
        address: Address of its table.
        pose: T_world_tip, shape (4, 4).
        near: Configuration near which solutions are wanted, shape (dof,).
        answers: Bytes that the kernel writes.
        numbers: The same as numbers.
        tolerances: Of the goal [m, rad].
    """

    def __init__(self, arm: _Arm) -> None:
        self._table = table = packed(
            PoseTable,
            arm=arm.table,
            pose=np.eye(MATRIX_SIDE),
            near=np.array(mid_range_configuration(arm.robot)),
            aim=np.zeros(ik_layout.AIM_FLOATS),
            walk=call_table(arm.table.limb, STEPS, PATIENCE),
            rows=np.zeros(ANSWER_NUMBERS),
            lanes=np.zeros(WIDTH * LANES),
        )
        self.address = table.address
        self.pose = table.pose.reshape(MATRIX_SIDE, MATRIX_SIDE)
        self.near: Vector = table.near
        self.numbers = memoryview(table.rows.data)
        self.answers = self.numbers.cast("B")
        self.tolerances = (0.0, 0.0)
        table.aim[FREE_TURN] = NO_TURN

    def set_tolerances(self, tolerances: tuple[float, float]) -> None:
        """Set the tolerances of the goal [m, rad]."""
        self.tolerances = tolerances
        self._table.aim[POSITION_TOLERANCE] = SHARE * tolerances[0]
        self._table.aim[CHORD_TOLERANCE] = SHARE * tolerances[1]
        self._table.slack = SLACK_SHARE * min(tolerances)

    def intact(self) -> bool:
        """Check that no kernel has written beyond an array."""
        return self._table.intact() and self._table.walk.intact()
