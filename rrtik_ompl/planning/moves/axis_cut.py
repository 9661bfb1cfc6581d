"""The axis post-processor, which reduces the number of single-joint moves. Source: [1, ch. 6.3, algorithm 12].

It works on arrays: a route is an array of waypoints, shape (k, n), every edge of which should move one joint.
``motions_free(A, B)`` returns for batches of shape (m, n) which straight motions are free. Beyond the published double
pass there are further rounds with random orders of the joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Budget, Stop, no_stop
from rrtik_ompl.model.transitions import lower_bound, merge_moves, route_length, transitions
from rrtik_ompl.world.motion_queries import MotionsFree

PART, LONGER = 16, 4  # moves in each of the first parts to be cut, and growth factor of the next parts
FIRST_TESTS, MORE_TESTS = 4, 4  # waypoints tried together from a pivot, and growth factor
MAX_CUT_ROUNDS = 20


def axis_cut(
    waypoints: Matrix, motions_free: MotionsFree, *, axes: Sequence[int] | None = None, stop: Stop = no_stop
) -> Matrix:
    """Run one pass of the axis post-processor.

    The pass begins with the end of the route as pivot. It looks for the earliest waypoint that a sequence of
    single-joint moves reaches from the pivot without collision, appends these moves, and makes that waypoint the next
    pivot, until it arrives at the start.

    Args:
        waypoints: Shape (k, n), start first. Every edge must be free. An edge that moves several joints is kept as it
            is where no sequence of single-joint moves replaces it.
        motions_free: Returns which straight motions are free, for batches of shape (m, n).
        axes: Order of all joints within a sequence; None for the last joint first, because distal joints sweep less
            space.
        stop: Called at every pivot; True leaves the rest of the route as it is.

    Returns:
        Shape (m, n), start first, with the same ends and no more moves than the route had.
    """
    return _backward_pass(merge_moves(waypoints, tolerance=0.0), check_once(motions_free), axes, stop)[::-1]


def double_axis_cut(
    waypoints: Matrix, motions_free: MotionsFree, *, axes: Sequence[int] | None = None, stop: Stop = no_stop
) -> Matrix:
    """Run the published post-processing: a pass from the end of the route, then one from its start.

    Each pass reverses the route, so the second pass cuts from the other end and restores the direction. For the
    arguments see :func:`axis_cut`.
    """
    free = check_once(motions_free)
    return _backward_pass(_backward_pass(merge_moves(waypoints, tolerance=0.0), free, axes, stop), free, axes, stop)


def cut_parts(waypoints: Matrix, motions_free: MotionsFree, *, stop: Stop = no_stop) -> Matrix:
    """Run the double cut on short parts of a long route, then on longer parts of the result, up to the whole.

    The cut of a whole route checks a number of motions that grows with the square of its moves and begins with far
    waypoints, although most of the gain is among near ones. For the arguments see :func:`axis_cut`.
    """
    route = merge_moves(waypoints, tolerance=0.0)
    size = PART
    while size < len(route) - 1 and not stop():
        parts = [route[k : k + size + 1] for k in range(0, len(route) - 1, size)]
        cut = [double_axis_cut(part, motions_free, stop=stop) for part in parts]
        route = merge_moves(np.vstack(cut), tolerance=0.0)
        size = LONGER * size
    return double_axis_cut(route, motions_free, stop=stop)


def axis_cut_rounds(
    waypoints: Matrix,
    motions_free: MotionsFree,
    *,
    rounds: int = MAX_CUT_ROUNDS,
    budget: Budget | None = None,
) -> Matrix:
    """Run the double pass and ``rounds`` passes with random joint orders in alternating direction; keep the best route.

    A pass never adds a move, but it may end in a different route with as many moves. Each round continues from the
    route of the last one, so the rounds wander among routes of equal rank until one of them leads to a shorter route.

    Args:
        waypoints: Shape (k, n), start first.
        motions_free: Returns which straight motions are free, for batches of shape (m, n).
        rounds: Number of further passes, at least 0.
        budget: When to end with the best route so far, and the seed of the random orders; None for no end.

    Returns:
        Shape (m, n), start first: the route with the fewest moves of all rounds, the shortest one among these.
    """
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


def route_rank(route: Matrix) -> tuple[int, float]:
    """Return the sort key of a route, shape (k, n): number of moves, then length."""
    return transitions(route), route_length(route)


def axis_moves(a: Vector, b: Vector, axes: Sequence[int]) -> Matrix:
    """Return the waypoints after a of the single-joint moves from a to b in the order ``axes``, shape (moves, n)."""
    changing = [axis for axis in axes if a[axis] != b[axis]]
    steps = np.repeat(a[None], len(changing), axis=0)
    for i, axis in enumerate(changing):
        steps[i:, axis] = b[axis]
    return steps


def check_once(motions_free: MotionsFree) -> MotionsFree:
    """Return a check that asks the given one only once for each motion, from its lexicographically smaller end.

    Both directions of a motion thus have the same answer, and answers of earlier passes are reused.
    """
    answers: dict[bytes, bool] = {}

    def free(A: Matrix, B: Matrix) -> Mask:
        """Return which motions from rows of A to rows of B are free."""
        swap = np.array([a > b for a, b in zip(A.tolist(), B.tolist(), strict=True)], dtype=bool)[:, None]
        first = np.where(swap, B, A)
        second = np.where(swap, A, B)
        keys = [motion.tobytes() for motion in np.hstack([first, second])]
        unknown = {key: k for k, key in enumerate(keys) if key not in answers}
        if unknown:
            rows = list(unknown.values())
            answers.update(zip(unknown, motions_free(first[rows], second[rows]).tolist(), strict=True))
        return np.array([answers[key] for key in keys], dtype=bool)

    return free


def _backward_pass(route: Matrix, motions_free: MotionsFree, axes: Sequence[int] | None, stop: Stop) -> Matrix:
    """Run algorithm 12; the returned route runs from the last waypoint to the first."""
    order = _order(axes, route.shape[1])
    pivot = len(route) - 1
    new = [route[-1:]]
    while pivot > 0 and not stop():
        test = _earliest_reachable(route, pivot, motions_free, order)
        new.append(_moves_to_waypoint(route, pivot, test, motions_free, order))
        pivot = test

    new.append(route[:pivot][::-1])
    return merge_moves(np.vstack(new), tolerance=0.0)


def _earliest_reachable(route: Matrix, pivot: int, motions_free: MotionsFree, order: Sequence[int]) -> int:
    """Return the index of the first waypoint that single-joint moves reach from the pivot, or that of its neighbour."""
    first = 0
    count = FIRST_TESTS
    while first < pivot - 1:
        last = min(first + count, pivot - 1)
        reached = _reached(route[pivot], route[first:last], motions_free, order)
        if reached.any():
            return first + int(reached.argmax())
        first = last
        count = MORE_TESTS * count
    return pivot - 1


def _reached(a: Vector, goals: Matrix, motions_free: MotionsFree, order: Sequence[int]) -> Mask:
    """Check which goals single-joint moves from ``a`` reach, joints in the given order.

    Args:
        a: Shape (n,).
        goals: Shape (m, n).
        motions_free: Returns which straight motions are free.
        order: Order of the joints.

    Returns:
        Mask, shape (m,).
    """
    # The last moves are checked first: these are moves of proximal joints, which sweep most space and collide most
    # often. The order of checks does not change the result.
    reached = np.ones(len(goals), dtype=bool)
    order = list(order)
    for k, axis in reversed(list(enumerate(order))):
        here = np.repeat(a[None], len(goals), axis=0)
        here[:, order[:k]] = goals[:, order[:k]]
        there = here.copy()
        there[:, axis] = goals[:, axis]

        undecided = np.flatnonzero(reached & (there[:, axis] != here[:, axis]))
        if len(undecided):
            reached[undecided] = motions_free(here[undecided], there[undecided])
    return reached


def _moves_to_waypoint(route: Matrix, pivot: int, test: int, motions_free: MotionsFree, order: Sequence[int]) -> Matrix:
    """Return the waypoints of the moves from the pivot to a waypoint before it, shape (moves, n).

    The edge to a neighbour is known to be free. If it moves one joint it is not checked again, so that an answer that
    differs by rounding cannot stop the pass.

    Args:
        route: Shape (k, n).
        pivot: Index of the waypoint from which to move.
        test: Index of the waypoint to reach.
        motions_free: Returns which straight motions are free.
        order: Order of the joints.
    """
    moves = axis_moves(route[pivot], route[test], order)

    neighbours = test == pivot - 1 and len(moves) > 1
    if neighbours and not _reached(route[pivot], route[test:pivot], motions_free, order).all():
        return route[test:pivot]
    return moves


def _order(axes: Sequence[int] | None, dof: int) -> list[int]:
    """Return the order of the joints; the last joint comes first if none is given."""
    return list(range(dof))[::-1] if axes is None else list(axes)
