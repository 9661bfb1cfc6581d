"""The tables of the kernels for timing."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Record

KERNELS = "timing.kernels"  # their library


class CurveTable(Record):
    """A curve through rounded corners, and where it is wanted."""

    vertices: Doubles  # rows of n
    along: Doubles  # distance of each vertex from the first one along the path
    directions: Doubles  # of the edge behind each vertex, of length 1, rows of n
    radii: Doubles  # how far from each vertex its rounding begins
    at: Doubles  # places, not decreasing
    values: Doubles  # rows of 3 n: position, its first and second derivative at each place
    widest: float  # the largest of the radii
    dof: int  # n
    vertex_count: int
    place_count: int


class SearchTable(Record):
    """The search, in path speed squared x and path acceleration u at the points of a grid.

    Row r of ``first``, ``second``, ``low``, ``high``, of which each point has ``rows``, says
    ``low <= first u + second x <= high``.
    """

    shape: Doubles  # rows of 3 n as the values of a curve
    velocity: Doubles  # limits of n coordinates
    acceleration: Doubles
    first: Doubles
    second: Doubles
    low: Doubles
    high: Doubles
    cap: Doubles  # the largest x of each point; the velocity limits lower it
    grid: Doubles  # places, increasing
    squares: Doubles  # x of each point, to be found
    reached: Doubles  # the largest x from which the end is reached
    lines: Doubles  # scratch, rows of LINE for one point at a time
    joints: int  # n
    rows: int
    points: int


LINE = 3  # numbers of a line: low, high and slope, for low <= u - slope x <= high

FLAT = 1e-12  # a row whose factor of u is less bounds x alone
MOST = 1e300  # more than any path acceleration
ROUNDS = 40  # of the search for the largest x of a point; three or four are usual


def line_count(joints: int, rows: int) -> int:
    """How many lines a point has at most, of which each limit is asked for there and at the next point."""
    return 1 + 2 * (joints + rows)
