"""Beyond the published double pass: further rounds of the axis cut in random orders, and the best of several routes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.transitions import lower_bound, route_length, transitions
from rrtik_ompl.planning.moves.axis_cut import axis_cut, check_once, double_axis_cut
from rrtik_ompl.world.motion_queries import MotionsFree

MAX_CUT_ROUNDS = 20


def axis_cut_rounds(
    waypoints: ArrayLike,
    motions_free: MotionsFree,
    *,
    rounds: int = MAX_CUT_ROUNDS,
    budget: Budget | None = None,
) -> Matrix:
    """The double pass, then ``rounds`` passes with random joint orders in alternating direction; keeps the best.

    A pass never adds a move, but may end in another route with as many. Each round goes on from the last one, so the
    rounds wander among routes of equal rank and leave where a shorter one opens.

    Args:
        waypoints: Shape (k, n), start first.
        motions_free: Which straight motions are free, for batches of shape (m, n).
        rounds: Number of further passes, at least 0.
        budget: When to end, with the best so far, and the seed of the random orders; without an end if None.

    Returns:
        Shape (m, n), start first: the route with the fewest transitions seen, the shortest among those.

    Raises:
        InputError: If the waypoints are no (k, n) numbers or ``rounds`` is negative.
    """
    if rounds < 0:
        raise InputError(f"rounds: expected at least 0, got {rounds}")

    budget = Budget() if budget is None else budget
    rng = np.random.default_rng(budget.seed)
    free = check_once(motions_free)
    route = best = double_axis_cut(waypoints, free, stop=budget.over)
    fewest = lower_bound(best[0], best[-1])

    for k in range(rounds):
        if transitions(best) == fewest or budget.over():
            break
        route = axis_cut(route[::-1], free, axes=rng.permutation(route.shape[1]).tolist(), stop=budget.over)
        best = min(best, route[::-1] if k % 2 == 0 else route, key=route_rank)
    return best


def best_of(attempt: Callable[[int], Matrix | None], count: int, *, seed: int = 0) -> Matrix | None:
    """Restarts: the best route of ``count`` attempts.

    Args:
        attempt: Makes a route, shape (k, n), from a seed, or None if it finds none.
        count: Number of attempts, at least 1.
        seed: From which the seeds of the attempts are drawn.

    Returns:
        The route with the fewest transitions, the shortest among those; None if no attempt found one.

    Raises:
        InputError: If ``count`` is below 1.
    """
    if count < 1:
        raise InputError(f"count: expected at least 1, got {count}")

    seeds = np.random.SeedSequence(seed).generate_state(count).tolist()
    return min((route for s in seeds if (route := attempt(s)) is not None), key=route_rank, default=None)


def route_rank(route: Matrix) -> tuple[int, float]:
    """Sort key of a route, shape (k, n): transitions, then length."""
    return transitions(route), route_length(route)
