"""Fewer single-joint moves: the axis post-processor. Source: [1, ch. 6.3, algorithm 12].

Works on arrays: a route is (k, n) waypoints, every edge of which should move one joint; ``motions_free(A, B)`` says
for batches which straight motions are free. Beyond the published double pass: further rounds in random orders.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Budget, Stop, no_stop
from rrtik_ompl.model.transitions import lower_bound, merge_moves, route_length, transitions
from rrtik_ompl.world.motion_queries import MotionsFree

PART, LONGER = 16, 4  # moves of the first parts that are cut, and how many times longer they are the next time
FIRST_TESTS, MORE_TESTS = 4, 4  # waypoints tried together from a pivot, and how many times more the next time
MAX_CUT_ROUNDS = 20


def axis_cut(
    waypoints: Matrix, motions_free: MotionsFree, *, axes: Sequence[int] | None = None, stop: Stop = no_stop
) -> Matrix:
    """One pass of the axis post-processor.

    From the end of the route (the pivot) it looks for the earliest waypoint that a sequence of single-joint moves
    reaches without collision, goes there, and repeats from there until it has come to the start.

    Args:
        waypoints: Shape (k, n), start first. Every edge must be free. An edge that moves several joints is kept as it
            is where no sequence of single-joint moves replaces it.
        motions_free: Which straight motions are free, for batches of shape (m, n).
        axes: Order of all joints within a sequence; the last joint first if None, because distal joints sweep less.
        stop: Called at every pivot; true leaves the rest of the route as it is.

    Returns:
        Shape (m, n), start first, ends as given, with no more moves than the route had.
    """
    return _backward_pass(merge_moves(waypoints, tolerance=0.0), check_once(motions_free), axes, stop)[::-1]


def double_axis_cut(
    waypoints: Matrix, motions_free: MotionsFree, *, axes: Sequence[int] | None = None, stop: Stop = no_stop
) -> Matrix:
    """The published post-processing: a pass from the end of the route, then one from the start. See :func:`axis_cut`.

    Each pass turns the route round, so the second one cuts the other way and restores the direction.
    """
    free = check_once(motions_free)
    return _backward_pass(_backward_pass(merge_moves(waypoints, tolerance=0.0), free, axes, stop), free, axes, stop)


def cut_parts(waypoints: Matrix, motions_free: MotionsFree, *, stop: Stop = no_stop) -> Matrix:
    """The double cut of short parts of a long route, then of longer ones of what is left, up to the whole.

    The cut of a whole route checks about the square of its moves, and far waypoints come first; most of its gain is
    near. See :func:`axis_cut`.
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
    """Sort key of a route, shape (k, n): transitions, then length."""
    return transitions(route), route_length(route)


def axis_moves(a: Vector, b: Vector, axes: Sequence[int]) -> Matrix:
    """The waypoints after a of the single-joint moves from a to b, joints in the order ``axes``, shape (moves, n)."""
    changing = [axis for axis in axes if a[axis] != b[axis]]
    steps = np.repeat(a[None], len(changing), axis=0)
    for i, axis in enumerate(changing):
        steps[i:, axis] = b[axis]
    return steps


def check_once(motions_free: MotionsFree) -> MotionsFree:
    """The same test, but each motion is checked once, from its lexicographically smaller end.

    So both directions have one answer, and what an earlier pass has checked is remembered.
    """
    answers: dict[bytes, bool] = {}

    def free(A: Matrix, B: Matrix) -> Mask:
        """Which motions are free, each asked of the given test once."""
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
    """Algorithm 12. The returned route runs from the last waypoint to the first."""
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
    """The first waypoint that single-joint moves reach from the pivot; its neighbour if there is no other."""
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
    """Which goals, shape (m, n), single-joint moves from a reach, the joints in the order given. Shape (m,)."""
    # What moves last from a, a proximal joint, sweeps most, so it refutes soonest. The answers are the same.
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
    """The moves from the pivot to a waypoint before it.

    A neighbour is reached by the original edge. That is not tested again if it moves one joint: a doubt by rounding
    must not stop the pass.
    """
    moves = axis_moves(route[pivot], route[test], order)

    neighbours = test == pivot - 1 and len(moves) > 1
    if neighbours and not _reached(route[pivot], route[test:pivot], motions_free, order).all():
        return route[test:pivot]
    return moves


def _order(axes: Sequence[int] | None, dof: int) -> list[int]:
    """The order of the joints: the last one first if none is given."""
    return list(range(dof))[::-1] if axes is None else list(axes)
