"""The table of random shortcuts in a kernel, and the words for its states."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Record
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable

KERNELS = "search.shortcut_kernels"  # their library

# What resume() returns: all tries are spent, the budget is spent, questions must be answered first.
DONE, RUNNING, ASKING = range(3)


class ShortcutTable(Record):
    """Random shortcuts of a route."""

    motions: MotionTable  # of the world
    metric: Doubles  # squared weights of the length
    waypoint_share: float  # probability that an end of a shortcut is a waypoint
    pull_share: float  # probability that a try is a pull
    route: Configuration  # waypoints
    arc_lengths: Doubles  # of the route up to each waypoint
    ends: Configuration  # of the shortcut
    question_starts: Configuration  # of motions to ask about
    question_ends: Configuration
    count: int  # waypoints
    capacity: int  # of the route
    random: int  # state
    tries: int
    max_tries: int
    failures: int  # tries since the last gain
    patience: int  # such tries that end the search
    gains: int
    resolve: int  # 1 if undecided motions are asked for, 0 if they count as colliding
    questions: int
    answered: int  # see below
    first: int  # waypoint at or before the first end of the shortcut
    second: int  # the same of the second
    cuts: int  # see below


# Bits of the cuts: whether an end of the shortcut lies inside an edge; whether it is a pull, and the first end the new
# place of the first waypoint.
FIRST_INSIDE, SECOND_INSIDE, PULL = 1, 2, 4
MAX_QUESTIONS = 3  # motions of a try
ANSWER_NO, ANSWER_YES, NO_ANSWER = range(3)
