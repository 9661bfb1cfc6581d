"""Queries on a roadmap in kernels: the halves to follow, the vertices that were reached, the path."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.motions.motion_kernels import dof_of
from rrtik_ompl.kernels.search.motions.row_kernels import distance
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.graph_kernels import head_of, length_of, motions_of, tail_of, vertices_of
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, DOUBTFUL, RoadmapTable
from rrtik_ompl.kernels.search.tree_kernels import row_of, size_of
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, field, int_at, set_double, set_field, set_int


@inlined
def swap(roadmap: RoadmapTable, one: int, two: int) -> None:
    """Swap two places of the heap."""
    heap, keys = field(roadmap, layout.HEAP), field(roadmap, layout.KEYS)
    half, key = int_at(heap, one), double_at(keys, one)
    set_int(heap, one, int_at(heap, two))
    set_double(keys, one, double_at(keys, two))
    set_int(heap, two, half)
    set_double(keys, two, key)


@kernel
def push(roadmap: RoadmapTable, half: int, key: float) -> None:
    """Put a half into the heap."""
    place, keys = field(roadmap, layout.HEAP_SIZE), field(roadmap, layout.KEYS)
    set_int(field(roadmap, layout.HEAP), place, half)
    set_double(keys, place, key)
    set_field(roadmap, layout.HEAP_SIZE, place + 1)
    while place > 0 and double_at(keys, (place - 1) >> 1) > double_at(keys, place):
        swap(roadmap, place, (place - 1) >> 1)
        place = (place - 1) >> 1


@kernel
def pop(roadmap: RoadmapTable) -> Any:
    """Take the half with the least key out of the heap, which is not empty."""
    size, keys = field(roadmap, layout.HEAP_SIZE) - 1, field(roadmap, layout.KEYS)
    half = int_at(field(roadmap, layout.HEAP), 0)
    swap(roadmap, 0, size)
    set_field(roadmap, layout.HEAP_SIZE, size)
    place = 0
    while 2 * place + 1 < size:
        child = 2 * place + 1
        if child + 1 < size and double_at(keys, child + 1) < double_at(keys, child):
            child += 1
        if double_at(keys, child) >= double_at(keys, place):
            break
        swap(roadmap, place, child)
        place = child
    return half


@kernel
def ahead_of(roadmap: RoadmapTable, vertex: int) -> Any:
    """Distance from a vertex to the nearest goal, computed once in a query."""
    known = double_at(field(roadmap, layout.AHEAD), vertex)
    if known != layout.NOT_COMPUTED:
        return known
    tree, dof, least = vertices_of(roadmap), dof_of(motions_of(roadmap)), 1e300
    for goal in range(field(roadmap, layout.MAPPED) + field(roadmap, layout.STARTS), size_of(tree)):
        least = min(least, distance(dof, row_of(tree, vertex), row_of(tree, goal)))
    set_double(field(roadmap, layout.AHEAD), vertex, least)
    return least


@kernel
def reach(roadmap: RoadmapTable, vertex: int, half: int, cost: float) -> None:
    """Reach a vertex by a half, and follow the halves that leave it."""
    set_int(field(roadmap, layout.CAME), vertex, half)
    set_double(field(roadmap, layout.COSTS), vertex, cost)
    leaving = int_at(field(roadmap, layout.HEADS), vertex)
    while leaving != layout.END:
        head = head_of(roadmap, leaving)
        open_ = int_at(field(roadmap, layout.CAME), head) == layout.UNSEEN
        if open_ and int_at(field(roadmap, layout.STATES), leaving >> 1) != BLOCKED:
            push(roadmap, leaving, cost + length_of(roadmap, leaving) + ahead_of(roadmap, head))
        leaving = int_at(field(roadmap, layout.NEXT), leaving)


@kernel
def ask_or_finish(roadmap: RoadmapTable) -> int:
    """SOLVED if all motions of the path are certain, else the doubtful ones are asked for."""
    asked, half = 0, int_at(field(roadmap, layout.CAME), field(roadmap, layout.MEETING))
    while half >= 0:
        if asked < layout.MAX_QUESTIONS and int_at(field(roadmap, layout.STATES), half >> 1) == DOUBTFUL:
            set_int(field(roadmap, layout.QUESTIONS), asked, half)
            asked += 1
        half = int_at(field(roadmap, layout.CAME), tail_of(roadmap, half))
    set_field(roadmap, layout.ASKED, asked)
    return layout.SOLVED if asked == 0 else layout.ASKING
