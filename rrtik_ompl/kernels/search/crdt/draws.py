"""Random numbers of searches in kernels, the same as those of the search in Python."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.accessors import dof_in, extension_row, order_of, rule_of
from rrtik_ompl.kernels.search.crdt.layout import CrdtTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import field, int_at, set_double, set_int
from rrtik_ompl.kernels.simd.random_kernels import next_share_at


@inlined
def draw(search: CrdtTable) -> Any:
    """The next number of the stream, from 0 to 1, less than 1."""
    return next_share_at(search, crdt_layout.RANDOM)


@inlined
def sample(search: CrdtTable) -> None:
    """Draw a target within the bounds."""
    for axis in range(dof_in(search)):
        low = rule_of(search, crdt_layout.SAMPLE_LOWER, axis)
        high = rule_of(search, crdt_layout.SAMPLE_UPPER, axis)
        share = draw(search)
        set_double(extension_row(search, crdt_layout.TARGET), axis, min(low + share * (high - low), high))


@kernel
def shuffle(search: CrdtTable) -> None:
    """The axes that may move, in random order."""
    order, count = order_of(search), field(search, crdt_layout.AXIS_COUNT)
    for k in range(count):
        set_int(order, k, int_at(field(search, crdt_layout.AXES), k))
    for k in range(count - 1, 0, -1):
        other = int(draw(search) * (k + 1))
        axis = int_at(order, k)
        set_int(order, k, int_at(order, other))
        set_int(order, other, axis)


@inlined
def to_front(search: CrdtTable, axis: int) -> None:
    """Let an axis go first and the others keep their order."""
    order, k = order_of(search), 0
    while int_at(order, k) != axis:
        k += 1
    for place in range(k, 0, -1):
        set_int(order, place, int_at(order, place - 1))
    set_int(order, 0, axis)
