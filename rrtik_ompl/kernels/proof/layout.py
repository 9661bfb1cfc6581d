"""The table of a proof: what each field is, and the places of numbers in its rows."""

from __future__ import annotations

from rrtik_ompl.kernels.layout import NeighbourTable
from rrtik_ompl.kernels.record import Doubles, Ints, Record, Wholes


class Frame(Doubles):
    """Frames: the rotation row by row, then the origin."""


class JointRows(Frame):
    """The placement of each joint in its parent's frame, and its axis."""


class SolidRows(Ints):
    """Of each solid what it is, and where its corners are; see below."""


class SizeRows(Doubles):
    """The measures of each solid; see below."""


class Corners(Doubles):
    """Blocks of x, y and z of as many corners as there are lanes; the last block of a solid is filled up."""


class StillBlocks(Doubles):
    """Blocks of as many solids at rest as there are lanes: of each measure, up to those of the box, a row of lanes."""


class SweepRows(Ints):
    """Of each sweep the frame of the body, and the frame that it is seen from."""


class PairRows(Ints):
    """Of each pair its solids, and how they are seen; see below."""


class ChordKeys(Ints):
    """Of each chord the solid, and the frame that it is seen from."""


class ChordRows(Doubles):
    """Of each chord what balls are compared by; see below."""


class LogRows(Ints):
    """Of each record what is proven; see below."""


class CarriedSolids(Record):
    """An arm, the solids that its joints carry or that stand still, and the frames of the joints.

    Frames are counted like Pinocchio's joints: 0 is the world.
    """

    joint_count: int
    parents: Ints  # frame that carries each joint
    sliding: Ints  # whether each slides
    joints: JointRows
    solids: SolidRows
    sizes: SizeRows
    corners: Corners
    frames: Frame  # at each node that of the world, then those of all joints
    angles: Doubles  # lanes of the joints' values, then of their sines and of their cosines


class ProofTable(CarriedSolids):
    """What of an arm and what is around it must not touch, and what a proof of a motion computes in.

    A sweep is a body, or several, seen from a frame that it moves in. A chord leads from where the middle of a solid's
    ball is at the begin of an interval to where it is at the end, seen from such a frame. A node is one of ``NODES``
    places of a motion, from its start to its end.
    """

    sweep_count: int
    sweeps: SweepRows
    # Blocks of lanes for as many sweeps, of each joint a row: how far a sweep's points come from its axis [m], and
    # whether it moves them (1 or 0).
    reaches: Doubles
    carries: Doubles

    body_pair_count: int  # pairs of whole bodies, which come first
    pair_count: int
    pairs: PairRows
    margins: Doubles  # what each pair keeps [m], rounding included; behind them as many numbers as there are lanes
    still: StillBlocks
    top_count: int
    top_pairs: Ints  # the pairs to begin with, groups of bodies before their bodies
    looked_up: Ints  # of each of them its number among the neighbours, -1 for others
    neighbours: NeighbourTable
    chord_count: int
    chord_keys: ChordKeys

    # What a proof computes in.
    stamps: Ints  # number of the motion that the frames of each node are of
    stamp: int  # number of this motion
    bends: Doubles  # largest acceleration of each sweep in this motion [m]
    ways: Doubles  # of each pair the normal of its last plane
    way_stamps: Ints  # number of the motion that this plane is of, or SUGGESTED
    lists: Ints  # open pairs at each level, ``pair_count`` places for each
    counts: Ints  # how many of them
    stack: Ints  # levels and numbers of intervals
    chords: ChordRows
    chord_stamps: Ints  # number of the interval that each chord is of
    interval: int  # number of this interval
    seen: Frame  # four, of a pair's solids at both ends of an interval, seen from the pair's base

    # What it tells of itself.
    log_room: int  # records that there is room for; 0 for a proof that tells nothing
    log: LogRows
    log_ways: Doubles  # of each record the unit normal of its plane, seen from the base of its pair, or zeros
    log_count: int  # records, also those for which there was no room

    clouds: Wholes  # addresses of their tables
    cloud_poses: Frame  # in the world


FRAME_SIZE = 12
ORIGIN = 9

JOINT_SIZE = 15
JOINT_AXIS = 12  # behind a frame

# Solid: its frame, blocks of its corners from, to, kind.
SOLID_SIZE = 4
SOLID_FRAME, FIRST_BLOCK, END_BLOCK, SOLID_KIND = range(4)
CONVEX_SOLID, HALF_SPACE, WHOLE_BODY, UNKNOWN = range(4)  # a whole body, or several, has a ball and a box, no corners
CLOUD = 4  # and its number among the clouds; its corners are the points that are compared at the moment

# Sizes: bounding ball; axes of the box row by row, its middle along them, its half sides; radius of the disc (offset
# of a half-space) and its axis; radius of the ball around every point.
SIZE_COUNT = 24
BALL_CENTRE, BALL_RADIUS, BOX_AXES, BOX_MIDDLE, BOX_HALF, DISC, DISC_AXIS, ROUND = 0, 3, 4, 13, 16, 19, 20, 23

STILL_SIZE = DISC  # of these measures those that balls on chords are compared with

SWEEP_SIZE = 2
SWEEP_FRAME, SWEEP_BASE = range(2)

# Pair: two solids, the frame that both are seen from, their sweeps (-1: it stands still there), pairs of their parts
# from, to, the chord of the first one (-1: one of them has no ball), that of the other one (-1: it stands still); of a
# run that begins with it how many pairs it has, and its block. A run is of pairs with one chord and others at rest.
PAIR_SIZE = 11
PAIR_ONE, PAIR_OTHER, PAIR_BASE, ONE_SWEEP, OTHER_SWEEP, PARTS_FIRST, PARTS_END, PAIR_CHORD, OTHER_CHORD = range(9)
RUN_LENGTH, RUN_BLOCK = 9, 10

CHORD_KEY_SIZE = 2
CHORD_SOLID, CHORD_BASE = range(2)

# Chord: its begin, the way to its end, 1 / square of that, the ball's radius, half the chord's length.
CHORD_SIZE = 9
CHORD_BEGIN, CHORD_WAY, CHORD_INVERSE, CHORD_RADIUS, CHORD_HALF = 0, 3, 6, 7, 8

# Log: a pair, level and number of an interval on which it is proven apart, by what.
LOG_SIZE = 4
LOG_PAIR, LOG_LEVEL, LOG_NUMBER, LOG_MEANS = range(4)
OPEN, BY_BALL, BY_PLANE = range(3)  # not proven; by a ball and a ball or box; by a plane

SUGGESTED = -1  # a plane to begin with in every motion

DEEPEST = 9  # an interval of a motion is 1 / 2**DEEPEST of it at least
NODES = (1 << DEEPEST) + 1
