"""`plan()`: from a problem to a path that has been checked twice, or to the reason why there is none."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, get_args

import numpy as np

from rrtik_ompl import catalog
from rrtik_ompl.arrays import positive, whole_number
from rrtik_ompl.choices import Accuracy, ProofMode, one_of
from rrtik_ompl.errors import InputError, require
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.goal import JointGoal
from rrtik_ompl.ik.methods import load_kernels
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, traits_of
from rrtik_ompl.path import JointPath
from rrtik_ompl.planning.planner_names import find_planner as find_planner
from rrtik_ompl.planning.planner_names import list_planners as list_planners
from rrtik_ompl.planning.search import Search
from rrtik_ompl.planning.second_check import fixed_ends
from rrtik_ompl.problem import Problem
from rrtik_ompl.world.kept_clearance import check_clearance
from rrtik_ompl.world.proof import PROOF_KERNELS

RESTARTS = 20
MAX_RESTARTS = 1_000_000
MAX_SECONDS = 1e9  # thirty years; OMPL's clock overflows at about nine times as much
PROOF_MODES: tuple[ProofMode, ...] = get_args(ProofMode)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The outcome of planning.

    Attributes:
        found: Whether there is a path.
        path: The path, or None.
        reason: "" if found, else a line that says why not.
        seconds: Wall time of everything: planning, restarts and re-checks [s]; without what it took to count how
            large an OMPL planner's graph has become.
        planner: Name of the planner.
        seed: The seed that repeats this plan.
        statistics: Plain counts, added up over all attempts: attempts, rejected paths, and the planner's own. Those
            that describe the path (``path_statistics`` of the planner's class) are the last attempt's.
    """

    found: bool
    path: JointPath | None
    reason: str
    seconds: float
    planner: str
    seed: int
    statistics: Mapping[str, int | float]

    @property
    def proven(self) -> bool | None:
        """Whether every motion of the path is proven free for its whole length; None without a path or a proof."""
        return None if self.path is None or self.path.proof is None else self.path.proof.proven


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
            class that is built from a SpaceInformation alone. None: the default of the installed packages,
            :func:`rrtik_ompl.catalog.default_planner`.
        seconds: Time limit for all attempts together [s].
        seed: The same seed gives the same path, as long as the time limit does not cut in; drawn if None. PRM and
            PRMstar work by the clock, so theirs may differ.
        restarts: Further attempts at most.
        parameters: Options of the planner; of OMPL's planners in snake case, such as ``range`` or ``goal_bias``.
        accuracy: "exact", or "conservative" to leave it at what can be proven without coal: faster, and blind to narrow
            passages. None: that of the problem's world.
        proof: "preferred": see above. "required": no path is found unless all of it is proven. "off": motions are
            checked, and nothing is said of proofs.
        clearance: What the path keeps from every obstacle on top of its margin [m], if there is such a path. None:
            1 mm, or what start and goal have.

    Raises:
        UnknownNameError: If there is no planner or no accuracy of that name.
        InputError: If a number or a parameter makes no sense, or start or goal cannot keep the clearance.
        PlannerError: If the planner broke.
    """
    require(problem, Problem, "problem to plan", "use Problem(world, start, goal) or load_problem(name)")
    planner = catalog.default_planner() if planner is None else planner
    require(planner, str | Callable, "planner", "use a name of list_planners() or a planner class")
    limit = positive(seconds, "seconds")
    if limit > MAX_SECONDS:
        raise InputError(f"seconds must be {MAX_SECONDS:g} or less, got {limit:g}")
    if isinstance(restarts, bool) or not isinstance(restarts, int) or not 0 <= restarts <= MAX_RESTARTS:
        raise InputError(f"restarts must be a whole number from 0 to {MAX_RESTARTS}, got {restarts!r}")
    name, factory = (planner, find_planner(planner)) if isinstance(planner, str) else (planner.__name__, planner)
    used = int(np.random.default_rng().integers(2**31)) if seed is None else whole_number(seed, "seed")
    problem = problem if accuracy is None else problem.with_accuracy(accuracy)
    seeds = [int(child) for child in np.random.SeedSequence(used).generate_state(restarts + 1, np.uint32)]
    one_of(PROOF_MODES, proof, "proof")
    _load_kernels(problem, factory)
    check_clearance(problem.world, clearance, fixed_ends(problem))
    begin = time.perf_counter()
    search = Search(problem, factory, name, begin + limit, seeds, parameters or {}, proof, clearance)
    if _nothing_to_do(problem):  # some planners return a detour, others crash
        still = JointPath.of(problem.robot, problem.start[None])
        path: JointPath | None = still if proof == "off" else still.proved(problem.world)
    else:
        path = search.run()
    elapsed, reason = time.perf_counter() - begin - search.counting, search.reason
    if path is None and elapsed >= limit:
        attempts = search.totals["attempts"]
        tried = f"{attempts} attempt{'s' * (attempts != 1)}"
        reason = f"no path within {limit:g} s ({tried}; the last one: {reason or 'out of time'})"
    return Plan(path is not None, path, reason, elapsed, name, used, MappingProxyType(search.totals))


def _load_kernels(problem: Problem, factory: PlannerFactory) -> None:
    """Load what the search will use: compiling it for the first time is no part of planning."""
    if not isinstance(problem.goal, JointGoal):
        load_kernels(problem.robot)
    if problem.world.fast is not None:
        for name in (*traits_of(factory).kernels, PROOF_KERNELS):
            library(name)


def _nothing_to_do(problem: Problem) -> bool:
    """Whether the start is the goal, to the bit if that is a configuration; a `Problem` has checked its start."""
    if isinstance(problem.goal, JointGoal):
        return bool((problem.start == problem.goal.q).all())
    return problem.reached(problem.start)
