"""Roadmaps in kernels: how they grow, and the shortest path between a start and a goal on them.

Sources: probabilistic roadmaps [63]; edges are checked when a search comes to them [64], by A* that puts an
edge of unknown state among those to follow as if it were free and checks it when it is the best of them [65].

A query, as :mod:`rrtik_ompl.planning.search.roadmap_in_python` runs it, and the kernels of each line::

    for start in starts: reach(start, by=None)                #   begin
    while heap:                                              #   search_on
        half = pop(heap)                                     #   pop
        if reached(head(half)): continue                     #   .
        if blocked(half): continue                           #   checked_state
        reach(head(half), by=half)                           #   reach
        if head(half) in goals: return path                  #   ask_or_finish

An edge that the kernels leave undecided counts as free until it is part of a path. Then it is asked for; if it is not
free the query begins again, with all that is known by then.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, distance, row_at
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.graph_kernels import (
    add_row,
    checked_state,
    drop_last_edge,
    head_of,
    join,
    join_near,
    length_of,
    row_is_free,
    tail_of,
)
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, DOUBTFUL, SURE, UNKNOWN, RoadmapTable
from rrtik_ompl.kernels.search.sample_kernels import draw, load_row, set_query, set_row_values, start_samples
from rrtik_ompl.kernels.search.tree_kernels import row_of
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel

# The roadmap.


@entry
def seed_samples(roadmap: RoadmapTable, seed: int) -> int:
    """Choose the first sample."""
    start_samples(roadmap, seed)
    return roadmap.motions.dof


@entry
def grow(roadmap: RoadmapTable, wanted: int, samples: int) -> int:
    """Add free samples, joined with those nearest to them, until there are enough or no samples left.

    There must be room, and no query in the roadmap. Returns how many were added.
    """
    added = 0
    while added < wanted and samples > 0:
        samples -= 1
        roadmap.samples += 1
        draw(roadmap, roadmap.row)
        set_row_values(roadmap)
        if row_is_free(roadmap):
            set_query(roadmap, roadmap.row)
            before = roadmap.vertices.size
            join_near(roadmap, add_row(roadmap), before)
            added += 1
    roadmap.mapped = roadmap.vertices.size
    return added


@entry
def insert(roadmap: RoadmapTable, rows: Configuration, count: int) -> int:
    """Make rows vertices without edges; there must be room, and no query in the roadmap.

    Returns -1, or the number of a row that is outside the box; then none of them is a vertex.
    """
    for k in range(count):
        if not load(roadmap, rows, k):
            forget_query(roadmap)
            return k
        add_row(roadmap)
    roadmap.mapped = roadmap.vertices.size
    return -1


@entry
def learn(roadmap: RoadmapTable, rows: Configuration, count: int) -> int:
    """Make the rows of a path vertices, each joined with the one before and those near it; there must be room.

    No query may be in the roadmap. Returns how many were added; the first one outside the box ends it.
    """
    for k in range(count):
        if not load(roadmap, rows, k):
            return k
        before = roadmap.vertices.size
        vertex = add_row(roadmap)
        join_near(roadmap, vertex, before)
        if k > 0:
            join(roadmap, before - 1, vertex)
        roadmap.mapped = before + 1
    return count


@kernel
def load(roadmap: RoadmapTable, rows: Configuration, k: int) -> bool:
    """Set the row, and what is looked for, to a row at an address; False if that is outside the box."""
    if not load_row(roadmap, row_at(rows, roadmap.motions.dof, k)):
        return False
    set_query(roadmap, roadmap.row)
    return True


@entry
def connect(roadmap: RoadmapTable, pairs: Ints, count: int) -> int:
    """Add edges between pairs of vertices, int32 at an address; there must be room. Returns HALVES."""
    for k in range(count):
        join(roadmap, pairs[2 * k], pairs[2 * k + 1])
    halves: int = roadmap.halves
    return halves


@entry
def check_edges(roadmap: RoadmapTable, first: int, count: int) -> int:
    """Check the motions of edges that nobody has looked at; returns how many of them are not free."""
    blocked = 0
    for edge in range(first, first + count):
        blocked += checked_state(roadmap, 2 * edge) == BLOCKED
    return blocked


@entry
def doubt(roadmap: RoadmapTable) -> int:
    """Forget what is known of the edges; returns how many there are."""
    edges: int = roadmap.halves >> 1
    for edge in range(edges):
        roadmap.states[edge] = UNKNOWN
    return edges


# Queries.


@entry
def pose(roadmap: RoadmapTable, rows: Configuration, starts: int, goals: int) -> int:
    """Put starts and goals into the roadmap, joined with vertices near them and with each other; there must be room.

    Returns -1, or the number of a row that is outside the box.
    """
    forget_query(roadmap)
    mapped = roadmap.mapped
    roadmap.starts = starts
    for k in range(starts + goals):
        if not load(roadmap, rows, k):
            return k
        vertex = add_row(roadmap)
        join_near(roadmap, vertex, mapped)
        for start in range(starts if k >= starts else 0):
            join(roadmap, mapped + start, vertex)
    return -1


@entry
def forget_query(roadmap: RoadmapTable) -> int:
    """Take starts and goals out of the roadmap."""
    while roadmap.halves > 0:
        last = roadmap.halves - 1
        if max(head_of(roadmap, last), tail_of(roadmap, last)) < roadmap.mapped:
            break
        drop_last_edge(roadmap)
    roadmap.vertices.size = roadmap.mapped
    roadmap.vertices.live = roadmap.mapped
    return 0


@entry
def begin(roadmap: RoadmapTable) -> int:
    """Begin the search for a path between the starts and the goals in the roadmap."""
    for vertex in range(roadmap.vertices.size):
        roadmap.came[vertex] = layout.UNSEEN
        roadmap.ahead[vertex] = layout.NOT_COMPUTED
    roadmap.heap_size = 0
    roadmap.asked = 0
    for start in range(roadmap.starts):
        reach(roadmap, roadmap.mapped + start, layout.ROOT, 0.0)
    return layout.RUNNING


@entry
def search_on(roadmap: RoadmapTable, budget: int) -> int:
    """Search on until a goal is reached, at most ``budget`` halves; returns the status."""
    goals = roadmap.mapped + roadmap.starts
    while budget > 0:
        budget -= 1
        if roadmap.heap_size == 0:
            return layout.EXHAUSTED
        half = pop(roadmap)
        head = head_of(roadmap, half)
        if roadmap.came[head] != layout.UNSEEN:
            continue
        if checked_state(roadmap, half) == BLOCKED:
            continue
        reach(roadmap, head, half, roadmap.costs[tail_of(roadmap, half)] + length_of(roadmap, half))
        if head >= goals:
            roadmap.meeting = head
            return ask_or_finish(roadmap)
    return layout.RUNNING


@entry
def answer(roadmap: RoadmapTable, mask: int) -> int:
    """Use the answers for the halves that were asked for, bit by bit, 1 for free; returns the status."""
    broken = False
    for k in range(roadmap.asked):
        free = (mask >> k) & 1
        roadmap.states[roadmap.questions[k] >> 1] = SURE if free else BLOCKED
        broken = broken or not free
    return begin(roadmap) if broken else ask_or_finish(roadmap)


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
def ahead_of(roadmap: RoadmapTable, vertex: int) -> Any:
    """Distance from a vertex to the nearest goal, computed once in a query."""
    known = roadmap.ahead[vertex]
    if known != layout.NOT_COMPUTED:
        return known
    tree = roadmap.vertices
    dof = roadmap.motions.dof
    least = 1e300
    for goal in range(roadmap.mapped + roadmap.starts, tree.size):
        least = min(least, distance(dof, row_of(tree, vertex), row_of(tree, goal)))
    roadmap.ahead[vertex] = least
    return least


@kernel
def ask_or_finish(roadmap: RoadmapTable) -> int:
    """SOLVED if all motions of the path are certain, else the doubtful ones are asked for."""
    asked = 0
    half = roadmap.came[roadmap.meeting]
    while half >= 0:
        if asked < layout.MAX_QUESTIONS and roadmap.states[half >> 1] == DOUBTFUL:
            roadmap.questions[asked] = half
            asked += 1
        half = roadmap.came[tail_of(roadmap, half)]
    roadmap.asked = asked
    return layout.SOLVED if asked == 0 else layout.ASKING


@kernel
def push(roadmap: RoadmapTable, half: int, key: float) -> None:
    """Put a half into the heap."""
    keys = roadmap.keys
    place = roadmap.heap_size
    roadmap.heap_size += 1
    roadmap.heap[place] = half
    keys[place] = key
    while place > 0 and keys[(place - 1) >> 1] > keys[place]:
        swap(roadmap, place, (place - 1) >> 1)
        place = (place - 1) >> 1


@kernel
def pop(roadmap: RoadmapTable) -> Any:
    """Take the half with the least key out of the heap, which is not empty."""
    keys = roadmap.keys
    size = roadmap.heap_size - 1
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


@inlined
def swap(roadmap: RoadmapTable, one: int, two: int) -> None:
    """Swap two places of the heap."""
    heap = roadmap.heap
    keys = roadmap.keys
    half = heap[one]
    heap[one] = heap[two]
    heap[two] = half
    key = keys[one]
    keys[one] = keys[two]
    keys[two] = key
