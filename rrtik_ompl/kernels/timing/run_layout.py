"""The tables of the kernels that time runs: through rounded corners, and straight ones."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Ints, Record
from rrtik_ompl.kernels.timing.layout import CurveTable, SearchTable

KERNELS = "timing.run_kernels"  # their library

MOST_PIECES = 1250  # largest number of pieces of a curve
MOST_STEPS = 16  # most steps in the widest window
LEAST_PIECES = 8  # fewest pieces of a motion

# Of the grid along a curve.
LEAST_STEPS = 150  # fewest steps along a whole curve
STEPS_PER_RADIUS = 12  # steps per radius of a rounded corner
STEPS_PER_LINE = 8  # steps along a line between two rounded corners
SAME_PLACE = 1e-9  # share of a curve's length within which two points are merged
KNOTS = 3  # of each corner: where its rounding begins, is at the corner, and ends

CONTROLS = MOST_PIECES + 1 + MOST_STEPS + 3  # most control points of a spline
MOST_PARTS = 2000  # largest number of parts of a motion in the search for its cruising speed
CRUISE_PARTS = 12.0  # number of parts into which the shortest cruise is divided
WIDEST = 16  # more than the parts of a cruise
SPEEDS = MOST_PARTS + 2 * WIDEST

# Of peaks of motions: share of the largest acceleration above which a difference between two pieces counts as a jump,
# of infinite jerk; and what the rounding of times and velocities adds to it, as a share of these.
JUMP_SHARE = 1e-6
ROUNDING = 8.0 * 2.0**-52


MIN_PHASE_SECONDS = 1e-9  # shorter phases of a straight motion are left out
PHASES = 7


class RunTable(Record):
    """A run from rest to rest, and how it is smoothed."""

    curve: CurveTable
    search: SearchTable
    room: int  # points of a grid for which there is memory
    classes: Doubles  # radii of the corners, rounded down so that there are few different ones
    share: float  # of a corner's radius by which smoothing may leave the rounded corner
    most: Doubles  # by the curve's deviation: largest path speed squared times a twenty-fourth of the window squared
    jerk: Doubles  # limits of the coordinates, may be infinite
    window: float  # the widest one that the jerk limits may need [s]
    period: float  # the shortest piece [s]
    attempts: int
    shares: Doubles  # of each attempt: its largest window, as a share of the widest one
    cruises: Ints  # whether its speed is to stay constant for as long
    widths: Doubles  # windows that each attempt tries, as ascending shares of its largest one
    width_count: int
    max_deviation: float
    slack: float  # share by which the speed may exceed the cruising speed
    margin: float  # factor by which a spline is slowed more than it must, for rounding
    coincidence: float  # how far from the path a control point that is on it may be

    # What is found.
    found_step: float  # of the spline [s]
    found_pieces: int
    positions: Doubles  # at the beginning of each piece, rows of n
    velocities: Doubles
    accelerations: Doubles
    begins: Doubles  # places of these on the path
    gaps: Doubles  # from the path
    on_path: Ints  # whether a piece does not leave the path

    # Scratch memory.
    knots: Doubles  # places on the curve where its third derivative jumps
    tightest: Doubles  # of each stretch between two knots: the smallest class of the corners in whose rounding it lies
    step: float  # of the last spline [s]
    pieces: int
    times: Doubles  # of the points of the grid
    rows: Doubles  # the motion at even times: n coordinates and the place on the path
    sums: Doubles  # over windows, rows of n + 1
    trial: Doubles  # control points of a spline, rows of n + 1
    controls: Doubles  # of the shortest spline
    cut: Doubles  # mean speeds of even parts of a motion, without narrow peaks
    middles: Doubles  # places in the middle of these
    lows: Doubles  # least speeds of windows


class LinesTable(Record):
    """Straight motions from each vertex of a path to the next, from rest to rest."""

    vertices: Doubles  # rows of n
    lengths: Doubles  # of the edges
    directions: Doubles  # of the edges, of length 1, rows of n
    along: Doubles  # distance of each vertex from the first one along the path
    velocity: Doubles  # limits of n coordinates
    acceleration: Doubles
    jerk: Doubles  # may be infinite
    dof: int  # n
    edges: int

    # What is found.
    durations: Doubles  # of the pieces of all motions, one behind the other
    positions: Doubles  # at the beginning of each piece, rows of n
    velocities: Doubles
    accelerations: Doubles
    begins: Doubles  # places of these on the path

    # Scratch memory.
    phases: Doubles  # durations of the phases of one motion
    pushes: Doubles  # accelerations along the line at their beginnings
