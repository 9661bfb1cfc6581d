"""Corner snapping: every bend is pulled by bisection to the corner that it goes round.

Three waypoints span a triangle, in which the bend between the other two is moved: along its second edge to the last
point that the first waypoint sees, then back along that sight line to the last point that the third waypoint sees. If
there is one corner in the triangle, both sight lines touch it, and the bend is there. If there are several corners, or
a round obstacle, chords then cut the bend off. The triangle inequality bounds the gain of a motion before it is
checked, so no motion is checked that cannot gain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.transitions import route_length, without_repeats
from rrtik_ompl.planning.shortening.task import Task

FIRST_GAIN = 2e-3  # share of the length; smaller gains at a bend are ignored by the first round
LEAST_GAIN = 1.2e-4  # the same for the second round; later rounds are finer
FINER = 0.4  # factor of this share from one round to the next
ROUND = 2e-4  # share of the length; while chords gain more, a further round follows
MAX_CORNER_ROUNDS = 8
CHORD = 1.3  # relative accuracy of the length of a chord


def snap_corners(route: Matrix, task: Task) -> Matrix:
    """Pull a route, shape (k, n), taut; deterministic.

    Parts of free motions count as free at first, and the result is checked as a whole. If that fails (checks at a
    finite density may miss a contact that others find), the work is repeated with every part checked.

    Args:
        route: Free, start first.
        task: Checks motions. The result has straight motions, so single-joint moves are lost.

    Returns:
        The new route, or the given one if that is not worse.
    """
    if len(route) < 3:
        return route
    for checks_parts in (False, True):
        found = _Corners(task, checks_parts).pulled(without_repeats(route))
        if task.confirmed(found, route):
            found = task.better(route, found)
            task.report(found)
            return found
    return route


class _Corners:
    """The state of one run: the answers of checks so far, and the gain that is worth a check.

    Attributes:
        min_gain: The smallest gain of length that is worth a check.
        checks_parts: Whether parts of free motions are checked, too.
    """

    def __init__(self, task: Task, checks_parts: bool) -> None:
        self.task = task
        self.checks_parts = checks_parts
        self.min_gain = 0.0
        self._answers: dict[frozenset[bytes], bool] = {}

    def pulled(self, route: Matrix) -> Matrix:
        """Run rounds of pulling and cutting bends, until they gain next to nothing."""
        rows = self._keep_last_seen(list(route))
        share = FIRST_GAIN
        self.task.report(np.array(rows))
        for number in range(MAX_CORNER_ROUNDS):
            if self.task.expired():
                break

            total_length = _length(rows)
            self.min_gain = share * total_length
            rows = self._pull_bends(rows, nearly_done=number > 0)
            length_before = _length(rows)
            rows = self._cut_bends(rows)
            if number > 0 and length_before - _length(rows) < ROUND * total_length:
                break
            share = LEAST_GAIN if number == 0 else FINER * share
        return without_repeats(np.array(rows))

    def _free(self, a: Vector, b: Vector) -> bool:
        """Check whether a motion is free; each motion is checked once for both directions."""
        edge = frozenset((a.tobytes(), b.tobytes()))
        if edge not in self._answers:
            self._answers[edge] = self.task.free(a, b)
        return self._answers[edge]

    def _part_free(self, a: Vector, b: Vector) -> bool:
        """Check a part of a free motion, which counts as free unless `checks_parts`."""
        return not self.checks_parts or self._free(a, b)

    def _keep_last_seen(self, route: list[Vector]) -> list[Vector]:
        """Keep from waypoint to waypoint the last one seen by bisection, as in the first phase of retraction."""
        rows = [route[0]]
        here = 0
        last = len(route) - 1
        while here < last:
            seen, hidden = (last, last) if self._free(route[here], route[last]) else (here + 1, last)
            while hidden - seen > 1:
                middle = (seen + hidden) // 2
                seen, hidden = (middle, hidden) if self._free(route[here], route[middle]) else (seen, middle)
            rows.append(route[seen])
            here = seen
        return rows

    def _pull_bends(self, rows: list[Vector], *, nearly_done: bool) -> list[Vector]:
        """Drop every bend or pull it to its corner, one after the other."""
        rows = list(rows)
        k = 1
        while k < len(rows) - 1:
            a, bend, b = rows[k - 1 : k + 2]
            if _detour(a, bend, b) <= self.min_gain:
                k += 1
            elif self._free(a, b):
                del rows[k]
            else:
                rows[k] = self._pulled(a, bend, b, nearly_done)
                k += 1
        return rows

    def _pulled(self, a: Vector, bend: Vector, b: Vector, nearly_done: bool) -> Vector:
        """Return the bend between a and b, pulled to a corner of the obstacle that it goes round, or as it is."""
        seen = self._last_seen(a, bend, b, nearly_done)
        if not self._part_free(seen, b):
            return bend
        corner = self._last_seen(b, seen, a, nearly_done)
        return corner if self._part_free(a, corner) else seen

    def _last_seen(self, eye: Vector, visible_end: Vector, hidden_end: Vector, nearly_done: bool) -> Vector:
        """Find the last point that the eye sees on the segment from ``visible_end`` to ``hidden_end``.

        Args:
            eye: Shape (n,).
            visible_end: Known to be visible, shape (n,).
            hidden_end: Known to be hidden, shape (n,).
            nearly_done: Whether little is to be gained, so that the search begins at the visible end.
        """
        segment = hidden_end - visible_end
        segment_length = float(np.linalg.norm(hidden_end - visible_end))

        def visible(share: float) -> bool:
            return self._free(eye, visible_end + share * segment)

        def length(share: float) -> float:
            return float(np.linalg.norm(visible_end + share * segment - eye)) + (1.0 - share) * segment_length

        first = _first_below(length, length(0.0) - self.min_gain) if nearly_done else 1.0
        seen, hidden = _bracket(visible, first)
        if nearly_done and seen == 0.0:
            return visible_end  # a nearer point is not worth a check
        while length(seen) - length(hidden) > self.min_gain:
            middle = 0.5 * (seen + hidden)
            seen, hidden = (middle, hidden) if visible(middle) else (seen, middle)
        return visible_end if seen == 0.0 else visible_end + seen * segment

    def _cut_bends(self, rows: list[Vector]) -> list[Vector]:
        """Replace bends by two where a chord across them is free and gains enough, and treat the new bends likewise."""
        done = [rows[0]]
        ahead = rows[:0:-1]
        while len(ahead) > 1:
            chord = self._chord(done[-1], ahead[-1], ahead[-2])
            if chord is None:
                done.append(ahead.pop())
            else:
                ahead[-1:] = chord[::-1]
        return [*done, *ahead]

    def _chord(self, a: Vector, bend: Vector, b: Vector) -> tuple[Vector, Vector] | None:
        """Find the longest free chord across a bend.

        Both ends are at the same distance from the bend. This distance is found by bisection.

        Args:
            a: Waypoint before the bend, shape (n,).
            bend: Shape (n,).
            b: Waypoint after the bend, shape (n,).

        Returns:
            The ends of the chord on the sides towards a and b, shapes (n,); None if it gains too little.
        """
        sides = float(np.linalg.norm(a - bend)), float(np.linalg.norm(b - bend))
        if min(sides) == 0.0:
            return None

        to_a = (a - bend) / sides[0]
        to_b = (b - bend) / sides[1]

        def is_free(distance: float) -> bool:
            return self._free(bend + distance * to_a, bend + distance * to_b)

        # The shortest distance from the bend that is worth a chord, and one at which a chord is blocked or leaves the
        # edges.
        gain_per_distance = 2.0 - float(np.linalg.norm(to_a - to_b))
        free = self.min_gain / max(gain_per_distance, 1e-300)  # practically infinite if nothing can be gained
        blocked = min(sides)
        if free >= blocked or not is_free(free):
            return None

        while blocked > CHORD * free and gain_per_distance * (blocked - free) > self.min_gain:
            middle = min(float(np.sqrt(free * blocked)), 0.5 * (free + blocked))
            if is_free(middle):
                free = middle
            else:
                blocked = middle

        ends = bend + free * to_a, bend + free * to_b
        sides_are_free = self._part_free(a, ends[0]) and self._part_free(ends[1], b)
        return ends if sides_are_free else None


def _bracket(visible: Callable[[float], bool], first: float) -> tuple[float, float]:
    """Return a visible share (or 0) and a larger hidden one (or 1).

    The shares tried are ``first`` and then four times as much each time.

    Args:
        visible: Returns whether the point at a share of a segment is visible.
        first: The first share to try.
    """
    seen = 0.0
    while first < 1.0:
        if not visible(first):
            return seen, first
        seen = first
        first *= 4.0
    return seen, 1.0


def _length(rows: list[Vector]) -> float:
    return route_length(np.array(rows))


def _detour(a: Vector, bend: Vector, b: Vector) -> float:
    """Return how much longer the path from a to b over the bend is than the straight one."""
    return float(np.linalg.norm(bend - a) + np.linalg.norm(b - bend) - np.linalg.norm(b - a))


def _first_below(length: Callable[[float], float], max_length: float) -> float:
    """Return the smallest share at which a decreasing length is at most ``max_length``; 1 if nowhere.

    The share is found by bisection to one millionth.
    """
    low = 0.0
    high = 1.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        if length(middle) > max_length:
            low = middle
        else:
            high = middle
    return high
