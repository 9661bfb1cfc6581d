"""The table of an RRT-Connect search in kernels: what each field is, and the words for its states."""

from __future__ import annotations

from typing import NewType

KERNELS = "search.connect_kernels"  # the library of these searches
ConnectTable = NewType("ConnectTable", int)  # of the table of a search

# What a search works on: the motion table of the world, its trees, the box of configurations, the numbers below, the
# inverse bases of the sequence of samples ...
MOTIONS, START_TREE, GOAL_TREE, LOWER, UPPER, NUMBERS, INVERSE_BASES = range(7)
# ... its rules. RESOLVE: 1 if undecided motions are asked for, 0 if they count as colliding · PATIENCE: rejected paths
# until undecided motions are asked for before they are inserted · LIMIT: of the samples ...
RESOLVE, PATIENCE, LIMIT, START_ROWS, GOAL_ROWS = range(7, 12)
# ... the motion that is checked: from vertex FROM of tree GROWING to ROW (joint values ROW_VALUES). If BRIDGE, it ends
# at vertex TARGET of the other tree. GROWER: the tree that was extended towards the last sample. QUERY: floats of the
# configuration whose nearest vertex is wanted. POINT: the last sample in the unit box ...
PHASE, GROWER, GROWING, FROM, TARGET, BRIDGE, ROW, ROW_VALUES, QUERY, POINT, RANDOM = range(12, 23)
# ... the vertices at which the trees meet and the state of the motion between them; what is asked. SIDES and VERTICES:
# to which vertex of which tree a motion leads, or -1 ...
START_MEETING, GOAL_MEETING, MEETING_STATE, ASKED, QUESTIONS, QUESTION_STARTS, QUESTION_ENDS = range(23, 30)
QUESTION_SIDES, QUESTION_VERTICES, ANSWERS = range(30, 33)
# ... and counts. CHECKED: motions. STRAIGHT_TRIED: of GOAL_COUNT goals.
ITERATIONS, REJECTED, CHECKED, GOAL_COUNT, STRAIGHT_TRIED = range(33, 38)
# Samples lie in the box around CENTRE whose sides are twice the number SPREAD, which grows with every sample.
CENTRE = 38
# PATH: memory for PATH_CAPACITY rows, and how many the path has, which is there if these are enough.
PATH, PATH_CAPACITY, PATH_ROWS, FIELD_COUNT = range(39, 43)

# The numbers, all in the unit of the configurations. RANGE: longest motion of the trees · DOMAIN: radius in which a
# vertex is extended once it was blocked · BOUND: length that paths have to stay below, see kernels/search/bounded.
RANGE, DOMAIN, SPREAD, BOUND = range(4)
UNBOUNDED_COST = 1e30  # [unit of the configurations] of BOUND: paths of any length
UNBOUNDED_SPREAD = 1e30  # [unit of the configurations] samples lie in the whole box
UNBOUNDED_DOMAIN = 1e30  # [unit of the configurations] of a vertex that was never blocked

STRAIGHT, EXTEND, CONNECT = range(3)  # phases
NO_QUESTION, MOTION_QUESTION, PATH_QUESTION = range(3)  # what is asked
NO_VERTEX = -1  # to which a question's motion leads
SOLVED, EXHAUSTED, RUNNING, ASKING, FULL = range(5)  # status
OUTSIDE = -1  # status that a root is not in the box; less its number
MAX_QUESTIONS = 64  # at a time
RESULT_NUMBERS = 7  # of one of several queries: status, rows, samples, motions, vertices, questions, rejected paths
