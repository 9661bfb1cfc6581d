"""`plan()`: search for a path, check it twice, and return it or the reason why there is none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, get_args

from rrtik_ompl.base.arrays import not_negative, positive, seed_of
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import Accuracy, ImproveStrategy, PathObjective, ProofMode, ShorteningMethod, one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.description.catalog import AUTO, is_auto
from rrtik_ompl.planning.outcome import RESTARTS, Improvement, Plan, Request
from rrtik_ompl.planning.short_path import short_path
from rrtik_ompl.world.clearances import check_clearance
from rrtik_ompl.world.problem import Problem, fixed_ends, refuse_covered_goal

if TYPE_CHECKING:
    from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory

MAX_RESTARTS = 1_000_000
MAX_SECONDS = 1e9  # [s] thirty years; OMPL's clock overflows at about nine times as much
PROOF_MODES: tuple[ProofMode, ...] = get_args(ProofMode)
OBJECTIVES: tuple[PathObjective, ...] = get_args(PathObjective)
STRATEGIES: tuple[ImproveStrategy, ...] = get_args(ImproveStrategy)
SHORTENING_METHODS: tuple[ShorteningMethod, ...] = get_args(ShorteningMethod)


def plan(
    problem: Problem,
    planner: str | PlannerFactory | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = 0,
    restarts: int = RESTARTS,
    parameters: Mapping[str, Any] | None = None,
    accuracy: Accuracy | None = None,
    proof: ProofMode = "preferred",
    clearance: float | None = None,
    improve: float = 0.0,
    objective: PathObjective = "length",
    strategy: ImproveStrategy = "restart-shorten",
    shorten: ShorteningMethod | bool = "auto",
    tree: bool = False,
) -> Plan:
    """Find a collision-free path from the start to the goal of a problem, and shorten it.

    A goal of the tip is first turned into collision-free goal configurations by inverse kinematics, unless the planner
    finds such configurations itself. If the planner does not reach them within a bounded effort, more configurations
    are drawn and the planner is started anew with twice the effort (see :class:`GoalSearch`). "auto" chooses among the
    configurations by the length of the path.

    The search runs in three stages, and the path that it finds is shortened within the time left:

    1. For a short while, the planner relies on what the kernels can prove without coal.
    2. If that finds no path, the motions of the planner are checked exactly.
    3. A second check examines every path. It accepts a path whose motions are proven free for their whole length, with
       a clearance (:meth:`World.prove`). Motions that are not proven are replaced by detours. If there is no such
       detour, the planner is started anew with more room around obstacles. If a few such attempts do not help, the path
       with the fewest unproven motions is returned; these motions are checked in steps (:meth:`JointPath.violations`).

    A planner that gives up before its time is up is started anew with another random stream. If the second check
    rejects its path, it is started anew and its motions are checked as densely as by the second check.

    Args:
        problem: The problem to solve.
        planner: The name of one of :func:`list_planners` (``geometric::`` may stand before OMPL's names), or a planner
            class that is built from a SpaceInformation alone. "auto" runs several planners one after the other until
            one finds a path. None stands for the planner that the problem names, or else for "auto".
        seconds: Limit of wall time for all attempts together [s]; a busy machine gets less done in it.
        seed: The same seed gives the same path, as long as the time limit does not cut in. None draws a seed. PRM and
            PRMstar depend on the clock, so their paths may differ even with the same seed.
        restarts: The largest number of further attempts.
        parameters: Options of the planner; those of OMPL's planners in snake case, such as ``range`` or ``goal_bias``.
        accuracy: "exact", or "conservative" to count as free only what can be proven without coal, which is faster but
            misses narrow passages. None stands for the accuracy of the problem's world.
        proof: "preferred" works as described above. "required" accepts a path only if all of it is proven. "off" checks
            motions in steps and proves nothing.
        clearance: The distance that the path keeps from every obstacle on top of its margin [m], if there is such a
            path. None stands for 1 mm, or for the clearance of start and goal if that is less. For a goal of the tip,
            goal configurations that keep the clearance are preferred.
        improve: How long the path may be improved after it was found [s], within ``seconds``: the problem is planned
            again with other seeds, each path is shortened, and the best one is kept. Improvement ends when sixty plans
            in a row (240 brief ones of "auto") gain nothing, or when the path reaches the lower bound of its cost.
            ``statistics["cost_over_time"]`` holds rows of seconds and cost, ``"length_bound"`` a lower bound of the
            length of any path. Ctrl-C ends the improvement, and the best path so far is returned. The clock decides how
            many plans are tried, so paths of the same seed may differ.
        objective: The cost that ``improve`` minimizes: "length" is the length in joint space; "time" is the least time
            that the robot's velocity limits allow; "clearance" is the length with each piece counted more the nearer
            the arm is to a body, double at 5 cm. The objective only chooses among paths: each of them is still
            shortened in length.
        strategy: How ``improve`` works: "restart-shorten" as described above; "shorten" shortens the first path alone.
        shorten: How the path is shortened: a method of :func:`shorten`, or True for "auto", which keeps single-joint
            moves and looks for the fewest. The path keeps the rules of single-joint moves in ``parameters``. False
            leaves the planner's own path, which is also ``unshortened`` in the plan of a shortened one. Ctrl-C ends
            the shortening, and leaves the path that was found.
        tree: Whether to keep the tree that the planner has grown, as :attr:`Plan.tree`, for :func:`view`. "auto" then
            begins with its planners, as the brief searches before them keep no trees, so its path may be another.

    Raises:
        UnknownNameError: If there is no planner, accuracy, objective, strategy or method of shortening of that name.
        InputError: If a number or a parameter makes no sense, start or goal cannot keep the clearance, or the objective
            is "time" and the robot has no velocity limits.
        ProblemError: If an obstacle that moves covers the goal now.
        PlannerError: If the planner broke.

    Example:
        >>> problem = rrtik.load_problem("titan4_sdu")
        >>> rrtik.plan(problem, "fewest-moves", seed=1).path.transitions
        6
    """
    require(problem, Problem, "problem to plan", "use Problem(world, start, goal) or load_problem(name)")
    planner = (problem.planner or AUTO) if planner is None else planner
    require(planner, str | Callable, "planner", "use a name of list_planners() or a planner class")
    limit = time_limit(seconds)
    if isinstance(restarts, bool) or not isinstance(restarts, int) or not 0 <= restarts <= MAX_RESTARTS:
        raise InputError(f"restarts must be a whole number from 0 to {MAX_RESTARTS}, got {restarts!r}")
    require(parameters, Mapping | None, "parameters of a planner", "use {name of an option: value}")
    one_of(PROOF_MODES, proof, "proof")
    require(tree, bool, "tree")
    method = shortening_method(shorten)
    problem = problem if accuracy is None else problem.with_accuracy(accuracy)
    check_clearance(problem.world, clearance, fixed_ends(problem))
    how = Improvement(
        not_negative(improve, "improve"),
        one_of(OBJECTIVES, objective, "objective"),
        one_of(STRATEGIES, strategy, "strategy of improve"),
    )
    request = Request(Budget(seed_of(seed), limit), restarts, parameters or {}, proof, clearance, tree)

    found = planned_and_finished(problem, planner, request, method)
    if found.found and how.seconds > 0.0:
        from rrtik_ompl.planning.improving import improved
        from rrtik_ompl.planning.searching import named_planner

        finder = named_planner(found.planner if isinstance(planner, str) else planner)
        found = improved(problem, found, finder, request, how)
    return found


def shortening_method(shorten: ShorteningMethod | bool) -> ShorteningMethod | None:
    """Return the method of shortening that a caller asks for; None for no shortening."""
    if isinstance(shorten, bool):
        return "auto" if shorten else None
    return one_of(SHORTENING_METHODS, shorten, "shortening method")


def time_limit(seconds: float) -> float:
    """Check a limit of wall time [s] and return it.

    Raises:
        InputError: If it is not positive, or more than OMPL's clock can bear.
    """
    limit = positive(seconds, "seconds")
    if limit > MAX_SECONDS:
        raise InputError(f"seconds must be {MAX_SECONDS:g} or less, got {limit:g}")
    return limit


def planned_and_finished(
    problem: Problem, planner: str | PlannerFactory, request: Request, method: ShorteningMethod | None
) -> Plan:
    """Search as :func:`plan` does, and shorten the path, if there is a method of shortening.

    Raises:
        UnknownNameError: If there is no planner of that name.
        InputError: If the planner does not take a parameter.
        ProblemError: If the goal is not free now, see :func:`refuse_covered_goal`.
        PlannerError: If the planner broke.
    """
    refuse_covered_goal(problem)
    brief = _is_auto(planner) and not request.tree
    short = short_path(problem, request, pull=method == "auto") if brief else None
    if short is not None and method in ("auto", None):
        return short
    found = short
    if found is None:
        from rrtik_ompl.planning.searching import searched  # with OMPL, which the short path does without

        found = searched(problem, planner, request, finish_follows=method is not None)
    if method is None:
        return found

    from rrtik_ompl.planning.finish import finished  # with shortening, which many plans do without

    return finished(problem, found, request, method)


def planned(problem: Problem, planner: str | PlannerFactory, request: Request) -> Plan:
    """Search as :func:`plan` does, with arguments that have been checked; a path of "auto" is shortened.

    For callers that plan many times, or shorten in a way of their own.

    Raises:
        UnknownNameError: If there is no planner of that name.
        InputError: If the planner does not take a parameter.
        ProblemError: If the goal is not free now, see :func:`refuse_covered_goal`.
        PlannerError: If the planner broke.
    """
    refuse_covered_goal(problem)
    short = short_path(problem, request, pull=True) if _is_auto(planner) else None
    if short is not None:
        return short

    from rrtik_ompl.planning.searching import searched  # with OMPL, which the short path does without

    found = searched(problem, planner, request)
    if not _is_auto(planner):
        return found

    from rrtik_ompl.planning.finish import briefly_shortened  # with shortening, which many plans do without

    return briefly_shortened(problem, found, request)


def _is_auto(planner: str | PlannerFactory) -> bool:
    return isinstance(planner, str) and is_auto(planner)
