"""The choice among goal configurations by the length of the path: the first one that a search reaches may be far away.

To each configuration, the nearest first, there is one brief search in kernels, whose route is pulled taut for a moment.
One whose straight line is no shorter than the best route so far is left out, and so is one that the first attempt of a
planner leaves out. A brief pull may err, so the winner and the given path are both shortened in the end. Searches check
motions in coarse steps, as every motion that is kept is proven anyway. All of it is bounded by counts: the same seed
gives the same path.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.kernels.search.connect import ConnectSearch, kept_search
from rrtik_ompl.kernels.search.connect_layout import KERNELS as SEARCH_KERNELS
from rrtik_ompl.kernels.search.contacts.layout import KERNELS as PULL_KERNELS
from rrtik_ompl.kernels.search.contacts.pulling import Pulling
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.ompl_bridge.setup import planning_bounds
from rrtik_ompl.ompl_bridge.weighted import has_weights
from rrtik_ompl.planning.goal_choice import FAR
from rrtik_ompl.planning.shortening import Wishes, shortened
from rrtik_ompl.world.clearances import proved
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.proven_motions import KERNELS as PROVEN_KERNELS
from rrtik_ompl.world.proven_motions import ProvenMotions
from rrtik_ompl.world.world import form_of

MOST = 8  # goal configurations that are tried
SAMPLES = 2000  # of each search
COARSE = 4.0  # times the usual steps
BRIEF_WORK = 20.0  # of the pull of a route
WORTH = 0.98  # a straight line of more than this share of the best length is left out
SPARE = 2.5e-4  # [m] that motions keep beyond the clearance of the path, as those of `shorten()` do


def shorter_branch(problem: Problem, path: JointPath, goals: Matrix, budget: Budget) -> JointPath:
    """Return a path that becomes shorter than a given one by `shorten()`, perhaps to another goal configuration.

    Args:
        problem: The problem.
        path: A path of it.
        goals: Goal configurations, shape (k, dof).
        budget: Its seed, and when to end.

    Returns:
        A search's path with a proof of the same clearance; or the given one, also where there are no kernels, the
        path is not proven, or lengths are weighted.
    """
    world = problem.world
    proof = path.proof
    ends = np.vstack([path.waypoints, goals])
    if proof is None or not proof.proven or len(goals) < 2 or problem.constraints or has_weights(problem):
        return path
    known: object = world
    if not has_kernels(known, SEARCH_KERNELS, PULL_KERNELS, PROVEN_KERNELS, within=ends):
        return path
    coarse = form_of(world, accuracy="conservative", motion_resolution=COARSE * world.motion_resolution).motions
    if coarse is None:
        return path

    lower, upper = planning_bounds(problem, goals)
    motions = ProvenMotions(world, proof.clearance + SPARE).motions
    lines = np.linalg.norm(goals - problem.start, axis=1)
    near = np.flatnonzero(lines <= FAR * lines.min())
    order = near[np.argsort(lines[near], kind="stable")][:MOST]

    def pulled(rows: Matrix, seed: int) -> float:
        """Return the length of a route after a brief pull, +inf if it is not proven."""
        pull = Pulling(motions, rows, lower, upper, seed=seed, work=BRIEF_WORK)
        pull.run()
        return route_length(pull.waypoints) if pull.proven else np.inf

    best = path
    shortest = min(pulled(path.waypoints, budget.seed), path.length)
    key = (lower.tobytes(), upper.tobytes(), None, None)
    with kept_search(coarse, key, lambda: ConnectSearch(coarse, lower, upper)) as search:
        for k in order.tolist():
            if lines[k] > WORTH * shortest or budget.over():
                break
            seed = budget.seed + k
            rows = search.solve(problem.start[None], goals[k : k + 1], seed, max_iterations=SAMPLES, stop=budget.over)
            if rows is None:
                continue
            length = pulled(rows, seed)
            if length >= shortest:
                continue
            found = proved(JointPath.of(problem.robot, rows), world, clearance=proof.clearance)
            if found.proven:
                best = found
                shortest = length
    if best is path:
        return path

    wishes = Wishes(Budget(budget.seed, stop=budget.over), clearance=proof.clearance)
    return min((path, best), key=lambda each: shortened(each, problem, wishes).length)
