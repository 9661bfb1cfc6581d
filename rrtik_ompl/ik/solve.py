"""Inverse kinematics by one call: from a goal to configurations that were checked, or the reason why there is none."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen, not_negative
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import IkMethod, one_of
from rrtik_ompl.base.errors import InputError, require
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
from rrtik_ompl.ik.residual import error_of_one
from rrtik_ompl.ik.targets import leaves_freedom, targets
from rrtik_ompl.model.goal import TIP_GOALS, MultiGoal, PoseGoal, Target, TipGoal, has_continuous, joint_difference
from rrtik_ompl.model.robot import Robot, inside_limits
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.world import World, check_world

SECONDS = 1.0  # of a numeric method, unless said otherwise
METHOD = "inverse kinematics method"  # in messages
DRAWS = 32  # targets drawn from a goal that leaves freedom; one for each part if it has more parts
COMPARED = 1_000_000  # rows times parts of a goal at once, some tenths of a second
DIGITS = 9  # of metres and degrees in a message: less is rounding


def list_ik_methods() -> tuple[IkMethod, ...]:
    """Names that `solve_ik` takes as a method, beside "auto"."""
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
    seed: int = 0,
) -> IkResult:
    """Find configurations at a goal.

    Args:
        robot: The arm.
        goal: A pose, a position, or a region with some freedom (of which targets are drawn); or a pose in any form that
            `PoseGoal` takes; or a `MultiGoal`, for several tips at once.
        method: A name from `list_ik_methods`; "auto" is the closed form where it fits, else (and where the targets
            drawn from a region, or the curve of a singular pose, bring none) numeric, or projection onto task-space
            regions; the others are there to be compared. Of several tips it is projection.
        near: Posture near which a solution is wanted, shape (dof,); the middle of the limits if None. A closed form
            gives the nearest one there is (of a singular pose its nearest representative; where joints have weights, by
            their weighted way), a numeric method the first that it finds on its way from there.
        all: Every solution that the method finds, not just one: a closed form gives all branches (of a singular pose
            representatives), each in the turns nearest to ``near``; a numeric one those it comes across, full turns
            of a joint counted apart.
        world: If given, solutions in collision are left out. Its robot must be this one.
        seconds: Wall time that a numeric method may take; the clock is read between rounds, of which the first is done.
        seed: Of the random numbers; the same seed gives the same answer as long as the time does not cut in.

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If the method does not fit the robot and the goal, or an argument makes no sense.
    """
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
    """Which configurations, shape (k, dof), are free: by the fast check first, then by the independent one.

    All are if there is no world.
    """
    if world is None or len(Q) == 0:
        return ~np.zeros(len(Q), dtype=bool)  # in a third of the time of numpy's own ones
    free = np.array(world.checks.free(Q))
    free[free] = world.checks.certified(Q[free])
    return free


def _tip_goal(goal: TipGoal | ArrayLike | pin.SE3) -> TipGoal:
    """The goal itself, or that of a pose."""
    taken: Any = PoseGoal(goal) if isinstance(goal, (pin.SE3, np.ndarray, list, tuple)) else goal
    if not isinstance(taken, TipGoal):
        require(taken, TIP_GOALS, "goal", "inverse kinematics needs a goal of the tip, such as PoseGoal(T_world_tip)")
    return taken  # type: ignore[no-any-return]


def chosen_method(robot: Robot, drawn: tuple[Target, ...], method: IkMethod) -> IkMethod:
    """The name of the method for targets: the first that fits if it is "auto".

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If it does not fit.
    """

    def misfit(name: IkMethod) -> str:
        """Why a method does not fit the targets; "" if it does."""
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
    """The method for goals with freedom that walks to all of them, not to targets drawn from them."""
    return "projection" if goal.has_regions else "numeric"


def _solve_by(request: IkRequest, name: IkMethod, auto: bool) -> IkResult:
    """The answer of a method; if it has none and was chosen by "auto", of the one that walks to the goal."""
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
        if walked.found or took_draws:  # else the closed form knows better why there is nothing
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
    """Of rows inside the limits the nearest to the posture, shape (1, dof), and its residuals, shape (1, 2).

    It is checked first and alone, for mostly it will do: None if it is not at the goal or not accepted.
    """
    robot = request.robot
    within_limits = q  # most often all are, and to clamp them takes twice as long as to see that
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
    """Rows of q inside the limits and at the goal: the accepted ones or, if there is none, some of the others.

    Of the accepted ones the nearest are enough unless all are wanted.

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
    """The rows of q at the goal, and their residuals, shape (k, 2): of a region from the part a row is nearest to."""
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
    """How many rows are compared with a goal at once: thousands of rows with thousands of grasps take minutes."""
    return max(1, COMPARED // len(goal.parts))


def _takes_draws_alone(name: str, goal: TipGoal) -> bool:
    """Whether the targets that a method takes are not all there is of a goal."""
    return name not in ("projection", _walking_method(goal)) and any(map(leaves_freedom, goal.parts))


def _why(request: IkRequest, answer: IkResponse, name: str, q: Matrix) -> tuple[str, str]:
    """Reason and detail of a failure, see `IkResult`, of a method that found q, shape (k, dof), all in collision."""
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

    nearest_posture = f"the nearest posture is {_distance_in_words(robot, goal, answer.nearest)}"
    if answer.timed_out and not all(_out_of_reach(robot, target) for target in request.targets):
        return "time", f"no solution in time; {nearest_posture}"
    return "unreachable", f"{nearest_posture} from the goal"


def _out_of_reach(robot: Robot, target: Target) -> bool:
    """Whether the lengths of an arm do not allow a target, for certain."""
    from rrtik_ompl.ik.mb_rrt.search import out_of_reach  # whoever finds a solution needs no tree

    return out_of_reach(robot, target)


def _distance_in_words(robot: Robot, goal: TipGoal, q: Vector) -> str:
    """How far a posture is from a goal, in metres and, unless it is a position, degrees."""
    ((distance,), (angle,)) = goal.errors(robot, q[None])
    turned = f" and {round(np.degrees(angle), DIGITS):.4g} deg" if goal.oriented else ""
    return f"{round(distance, DIGITS):.4g} m{turned} away"
