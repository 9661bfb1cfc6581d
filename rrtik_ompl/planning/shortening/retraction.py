"""Retraction: bends slide back along lines of sight until they touch the obstacles that they go round.

Source: [1, ch. 5.3, method 3], in three phases with bisection. Visibility is not monotone along a route, so a bisection
finds some visible point that is followed by a hidden one, not necessarily the farthest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.transitions import merge_moves, part_counts, route_length, subdivided, without_repeats
from rrtik_ompl.planning.shortening.task import Task

STEPS = 40  # steps along a route if their size is not given
FINENESS = 5.0  # factor by which the steps of the third phase are smaller


def retract(route: Matrix, task: Task, *, step: float | None = None, fineness: float = FINENESS) -> Matrix:
    """Retract a route, shape (k, n); deterministic.

    From a pivot, the last visible waypoint is found (phase 1). Along the edge behind it the last visible point is found
    (phase 2). On the sight line to this point, the point nearest to the pivot that still sees the next point of the
    edge is the new bend (phase 3), and the next pivot.

    Args:
        route: Free, start first.
        task: Checks motions.
        step: Step of the second phase, in the unit of the route's length; None for a fortieth of the route.
        fineness: Factor by which the steps of the third phase are smaller.

    Returns:
        The new route, or the given one if that is better or an edge of the new one turns out not to be free.
    """
    coarse = route_length(route) / STEPS if step is None else step
    if len(route) < 3 or coarse <= 0.0:
        return route

    route = without_repeats(route)
    pivot = route[0]
    ahead = route[1:]
    done = [route[:1]]
    while len(ahead) > 0 and not task.expired():
        # Phase 1: the last visible waypoint.
        seen = _last_visible(len(ahead), _seen_from(pivot, ahead, task))
        if seen == len(ahead) - 1:
            done.append(task.moves(pivot, ahead[-1]))
            ahead = ahead[:0]
        else:
            # Phases 2 and 3. If the new motions are not free, the waypoint itself becomes the bend.
            bend, rest = _one_bend(pivot, ahead[seen:], coarse, coarse / fineness, task)
            if not task.confirmed(_joined([pivot[None], bend], rest, task), route):
                bend = task.moves(pivot, ahead[seen])
                rest = ahead[seen + 1 :]
            done.append(bend)
            pivot = bend[-1]
            ahead = rest
        task.report(_joined(done, ahead, task))

    found = without_repeats(_joined(done, ahead, task))
    return task.better(route, found) if task.confirmed(found, route) else route


def _joined(done: list[Matrix], ahead: Matrix, task: Task) -> Matrix:
    """Join the waypoints so far, the moves to the next waypoint ahead, and the waypoints ahead."""
    return np.vstack([*done, task.moves(done[-1][-1], ahead[0]), ahead[1:]] if len(ahead) else done)


def _one_bend(pivot: Vector, ahead: Matrix, coarse: float, fine: float, task: Task) -> tuple[Matrix, Matrix]:
    """Run phases 2 and 3 for one bend.

    Args:
        pivot: Shape (n,).
        ahead: Waypoints ahead, shape (k, n); the first is visible from the pivot, the second is not.
        coarse: Step of phase 2.
        fine: Step of phase 3.
        task: Checks motions.

    Returns:
        The waypoints after the pivot up to the next one, and the waypoints ahead of that.
    """
    on_edge = _divided(ahead[:2], coarse)
    seen = _last_visible(len(on_edge), _seen_from(pivot, on_edge, task), last_is_hidden=True)
    beyond = on_edge[seen + 1]
    rest = ahead[1:] if seen + 2 == len(on_edge) else np.vstack([beyond[None], ahead[1:]])

    sight_line = _divided(np.vstack([pivot[None], task.moves(pivot, on_edge[seen])]), fine)
    last = len(sight_line) - 1
    back = _last_visible(last + 1, lambda k: task.link(sight_line[last - k], beyond) is not None, last_is_hidden=True)
    # Nothing is left of the sight line, so the hidden point is the next pivot.
    if back == last:
        return beyond[None], ahead[1:]
    bend = sight_line[: last - back + 1]
    return (merge_moves(bend, tolerance=0.0)[1:] if task.one_joint else bend[-1:]), rest


def _seen_from(pivot: Vector, points: Matrix, task: Task) -> Callable[[int], bool]:
    """Return a function that checks whether the point of an index is visible from the pivot."""
    return lambda k: task.link(pivot, points[k]) is not None


def _last_visible(count: int, visible: Callable[[int], bool], *, last_is_hidden: bool = False) -> int:
    """Find, by bisection, the index of a visible point that is the last one or is followed by a hidden one.

    The first point is known to be visible.

    Args:
        count: Number of points.
        visible: Returns whether the point of an index is visible.
        last_is_hidden: Whether the last point is known to be hidden, so that it need not be checked.
    """
    if count == 1 or (not last_is_hidden and visible(count - 1)):
        return count - 1
    seen = 0
    unseen = count - 1
    while unseen - seen > 1:
        middle = (seen + unseen) // 2
        if visible(middle):
            seen = middle
        else:
            unseen = middle
    return seen


def _divided(corners: Matrix, step: float) -> Matrix:
    """Subdivide a polyline so that no point is farther than ``step`` from the next; its corners stay."""
    counts = part_counts(corners, step)
    points, edges = subdivided(corners, counts)
    a = corners[edges]
    b = corners[edges + 1]
    # Clipped, so that a joint that does not move keeps its exact value.
    divided: Matrix = np.clip(points, np.minimum(a, b), np.maximum(a, b))
    return divided
