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

from rrtik_ompl.kernels.search.box_kernels import copy_inside
from rrtik_ompl.kernels.search.motions.motion_kernels import dof_of
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
    motions_of,
    place_row,
    row_is_free,
    sample_of,
    tail_of,
    vertices_of,
)
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, SURE, UNKNOWN, RoadmapTable
from rrtik_ompl.kernels.search.roadmap.query_kernels import ask_or_finish, pop, reach
from rrtik_ompl.kernels.search.tree_kernels import size_of
from rrtik_ompl.kernels.search.tree_layout import LIVE, SIZE
from rrtik_ompl.kernels.simd.access import count_up
from rrtik_ompl.kernels.simd.compiled import entry, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, field, int_at, set_double, set_field, set_int
from rrtik_ompl.kernels.simd.random_kernels import next_point_at, next_share_at, start_points_at


@entry
def seed_samples(roadmap: RoadmapTable, seed: int) -> int:
    """Choose the first sample."""
    set_field(roadmap, layout.RANDOM, seed)
    next_share_at(roadmap, layout.RANDOM)
    return start_points_at(roadmap, layout.RANDOM, field(roadmap, layout.POINT), dof_of(motions_of(roadmap)))


@entry
def grow(roadmap: RoadmapTable, wanted: int, samples: int) -> int:
    """Add free samples, joined with those nearest to them, until there are enough or no samples left.

    There must be room, and no query in the roadmap. Returns how many were added.
    """
    dof, row, added = dof_of(motions_of(roadmap)), sample_of(roadmap), 0
    point, bases = field(roadmap, layout.POINT), field(roadmap, layout.INVERSE_BASES)
    while added < wanted and samples > 0:
        samples -= 1
        count_up(roadmap, layout.SAMPLES)
        next_point_at(roadmap, layout.RANDOM, point, bases, dof)
        for k in range(dof):
            low, high = double_at(field(roadmap, layout.LOWER), k), double_at(field(roadmap, layout.UPPER), k)
            set_double(row, k, low + (high - low) * double_at(point, k))
        place_row(roadmap)
        if row_is_free(roadmap):
            before = size_of(vertices_of(roadmap))
            join_near(roadmap, add_row(roadmap), before)
            added += 1
    set_field(roadmap, layout.MAPPED, size_of(vertices_of(roadmap)))
    return added


@entry
def insert(roadmap: RoadmapTable, rows: Configuration, count: int) -> int:
    """Make rows vertices without edges; there must be room. Returns how many there are."""
    for k in range(count):
        load(roadmap, rows, k)
        add_row(roadmap)
    total: int = size_of(vertices_of(roadmap))
    set_field(roadmap, layout.MAPPED, total)
    return total


@entry
def learn(roadmap: RoadmapTable, rows: Configuration, count: int) -> int:
    """Make the rows of a path vertices, each joined with the one before and those near it; there must be room.

    No query may be in the roadmap. Returns how many were added; the first one outside the box ends it.
    """
    for k in range(count):
        if not load(roadmap, rows, k):
            return k
        before = size_of(vertices_of(roadmap))
        vertex = add_row(roadmap)
        join_near(roadmap, vertex, before)
        if k > 0:
            join(roadmap, before - 1, vertex)
        set_field(roadmap, layout.MAPPED, before + 1)
    return count


@entry
def connect(roadmap: RoadmapTable, pairs: int, count: int) -> int:
    """Add edges between pairs of vertices, int32 at an address; there must be room. Returns HALVES."""
    for k in range(count):
        join(roadmap, int_at(pairs, 2 * k), int_at(pairs, 2 * k + 1))
    halves: int = field(roadmap, layout.HALVES)
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
    dof, row = dof_of(motions_of(roadmap)), sample_of(roadmap)
    lower, upper = field(roadmap, layout.LOWER), field(roadmap, layout.UPPER)
    inside = copy_inside(dof, row_at(rows, dof, k), lower, upper, row)
    place_row(roadmap)
    return inside


@entry
def forget_query(roadmap: RoadmapTable) -> int:
    """Take starts and goals out of the roadmap."""
    while field(roadmap, layout.HALVES) > 0 and max(
        head_of(roadmap, field(roadmap, layout.HALVES) - 1), tail_of(roadmap, field(roadmap, layout.HALVES) - 1)
    ) >= field(roadmap, layout.MAPPED):
        drop_last_edge(roadmap)
    set_field(vertices_of(roadmap), SIZE, field(roadmap, layout.MAPPED))
    set_field(vertices_of(roadmap), LIVE, field(roadmap, layout.MAPPED))
    return 0


@entry
def pose(roadmap: RoadmapTable, rows: Configuration, starts: int, goals: int) -> int:
    """Put starts and goals into the roadmap, joined with vertices near them and with each other; there must be room.

    Returns -1, or the number of a row that is outside the box.
    """
    forget_query(roadmap)
    mapped = field(roadmap, layout.MAPPED)
    set_field(roadmap, layout.STARTS, starts)
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
    for vertex in range(size_of(vertices_of(roadmap))):
        set_int(field(roadmap, layout.CAME), vertex, layout.UNSEEN)
        set_double(field(roadmap, layout.AHEAD), vertex, layout.NOT_COMPUTED)
    set_field(roadmap, layout.HEAP_SIZE, 0)
    set_field(roadmap, layout.ASKED, 0)
    for start in range(field(roadmap, layout.STARTS)):
        reach(roadmap, field(roadmap, layout.MAPPED) + start, layout.ROOT, 0.0)
    return layout.RUNNING


@entry
def search_on(roadmap: RoadmapTable, budget: int) -> int:
    """Search on until a goal is reached, at most ``budget`` halves; returns the status."""
    goals = field(roadmap, layout.MAPPED) + field(roadmap, layout.STARTS)
    while budget > 0:
        budget -= 1
        if field(roadmap, layout.HEAP_SIZE) == 0:
            return layout.EXHAUSTED
        half = pop(roadmap)
        head, tail = head_of(roadmap, half), tail_of(roadmap, half)
        if int_at(field(roadmap, layout.CAME), head) != layout.UNSEEN:
            continue
        if checked_state(roadmap, half) == BLOCKED:
            continue
        reach(roadmap, head, half, double_at(field(roadmap, layout.COSTS), tail) + length_of(roadmap, half))
        if head >= goals:
            set_field(roadmap, layout.MEETING, head)
            return ask_or_finish(roadmap)
    return layout.RUNNING


@entry
def answer(roadmap: RoadmapTable, mask: int) -> int:
    """Use the answers for the halves that were asked for, bit by bit, 1 for free; returns the status."""
    broken = False
    for k in range(field(roadmap, layout.ASKED)):
        free, edge = (mask >> k) & 1, int_at(field(roadmap, layout.QUESTIONS), k) >> 1
        set_int(field(roadmap, layout.STATES), edge, SURE if free else BLOCKED)
        broken = broken or not free
    return begin(roadmap) if broken else ask_or_finish(roadmap)


@entry
def doubt(roadmap: RoadmapTable) -> int:
    """Forget what is known of the edges; returns how many there are."""
    edges: int = field(roadmap, layout.HALVES) >> 1
    for edge in range(edges):
        set_int(field(roadmap, layout.STATES), edge, UNKNOWN)
    return edges
