"""The graph of a roadmap in kernels: vertices, their nearest ones, edges and the motions that these stand for."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.layout import FREE, UNDECIDED
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, step_count
from rrtik_ompl.kernels.search.motions.row_kernels import distance
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, DOUBTFUL, SURE, UNKNOWN, RoadmapTable
from rrtik_ompl.kernels.search.tree_kernels import add_vertex, row_of, squares_of, values_of
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, NO_PARENT
from rrtik_ompl.kernels.simd.access import lane_at
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import lowest

ANY_RADIUS = 0.0  # domains of vertices are of no use here
FARTHEST = np.float32(3e38)  # more than any squared distance


@inlined
def head_of(roadmap: RoadmapTable, half: int) -> Any:
    """The vertex that a half leads to."""
    return roadmap.to[half]


@inlined
def tail_of(roadmap: RoadmapTable, half: int) -> Any:
    """The vertex that a half leaves."""
    return roadmap.to[half ^ 1]


@inlined
def length_of(roadmap: RoadmapTable, half: int) -> Any:
    """Length of the motion of a half."""
    return roadmap.lengths[half >> 1]


@kernel
def row_is_free(roadmap: RoadmapTable) -> bool:
    """Whether the row is certain to be free."""
    values = roadmap.row_values
    return check_part(roadmap.motions.world, values, values, 1, 1, 1, roadmap.resolve != 0) == FREE


@kernel
def add_row(roadmap: RoadmapTable) -> Any:
    """Make the row a vertex without edges; there must be room. Returns its number."""
    vertex = add_vertex(roadmap.vertices, roadmap.row, roadmap.row_values, NO_PARENT, CERTAIN, ANY_RADIUS)
    roadmap.heads[vertex] = layout.END
    return vertex


@kernel
def keep_near(roadmap: RoadmapTable, vertex: int, square: float, count: int) -> Any:
    """Put a vertex among the ``count`` nearest ones so far; returns how many there are then."""
    vertices = roadmap.near_vertices
    squares = roadmap.near_squares
    place = min(count, roadmap.near - 1)
    while place > 0 and squares[place - 1] > square:
        squares[place] = squares[place - 1]
        vertices[place] = vertices[place - 1]
        place -= 1
    squares[place] = np.float32(square)
    vertices[place] = vertex
    return min(count + 1, roadmap.near)


@kernel
def find_near(roadmap: RoadmapTable, below: int) -> int:
    """Find the vertices nearest to what is looked for among the first ``below`` ones; returns how many there are."""
    wanted = roadmap.near
    count = 0
    worst = FARTHEST
    for block in range((below + WIDTH - 1) // WIDTH):
        total = squares_of(roadmap.vertices.points, roadmap.query, roadmap.motions.dof, block)
        if lowest(total) >= worst:
            continue
        for lane in range(min(WIDTH, below - block * WIDTH)):
            square = lane_at(total, lane)
            if square < worst:
                count = keep_near(roadmap, block * WIDTH + lane, square, count)
                if count == wanted:
                    worst = roadmap.near_squares[wanted - 1]
    return count


@kernel
def leave(roadmap: RoadmapTable, vertex: int, half: int) -> None:
    """Let a half leave a vertex."""
    heads = roadmap.heads
    roadmap.next[half] = heads[vertex]
    heads[vertex] = half


@kernel
def join(roadmap: RoadmapTable, first: int, second: int) -> None:
    """Add an edge between two vertices; there must be room."""
    tree = roadmap.vertices
    half = roadmap.halves
    edge = half >> 1
    leave(roadmap, first, half)
    leave(roadmap, second, half + 1)
    roadmap.to[half] = second
    roadmap.to[half + 1] = first
    roadmap.lengths[edge] = distance(roadmap.motions.dof, row_of(tree, first), row_of(tree, second))
    roadmap.states[edge] = UNKNOWN
    roadmap.halves = half + 2


@kernel
def join_near(roadmap: RoadmapTable, vertex: int, below: int) -> int:
    """Join the vertex that is looked for with those nearest to it among the first ``below`` ones; returns how many."""
    count = find_near(roadmap, below)
    for k in range(count):
        join(roadmap, vertex, roadmap.near_vertices[k])
    return count


@kernel
def drop_last_edge(roadmap: RoadmapTable) -> None:
    """Take the edge away that was added last."""
    first = roadmap.halves - 2
    for half in range(first, first + 2):
        roadmap.heads[tail_of(roadmap, half)] = roadmap.next[half]
    roadmap.halves = first


@kernel
def checked_state(roadmap: RoadmapTable, half: int) -> Any:
    """The state of a half's edge, whose motion is checked if nobody has looked at it; its ends are taken to be free."""
    edge = half >> 1
    known = roadmap.states[edge]
    if known != UNKNOWN:
        return known

    motions = roadmap.motions
    tree = roadmap.vertices
    first = tail_of(roadmap, half)
    second = head_of(roadmap, half)
    if descends(motions.dof, row_of(tree, first), row_of(tree, second)):
        first, second = second, first
    last = step_count(motions, row_of(tree, first), row_of(tree, second))
    resolve = roadmap.resolve != 0
    answer = check_part(motions.world, values_of(tree, first), values_of(tree, second), last, 1, last - 1, resolve)
    roadmap.checked += 1
    state = BLOCKED
    if answer == FREE:
        state = SURE
    elif answer == UNDECIDED and resolve:
        state = DOUBTFUL
    roadmap.states[edge] = state
    return state
