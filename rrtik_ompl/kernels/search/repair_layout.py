"""The table of a path's check and repair in kernels: what each field is, and the words for their results."""

from __future__ import annotations

from typing import NewType

KERNELS = "search.repair_kernels"  # their library
RepairTable = NewType("RepairTable", int)  # of the table of a repair

# MOTIONS: the motion table of the world · SEARCH, CUTS: tables of an RRT-Connect search and of random shortcuts in that
# world · NUMBERS: doubles, see below · GIVEN: the path as it was given · POINTS: points along it · PATH: the repaired
# one · CAPACITY: of each, in rows
MOTIONS, SEARCH, CUTS, NUMBERS, GIVEN, POINTS, PATH, CAPACITY = range(8)
# Numbers that the kernels set. COUNT: of points · FIRST, LAST: blocked edges between points, seen from both ends
# CHECKED: configurations that the check of a path counts · TRIES, PATIENCE: of the shortcuts
COUNT, FIRST, LAST, CHECKED, TRIES, PATIENCE, FIELD_COUNT = range(8, 15)
# The doubles. STEP: longest edge of the path's points · BOX_RATIO: half the side of the first sample's box over the gap
STEP, BOX_RATIO = range(2)

HIT, FREE_PATH, NO_ROOM = range(3)  # what check_path() returns
UNFINISHED, NO_PATH, TOO_LONG = -1, -2, -3  # what repair() and finish() return in place of a number of rows
