"""The table of a roadmap in kernels: what each field is, and the words for its states."""

from __future__ import annotations

from typing import NewType

KERNELS = "search.roadmap.kernels"  # the library of roadmaps
RoadmapTable = NewType("RoadmapTable", int)  # of the table of a roadmap

# What it works on: the motion table of the world, its vertices (a tree whose parents nobody reads), the box of
# configurations, the inverse bases of the sequence of samples. RESOLVE: 1 if undecided motions are asked for ...
MOTIONS, VERTICES, LOWER, UPPER, INVERSE_BASES, RESOLVE = range(6)
# ... the sample: ROW (joint values ROW_VALUES), its floats QUERY, POINT of the unit box, random state ...
ROW, ROW_VALUES, QUERY, POINT, RANDOM = range(6, 11)
# ... the edges. Edge e is the halves 2 e and 2 e + 1, one each way: the vertex that a half leads TO, and the NEXT half
# of the vertex that it leaves, whose first one is in HEADS. By edge: LENGTHS and STATES. HALVES: how many there are ...
HALVES, TO, NEXT, HEADS, LENGTHS, STATES = range(11, 17)
# ... the nearest vertices of a configuration, NEAR of them, nearest first, and the squares of their distances ...
NEAR, NEAR_VERTICES, NEAR_SQUARES = range(17, 20)
# ... a query. The vertices from MAPPED on are its STARTS starts, then its goals. Of each vertex: COSTS, the length of
# the path to it; AHEAD, what lies ahead at least; CAME, the half by which it was reached. HEAP: halves to follow, least
# KEYS first. MEETING: the goal that was reached. QUESTIONS: halves of its path that are asked for ...
MAPPED, STARTS, COSTS, AHEAD, CAME, HEAP_SIZE, HEAP, KEYS, MEETING, QUESTIONS, ASKED = range(20, 31)
# ... and counts: motions checked, samples drawn.
CHECKED, SAMPLES, FIELD_COUNT = range(31, 34)

UNKNOWN, SURE, DOUBTFUL, BLOCKED = range(4)  # state of an edge: not looked at, free, left undecided, not free
UNSEEN, ROOT, END = -2, -1, -1  # of CAME: not reached, a start; of HEADS and NEXT: no further half
NOT_COMPUTED = -1.0  # of AHEAD
SOLVED, EXHAUSTED, RUNNING, ASKING = range(4)  # status
MAX_QUESTIONS = 64  # at a time
