"""Corner snapping: every bend is pulled by bisection to the corner that it goes round.

Three waypoints span a triangle, in which the bend between the other two is moved: along its second edge to the last
place that the first waypoint sees, then back along that sight line to the last place that the third one sees. With one
corner in the triangle both sight lines touch it, and the bend is there. With several, or with something round, chords
then cut the bend off. What a motion could gain at most is known before it is checked (the triangle inequality), so no
motion is checked that cannot gain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.transitions import route_length, without_repeats
from rrtik_ompl.planning.shortening.task import Task

FIRST_GAIN = 2e-3  # of the length: what the first round does not bother to gain at a bend
LEAST_GAIN = 1.2e-4  # likewise for the second round; the rounds after it are finer still
FINER = 0.4  # from one round to the next
ROUND = 2e-4  # of the length: where chords still gain as much, something round is left to be gone round
MAX_CORNER_ROUNDS = 8
CHORD = 1.3  # a chord is found to this factor


def snap_corners(route: Matrix, task: Task) -> Matrix:
    """Pull a route, shape (k, n), taut; deterministic.

    Parts of free motions count as free on the way, and the answer is checked as a whole; if that fails (checks at a
    finite density may miss a graze that others hit) the work is done again with every part checked.

    Args:
        route: Free, start first.
        task: Checks motions, straight ones, so single-joint moves are lost.

    Returns:
        The new route, or the given one if that is not worse.
    """
    if len(route) < 3:
        return route
    for careful in (False, True):
        found = _Corners(task, careful).pulled(without_repeats(route))
        if task.confirmed(found, route):
            found = task.better(route, found)
            task.report(found)
            return found
    return route


class _Corners:
    """The answers so far, and how small a gain is worth a check.

    Attributes:
        least: The smallest gain of length that is worth a check.
        careful: Whether parts of free motions are checked too.
    """

    def __init__(self, task: Task, careful: bool) -> None:
        self.task = task
        self.careful = careful
        self.least = 0.0
        self._answers: dict[frozenset[bytes], bool] = {}

    def pulled(self, route: Matrix) -> Matrix:
        """Rounds of pulling and cutting, until the chords gain nothing more."""
        rows = self._few(list(route))
        share = FIRST_GAIN
        self.task.report(np.array(rows))
        for number in range(MAX_CORNER_ROUNDS):
            if self.task.expired():
                break

            whole = _length(rows)
            self.least = share * whole
            rows = self._swept(rows, nearly_done=number > 0)
            before = _length(rows)
            rows = self._cut_off(rows)
            if number > 0 and before - _length(rows) < ROUND * whole:
                break
            share = LEAST_GAIN if number == 0 else FINER * share
        return without_repeats(np.array(rows))

    def _free(self, a: Vector, b: Vector) -> bool:
        edge = frozenset((a.tobytes(), b.tobytes()))
        if edge not in self._answers:
            self._answers[edge] = self.task.free(a, b)
        return self._answers[edge]

    def _part_free(self, a: Vector, b: Vector) -> bool:
        """Whether a part of a free motion is free."""
        return not self.careful or self._free(a, b)

    def _few(self, route: list[Vector]) -> list[Vector]:
        """From waypoint to waypoint, each the last one seen by bisection; as the first phase of retraction."""
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

    def _swept(self, rows: list[Vector], *, nearly_done: bool) -> list[Vector]:
        """Every bend dropped or pulled to its corner, one after the other."""
        rows = list(rows)
        k = 1
        while k < len(rows) - 1:
            a, bend, b = rows[k - 1 : k + 2]
            if _detour(a, bend, b) <= self.least:
                k += 1
            elif self._free(a, b):
                del rows[k]
            else:
                rows[k] = self._pulled(a, bend, b, nearly_done)
                k += 1
        return rows

    def _pulled(self, a: Vector, bend: Vector, b: Vector, nearly_done: bool) -> Vector:
        seen = self._last_seen(a, bend, b, nearly_done)
        if not self._part_free(seen, b):
            return bend
        corner = self._last_seen(b, seen, a, nearly_done)
        return corner if self._part_free(a, corner) else seen

    def _last_seen(self, eye: Vector, near: Vector, far: Vector, nearly_done: bool) -> Vector:
        """The last place that the eye sees between ``near``, which it sees, and ``far``, which it does not.

        Where the route is nearly done little is to be expected: the search then begins at the near end.
        """
        way = far - near
        rest = float(np.linalg.norm(far - near))

        def visible(share: float) -> bool:
            return self._free(eye, near + share * way)

        def length(share: float) -> float:
            return float(np.linalg.norm(near + share * way - eye)) + (1.0 - share) * rest

        first = _first_below(length, length(0.0) - self.least) if nearly_done else 1.0
        seen, hidden = _bracket(visible, first)
        if nearly_done and seen == 0.0:
            return near  # and what is nearer than the first place is not worth a check
        while length(seen) - length(hidden) > self.least:
            middle = 0.5 * (seen + hidden)
            seen, hidden = (middle, hidden) if visible(middle) else (seen, middle)
        return near if seen == 0.0 else near + seen * way

    def _cut_off(self, rows: list[Vector]) -> list[Vector]:
        """Bends replaced by two where a chord across them is free and gains enough, and these two likewise."""
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
        """The ends of the longest chord, as far from the bend on one side as on the other; None if it gains little."""
        sides = float(np.linalg.norm(a - bend)), float(np.linalg.norm(b - bend))
        if min(sides) == 0.0:
            return None

        back = (a - bend) / sides[0]
        on = (b - bend) / sides[1]
        gain = 2.0 - float(np.linalg.norm(back - on))  # per distance from the bend
        free = self.least / max(gain, 1e-300)
        hidden = min(sides)
        if free >= hidden or not self._free(bend + free * back, bend + free * on):
            return None

        while hidden > CHORD * free and gain * (hidden - free) > self.least:
            middle = min(float(np.sqrt(free * hidden)), 0.5 * (free + hidden))
            middle_free = self._free(bend + middle * back, bend + middle * on)
            free, hidden = (middle, hidden) if middle_free else (free, middle)

        ends = bend + free * back, bend + free * on
        return ends if self._part_free(a, ends[0]) and self._part_free(ends[1], b) else None


def _bracket(visible: Callable[[float], bool], first: float) -> tuple[float, float]:
    """A share that is visible (or 0) and a larger one that is not (or 1); the first is tried, then four times that."""
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
    """How much longer the path from a to b is over the bend."""
    return float(np.linalg.norm(bend - a) + np.linalg.norm(b - bend) - np.linalg.norm(b - a))


def _first_below(length: Callable[[float], float], wanted: float) -> float:
    """The smallest share, to a part in a million, at which a length that falls is as small as wanted; 1 if nowhere."""
    low = 0.0
    high = 1.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        if length(middle) > wanted:
            low = middle
        else:
            high = middle
    return high
