"""`plan()`: from a problem to a path that has been checked twice, or to the reason why there is none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from rrtik_ompl.base.arrays import not_negative, positive, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import Accuracy, ImproveStrategy, PathObjective, ProofMode, one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.ompl_bridge.planner_names import AUTO, find_planner
from rrtik_ompl.ompl_bridge.planner_names import list_planners as list_planners
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory
from rrtik_ompl.planning.attempts import run_planner
from rrtik_ompl.planning.outcome import RESTARTS, Improvement, NamedPlanner, Request
from rrtik_ompl.planning.outcome import Plan as Plan
from rrtik_ompl.planning.second_check import fixed_ends
from rrtik_ompl.world.clearances import check_clearance
from rrtik_ompl.world.problem import Problem

MAX_RESTARTS = 1_000_000
MAX_SECONDS = 1e9  # thirty years; OMPL's clock overflows at about nine times as much
PROOF_MODES: tuple[ProofMode, ...] = get_args(ProofMode)
OBJECTIVES: tuple[PathObjective, ...] = get_args(PathObjective)
STRATEGIES: tuple[ImproveStrategy, ...] = get_args(ImproveStrategy)
NOT_IMPROVED = Improvement(0.0)


def plan(
    problem: Problem,
    planner: str | PlannerFactory | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = None,
    restarts: int = RESTARTS,
    parameters: Mapping[str, Any] | None = None,
    accuracy: Accuracy | None = None,
    proof: ProofMode = "preferred",
    clearance: float | None = None,
    improve: float = 0.0,
    objective: PathObjective = "length",
    strategy: ImproveStrategy = "restart-shorten",
) -> Plan:
    """Find a collision-free path from the start to the goal of a problem.

    A goal of the tip is first turned into free configurations by inverse kinematics, unless the planner finds them
    itself. If it does not get to them with some effort, more are drawn and it is started anew with twice the effort
    (see :class:`GoalSearch`).

    The planner first relies on what the kernels can prove without coal, for a short while; where that finds no path its
    motions are checked exactly. Either way a path is returned only if a second check agrees: its motions are proven
    free for their whole length (:meth:`World.prove`), with a clearance. What is not proven gets a detour. Where none is
    found, the planner is started anew with more room around obstacles. If that does not help in a few attempts, the
    path is returned that is proven in most parts, the others checked in steps (:meth:`JointPath.violations`).

    If a planner gives up before its time it is started anew with another random stream; if the second check rejects its
    path, it is started anew and its motions are checked as densely as by the second check.

    Args:
        problem: What to solve.
        planner: Name of one of :func:`list_planners` (``geometric::`` may stand before OMPL's names), or a planner
            class that is built from a SpaceInformation alone. "auto" lets several search one after the other, until
            one finds a path, and shortens that a little. None: what the problem names, or else "auto".
        seconds: Limit of wall time for all attempts together [s]; a busy machine gets less done in it.
        seed: The same seed gives the same path, as long as the time limit does not cut in; drawn if None. PRM and
            PRMstar work by the clock, so theirs may differ.
        restarts: Further attempts at most.
        parameters: Options of the planner; of OMPL's planners in snake case, such as ``range`` or ``goal_bias``.
        accuracy: "exact", or "conservative" to leave it at what can be proven without coal: faster, and blind to narrow
            passages. None: that of the problem's world.
        proof: "preferred": see above. "required": no path is found unless all of it is proven. "off": motions are
            checked, and nothing is said of proofs.
        clearance: What the path keeps from every obstacle on top of its margin [m], if there is such a path. None:
            1 mm, or what start and goal have. At a goal of the tip configurations that keep it are preferred.
        improve: How long the path may go on getting better after it was found [s], within ``seconds``: further plans
            with other seeds, each shortened, of which the best is kept. It ends when sixty of them in a row gain
            nothing, or the path is as short as can be. ``statistics["cost_over_time"]`` has the course, rows of seconds
            and cost, ``"length_bound"`` a length below which there is none. Ctrl-C ends it, and the best path so far is
            returned. The clock decides how many plans are tried, so paths of a seed may differ.
        objective: What ``improve`` makes small: "length" in joint space; "time", which the robot's velocity limits
            allow at least; or "clearance", the length of which each piece counts more the nearer the arm is to
            something, double at 5 cm. Paths are shortened in length all the same: the objective chooses among them.
        strategy: Of ``improve``: "restart-shorten" as above, or "shorten", the first path alone.

    Raises:
        UnknownNameError: If there is no planner, accuracy, objective or strategy of that name.
        InputError: If a number or a parameter makes no sense, start or goal cannot keep the clearance, or the objective
            is "time" and the robot has no velocity limits.
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
    drawn = int(np.random.default_rng().integers(2**31)) if seed is None else whole_number(seed, "seed")
    one_of(PROOF_MODES, proof, "proof")
    problem = problem if accuracy is None else problem.with_accuracy(accuracy)
    check_clearance(problem.world, clearance, fixed_ends(problem))
    how = Improvement(
        not_negative(improve, "improve"),
        one_of(OBJECTIVES, objective, "objective"),
        one_of(STRATEGIES, strategy, "strategy of improve"),
    )

    return planned(problem, planner, Request(Budget(drawn, limit), restarts, parameters or {}, proof, clearance), how)


def time_limit(seconds: float) -> float:
    """A limit of wall time [s], checked.

    Raises:
        InputError: If it is not positive, or more than OMPL's clock can bear.
    """
    limit = positive(seconds, "seconds")
    if limit > MAX_SECONDS:
        raise InputError(f"seconds must be {MAX_SECONDS:g} or less, got {limit:g}")
    return limit


def planned(problem: Problem, planner: str | PlannerFactory, request: Request, how: Improvement = NOT_IMPROVED) -> Plan:
    """What :func:`plan` does with arguments that make sense.

    Raises:
        UnknownNameError: If there is no planner of that name.
        InputError: If the planner does not take a parameter.
        PlannerError: If the planner broke.
    """
    if isinstance(planner, str) and planner.lower() == AUTO:
        found = _found_by_portfolio(problem, request)
    else:
        found = run_planner(problem, named_planner(planner), request)

    if found.found and how.seconds > 0.0:
        from rrtik_ompl.planning.improving import improved  # with shortening, which many plans do without

        finder = named_planner(found.planner if isinstance(planner, str) else planner)
        found = improved(problem, found, finder, request, how)
    if found.path is None:
        return found
    return replace(found, member=problem.goal.member_at(problem.robot, found.path.end))


def plan_counted(problem: Problem, budget: Budget) -> Plan:
    """A plan by "auto" that ends after the iterations of a budget, of each planner, about: no clock decides."""
    return _found_by_portfolio(problem, Request(budget))


def named_planner(planner: str | PlannerFactory) -> NamedPlanner:
    """A planner with its name; of one that has a name alone, its class.

    Raises:
        UnknownNameError: If there is none of that name, as of "auto".
    """
    if isinstance(planner, str):
        return NamedPlanner(planner, find_planner(planner))
    return NamedPlanner(planner.__name__, planner)


def _found_by_portfolio(problem: Problem, request: Request) -> Plan:
    """What "auto" finds."""
    from rrtik_ompl.planning.portfolio import run_portfolio  # with shortening, which many plans do without

    return run_portfolio(problem, request)
