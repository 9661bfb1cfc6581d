"""The graph of a roadmap in kernels: vertices, their nearest ones, edges and the motions that these stand for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.check_kernels import check_part
from rrtik_ompl.kernels.layout import FREE, UNDECIDED, JointValues
from rrtik_ompl.kernels.search.motions.motion_kernels import descends, dof_of, set_joint_values, step_count, world_of
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, distance
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, DOUBTFUL, SURE, UNKNOWN, RoadmapTable
from rrtik_ompl.kernels.search.tree_kernels import add_vertex, points_of, row_of, squares_of, values_of
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, NO_PARENT, TreeTable
from rrtik_ompl.kernels.simd.access import count_up, field_reader, lane_at
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    double_at,
    field,
    float_at,
    int_at,
    lowest,
    set_double,
    set_field,
    set_float,
    set_int,
)

ANY_RADIUS = 0.0  # domains of vertices are of no use here
FARTHEST = np.float32(3e38)  # more than any squared distance

motions_of: Callable[[RoadmapTable], MotionTable] = field_reader(layout.MOTIONS)
vertices_of: Callable[[RoadmapTable], TreeTable] = field_reader(layout.VERTICES)
sample_of: Callable[[RoadmapTable], Configuration] = field_reader(layout.ROW)
sample_values_of: Callable[[RoadmapTable], JointValues] = field_reader(layout.ROW_VALUES)


@inlined
def head_of(roadmap: RoadmapTable, half: int) -> Any:
    """The vertex that a half leads to."""
    return int_at(field(roadmap, layout.TO), half)


@inlined
def tail_of(roadmap: RoadmapTable, half: int) -> Any:
    """The vertex that a half leaves."""
    return int_at(field(roadmap, layout.TO), half ^ 1)


@inlined
def length_of(roadmap: RoadmapTable, half: int) -> Any:
    """Length of the motion of a half."""
    return double_at(field(roadmap, layout.LENGTHS), half >> 1)


@kernel
def place_row(roadmap: RoadmapTable) -> None:
    """Make the joint values and the floats of ROW."""
    motions, row, values = motions_of(roadmap), sample_of(roadmap), sample_values_of(roadmap)
    if int(row) != values:
        set_joint_values(motions, row, values)
    for k in range(dof_of(motions)):
        set_float(field(roadmap, layout.QUERY), k, np.float32(double_at(row, k)))


@kernel
def row_is_free(roadmap: RoadmapTable) -> bool:
    """Whether ROW is certain to be free."""
    world, values = world_of(motions_of(roadmap)), sample_values_of(roadmap)
    return check_part(world, values, values, 1, 1, 1, field(roadmap, layout.RESOLVE) != 0) == FREE


@kernel
def add_row(roadmap: RoadmapTable) -> Any:
    """Make ROW a vertex without edges; there must be room. Returns its number."""
    row, values = sample_of(roadmap), sample_values_of(roadmap)
    vertex = add_vertex(vertices_of(roadmap), row, values, NO_PARENT, CERTAIN, ANY_RADIUS)
    set_int(field(roadmap, layout.HEADS), vertex, layout.END)
    return vertex


@kernel
def keep_near(roadmap: RoadmapTable, vertex: int, square: float, count: int) -> Any:
    """Put a vertex among the ``count`` nearest ones so far; returns how many there are then."""
    vertices, squares = field(roadmap, layout.NEAR_VERTICES), field(roadmap, layout.NEAR_SQUARES)
    place = min(count, field(roadmap, layout.NEAR) - 1)
    while place > 0 and float_at(squares, place - 1) > square:
        set_float(squares, place, float_at(squares, place - 1))
        set_int(vertices, place, int_at(vertices, place - 1))
        place -= 1
    set_float(squares, place, np.float32(square))
    set_int(vertices, place, vertex)
    return min(count + 1, field(roadmap, layout.NEAR))


@kernel
def find_near(roadmap: RoadmapTable, below: int) -> int:
    """Find the vertices nearest to QUERY among the first ``below`` ones; returns how many there are."""
    tree, query, dof = vertices_of(roadmap), field(roadmap, layout.QUERY), dof_of(motions_of(roadmap))
    points, wanted, count, worst = points_of(tree), field(roadmap, layout.NEAR), 0, FARTHEST
    for block in range((below + WIDTH - 1) // WIDTH):
        total = squares_of(points, query, dof, block)
        if lowest(total) >= worst:
            continue
        for lane in range(min(WIDTH, below - block * WIDTH)):
            square = lane_at(total, lane)
            if square < worst:
                count = keep_near(roadmap, block * WIDTH + lane, square, count)
                if count == wanted:
                    worst = float_at(field(roadmap, layout.NEAR_SQUARES), wanted - 1)
    return count


@kernel
def leave(roadmap: RoadmapTable, vertex: int, half: int) -> None:
    """Let a half leave a vertex."""
    heads = field(roadmap, layout.HEADS)
    set_int(field(roadmap, layout.NEXT), half, int_at(heads, vertex))
    set_int(heads, vertex, half)


@kernel
def join(roadmap: RoadmapTable, first: int, second: int) -> None:
    """Add an edge between two vertices; there must be room."""
    half, tree, dof = field(roadmap, layout.HALVES), vertices_of(roadmap), dof_of(motions_of(roadmap))
    leave(roadmap, first, half)
    leave(roadmap, second, half + 1)
    set_int(field(roadmap, layout.TO), half, second)
    set_int(field(roadmap, layout.TO), half + 1, first)
    set_double(field(roadmap, layout.LENGTHS), half >> 1, distance(dof, row_of(tree, first), row_of(tree, second)))
    set_int(field(roadmap, layout.STATES), half >> 1, UNKNOWN)
    set_field(roadmap, layout.HALVES, half + 2)


@kernel
def join_near(roadmap: RoadmapTable, vertex: int, below: int) -> int:
    """Join the vertex at QUERY with those nearest to it among the first ``below`` ones; returns how many."""
    count = find_near(roadmap, below)
    for k in range(count):
        join(roadmap, vertex, int_at(field(roadmap, layout.NEAR_VERTICES), k))
    return count


@kernel
def drop_last_edge(roadmap: RoadmapTable) -> None:
    """Take the edge away that was added last."""
    half, heads, after = field(roadmap, layout.HALVES) - 2, field(roadmap, layout.HEADS), field(roadmap, layout.NEXT)
    for each in range(half, half + 2):
        set_int(heads, tail_of(roadmap, each), int_at(after, each))
    set_field(roadmap, layout.HALVES, half)


@kernel
def checked_state(roadmap: RoadmapTable, half: int) -> Any:
    """The state of a half's edge, whose motion is checked if nobody has looked at it; its ends are taken to be free."""
    edge, states = half >> 1, field(roadmap, layout.STATES)
    known = int_at(states, edge)
    if known != UNKNOWN:
        return known
    motions, tree = motions_of(roadmap), vertices_of(roadmap)
    first, second = tail_of(roadmap, half), head_of(roadmap, half)
    if descends(dof_of(motions), row_of(tree, first), row_of(tree, second)):
        first, second = second, first
    last = step_count(motions, row_of(tree, first), row_of(tree, second))
    resolve = field(roadmap, layout.RESOLVE) != 0
    answer = check_part(world_of(motions), values_of(tree, first), values_of(tree, second), last, 1, last - 1, resolve)
    count_up(roadmap, layout.CHECKED)
    state = SURE if answer == FREE else DOUBTFUL if answer == UNDECIDED and resolve else BLOCKED
    set_int(states, edge, state)
    return state
