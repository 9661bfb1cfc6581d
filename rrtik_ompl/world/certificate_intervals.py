"""What is claimed, and what is still to be shown, of parts of bodies on intervals of motions; many of them as arrays.

Point 8.6 of ``docs/science/certificate.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector

Numbers = NDArray[np.int64]


class Rows(NamedTuple):
    """Claims that two nodes, one of each body of a pair, are apart on an interval of a motion; arrays of one shape.

    Attributes:
        motion: Numbers of the motions, from 0.
        pair: Numbers of the pairs.
        first, second: Nodes of the first and the second body of the pair.
        begin, width: Start and width of the interval as a share of the motion.
    """

    motion: Numbers
    pair: Numbers
    first: Numbers
    second: Numbers
    begin: Vector
    width: Vector

    def of(self, chosen: NDArray[Any] | slice) -> Rows:
        """Return some of the rows."""
        numbers = self.motion[chosen], self.pair[chosen], self.first[chosen], self.second[chosen]
        return Rows(*numbers, self.begin[chosen], self.width[chosen])


class Open(NamedTuple):
    """What is still to be shown: that two nodes are apart on an interval of a motion; arrays of one shape.

    Attributes:
        motion, pair, first, second: As of :class:`Rows`.
        level, number: The interval from number / 2**level to (number + 1) / 2**level.
        origin: Number of the claim that it is a part of.
    """

    motion: Numbers
    pair: Numbers
    first: Numbers
    second: Numbers
    level: Numbers
    number: Numbers
    origin: Numbers

    def of(self, chosen: NDArray[Any] | slice) -> Open:
        """Return some of them."""
        return Open(*(column[chosen] for column in self))

    @property
    def rows(self) -> Rows:
        """The same with begin and width of the intervals."""
        width = np.asarray(0.5**self.level)
        return Rows(self.motion, self.pair, self.first, self.second, np.asarray(self.number * width), width)

    def halves(self) -> Open:
        """Return each twice, for both halves of its interval."""
        twice = self.of(np.repeat(np.arange(len(self.pair)), 2))
        later = np.arange(len(twice.pair)) % 2
        return twice._replace(level=twice.level + 1, number=2 * twice.number + later)

    def parts(self, side: Numbers, children: Numbers) -> Open:
        """Return each twice, with both children, shape (n, 2), of its first (side 0) or second (1) node."""
        twice = self.of(np.repeat(np.arange(len(self.pair)), 2))
        side = np.repeat(side, 2)
        new = children.reshape(-1)
        return twice._replace(
            first=np.where(side == 0, new, twice.first), second=np.where(side == 1, new, twice.second)
        )


def joined(several: Sequence[Open]) -> Open:
    """Return all of them as one."""
    return Open(*(np.concatenate(columns) for columns in zip(*several, strict=True)))


def intervals_of(rows: Rows) -> tuple[Numbers, Numbers]:
    """Return the levels and numbers of intervals."""
    return np.rint(-np.log2(rows.width)).astype(np.int64), np.rint(rows.begin / rows.width).astype(np.int64)


class Known:
    """Entries, which are asked for those of two nodes whose interval contains another one.

    Args:
        entries: The entries.
        motions, pairs, nodes: How many there are of each, of nodes in one body.

    Attributes:
        too_many: Whether nodes, motions and intervals are more than a whole number of 64 bits tells apart: another
            entry could then be taken for the one that is asked for.
        used: Which entries were found, shape (entries,).
    """

    def __init__(self, entries: Rows, motions: int, pairs: int, nodes: int) -> None:
        self._pairs = pairs
        self._size = nodes + 1
        self.used = np.zeros(len(entries.pair), dtype=bool)
        level, number = intervals_of(entries)
        self.too_many = motions * pairs * self._size**2 << int(level.max(initial=0)) >= 1 << 63
        if self.too_many:
            return
        nodes_of = np.maximum(entries.first, 0), np.maximum(entries.second, 0)
        keys = self._key(entries.motion, entries.pair, *nodes_of)
        self._keys = np.unique(keys)
        self._places: list[tuple[int, Numbers, Numbers]] = []  # of each level: intervals, in order, and their entries
        for each in np.unique(level).tolist():
            own = np.flatnonzero(level == each)
            place = (keys[own] << each) + number[own]
            order = np.argsort(place, kind="stable")
            self._places.append((each, place[order], own[order]))

    def _key(self, motion: Numbers, pair: Numbers, first: Numbers, second: Numbers) -> Numbers:
        return ((motion * self._pairs + pair) * self._size + first) * self._size + second

    def entry_of(self, open_: Open) -> Numbers:
        """Return the number of an entry of both nodes, or of both whole bodies, whose interval contains each; or -1."""
        none = np.zeros_like(open_.first)
        found = self._entry_with(self._key(*open_[:4]), open_)
        whole = self._entry_with(self._key(*open_[:2], none, none), open_)
        found = np.where(found < 0, whole, found)
        self.used[found[found >= 0]] = True
        return found

    def _entry_with(self, keys: Numbers, open_: Open) -> Numbers:
        """Return the number of an entry with each key whose interval contains each interval; -1 if there is none."""
        found = np.full(len(keys), -1)
        if len(self._keys) == 0:
            return found
        nearest = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        rows = np.flatnonzero(self._keys[nearest] == keys)
        for level, places, numbers in self._places:
            own = rows[open_.level[rows] >= level]
            wanted = (keys[own] << level) + (open_.number[own] >> (open_.level[own] - level))
            at = np.minimum(np.searchsorted(places, wanted), len(places) - 1)
            there = places[at] == wanted
            found[own[there]] = numbers[at[there]]
        return found
