"""The table of a search for the shortest of some routes that are pulled taut."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Record, Wholes
from rrtik_ompl.kernels.search.connect_layout import ConnectTable
from rrtik_ompl.kernels.search.contacts.layout import PullTable
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration

KERNELS = "search.short.kernels"  # their library


class ShortTable(Record):
    """Searches to some goals, and two routes by turns: the shortest so far, and the one that is compared with it."""

    search: ConnectTable
    first: PullTable
    second: PullTable
    found: Configuration  # what was searched of each, before it was pulled; ``CAPACITY`` rows for either
    found_rows: Wholes  # how many of them

    start: Configuration
    goals: Configuration  # the nearest first; those that are not proven free are left out
    lines: Doubles  # length of the straight line to each
    goal_count: int
    seed: int

    stage: int
    turn: int  # of the searches to all goals
    goal: int  # the next one
    left: float  # work until the kernel returns, in proofs of free motions
    best: int  # which route is the shortest, -1 if there is none
    length: float  # of it

    attempts: int  # searches
    rejected: int  # routes that cannot be proven
    iterations: int  # samples
    checked: int  # motions


GIVEN, NEXT, SEARCHING, FOUND = range(4)  # stages
DONE, RUNNING, FULL = range(3)  # status; full: a tree of the search needs room
CAPACITY = 512  # waypoints of a route; one with more is rejected
