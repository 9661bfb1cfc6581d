"""The methods of inverse kinematics behind one face: what each is asked, what it answers, and which goals it fits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.goal import PoseGoal, PositionGoal
from rrtik_ompl.ik.closed_form import family, form_of, has_closed_form, solutions, tip_fault
from rrtik_ompl.ik.mb_rrt.axes import misfit as no_tree
from rrtik_ompl.ik.mb_rrt.search import ROUNDS as TREE_ROUNDS
from rrtik_ompl.ik.mb_rrt.search import search
from rrtik_ompl.ik.numeric import descend
from rrtik_ompl.robot import Robot
from rrtik_ompl.world import World

STARTS = 32  # of the numeric method in one round
ROUNDS = 16  # after which it gives up
ALL_ROUNDS = 8  # of the workspace tree where every solution is wanted

Target = PoseGoal | PositionGoal


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """What a method is asked.

    Attributes:
        robot: The arm.
        targets: Goals without freedom; one of them is enough.
        near: Posture near which a solution is wanted, shape (dof,).
        accept: Which of some configurations, shape (k, dof), inside the limits and at the goal, will do.
        all: Whether every solution is wanted that the method can find, not just one.
        deadline: Time of ``time.monotonic`` at which to stop.
        rng: Random numbers.
        world: What ``accept`` asks about collisions, for methods that place the arm link by link.
    """

    robot: Robot
    targets: tuple[Target, ...]
    near: Vector
    accept: Callable[[Matrix], Mask]
    all: bool
    deadline: float
    rng: np.random.Generator
    world: World | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What a method found.

    Attributes:
        q: Configurations at one of the targets, inside the limits, in collision or not, shape (k, dof).
        nearest: If there is none: the posture that came nearest to a target with no regard to limits, shape (dof,).
        target: The target that it came near to.
        iterations: Steps, 0 for a closed form.
        timed_out: Whether the time was up before the method was through.
    """

    q: Matrix
    nearest: Vector
    target: Target
    iterations: int = 0
    timed_out: bool = False


@dataclass(frozen=True, slots=True)
class Method:
    """A method: ``misfit`` says why it does not fit a robot and a target ("" if it does); ``run`` answers."""

    misfit: Callable[[Robot, Target], str]
    run: Callable[[Question], Answer]


def errors(robot: Robot, target: Target, Q: Matrix) -> Matrix:
    """Distance [m] and angle [rad] (0 for a position) of configurations from a target, shape (k, 2)."""
    if isinstance(target, PositionGoal):
        return np.column_stack([target.distance(robot, Q), np.zeros(len(Q))])
    return np.column_stack(target.errors(robot, Q))


def _closed_form_misfit(robot: Robot, target: Target) -> str:
    if not has_closed_form(robot):
        return "the robot brings no closed form"
    if form_of(robot).kind == "pose" and isinstance(target, PositionGoal):
        return "its closed form needs a pose, and a position leaves a whole family of solutions"
    return tip_fault(robot, form_of(robot))


def _closed_form(question: Question) -> Answer:
    """All branches of all targets; if none will do, the curves of those that are singular within their tolerances."""
    robot, targets = question.robot, question.targets
    found = solutions(robot, np.array([_matrix(target) for target in targets]), near=question.near)
    rows, owner = found.branches.reshape(-1, robot.dof), np.repeat(np.arange(len(targets)), found.real.shape[1])
    fits = robot.within_limits(rows) & _at_targets(question, rows, owner)
    q = rows[fits]
    if not question.accept(q).any():
        q = np.vstack([q, *(family(robot, _matrix(target), slack=_slack(target)) for target in targets)])
    residuals = np.asarray(found.residuals).reshape(-1, 2)
    best = int(np.argmin(residuals.sum(axis=1)))
    return Answer(q, rows[best], targets[int(owner[best])])


def _slack(target: Target) -> float:
    """How far from singular a target may be to be treated as singular: a part of its tolerances [m, rad]."""
    if isinstance(target, PositionGoal):
        return 0.0
    return 0.4 * min(target.position_tolerance, target.orientation_tolerance)


def _at_targets(question: Question, rows: Matrix, owner: np.ndarray) -> Mask:
    satisfied = np.zeros(len(rows), dtype=bool)
    for k, target in enumerate(question.targets):
        mine = owner == k
        satisfied[mine] = target.satisfied(question.robot, rows[mine])
    return satisfied


def _matrix(target: Target) -> Matrix:
    matrix: Matrix = np.eye(4)
    if isinstance(target, PositionGoal):
        matrix[:3, 3] = target.position
        return matrix
    return np.asarray(target.T_world_tip.homogeneous, dtype=np.float64)


def _numeric(question: Question) -> Answer:
    """Levenberg-Marquardt from the posture and from random ones, round after round until a solution will do."""
    robot = question.robot
    found, steps = np.zeros((0, robot.dof)), 0
    for number in range(ROUNDS):
        target = question.targets[number % len(question.targets)]
        starts = question.rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
        if number < len(question.targets):
            starts[0] = question.near
        Q, taken = descend(robot, target, starts)
        found, steps = np.vstack([found, Q[target.satisfied(robot, Q)]]), steps + taken
        if question.accept(found).any() and not question.all:
            break
        if time.monotonic() > question.deadline:
            return Answer(found, *_nearest(question, steps), timed_out=True)
    return Answer(found, question.near, target, steps) if len(found) else Answer(found, *_nearest(question, steps))


def _nearest(question: Question, steps: int) -> tuple[Vector, Target, int]:
    """The posture that comes nearest to the first target when the joints may turn without limits."""
    robot, target = question.robot, question.targets[0]
    turning = ~robot.prismatic
    free = replace(
        robot,
        lower=np.where(turning, -2.0 * np.pi, robot.lower),
        upper=np.where(turning, 2.0 * np.pi, robot.upper),
    )
    starts = question.rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
    Q, taken = descend(free, target, starts)
    return Q[int(np.argmin(errors(robot, target, Q).sum(axis=1)))], target, steps + taken


def _mb_rrt(question: Question) -> Answer:
    """A tree in the workspace for one target after the other, until a solution will do."""
    robot, count = question.robot, len(question.targets)
    rows, passes = np.zeros((0, robot.dof)), 0
    for target in question.targets:
        found = search(
            robot,
            target,
            near=question.near,
            accept=question.accept,
            rng=question.rng,
            deadline=question.deadline,
            world=question.world,
            all=question.all,
            rounds=max(1, (ALL_ROUNDS if question.all else TREE_ROUNDS) // count),
        )
        rows, passes = np.vstack([rows, found.q]), passes + found.passes
        if found.timed_out or (question.accept(found.q).any() and not question.all):
            break
    nearest = (question.near, target) if len(rows) else _nearest(question, 0)[:2]
    return Answer(rows, *nearest, passes, found.timed_out)


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "closed-form": Method(_closed_form_misfit, _closed_form),
        "numeric": Method(lambda robot, target: "", _numeric),
        "mb-rrt": Method(lambda robot, target: no_tree(robot), _mb_rrt),
    }
)
