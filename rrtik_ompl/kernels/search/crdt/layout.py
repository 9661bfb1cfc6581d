"""The tables of C-RDT searches, whose trees move one coordinate an edge, and the words for their states."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Ints, Record
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable

ROOT = -1

# Statuses of a search.
RUNNING, ASKING, FULL, SOLVED, EXHAUSTED = range(5)
# What an extension achieved: nothing, a part of it, its target exactly.
TRAPPED, ADVANCED, REACHED = range(3)
# What a search does next.
BEGIN, GROW, MEET, CHOOSE_GOAL, REACH_GOAL = range(5)


class CrdtTreeTable(Record):
    """A tree."""

    size: int  # vertices
    capacity: int  # for which there is room
    coordinates: Doubles  # runs of ``capacity``, one for each coordinate
    parents: Ints


class CrdtTable(Record):
    """A search."""

    motions: MotionTable  # of the world
    rules: Configuration  # rows, see below
    axes: Ints  # that may move
    axis_count: int
    random: int  # state
    iterations: int
    iteration_limit: int
    next: int  # what the search does next
    checked: int  # edges
    tree: CrdtTreeTable
    other_tree: CrdtTreeTable
    growing: int  # which tree
    met: int  # the vertex of that one which the other is to meet

    # The extension from a vertex.
    extension: Configuration  # rows, see below
    near: int  # the vertex
    order: Ints  # of the axes
    turn: int  # how the first leg turns
    first_edges: int  # those that belong to the first leg
    edge_count: int
    complete: int  # whether it leads to its target
    verdicts: Ints  # what was found of each edge
    last: int  # vertex that it has led to

    nearest: Doubles  # memory of the search for the nearest vertex
    goals: Configuration  # of a single tree
    goal_tolerance: float  # square of how near to a goal a vertex tries to reach it
    goal_count: int
    vertex: int  # the one that tries to reach a goal next
    vertex_end: int  # the one after the last that does
    goal: int  # that it tries


# Rows of the rules: limits of a valid configuration, then what CrdtRules says.
LIMIT_LOWER, LIMIT_UPPER, SAMPLE_LOWER, SAMPLE_UPPER, SCALE, SMALLEST_MOVE, CHANCE, RULE_COUNT = range(8)

# Rows of the extension: the target, the configuration that the extension has reached, the starts of as many edges as
# there are coordinates and one more, then their ends.
TARGET, CURRENT, EDGES = range(3)

# The first leg: a new direction; back into the last edge, beyond its beginning, exactly to its beginning.
ONWARD, BETWEEN, BEYOND, BACK = range(4)
