"""The table of random shortcuts in a kernel: what each field is, and the words for its states."""

from __future__ import annotations

KERNELS = "search.shortcut_kernels"  # their library

# What resume() returns: all tries are spent, the budget is spent, questions must be answered first.
DONE, RUNNING, ASKING = range(3)

# Search. GAIN, OFFSET: joint values = gain @ q + offset · REACH: weights of the steps, then the resolution [m]
# METRIC: squared weights of the length · SHARE: probability that a shortcut's end is a waypoint, that a try is a pull
# ROUTE: waypoints · PLACES: length of the route up to each waypoint · ENDS: both ends of the shortcut
# VALUES: joint values of the ends of an edge · STARTS, GOALS: edges to ask about
WORLD, DOF, GAIN, OFFSET, REACH, METRIC, SHARE, ROUTE, PLACES, ENDS, VALUES, STARTS, GOALS = range(13)
# Numbers that the kernel changes. FAILURES: tries since the last gain · FIRST, SECOND: waypoints at or before the ends
# of the shortcut · CUTS: 1 if the first end lies inside an edge, plus 2 if the second does; PULL if the first end is
# the new place of waypoint FIRST
COUNT, CAPACITY, RANDOM, TRIES, MOST_TRIES, FAILURES, PATIENCE, GAINS, ASKS = range(13, 22)
QUESTIONS, ANSWERED, FIRST, SECOND, CUTS = range(22, 27)
PULL = 4
ANSWER_NO, ANSWER_YES, NO_ANSWER = range(3)
