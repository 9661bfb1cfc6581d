"""The table of an RRT-Connect tree in kernels, and the states of a vertex."""

from __future__ import annotations

from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.record import Floats, Ints, Record
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration


class TreeTable(Record):
    """A tree, and for each vertex what an array holds."""

    capacity: int  # vertices for which there is room
    size: int  # vertices
    live: int  # those that are not cut off
    dof: int
    joints: int
    points: Floats  # ``dof`` in lanes, block by block
    rows: Configuration
    values: JointValues  # of the row; the same memory where they are the same
    parents: Ints  # -1 for a root
    radii: Floats  # of the vertex's domain [unit of the configurations]
    states: Ints  # of the motion from the parent
    costs: Floats  # length of the path from a root, where a search is bounded by that


CERTAIN, OPEN, CUT = 0, 1, 2  # of the motion from the parent: free, undecided, or not free
NO_PARENT = -1  # of a root
