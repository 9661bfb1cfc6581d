"""Inverse kinematics by one call: checked configurations at a goal, or the reason why there is none."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, frozen, not_negative
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import IkMethod, one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.units import closest_configuration
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik.method_interface import (
    IkRequest,
    IkResponse,
    RandomStream,
    different_rows,
    mid_range_configuration,
    nearest_first,
)
from rrtik_ompl.ik.method_interface import IkResult as IkResult
from rrtik_ompl.ik.methods import METHODS, load_kernels
from rrtik_ompl.ik.multi_goals import PROJECTION, solve_all_tips
from rrtik_ompl.ik.one_pose import solve_one_pose
from rrtik_ompl.ik.residual import error_of_one
from rrtik_ompl.ik.targets import leaves_freedom, targets
from rrtik_ompl.model.goal import TIP_GOALS, MultiGoal, PoseGoal, Target, TipGoal, has_continuous, joint_difference
from rrtik_ompl.model.robot import Robot, inside_limits
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.world import World, check_world

SECONDS = 1.0  # default time limit of a numeric method [s]
METHOD = "inverse kinematics method"  # in messages
DRAWS = 32  # targets drawn from a goal that leaves freedom; one for each part if it has more parts
COMPARED = 1_000_000  # rows times parts of a goal that are compared at once, which takes some tenths of a second


def list_methods() -> tuple[IkMethod, ...]:
    """Return the names that `solve_ik` takes as a method, apart from "auto".

    Example:
        >>> {"closed-form", "numeric", "genetic"} <= set(rrtik.ik.list_methods())
        True
    """
    return tuple(METHODS)


def solve_ik(
    robot: Robot,
    goal: TipGoal | MultiGoal | ArrayLike | pin.SE3,
    *,
    method: IkMethod = "auto",
    near: ArrayLike | None = None,
    all: bool = False,
    world: World | None = None,
    seconds: float = SECONDS,
    seed: int | None = 0,
) -> IkResult:
    """Find configurations at a goal.

    Args:
        robot: The arm.
        goal: A pose, a position, or a region with some freedom (from which targets are drawn); or a pose in any form
            that `PoseGoal` takes; or a `MultiGoal`, for several tips at once.
        method: A name from `list_methods`, or "auto": the closed form where it fits, otherwise "numeric", or
            "projection" for task-space regions. "auto" also takes one of these two if the closed form finds nothing
            for the targets drawn from a region or for a singular pose. For several tips it is projection. The other
            methods are there for comparison.
        near: Configuration near which a solution is wanted, shape (dof,); the middle of the limits if None. A closed
            form gives the nearest solution (for a singular pose the nearest of its representatives), by the weighted
            distance if joints have weights; a numeric method gives the first that it finds from there.
        all: Whether to return every solution that the method finds, not just one. A closed form gives all branches (for
            a singular pose representatives), each in the turns nearest to ``near``, so a UR arm has at most eight; a
            numeric method gives those that it comes across, and solutions that differ by full turns of a joint count
            as different.
        world: If given, solutions in collision are left out. Its robot must be this one.
        seconds: Wall time that a numeric method may take [s]. The clock is read between rounds, and the first round is
            always done.
        seed: Seed of the random numbers; the same seed gives the same answer as long as time does not run out. None
            draws one.

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If the method does not fit the robot and the goal, or an argument makes no sense.

    Example:
        >>> robot = rrtik.load_robot("panda")
        >>> q = rrtik.solve_ik(robot, [0.4, 0.2, 0.5, np.pi, 0.0, 0.0], seed=1).require()
        >>> robot.fk(q).translation.round(2)
        array([0.4, 0.2, 0.5])
    """
    if isinstance(method, str) and method == "auto" and world is None and (all is False or all is True):
        quick = solve_one_pose(robot, goal, near, all, seconds, seed, solve_in_any_way)
        if quick is not None:
            return quick
    return solve_in_any_way(robot, goal, method=method, near=near, all=all, world=world, seconds=seconds, seed=seed)


def solve_in_any_way(
    robot: Robot,
    goal: TipGoal | MultiGoal | ArrayLike | pin.SE3,
    *,
    method: IkMethod = "auto",
    near: ArrayLike | None = None,
    all: bool = False,
    world: World | None = None,
    seconds: float = SECONDS,
    seed: int | None = 0,
) -> IkResult:
    """Find configurations at any goal, by any method, as `solve_ik`."""
    check_world(world, robot)
    one_of(get_args(IkMethod), method, METHOD)
    require(all, bool, "all")
    load_kernels(robot)

    budget = Budget(seconds=not_negative(seconds, "seconds"))
    random = RandomStream(seed)
    posture = mid_range_configuration(robot) if near is None else robot.configuration(near, "near")

    def accept(Q: Matrix) -> Mask:
        return free_of_collision(world, Q)

    if isinstance(goal, MultiGoal):
        if method not in ("auto", PROJECTION):
            raise InputError(f"method '{method}' is for one tip; use {PROJECTION}")
        scene = Scene() if world is None else world.scene
        found = solve_all_tips(robot, goal, posture, accept, budget, random.rng, scene=scene)
        return found if all else found.nearest()

    goal = _tip_goal(goal)
    drawn = (goal,) if isinstance(goal, Target) else tuple(targets(goal, max(DRAWS, len(goal.parts)), random.rng))
    name = chosen_method(robot, drawn, method)
    if method == "auto" and name == "numeric":
        name = _walking_method(goal)

    request = IkRequest(robot, goal, drawn, posture, accept, all, budget, random, world)
    return _solve_by(request, name, method == "auto")


def free_of_collision(world: World | None, Q: Matrix) -> Mask:
    """Check which configurations, shape (k, dof), are free: by the fast check first, then by the independent one.

    Returns:
        Mask, shape (k,); all True if there is no world.
    """
    if world is None or len(Q) == 0:
        return ~np.zeros(len(Q), dtype=bool)  # This takes a third of the time of np.ones().
    free = np.array(world.checks.free(Q))
    free[free] = world.checks.certified(Q[free])
    return free


def _tip_goal(goal: TipGoal | ArrayLike | pin.SE3) -> TipGoal:
    """Return the goal itself, or a `PoseGoal` if it is given as a pose; raise an error for anything else."""
    taken: Any = PoseGoal(goal) if isinstance(goal, (pin.SE3, np.ndarray, list, tuple)) else goal
    if not isinstance(taken, TipGoal):
        require(taken, TIP_GOALS, "goal", "inverse kinematics needs a goal of the tip, such as PoseGoal(T_world_tip)")
    return taken  # type: ignore[no-any-return]


def chosen_method(robot: Robot, drawn: tuple[Target, ...], method: IkMethod) -> IkMethod:
    """Return the name of the method for targets: the first that fits if ``method`` is "auto".

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If it does not fit.
    """

    def misfit(name: IkMethod) -> str:
        """Return why a method does not fit the targets; "" if it does."""
        for target in drawn:
            fault = METHODS[name].misfit(robot, target)
            if fault:
                return fault
        return ""

    if method == "auto":
        return next(name for name in METHODS if not misfit(name))
    fault = misfit(one_of(get_args(IkMethod), method, METHOD))
    if fault:
        raise InputError(
            f"method '{method}' does not fit robot '{robot.name}' and this goal: {fault}; "
            f"what fits: {', '.join(name for name in METHODS if not misfit(name))}"
        )
    return method


def _walking_method(goal: TipGoal) -> IkMethod:
    """Return the method that moves to the goal with all its freedom, not to targets drawn from it."""
    return "projection" if goal.has_regions else "numeric"


def _solve_by(request: IkRequest, name: IkMethod, auto: bool) -> IkResult:
    """Run a method and return its checked solutions, or the reason why there are none.

    If the method was chosen by "auto", finds nothing, and covered only a part of the goal (drawn targets, or samples of
    a singular pose's curve), the method that moves to the whole goal is run too.

    Args:
        request: The problem.
        name: The method to run.
        auto: Whether it was chosen by "auto".
    """
    robot = request.robot
    goal = request.goal
    response = METHODS[name].run(request)

    nearest = None if request.all else _nearest(request, response.q)
    if nearest is not None:
        return IkResult(*nearest, "", "", response.iterations, name, request.budget.elapsed)

    q, residuals, free = _rows_at_goal(request, response.q)
    took_draws = _takes_draws_alone(name, goal)
    took_part_of_a_curve = name == "closed-form" and response.singular and len(q) == 0
    if auto and not free.any() and (took_draws or took_part_of_a_curve):
        walked = _solve_by(request, _walking_method(goal), False)
        # For a singular pose the closed form gives the better reason.
        if walked.found or took_draws:
            return walked

    (rows,) = free.nonzero()
    order = rows[nearest_first(robot, q[rows], request.near)]
    turned = joint_difference(robot, q, request.near)
    chosen = different_rows(turned, order) if request.all else order[:1]
    reason = detail = ""
    if len(chosen) == 0:
        reason, detail = _why(request, response, name, q)
    return IkResult(
        solutions=frozen(np.where(robot.continuous, request.near + turned[chosen], q[chosen])),
        residuals=frozen(residuals[chosen]),
        reason=reason,
        detail=detail,
        iterations=response.iterations,
        method=name,
        seconds=request.budget.elapsed,
    )


def _nearest(request: IkRequest, q: Matrix) -> tuple[Matrix, Matrix] | None:
    """Check the row of q, shape (k, dof), that is inside the limits and nearest to the wanted posture.

    This is the fast path: mostly this row will do, and then the others need no check.

    Returns:
        The row, shape (1, dof), and its residuals, shape (1, 2) [m, rad]; None if it is not at the goal or not
        accepted.
    """
    robot = request.robot
    within_limits = q  # Mostly all rows are inside, and this test takes half the time of clamping them.
    if not ((q >= robot.lower) & (q <= robot.upper)).all():
        within_limits = robot.clamp(q[inside_limits(robot, q)])

    if len(within_limits) > 1:
        difference = weighted_difference(robot, within_limits, request.near)
        nearest = int(np.vecdot(difference, difference).argmin())
        within_limits = within_limits[nearest : nearest + 1]
    reaching, residuals = _at_goal(robot, request.goal, within_limits)
    if len(reaching) == 0 or not request.accept(reaching)[0]:
        return None

    if has_continuous(robot):
        turned = joint_difference(robot, reaching, request.near)
        reaching = np.where(robot.continuous, request.near + turned, reaching)
    return frozen(reaching), frozen(residuals)


def _rows_at_goal(request: IkRequest, q: Matrix) -> tuple[Matrix, Matrix, Mask]:
    """Select the rows of q inside the limits and at the goal: accepted ones or, if there are none, rejected ones.

    Rows are compared with the goal in blocks, nearest first. Unless all solutions are wanted, the first block with a
    row at the goal is enough. Of the rejected rows, which only serve the reason of a failure, one block is compared.

    Returns:
        The rows, shape (k, dof); their residuals, shape (k, 2) [m, rad]; and whether they are accepted, shape (k,).
    """
    robot = request.robot
    goal = request.goal
    rows = robot.clamp(q[inside_limits(robot, q)])
    free = request.accept(rows)
    chosen = rows[free]
    block = _rows_at_a_time(goal)
    if not request.all and len(chosen) > block:
        chosen = chosen[nearest_first(robot, chosen, request.near)]

    found = [(chosen[:0], np.zeros((0, 2)))]
    for k in range(0, len(chosen), block):
        found.append(_at_goal(robot, goal, chosen[k : k + block]))
        if len(found[-1][0]) and not request.all:
            break
    at_goal, residuals = (np.concatenate(each) for each in zip(*found, strict=True))
    if len(at_goal):
        return at_goal, residuals, np.ones(len(at_goal), dtype=bool)

    at_goal, residuals = _at_goal(robot, goal, rows[~free][:block])
    return at_goal, residuals, np.zeros(len(at_goal), dtype=bool)


def _at_goal(robot: Robot, goal: TipGoal, q: Matrix) -> tuple[Matrix, Matrix]:
    """Return the rows of q at the goal, shape (k, dof), and their residuals, shape (k, 2) [m, rad].

    For a goal of several parts, the residuals are those from the part to which a row is nearest.
    """
    if len(q) == 0:
        return q, np.zeros((0, 2))
    if len(q) == 1 and isinstance(goal, Target):
        position, angle = error_of_one(robot, goal, q[0])
        max_distance, max_angle = goal.tolerances
        count = int(position <= max_distance and angle <= max_angle)
        return q[:count], np.array([[position, angle]])[:count]

    residuals = np.array(goal.errors(robot, q)).T
    is_at_goal = (residuals <= goal.tolerances).all(axis=1) if isinstance(goal, Target) else goal.satisfied(robot, q)
    return q[is_at_goal], residuals[is_at_goal]


def _rows_at_a_time(goal: TipGoal) -> int:
    """Return how many rows to compare with a goal at once; thousands of rows and of grasps would take minutes."""
    return max(1, COMPARED // len(goal.parts))


def _takes_draws_alone(name: str, goal: TipGoal) -> bool:
    """Check whether a method uses only targets drawn from a goal that leaves more freedom than these."""
    return name not in ("projection", _walking_method(goal)) and any(map(leaves_freedom, goal.parts))


def _why(request: IkRequest, answer: IkResponse, name: str, q: Matrix) -> tuple[str, str]:
    """Return reason and detail of a failure, see `IkResult`.

    Args:
        request: The problem.
        answer: What the method answered.
        name: Name of the method.
        q: Configurations at the goal that were rejected, all in collision, shape (k, dof).
    """
    robot = request.robot
    goal = request.goal
    if len(q) and request.world is not None:
        count = f"{len(q)} configurations" + (" or more" if len(q) >= _rows_at_a_time(goal) else "")
        return "collision", f"{count} reach the goal, all in collision: {request.world.explain(q[0])}"

    fault = robot.limit_fault(answer.nearest)
    reached = bool(goal.satisfied(robot, answer.nearest[None])[0])
    if reached and not fault:
        return "time", f"the goal is in reach, but the method gave up after {answer.iterations} steps"
    if _takes_draws_alone(name, goal):
        return "time", f"none of {len(request.targets)} targets drawn from the goal is reached inside the limits"
    if reached and answer.singular:
        return "limits", f"the arm could reach this singular pose in many postures, all outside the limits: {fault}"
    if reached:
        return "limits", f"the arm could reach the goal, but {fault}"

    ((distance,), (angle,)) = goal.errors(robot, answer.nearest[None])
    closest = closest_configuration(distance, angle if goal.oriented else 0.0)
    if answer.timed_out and not all(_out_of_reach(robot, target) for target in request.targets):
        return "time", f"no solution in time; {closest}"
    return "unreachable", closest


def _out_of_reach(robot: Robot, target: Target) -> bool:
    """Check whether a target is certainly out of reach by the lengths of the arm."""
    from rrtik_ompl.ik.mb_rrt.search import out_of_reach  # It is loaded here, since only failures need it.

    return out_of_reach(robot, target)
