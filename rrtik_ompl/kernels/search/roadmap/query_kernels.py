"""Queries on a roadmap in kernels: the halves to follow, the vertices that were reached, the path."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.search.motions.row_kernels import distance
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.graph_kernels import head_of, length_of, tail_of
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, DOUBTFUL, RoadmapTable
from rrtik_ompl.kernels.search.tree_kernels import row_of
from rrtik_ompl.kernels.simd.compiled import inlined, kernel


@inlined
def swap(roadmap: RoadmapTable, one: int, two: int) -> None:
    """Swap two places of the heap."""
    heap, keys = roadmap.heap, roadmap.keys
    half, key = heap[one], keys[one]
    heap[one] = heap[two]
    keys[one] = keys[two]
    heap[two] = half
    keys[two] = key


@kernel
def push(roadmap: RoadmapTable, half: int, key: float) -> None:
    """Put a half into the heap."""
    place, keys = roadmap.heap_size, roadmap.keys
    roadmap.heap[place] = half
    keys[place] = key
    roadmap.heap_size = place + 1
    while place > 0 and keys[(place - 1) >> 1] > keys[place]:
        swap(roadmap, place, (place - 1) >> 1)
        place = (place - 1) >> 1


@kernel
def pop(roadmap: RoadmapTable) -> Any:
    """Take the half with the least key out of the heap, which is not empty."""
    size, keys = roadmap.heap_size - 1, roadmap.keys
    half = roadmap.heap[0]
    swap(roadmap, 0, size)
    roadmap.heap_size = size
    place = 0
    while 2 * place + 1 < size:
        child = 2 * place + 1
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= keys[place]:
            break
        swap(roadmap, place, child)
        place = child
    return half


@kernel
def ahead_of(roadmap: RoadmapTable, vertex: int) -> Any:
    """Distance from a vertex to the nearest goal, computed once in a query."""
    known = roadmap.ahead[vertex]
    if known != layout.NOT_COMPUTED:
        return known
    tree, dof, least = roadmap.vertices, roadmap.motions.dof, 1e300
    for goal in range(roadmap.mapped + roadmap.starts, tree.size):
        least = min(least, distance(dof, row_of(tree, vertex), row_of(tree, goal)))
    roadmap.ahead[vertex] = least
    return least


@kernel
def reach(roadmap: RoadmapTable, vertex: int, half: int, cost: float) -> None:
    """Reach a vertex by a half, and follow the halves that leave it."""
    roadmap.came[vertex] = half
    roadmap.costs[vertex] = cost
    leaving = roadmap.heads[vertex]
    while leaving != layout.END:
        head = head_of(roadmap, leaving)
        open_ = roadmap.came[head] == layout.UNSEEN
        if open_ and roadmap.states[leaving >> 1] != BLOCKED:
            push(roadmap, leaving, cost + length_of(roadmap, leaving) + ahead_of(roadmap, head))
        leaving = roadmap.next[leaving]


@kernel
def ask_or_finish(roadmap: RoadmapTable) -> int:
    """SOLVED if all motions of the path are certain, else the doubtful ones are asked for."""
    asked, half = 0, roadmap.came[roadmap.meeting]
    while half >= 0:
        if asked < layout.MAX_QUESTIONS and roadmap.states[half >> 1] == DOUBTFUL:
            roadmap.questions[asked] = half
            asked += 1
        half = roadmap.came[tail_of(roadmap, half)]
    roadmap.asked = asked
    return layout.SOLVED if asked == 0 else layout.ASKING
