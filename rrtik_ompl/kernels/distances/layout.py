"""The table of distances: what each field is, and the places of numbers in its rows."""

from __future__ import annotations

from rrtik_ompl.kernels.proof.layout import CarriedSolids
from rrtik_ompl.kernels.record import Doubles, Ints


class NodeRows(Ints):
    """Of each node of a tree of solids its solid, its two branches, and what it is; see below."""


class ColumnRows(Ints):
    """Of each pair of objects the roots of their trees (-1: none), and whether one is hollow and may hold the other."""


class PolytopePoints(Doubles):
    """Corners of a polytope inside the difference of two solids, and the points of the first one that made them."""


class PolytopeFaces(Ints):
    """Three corners of each face, counter-clockwise from outside."""


class PolytopePlanes(Doubles):
    """Outward unit normal and offset of each face."""


class DistanceTable(CarriedSolids):
    """Objects as trees of convex solids, and what distances between them are computed in.

    A leaf of a tree is a part of the object: a convex solid, a triangle of a mesh, or points of a cloud. Every other
    node is a convex solid around all leaves of its branches.
    """

    nodes: NodeRows
    spans: Doubles  # of each solid
    element: int  # the solid that stands for what is around a point, while that is compared
    dof: int
    coordinates: Ints  # coordinate of a configuration that moves each joint, -1 for none
    gains: Doubles  # by how much

    within: float  # [m] larger distances are of no interest
    keep: int  # so many of the smallest distances of a configuration are of interest

    # What a kernel computes in.
    twists: Doubles  # how each joint moves what it carries
    smallest: Doubles  # the ``keep`` smallest distances of a configuration, in order
    stack: Ints  # pairs of nodes
    bounds: Doubles  # of each of them a lower bound of its distance, the same of its parent, and a direction
    points: PolytopePoints
    faces: PolytopeFaces
    planes: PolytopePlanes
    edges: Ints  # of a hole in a polytope


# Node: its solid, its branches (of a leaf: -1), its kind, the solid whose corners are points, the solid around each.
NODE_SIZE = 6
NODE_SOLID, NODE_FIRST, NODE_SECOND, NODE_KIND, NODE_CENTRES, NODE_PART = range(6)
# SOLID: a convex leaf. TRIANGLE: of a mesh. HULL: of a whole mesh. AROUND: hull of a part of a mesh. BOX_AROUND: none
# of its corners need be of the object. POINTS: a leaf of points, with a solid around each.
SOLID, TRIANGLE, HULL, AROUND, BOX_AROUND, POINTS = range(6)

# Span: whether the core of a solid is a box (or a segment, or a point: edges are 0), its middle, three half edges.
SPAN_SIZE = 13
IS_SPAN, SPAN_MIDDLE, SPAN_EDGES = 0, 1, 4

COLUMN_SIZE = 3
COLUMN_ONE, COLUMN_OTHER, COLUMN_HOLLOW = range(3)

TWIST_SIZE = 6

STACKED = 512  # pairs of nodes that may wait: trees are at most a quarter as deep
STACK_SIZE = 2
BOUND_SIZE = 5
BOUND, PARENT_BOUND, BOUND_WAY = 0, 1, 2

MOST_POINTS = 128
MOST_FACES = 2 * MOST_POINTS
POINT_SIZE = 6
FACE_SIZE = 3
PLANE_SIZE = 4

# What is told of each distance. BEYOND: larger than what is of interest. CROSSING: two surfaces without an inside
# cross. SURROUNDED: the hull of one object overlaps the other, of which something may be inside it. UNKNOWN: not
# computed here.
MEASURED, BEYOND, CROSSING, SURROUNDED, UNKNOWN = range(5)
