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

from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.search.box_kernels import copy_inside
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, row_at
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.graph_kernels import (
    add_row,
    checked_state,
    drop_last_edge,
    head_of,
    join,
    join_near,
    length_of,
    place_row,
    row_is_free,
    tail_of,
)
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, SURE, UNKNOWN, RoadmapTable
from rrtik_ompl.kernels.search.roadmap.query_kernels import ask_or_finish, pop, reach
from rrtik_ompl.kernels.simd.compiled import entry, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_point, next_share, start_points


@entry
def seed_samples(roadmap: RoadmapTable, seed: int) -> int:
    """Choose the first sample."""
    roadmap.random = seed
    next_share(roadmap)
    return start_points(roadmap, roadmap.point, roadmap.motions.dof)


@entry
def grow(roadmap: RoadmapTable, wanted: int, samples: int) -> int:
    """Add free samples, joined with those nearest to them, until there are enough or no samples left.

    There must be room, and no query in the roadmap. Returns how many were added.
    """
    dof, row, added = roadmap.motions.dof, roadmap.row, 0
    point, bases = roadmap.point, roadmap.inverse_bases
    while added < wanted and samples > 0:
        samples -= 1
        roadmap.samples += 1
        next_point(roadmap, point, bases, dof)
        for k in range(dof):
            low, high = roadmap.lower[k], roadmap.upper[k]
            row[k] = low + (high - low) * point[k]
        place_row(roadmap)
        if row_is_free(roadmap):
            before = roadmap.vertices.size
            join_near(roadmap, add_row(roadmap), before)
            added += 1
    roadmap.mapped = roadmap.vertices.size
    return added


@entry
def insert(roadmap: RoadmapTable, rows: Configuration, count: int) -> int:
    """Make rows vertices without edges; there must be room. Returns how many there are."""
    for k in range(count):
        load(roadmap, rows, k)
        add_row(roadmap)
    total: int = roadmap.vertices.size
    roadmap.mapped = total
    return total


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


@kernel
def load(roadmap: RoadmapTable, rows: Configuration, k: int) -> bool:
    """Set ROW to a row at an address; False if that is outside the box."""
    dof, row = roadmap.motions.dof, roadmap.row
    lower, upper = roadmap.lower, roadmap.upper
    inside = copy_inside(dof, row_at(rows, dof, k), lower, upper, row)
    place_row(roadmap)
    return inside


@entry
def forget_query(roadmap: RoadmapTable) -> int:
    """Take starts and goals out of the roadmap."""
    while (
        roadmap.halves > 0
        and max(head_of(roadmap, roadmap.halves - 1), tail_of(roadmap, roadmap.halves - 1)) >= roadmap.mapped
    ):
        drop_last_edge(roadmap)
    roadmap.vertices.size = roadmap.mapped
    roadmap.vertices.live = roadmap.mapped
    return 0


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
        head, tail = head_of(roadmap, half), tail_of(roadmap, half)
        if roadmap.came[head] != layout.UNSEEN:
            continue
        if checked_state(roadmap, half) == BLOCKED:
            continue
        reach(roadmap, head, half, roadmap.costs[tail] + length_of(roadmap, half))
        if head >= goals:
            roadmap.meeting = head
            return ask_or_finish(roadmap)
    return layout.RUNNING


@entry
def answer(roadmap: RoadmapTable, mask: int) -> int:
    """Use the answers for the halves that were asked for, bit by bit, 1 for free; returns the status."""
    broken = False
    for k in range(roadmap.asked):
        free, edge = (mask >> k) & 1, roadmap.questions[k] >> 1
        roadmap.states[edge] = SURE if free else BLOCKED
        broken = broken or not free
    return begin(roadmap) if broken else ask_or_finish(roadmap)


@entry
def doubt(roadmap: RoadmapTable) -> int:
    """Forget what is known of the edges; returns how many there are."""
    edges: int = roadmap.halves >> 1
    for edge in range(edges):
        roadmap.states[edge] = UNKNOWN
    return edges
