"""Fewer single-joint moves: the axis post-processor. Source: the C-RDT paper, algorithm 12, and its double pass.

Works on arrays: a route is (k, n) waypoints, every edge of which should move one joint; ``motion_valid(a, b)`` tells
whether a straight motion is free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Matrix, Vector, finite_array
from rrtik_ompl.errors import InputError
from rrtik_ompl.transitions import merge_moves

MotionValid: TypeAlias = Callable[[Vector, Vector], bool]


def axis_cut(waypoints: ArrayLike, motion_valid: MotionValid, *, axes: Sequence[int] | None = None) -> Matrix:
    """One pass of the axis post-processor.

    From the end of the route (the pivot) it looks for the earliest waypoint that a sequence of single-joint moves
    reaches without collision, goes there, and repeats from there until it has come to the start.

    Args:
        waypoints: Shape (k, n), start first. Every edge must be free. An edge that moves several joints is kept as it
            is where no sequence of single-joint moves replaces it.
        motion_valid: Whether a straight motion is free.
        axes: Order of the joints within a sequence; the last joint first if None, because distal joints sweep less.

    Returns:
        Shape (m, n), start first, ends as given, with no more moves than the route had.

    Raises:
        InputError: If the waypoints are no (k, n) numbers or ``axes`` is no permutation of the joints.
    """
    return _backward_pass(_route(waypoints), ask_once(motion_valid), axes)[::-1]


def double_axis_cut(waypoints: ArrayLike, motion_valid: MotionValid, *, axes: Sequence[int] | None = None) -> Matrix:
    """The published post-processing: a pass from the end of the route, then one from the start. See :func:`axis_cut`.

    Each pass turns the route round, so the second one cuts the other way and restores the direction.
    """
    test = ask_once(motion_valid)
    return _backward_pass(_backward_pass(_route(waypoints), test, axes), test, axes)


def axis_moves(a: Vector, b: Vector, axes: Sequence[int]) -> Matrix:
    """The waypoints after a of the single-joint moves from a to b, joints in the order ``axes``, shape (moves, n)."""
    changing = [axis for axis in axes if a[axis] != b[axis]]
    steps = np.repeat(a[None], len(changing), axis=0)
    for i, axis in enumerate(changing):
        steps[i:, axis] = b[axis]
    return steps


def _backward_pass(route: Matrix, motion_valid: MotionValid, axes: Sequence[int] | None) -> Matrix:
    """Algorithm 12. The returned route runs from the last waypoint to the first."""
    order = _order(axes, route.shape[1])
    pivot, new = len(route) - 1, [route[-1:]]
    while pivot > 0:
        test, moves = _earliest_reachable(route, pivot, motion_valid, order)
        new.append(moves)
        pivot = test
    return merge_moves(np.vstack(new), tolerance=0.0)


def _earliest_reachable(
    route: Matrix, pivot: int, motion_valid: MotionValid, order: Sequence[int]
) -> tuple[int, Matrix]:
    """The first waypoint that single-joint moves reach from the pivot, and these moves."""
    for test in range(pivot - 1):
        moves = axis_moves(route[pivot], route[test], order)
        if _all_valid(route[pivot], moves, motion_valid):
            return test, moves
    return pivot - 1, _original_edge(route, pivot, motion_valid, order)


def _original_edge(route: Matrix, pivot: int, motion_valid: MotionValid, order: Sequence[int]) -> Matrix:
    """The edge before the pivot. Not tested again if it moves one joint: a doubt by rounding must not stop the pass."""
    moves = axis_moves(route[pivot], route[pivot - 1], order)
    if len(moves) <= 1 or _all_valid(route[pivot], moves, motion_valid):
        return moves
    return route[pivot - 1 : pivot]


def _all_valid(a: Vector, moves: Matrix, motion_valid: MotionValid) -> bool:
    """Whether every one of the moves that begin at a is free."""
    for b in moves:
        if not motion_valid(a, b):
            return False
        a = b
    return True


def ask_once(motion_valid: MotionValid) -> MotionValid:
    """The same test, but each motion is asked once, from its lexicographically smaller end.

    So both directions have one answer, and what an earlier pass has asked is remembered.
    """
    answers: dict[tuple[bytes, bytes], bool] = {}

    def test(a: Vector, b: Vector) -> bool:
        first, second = (a, b) if a.tolist() <= b.tolist() else (b, a)
        key = (first.tobytes(), second.tobytes())
        if key not in answers:
            answers[key] = motion_valid(first, second)
        return answers[key]

    return test


def _order(axes: Sequence[int] | None, dof: int) -> list[int]:
    order = list(range(dof))[::-1] if axes is None else [int(axis) for axis in axes]
    if sorted(order) != list(range(dof)):
        raise InputError(f"axes: expected each of 0 to {dof - 1} once, got {order}")
    return order


def _route(waypoints: ArrayLike) -> Matrix:
    route = finite_array(waypoints, (None, None), "waypoints")
    if len(route) == 0:
        raise InputError("waypoints: a route needs at least one configuration")
    return merge_moves(route, tolerance=0.0)
