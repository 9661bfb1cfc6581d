"""Post-processing behind one interface: a valid path in, a path with the same ends that is no worse out."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from rrtik_ompl.base.arrays import Matrix, positive, whole_number
from rrtik_ompl.base.budget import Budget, no_stop
from rrtik_ompl.base.choices import ShorteningMethod, one_of
from rrtik_ompl.base.errors import InputError, PathWarning, called, require
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.ompl_bridge.attempt import simplified
from rrtik_ompl.ompl_bridge.weighted import WeightedProblem, has_weights
from rrtik_ompl.planning.moves.axis_cut import axis_cut_rounds, double_axis_cut
from rrtik_ompl.planning.moves.rules import MoveRules
from rrtik_ompl.planning.shortening.acceptance import Acceptance, Form
from rrtik_ompl.planning.shortening.along_constraints import along_constraints
from rrtik_ompl.planning.shortening.best import best_in_time
from rrtik_ompl.planning.shortening.corners import snap_corners
from rrtik_ompl.planning.shortening.cuts import random_cut, sequential_cut, shortcut
from rrtik_ompl.planning.shortening.retraction import retract
from rrtik_ompl.planning.shortening.task import Task, Wishes
from rrtik_ompl.world.clearances import check_route_clearance, proved
from rrtik_ompl.world.problem import Problem

__all__ = ["METHODS", "Method", "MoveRules", "Task", "Wishes", "shorten", "shortened"]


@dataclass(frozen=True, slots=True, eq=False)
class Method:
    """A method of shortening.

    Attributes:
        run: Shortens a route, shape (k, n), of a problem, as a task says.
        keeps_moves: Whether a path of single-joint moves stays one, wanted or not, and has no more moves afterwards;
            its length may grow then.
        can_keep_moves: Whether it stays one if that is wanted.
        moves_only: Whether it takes nothing but such a path.
        leaves_room: Whether it keeps a clearance itself, where that costs no move.
        samples: Whether it checks motions in steps, by the problem's world alone.
        delegates_moves: Whether it leaves single-joint moves to other methods, and takes no path that is longer.
    """

    run: Callable[[Matrix, Task, Problem], Matrix]
    keeps_moves: bool = False
    can_keep_moves: bool = True
    moves_only: bool = False
    leaves_room: bool = False
    samples: bool = False
    delegates_moves: bool = False


def _ompl(route: Matrix, task: Task, problem: Problem) -> Matrix:
    rows, checked = simplified(problem, route, task.wishes.budget)
    task.asked += checked
    return rows


def _axis(route: Matrix, task: Task, _: Problem) -> Matrix:
    return double_axis_cut(route, task.free_batch, stop=task.expired)


def _axis_rounds(route: Matrix, task: Task, _: Problem) -> Matrix:
    return axis_cut_rounds(route, task.free_batch, budget=task.rest)


def _fewest_moves(route: Matrix, task: Task, problem: Problem) -> Matrix:
    from rrtik_ompl.planning.shortening.fewest_moves import fewest_moves  # many paths are shortened without its search

    wishes = task.wishes
    found = fewest_moves(route, problem.world, budget=task.rest, rules=wishes.rules, clearance=wishes.clearance)
    return found.route


METHODS: Mapping[ShorteningMethod, Method] = MappingProxyType(
    {
        "axis": Method(_axis, keeps_moves=True),
        "axis-rounds": Method(_axis_rounds, keeps_moves=True),
        "fewest-moves": Method(_fewest_moves, keeps_moves=True, moves_only=True, leaves_room=True),
        "sequential": Method(lambda route, task, _: sequential_cut(route, task)),
        "random": Method(lambda route, task, _: random_cut(route, task)),
        "shortcut": Method(lambda route, task, _: shortcut(route, task)),
        "retraction": Method(lambda route, task, _: retract(route, task)),
        "corners": Method(lambda route, task, _: snap_corners(route, task), can_keep_moves=False),
        "ompl": Method(_ompl, can_keep_moves=False, samples=True),
        "auto": Method(lambda route, task, _: best_in_time(route, task), delegates_moves=True),
    }
)
# under path constraints in place of these
_ALONG_CONSTRAINTS = Method(along_constraints, can_keep_moves=False, samples=True)
_CUTS = ("auto", "random", "shortcut")
_SINGLE_JOINT = METHODS["fewest-moves"], METHODS["axis-rounds"]  # in whose place "auto" is asked for single-joint moves


def shorten(
    path: JointPath,
    problem: Problem,
    *,
    method: ShorteningMethod = "auto",
    seconds: float | None = None,
    checks: int | None = None,
    seed: int = 0,
    one_joint: bool | None = None,
    rules: MoveRules | None = None,
    on_better: Callable[[JointPath], object] | None = None,
    stop: Callable[[], bool] | None = None,
    clearance: float | None = None,
) -> JointPath:
    """Shorten a path of a problem.

    Args:
        path: A valid path of the problem.
        problem: Its world checks the new motions.
        method: "auto" pulls several cut paths taut and is the best choice for straight motions; single-joint moves it
            leaves to "fewest-moves". "axis" is the published double axis cut: fewer moves of one joint at a time.
            "axis-rounds" goes on with twenty passes in random joint orders: fewer moves still, several times as long.
            Both return a path as it is, with a warning, if it moves several joints at once. "fewest-moves" takes
            single-joint moves and looks for the fewest, with the least travel among those. "sequential", "random" and
            "retraction" are the published methods for straight motions: quick, simple, and near the shortest path of
            the same class. "corners" pulls every bend to the corner that it goes round: nearer to that shortest path
            than "retraction" in its finest steps, with fewer checks. "shortcut" is a random cut that takes waypoints
            as ends too and pulls them straight. "ompl" is OMPL's PathSimplifier.
        seconds: Limit of wall time [s]. With one, random methods go on until nothing is gained any more; without one
            they make a fixed number of tries, so that a seed always gives the same path.
        checks: Most motions that are checked (tries, in random methods), a limit that always gives the same path: 100
            take some milliseconds. None for no such limit; "ompl" and "fewest-moves" know no other than time.
        seed: Of the random methods.
        one_joint: Keep a path of single-joint moves one: fewer moves first, length second. None: "auto" does.
        rules: What the path, of single-joint moves, keeps to and has to keep to: joints that must not move or move
            last, the smallest move, costs. Its last moves, of the joints that move last, stay as they are.
        on_better: Called with every better path in between; these have not yet passed the second check.
        stop: Called from time to time; True ends the work, and the best so far is returned.
        clearance: What the new motions keep from every obstacle on top of its margin [m]. None: 1 mm, or what the ends
            of the path have; with "fewest-moves" 1 cm where that costs no move.

    Under path constraints "auto", "random" and "shortcut" walk along them from one place of the path to another.

    Returns:
        A path with the same ends, and with its proof. If the input is proven free so is the result, with the clearance
        if the input has it: what is not gets a detour, or else only proven motions are used; if that does not help,
        the input is returned. It is not longer than the input (:func:`rrtik_ompl.weighted` where joints have weights),
        and where one joint moves at a time it has no more moves.

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If the path is not valid for the problem, does not keep to the rules or has one waypoint, a limit
            is not positive, the seed is negative, the method cannot do it, or an end of the path cannot keep the
            clearance.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> found = rrtik.plan(problem, "RRTConnect", seed=1)
        >>> rrtik.shorten(found.path, problem).length < found.path.length
        True
    """
    require(path, JointPath, "path to shorten", "a plan has one if plan.found")
    require(rules, MoveRules | None, "rules of a path to shorten")
    require(one_joint, bool | None, "one_joint")
    require(method, str, "shortening method", "such as 'auto'")
    if on_better is not None:
        called(on_better, "on_better", "a path")
    if stop is not None:
        called(stop, "stop")
    single = _keeps_single_joint_moves(path, method, one_joint) or rules is not None

    require(problem, Problem, "problem of a path to shorten")
    one_of(METHODS, method, "shortening method")
    if seconds is not None:
        positive(seconds, "seconds")
    if checks is not None and whole_number(checks, "checks") < 1:
        raise InputError("checks must be 1 or more, got 0")
    whole_number(seed, "seed")
    _refuse_what_cannot_be_shortened(path, problem)
    check_route_clearance(problem.world, clearance, path.waypoints)

    if single and not path.one_joint_at_a_time:
        raise InputError("path to shorten: it moves several joints at once, so one_joint cannot be kept")
    if single and not METHODS[method].can_keep_moves:
        raise InputError(f"shortening method '{method}' cannot keep one joint at a time; use axis or auto")
    if METHODS[method].keeps_moves and not path.one_joint_at_a_time:
        remedy = "use auto, or one_joint_moves(path, problem) first"
        message = f"shortening method '{method}' is for single-joint moves, so the path stays as it is: {remedy}"
        warnings.warn(PathWarning(message), stacklevel=2)
        return _with_proof(path, problem)

    budget = Budget(seed, np.inf if seconds is None else float(seconds), checks, no_stop if stop is None else stop)
    return shortened(path, problem, Wishes(budget, single, rules, clearance), method, on_better)


def shortened(
    path: JointPath,
    problem: Problem,
    wishes: Wishes,
    method: ShorteningMethod = "auto",
    on_better: Callable[[JointPath], object] | None = None,
) -> JointPath:
    """What :func:`shorten` does with a path that is known to be valid, by wishes that make sense for it."""
    chosen = _method_for(method, problem, wishes.one_joint)
    head, tail = _split_before_last_joints(path.waypoints, wishes.rules)
    if len(head) < 2:
        return path
    if on_better is not None:
        wishes = replace(wishes, on_better=lambda rows: on_better(path_through(path, np.vstack([rows, tail]))))

    delegated = chosen.delegates_moves and wishes.one_joint
    for candidate in _SINGLE_JOINT if delegated else (chosen,):
        found = _shorten_in_forms(path, problem, candidate, (head, tail), wishes)
        if not chosen.delegates_moves or found.length <= path.length:
            return found
    return _with_proof(path, problem)


def _with_proof(path: JointPath, problem: Problem) -> JointPath:
    """The path with what is proven of it."""
    return path if path.proven_in(problem.world) else proved(path, problem.world)


def _shorten_in_forms(
    path: JointPath, problem: Problem, chosen: Method, parts: tuple[Matrix, Matrix], wishes: Wishes
) -> JointPath:
    """The path after a method, in the first form of the problem in which that leads to one that is accepted."""
    head, tail = parts
    rules = wishes.rules
    single = wishes.one_joint or chosen.keeps_moves
    acceptance = Acceptance(
        path, problem, wishes, one_joint=single, leaves_room=chosen.leaves_room, samples=chosen.samples
    )

    for form in acceptance.forms():
        task, found = _run(chosen, form, head, replace(wishes, budget=wishes.budget.part(form.share)), single)
        rows = np.vstack([found, tail])
        ends_stay = (rows[[0, -1]] == path.waypoints[[0, -1]]).all()
        if not ends_stay or (rules is not None and not rules.kept_by(rows)):
            continue

        shorter = acceptance.accepted(path_through(path, rows))
        if shorter is None:
            continue

        joint_weights = 1.0 if single else weights_of(problem.robot)
        if chosen.keeps_moves:
            return shorter
        if task.rank(shorter.waypoints * joint_weights) <= task.rank(path.waypoints * joint_weights):
            return shorter
    return acceptance.input


def _run(chosen: Method, form: Form, route: Matrix, wishes: Wishes, single: bool) -> tuple[Task, Matrix]:
    """What a method makes of a route, in coordinates in which lengths are weighted where joints have weights."""
    if single or not has_weights(form.problem):
        task = Task(form.motions, wishes)
        return task, chosen.run(route, task, form.problem)

    weighted = WeightedProblem(form.problem, form.motions)
    on_better = wishes.on_better
    if on_better is not None:
        wishes = replace(wishes, on_better=lambda rows: on_better(weighted.joint_rows(rows, route[[0, -1]])))

    task = Task(weighted.problem.world, wishes)
    rows = chosen.run(weighted.weighted_rows(route), task, weighted.problem)
    return task, weighted.joint_rows(rows, route[[0, -1]])


def _keeps_single_joint_moves(path: JointPath, method: ShorteningMethod, one_joint: bool | None) -> bool:
    """Whether the moves of a path have to stay single-joint moves."""
    if one_joint is not None:
        return one_joint
    return method == "auto" and path.one_joint_at_a_time


def _split_before_last_joints(route: Matrix, rules: MoveRules | None) -> tuple[Matrix, Matrix]:
    """A route up to where the joints that move last begin, and the rest."""
    if rules is None:
        return route, route[:0]
    if not rules.kept_by(route):
        raise InputError("path to shorten: it does not keep to the rules that it is to keep to")
    return route[: rules.head(route)], route[rules.head(route) :]


def _method_for(name: ShorteningMethod, problem: Problem, one_joint: bool) -> Method:
    """The method of a name, or what takes its place under path constraints."""
    if problem.constraints and name in _CUTS and not one_joint:
        return _ALONG_CONSTRAINTS
    return METHODS[name]


def _refuse_what_cannot_be_shortened(path: JointPath, problem: Problem) -> None:
    """Refuse a path that cannot be shortened."""
    if len(path.waypoints) < 2:
        raise InputError("path to shorten: it has one waypoint, so there is nothing to shorten")
    faults = () if path.proven_in(problem.world) else path.violations(problem.world)
    if faults:
        raise InputError(f"path to shorten: motion {faults[0].edge + 1} is not valid: {faults[0].reason}")
