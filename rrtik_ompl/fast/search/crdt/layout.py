"""The tables of searches whose trees move one coordinate an edge: what each field is, and the words for its states."""

from __future__ import annotations

ROOT = -1

# Statuses of a search.
RUNNING, ASKING, FULL, SOLVED, EXHAUSTED = range(5)
# What an extension achieved: nothing, a part of the way, its target exactly.
TRAPPED, ADVANCED, REACHED = range(3)
# What a search does next.
BEGIN, GROW, MEET, CHOOSE_GOAL, REACH_GOAL = range(5)

# Tree: coordinates are runs of CAPACITY float64, one run for each coordinate; parents int32.
SIZE, CAPACITY, COORDINATES, PARENTS = range(4)

# Search, the motions: joint values = GAIN q + OFFSET, limits of a valid configuration, WEIGHTS of its travel. NUMBERS:
# see below. ASKS: whether the world is asked about what is undecided; otherwise it counts as colliding.
WORLD, DOF, GAIN, OFFSET, WEIGHTS, LEAST, MOST, NUMBERS, VALUES, ASKS = range(10)
# Its rules, see CrdtRules, and its progress.
LOWER, UPPER, SCALE, SMALLEST_MOVE, CHANCE, AXES, AXIS_COUNT = range(10, 17)
RANDOM, ITERATIONS, ITERATION_LIMIT, NEXT, MOTIONS = range(17, 22)
# Its trees: the addresses of two, which of them grows; where they met.
TREES, GROWING, MET = range(22, 25)
# Its extension: the edges are rows of STARTS and ENDS; the first FIRST_EDGES of them belong to the first leg.
TARGET, NEAR, ORDER, CURRENT, TURN, FIRST_EDGES, EDGE_COUNT, COMPLETE, STARTS, ENDS, VERDICTS, LAST = range(25, 37)
# Work of the search for the nearest vertex. Goals of a single tree; which vertex tries which of them next.
DISTANCES, GOALS, GOAL_COUNT, VERTEX, VERTEX_END, GOAL = range(37, 43)
FIELDS = 43

# Places in NUMBERS.
RESOLUTION, TOLERANCE_SQUARED = range(2)

# The first leg: a new direction; back into the last edge, beyond its beginning, exactly to its beginning.
ONWARD, BETWEEN, BEYOND, BACK = range(4)
