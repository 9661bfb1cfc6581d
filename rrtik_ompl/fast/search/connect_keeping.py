"""Searches that outlive a call: their memory is made once for a world, which takes longer than most of them run."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager

from rrtik_ompl.fast.search.connect import ConnectSearch
from rrtik_ompl.fast.search.motions.motion_table import FastMotions

LARGEST_KEPT = 1 << 16  # vertices of a tree; a search that has grown larger gives its memory back


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
