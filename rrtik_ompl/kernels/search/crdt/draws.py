"""Random numbers of searches in kernels, the same as those of the search in Python."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.accessors import dof_in, extension_row, rule_of
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_share


@inlined
def draw(search: CrdtTable) -> Any:
    """The next number of the stream, from 0 to 1, less than 1."""
    return next_share(search)


@inlined
def sample(search: CrdtTable) -> None:
    """Draw a target within the bounds."""
    for axis in range(dof_in(search)):
        low = rule_of(search, crdt_layout.SAMPLE_LOWER, axis)
        high = rule_of(search, crdt_layout.SAMPLE_UPPER, axis)
        share = draw(search)
        extension_row(search, crdt_layout.TARGET)[axis] = min(low + share * (high - low), high)


@kernel
def shuffle(search: CrdtTable) -> None:
    """The axes that may move, in random order."""
    order, count = search.order, search.axis_count
    for k in range(count):
        order[k] = search.axes[k]
    for k in range(count - 1, 0, -1):
        other = int(draw(search) * (k + 1))
        axis = order[k]
        order[k] = order[other]
        order[other] = axis


@inlined
def to_front(search: CrdtTable, axis: int) -> None:
    """Let an axis go first and the others keep their order."""
    order, k = search.order, 0
    while order[k] != axis:
        k += 1
    for place in range(k, 0, -1):
        order[place] = order[place - 1]
    order[0] = axis
