"""Searches that outlive a call, or serve many queries in one: making their memory takes longer than most of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.search import connect_layout
from rrtik_ompl.kernels.search.connect import FIRST_PATH, ConnectSearch
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.simd.library import library

LARGEST_KEPT = 1 << 16  # vertices of a tree; a search that has grown larger gives its memory back
MEAN_BUDGET = 512  # motions and samples, for each of many queries


@contextmanager
def kept_search(motions: FastMotions, key: Hashable, make: Callable[[], ConnectSearch]) -> Iterator[ConnectSearch]:
    """An RRT-Connect search in a world: the last one that was used there, if it has the same key.

    Nobody else gets it meanwhile: a second use at the same time makes a search of its own. One that an exception has
    left is not kept.

    Args:
        motions: How motions are checked in the world.
        key: What the search depends on beside these: box, range and domain.
        make: Makes the search.
    """
    known, search = motions.spare.pop("connect", (None, None))
    if search is None or known != key:
        search = make()
    yield search
    if search.capacity <= LARGEST_KEPT:
        motions.spare["connect"] = key, search


class Searched(NamedTuple):
    """The path of one of many searches, shape (k, n), or None, and what :meth:`ConnectSearch.statistics` says of it."""

    path: Matrix | None
    iterations: int
    motions: int
    vertices: int
    questions: int
    rejected: int


def solve_each(search: ConnectSearch, ends: Matrix, seeds: list[int], max_iterations: int) -> list[Searched | None]:
    """Search for many queries in one call; what :meth:`ConnectSearch.solve` finds if every answer is that none is free.

    Args:
        search: Whose memory is used.
        ends: A free start and a free goal each, shape (m, 2, n).
        seeds: Of each.
        max_iterations: Samples at most, for each.

    Returns:
        What was found for each; None for those that take long: they are to be solved one after the other.
    """
    address, rows, kernels = (
        search.serve(1, max_iterations),
        np.ascontiguousarray(ends),
        library(connect_layout.KERNELS),
    )
    if kernels is None:
        return [None] * len(ends)
    search.table.resolve = 1
    search.table.bound = connect_layout.UNBOUNDED_COST
    paths = np.empty((FIRST_PATH * len(rows), rows.shape[2]))
    numbers = np.array([seed & (2**63 - 1) for seed in seeds], dtype=np.int64)
    results = np.empty((len(rows), connect_layout.RESULT_NUMBERS), dtype=np.int64)
    given = (address, rows.ctypes.data, numbers.ctypes.data, len(rows), MEAN_BUDGET * len(rows))
    kernels.solve_each(*given, paths.ctypes.data, len(paths), results.ctypes.data)
    found, last = list[Searched | None](), 0
    for status, count, *counts in results.tolist():
        first, last = last, last + count
        ended = status in (connect_layout.SOLVED, connect_layout.EXHAUSTED)
        found.append(Searched(paths[first:last] if count else None, *counts) if ended else None)
    return found
