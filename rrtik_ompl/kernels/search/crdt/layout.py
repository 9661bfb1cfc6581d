"""The tables of C-RDT searches, whose trees move one coordinate an edge: what each field is, and the states' words."""

from __future__ import annotations

from typing import NewType

CrdtTable = NewType("CrdtTable", int)  # of the table of a search
CrdtTreeTable = NewType("CrdtTreeTable", int)  # of the table of a tree

ROOT = -1

# Statuses of a search.
RUNNING, ASKING, FULL, SOLVED, EXHAUSTED = range(5)
# What an extension achieved: nothing, a part of it, its target exactly.
TRAPPED, ADVANCED, REACHED = range(3)
# What a search does next.
BEGIN, GROW, MEET, CHOOSE_GOAL, REACH_GOAL = range(5)

# Tree: coordinates are runs of CAPACITY float64, one run for each coordinate; parents int32.
SIZE, CAPACITY, COORDINATES, PARENTS = range(4)

# Search: the motion table of the world; RULES: rows of float64, see below; the axes that may move.
MOTIONS, RULES, AXES, AXIS_COUNT = range(4)
# Its progress. CHECKED: edges.
RANDOM, ITERATIONS, ITERATION_LIMIT, NEXT, CHECKED = range(4, 9)
# Its trees, which of them grows, and the vertex of that one which the other is to meet.
TREE, OTHER_TREE, GROWING, MET = range(9, 13)
# Its extension from vertex NEAR: rows of float64, see below; the axes in their ORDER; how the first leg turns; the
# number of edges, and of those that belong to the first leg; whether it is COMPLETE; what was found of each edge; the
# LAST vertex.
EXTENSION, NEAR, ORDER, TURN, FIRST_EDGES, EDGE_COUNT, COMPLETE, VERDICTS, LAST = range(13, 22)
# Memory of the search for the nearest vertex. Goals of a single tree, and GOAL_TOLERANCE, one float64: the square of
# how near to a goal a vertex tries to reach it; which vertex tries which of them next.
NEAREST, GOALS, GOAL_TOLERANCE, GOAL_COUNT, VERTEX, VERTEX_END, GOAL, FIELD_COUNT = range(22, 30)

# Rows of RULES: limits of a valid configuration, then what CrdtRules says.
LIMIT_LOWER, LIMIT_UPPER, SAMPLE_LOWER, SAMPLE_UPPER, SCALE, SMALLEST_MOVE, CHANCE, RULE_COUNT = range(8)

# Rows of EXTENSION: the target, the configuration that the extension has reached, the starts of as many edges as there
# are coordinates and one more, then their ends.
TARGET, CURRENT, EDGES = range(3)

# The first leg: a new direction; back into the last edge, beyond its beginning, exactly to its beginning.
ONWARD, BETWEEN, BEYOND, BACK = range(4)
