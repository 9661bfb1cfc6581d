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
    slots_along = np.concatenate([[0.0], np.cumsum(pace.slots(np.diff(rows, axis=0)))])
    moving = np.concatenate([[True], np.diff(slots_along) > 0.0])
    count = max(int(np.ceil(slots_along[-1] - 1e-9)), 1)
    slots_of_places = slots_along[-1] * np.arange(count + 1) / count
    places = np.stack([np.interp(slots_of_places, slots_along[moving], column) for column in rows[moving].T], axis=1)
    places[[0, -1]] = rows[[0, -1]]
    return places


def hurried(rows: Matrix, pace: Pace, worlds: ForeseenWorlds, max_slots: int, stop: Stop) -> Matrix | None:
    """The same way with the fewest slots, at most so many; a configuration for each slot, or None.

    Args:
        rows: A configuration for each slot, shape (k, n).
        pace: How far the robot goes in a slot.
        worlds: What is free in which slot.
        max_slots: That it may take.
        stop: Ends it without a way.
    """
    places = full_pace(rows, pace)
    last = len(places) - 1
    begin = (0, 0)
    previous: dict[Place, Place] = {begin: begin}
    queue = deque([begin])  # those that have stood less come first

    while queue and not stop():
        slot, k = queue.popleft()
        if k == last:
            return places[_numbers(previous, (slot, k))]
        if slot + last - k > max_slots:
            continue

        for advance in (0, 1):  # going on is put before standing, for it is taken from the left
            place = (slot + 1, k + advance)
            if place in previous or (not advance and slot + 1 + last - k > max_slots):
                continue
            if worlds.free(slot, places[k], places[k + advance]):
                previous[place] = (slot, k)
                if advance:
                    queue.appendleft(place)
                else:
                    queue.append(place)

    return None


def _numbers(previous: dict[Place, Place], end: Place) -> list[int]:
    """Numbers of the places in each slot from the first to one."""
    numbers = [end[1]]
    place = end
    while previous[place] != place:
        place = previous[place]
        numbers.append(place[1])
    return numbers[::-1]
