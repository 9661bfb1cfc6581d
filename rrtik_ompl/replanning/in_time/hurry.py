"""The earliest arrival along a way that is known: go at full pace or stand still, slot by slot.

Along a fixed way only its timing is left to choose, as in the decomposition of [71]; here over whole slots, with the
fewest of them that stand still.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds
from rrtik_ompl.replanning.in_time.tree import Pace

Place = tuple[int, int]  # slot and number of a place


def full_pace(rows: Matrix, pace: Pace) -> Matrix:
    """Places along a way, shape (k, n), each a slot at full pace from the last one; both ends stay. Shape (m, n)."""
    along = np.concatenate([[0.0], np.cumsum(pace.slots(np.diff(rows, axis=0)))])
    kept = np.concatenate([[True], np.diff(along) > 0.0])
    count = max(int(np.ceil(along[-1] - 1e-9)), 1)
    marks = along[-1] * np.arange(count + 1) / count
    places = np.stack([np.interp(marks, along[kept], column) for column in rows[kept].T], axis=1)
    places[[0, -1]] = rows[[0, -1]]
    return places


def hurried(rows: Matrix, pace: Pace, worlds: ForeseenWorlds, most: int, stop: Stop) -> Matrix | None:
    """The same way with the fewest slots, at most so many; a configuration for each slot, or None.

    Args:
        rows: A configuration for each slot, shape (k, n).
        pace: How far the robot goes in a slot.
        worlds: What is free in which slot.
        most: Slots.
        stop: Ends it without a way.
    """
    places = full_pace(rows, pace)
    last = len(places) - 1
    begin = (0, 0)
    before: dict[Place, Place] = {begin: begin}
    queue = deque([begin])  # those that have stood less come first

    while queue and not stop():
        slot, k = queue.popleft()
        if k == last:
            return places[_numbers(before, (slot, k))]
        if slot + last - k > most:
            continue

        for on in (0, 1):  # going on is put before standing, for it is taken from the left
            place = (slot + 1, k + on)
            if place in before or (not on and slot + 1 + last - k > most):
                continue
            if worlds.free(slot, places[k], places[k + on]):
                before[place] = (slot, k)
                (queue.appendleft if on else queue.append)(place)

    return None


def _numbers(before: dict[Place, Place], end: Place) -> list[int]:
    """Numbers of the places in each slot until one."""
    numbers = [end[1]]
    place = end
    while before[place] != place:
        place = before[place]
        numbers.append(place[1])
    return numbers[::-1]
