"""The table of a path's look and repair in kernels: what each field is, and the words for their results."""

from __future__ import annotations

KERNELS = "search.repair_kernels"  # their library

# SEARCH, CUTS: tables of an RRT-Connect search and of random shortcuts · NUMBERS: doubles, see below
# GIVEN: the path as it was given · POINTS: points along it · PATH: the repaired one · ROOM: of each, in rows
SEARCH, CUTS, NUMBERS, GIVEN, POINTS, PATH, ROOM = range(7)
# Numbers that the kernels set. COUNT: of points · FIRST, LAST: blocked edges between points, seen from both ends
# CHECKED: configurations that a look asks for · TRIES, PATIENCE: of the shortcuts
COUNT, FIRST, LAST, CHECKED, TRIES, PATIENCE, FIELD_COUNT = range(7, 14)
# The doubles. STEP: longest edge of the path's points · NEAR: half the side of the first sample's box, of the gap
STEP, NEAR = range(2)

HIT, FREE_PATH, NO_ROOM = range(3)  # what look() returns
NOT_YET, NO_WAY, LONG = -1, -2, -3  # what repair() and finish() return in place of a number of rows
