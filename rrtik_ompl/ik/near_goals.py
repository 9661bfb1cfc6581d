"""The free configurations at a pose or a position of the tip that are nearest to the start of a problem.

This is the usual goal of the tip in a few calls of kernels: they walk there, or take all branches of a closed form, and
sort what they find; then configurations are checked, the nearest first, until enough of them are free. The answer
depends on the problem alone. A pose may leave its turn about one axis free, which need not go through the tip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.ik.analytic.closed_form import has_closed_form
from rrtik_ompl.ik.kernel_tables import call_table, pose_numbers, seeded_limb_of, seeds_of
from rrtik_ompl.ik.method_interface import SAME_POSTURE
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS
from rrtik_ompl.ik.one_pose import solve_one_pose
from rrtik_ompl.ik.residual import error_of_one
from rrtik_ompl.ik.solve import SECONDS, solve_in_any_way
from rrtik_ompl.ik.targets import goal_rows
from rrtik_ompl.kernels.ik.ik_layout import FREE_TURN, POSE_NUMBERS, LimbTable
from rrtik_ompl.kernels.ik.near_layout import CAPACITY, KERNELS, SLIDES, STARTS, NearTable
from rrtik_ompl.kernels.simd.library import Library, library
from rrtik_ompl.kernels.tables.memory import packed, with_own_arrays
from rrtik_ompl.model.goal import Goal, GoalSet, PoseGoal, PositionGoal, Target
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.problem import Problem

SAME_PLACE = 0.01  # [rad] or [m] of a joint: of nearer ones that slide the nearest to the start is kept
APART = 0.02  # [rad] or [m] of a joint by which those that slide are apart: each is searched to
AT_ONCE = 16  # configurations that are checked together
TURNS = 3  # coordinates of a region from which on they are angles
HERE = np.eye(4)


def near_goals(problem: Problem, most: int) -> Matrix | None:
    """Return free configurations at the goal of a problem, the nearest to its start first.

    They differ from each other, are within the limits, and at most ``FAR`` times as far as the nearest.

    Args:
        problem: The problem.
        most: Largest number of configurations.

    Returns:
        Shape (k, dof), k from 1 to ``most``; None if none is found, or the goal is of another kind than the kernels
        know, so that it has to be searched.
    """
    robot = problem.robot
    aim = None if problem.constraints else _aim_of(problem.goal)
    arm = _arm_of(robot)
    if arm is None or aim is None:
        return None

    branches: Matrix | None = None
    if isinstance(problem.goal, PoseGoal) and has_closed_form(robot):
        branches = _free_branches(problem)
        if branches is None:
            return None
    try:
        search = arm.spare.pop()
    except IndexError:  # none was made yet, or all are in use
        search = _Search(arm)
    if branches is None:
        found = search.walked(aim, problem.start, most, problem.world.checks.certified)
    else:
        found = search.turned(branches, problem.start, most)
    arm.spare.append(search)
    return found if len(found) else None


def looked_for(problem: Problem) -> bool:
    """Check whether :func:`near_goals` looks for configurations at the goal of a problem."""
    return not problem.constraints and _aim_of(problem.goal) is not None and _arm_of(problem.robot) is not None


def starts_at_goal(problem: Problem) -> bool:
    """Check whether the start of a problem is at its goal, one of the tip."""
    goal = problem.goal
    if not isinstance(goal, Target):
        return problem.reached(problem.start)
    distance, angle = error_of_one(problem.robot, goal, problem.start)
    return distance <= goal.tolerances[0] and angle <= goal.tolerances[1]


@dataclass(frozen=True, slots=True, eq=False)
class _Aim:
    """A goal as kernels know it.

    Attributes:
        row: The goal of a frame that is rigidly joined to the tip, shape (18,), see `rrtik_ompl.ik.targets`.
        frame: T_tip_frame, shape (4, 4); None for the tip itself.
        counts: How many of the six coordinates of the frame take a joint. A turn that is free saves two, as five joints
            that point a tool straight down can turn about it.
    """

    row: Vector
    frame: Matrix | None
    counts: int


def _aim_of(goal: Goal) -> _Aim | None:
    """Return a goal as kernels know it; None for one of another kind, such as a region with ranges."""
    if isinstance(goal, (PoseGoal, PositionGoal)):
        return _Aim(goal_rows(goal)[0], None, 6 if goal.oriented else 3)
    if isinstance(goal, GoalSet) and len(goal.members) == 1 and isinstance(goal.members[0], PoseGoal):
        turns = goal.free_rotation_axis is not None
        return _Aim(goal_rows(goal)[0], None, 6 - 2 * turns - int(np.count_nonzero(goal.box)))
    if not isinstance(goal, TaskRegion):
        return None

    # The frame is that of the region, displaced: what is left free is a whole turn about one of its axes.
    (places,) = np.nonzero(goal.bounds.any(axis=1))
    if len(places) != 1 or places[0] < TURNS or np.ptp(goal.bounds[places[0]]) < TAU:
        return None
    row = goal_rows(PoseGoal(goal.T_world_w, *goal.tolerances))[0]
    row[FREE_TURN] = places[0] - TURNS
    return _Aim(row, goal.T_w_tip.inverse().homogeneous, 4)


def _free_branches(problem: Problem) -> Matrix | None:
    """Return the free branches of the closed form at a pose, shape (k, dof); None if they are not all that there is."""
    solved = solve_one_pose(problem.robot, problem.goal, problem.start, True, SECONDS, 0, solve_in_any_way)
    if solved is None:
        return None
    rows = solved.solutions
    return rows[problem.world.checks.free(rows)]


@dataclass(frozen=True, slots=True, eq=False)
class _Arm:
    """What is known of an arm.

    Attributes:
        robot: The arm.
        limb: What the kernels know of it.
        kernels: These.
        spare: Searches that are not in use, so that two threads never share one.
    """

    robot: Robot
    limb: LimbTable
    kernels: Library
    spare: list[_Search] = field(default_factory=list)


@kept_with
def _arm_of(robot: Robot) -> _Arm | None:
    """Return what is known of an arm; None without kernels, or if a joint depends on several entries of q."""
    kernels = library(KERNELS)
    limb = seeded_limb_of(robot)
    return None if kernels is None or limb is None else _Arm(robot, limb, kernels)


class _Search:
    """Memory of one search at a time."""

    def __init__(self, arm: _Arm) -> None:
        robot = arm.robot
        turning = robot.chain.whole_turns() & ~robot.continuous & (robot.upper - robot.lower >= TAU)
        self._kernels = arm.kernels
        self._arm = arm
        self._dof = robot.dof
        self._frame = HERE  # T_tip_frame: what is brought to the goal
        self._limb = with_own_arrays(arm.limb, fixed=arm.limb.fixed, seed_tips=arm.limb.seed_tips)
        self._table = table = packed(
            NearTable,
            limb=self._limb,
            walk=call_table(arm.limb, STEPS, PATIENCE, STARTS),
            posture=np.zeros(robot.dof),
            weights=np.array(weights_of(robot) if robot.joint_weights else np.ones(robot.dof)),
            endless=robot.continuous.astype(np.int32),
            turning=turning.astype(np.int32),
            rows=np.zeros(CAPACITY * robot.dof),
            squares=np.zeros(CAPACITY),
            free=np.zeros(CAPACITY, dtype=np.int32),
            chosen=np.zeros(CAPACITY, dtype=np.int32),
        )
        self._rows: Matrix = table.rows.reshape(CAPACITY, robot.dof)

    def walked(self, aim: _Aim, posture: Vector, most: int, free: Callable[[Matrix], Mask]) -> Matrix:
        """Return free configurations at a goal, the nearest to a posture first, at most so many, shape (k, dof).

        Args:
            aim: The goal.
            posture: Shape (dof,).
            most: How many.
            free: Tells which rows, shape (m, dof), are free.
        """
        table = self._table
        table.posture[:] = posture
        table.walk.aims[:] = aim.row
        self._bring(HERE if aim.frame is None else aim.frame)
        slides = self._dof > aim.counts
        table.put(slides=SLIDES * slides, least=SAME_PLACE if slides else SAME_POSTURE)
        table.apart = APART if slides else SAME_POSTURE

        count = self._kernels.walk_near(table.address)
        chosen = 0
        for first in range(0, count, AT_ONCE):
            end = min(first + AT_ONCE, count)
            table.free[first:end] = free(self._rows[first:end])
            chosen = self._kernels.choose_near(table.address, end, most)
            if chosen == most:
                break
        return self._chosen(chosen)

    def _bring(self, frame: Matrix) -> None:
        """Have a frame brought to the goal; T_tip_frame, shape (4, 4)."""
        if (frame == self._frame).all():
            return
        self._frame = frame
        last = self._arm.limb.fixed[-POSE_NUMBERS:]
        tip = np.eye(4)
        tip[:3, :3] = last[:9].reshape(3, 3)
        tip[:3, 3] = last[9:]
        self._limb.fixed[-POSE_NUMBERS:] = pose_numbers((tip @ frame)[None])[0]
        self._limb.seed_tips[:] = pose_numbers(seeds_of(self._arm.robot).tips @ frame).ravel()

    def turned(self, rows: Matrix, posture: Vector, most: int) -> Matrix:
        """Return the nearest to a posture of some free configurations and of those a full turn of a joint away.

        Args:
            rows: The configurations, shape (m, dof).
            posture: Shape (dof,).
            most: How many, at most, shape (k, dof).
        """
        table = self._table
        table.posture[:] = posture
        table.walk.q[: rows.size] = rows.ravel()
        table.free[:] = 1
        table.put(least=SAME_POSTURE, apart=SAME_POSTURE)
        count = self._kernels.turn_near(table.address, len(rows))
        return self._chosen(self._kernels.choose_near(table.address, count, most))

    def _chosen(self, count: int) -> Matrix:
        rows: Matrix = self._rows[self._table.chosen[:count]]
        return rows

    def intact(self) -> bool:
        """Check that no kernel has written beyond an array."""
        return self._table.intact() and self._table.walk.intact()
