"""Retraction: bends slide back along the lines of sight until they touch what they go round.

Source: [1, ch. 5.3, method 3], in three phases with bisection. Visibility is not monotone along a route,
so a bisection finds some visible point that an invisible one follows, not the farthest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.transitions import merge_moves, part_counts, route_length, subdivided, without_repeats
from rrtik_ompl.planning.shortening.task import Task

STEPS = 40  # of the planner along a route, where nobody says how large they are
FINENESS = 5.0  # the third phase's steps are this many times as small


def retract(route: Matrix, task: Task, *, step: float | None = None, fineness: float = FINENESS) -> Matrix:
    """Retract a route, shape (k, n); deterministic.

    Args:
        route: Free, start first.
        task: Checks motions.
        step: Of the second phase, in the unit of the route's length; a fortieth of the route if None.
        fineness: How many times smaller the steps of the third phase are.

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
        seen = _last_visible(len(ahead), _seen_from(pivot, ahead, task))
        if seen == len(ahead) - 1:
            done.append(task.moves(pivot, ahead[-1]))
            ahead = ahead[:0]
        else:
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
    """The route so far, and the moves from there to what is ahead."""
    return np.vstack([*done, task.moves(done[-1][-1], ahead[0]), ahead[1:]] if len(ahead) else done)


def _one_bend(pivot: Vector, ahead: Matrix, coarse: float, fine: float, task: Task) -> tuple[Matrix, Matrix]:
    """Phases 2 and 3: the waypoints after the pivot up to the next one, and what is ahead of that.

    The first of the points ahead, shape (k, n), is visible from the pivot, the second is not.
    """
    on_edge = _divided(ahead[:2], coarse)
    seen = _last_visible(len(on_edge), _seen_from(pivot, on_edge, task), last_is_hidden=True)
    beyond = on_edge[seen + 1]
    rest = ahead[1:] if seen + 2 == len(on_edge) else np.vstack([beyond[None], ahead[1:]])

    sight_line = _divided(np.vstack([pivot[None], task.moves(pivot, on_edge[seen])]), fine)
    last = len(sight_line) - 1
    back = _last_visible(last + 1, lambda k: task.link(sight_line[last - k], beyond) is not None, last_is_hidden=True)
    if back == last:  # nothing is left of the sight line: the point that was out of sight is the next pivot
        return beyond[None], ahead[1:]
    bend = sight_line[: last - back + 1]
    return (merge_moves(bend, tolerance=0.0)[1:] if task.one_joint else bend[-1:]), rest


def _seen_from(pivot: Vector, points: Matrix, task: Task) -> Callable[[int], bool]:
    """Which of the points are visible from the pivot, by number."""
    return lambda k: task.link(pivot, points[k]) is not None


def _last_visible(count: int, visible: Callable[[int], bool], *, last_is_hidden: bool = False) -> int:
    """Bisection: the number of a visible point that is the last one or that an invisible one follows.

    The first point is known to be visible.
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
    """A polyline with further points, none farther than ``step`` from the next; its corners stay as they are."""
    counts = part_counts(corners, step)
    points, edges = subdivided(corners, counts)
    a = corners[edges]
    b = corners[edges + 1]
    divided: Matrix = np.clip(points, np.minimum(a, b), np.maximum(a, b))  # a joint that does not move stays to the bit
    return divided
