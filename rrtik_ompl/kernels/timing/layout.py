"""The tables of the kernels for timing: what each field is. All arrays are of float64."""

from __future__ import annotations

from typing import NewType

KERNELS = "timing.kernels"  # their library
CurveTable = NewType("CurveTable", int)  # of a curve and places on it
SearchTable = NewType("SearchTable", int)  # of the limits at the points of a grid

# A curve through rounded corners, and where it is wanted. VERTICES: rows of n · ALONG: distance of each vertex from the
# first one along the path · DIRECTIONS: of the edge behind each vertex, of length 1, rows of n · RADII: how far from
# each vertex its rounding begins · AT: places, not decreasing · VALUES: rows of 3 n: position, its first and second
# derivative at each place · WIDEST: the largest of the radii, an array of one
VERTICES, ALONG, DIRECTIONS, RADII, AT, VALUES, WIDEST = range(7)
# Numbers: of coordinates, vertices and places
DOF, COUNT, PLACES = range(7, 10)

# The search, in path speed squared x and path acceleration u at the points of a grid. SHAPE: rows of 3 n as in VALUES ·
# VELOCITY, ACCELERATION: limits of n coordinates · row r of FIRST, SECOND, LOW, HIGH, R of them at each point, says
# LOW <= FIRST u + SECOND x <= HIGH · CAP: the largest x of each point; the kernel lowers it by VELOCITY · GRID: places,
# increasing · SQUARES: x of each point, to be found · REACHED: the largest x from which the end is reached ·
# LINES: scratch, rows of LINE for one point at a time
SHAPE, VELOCITY, ACCELERATION, FIRST, SECOND, LOW, HIGH, CAP, GRID, SQUARES, REACHED, LINES = range(12)
# Numbers: of coordinates, of further rows at a point, and of points
JOINTS, ROWS, POINTS = range(12, 15)
LINE = 3  # numbers of a line: low, high and slope, for low <= u - slope x <= high

FLAT = 1e-12  # a row whose factor of u is less bounds x alone
MOST = 1e300  # more than any path acceleration
ROUNDS = 40  # of the search for the largest x of a point; three or four are usual


def line_count(joints: int, rows: int) -> int:
    """How many lines a point has at most, of which each limit is asked for there and at the next point."""
    return 1 + 2 * (joints + rows)
