"""The table of random shortcuts in a kernel: what each field is, and the words for its states."""

from __future__ import annotations

from typing import NewType

KERNELS = "search.shortcut_kernels"  # their library
ShortcutTable = NewType("ShortcutTable", int)  # of the table of a search

# What resume() returns: all tries are spent, the budget is spent, questions must be answered first.
DONE, RUNNING, ASKING = range(3)

# Search. MOTIONS: the motion table of the world · METRIC: squared weights of the length · PROBABILITIES: see below
# ROUTE: waypoints · ARC_LENGTHS: length of the route up to each waypoint · ENDS: both ends of the shortcut
# QUESTION_STARTS, QUESTION_ENDS: motions to ask about
MOTIONS, METRIC, PROBABILITIES, ROUTE, ARC_LENGTHS, ENDS, QUESTION_STARTS, QUESTION_ENDS = range(8)
# Numbers that the kernel changes. FAILURES: tries since the last gain · RESOLVE: 1 if undecided motions are asked for,
# 0 if they count as colliding · FIRST, SECOND: waypoints at or before the ends of the shortcut · CUTS: see below
COUNT, CAPACITY, RANDOM, TRIES, MAX_TRIES, FAILURES, PATIENCE, GAINS, RESOLVE = range(8, 17)
QUESTIONS, ANSWERED, FIRST, SECOND, CUTS = range(17, 22)

# Bits of CUTS: whether an end of the shortcut lies inside an edge; whether the first end is a pull, the new place of
# waypoint FIRST.
FIRST_INSIDE, SECOND_INSIDE, PULL = 1, 2, 4
WAYPOINT_END, PULL_TRY = range(2)  # probabilities: that a shortcut's end is a waypoint, that a try is a pull
MAX_QUESTIONS = 3  # motions of a try
ANSWER_NO, ANSWER_YES, NO_ANSWER = range(3)
