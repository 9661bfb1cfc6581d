"""The table of an RRT-Connect tree in kernels: what each field is, and the states of a vertex."""

from __future__ import annotations

from typing import NewType

TreeTable = NewType("TreeTable", int)  # of the table of a tree

# Tree. Vertex: ``DOF`` floats in lanes, block by block; a row of ``DOF`` and one of ``JOINTS`` doubles (the joint
# values; the same memory where they are the same); the parent, -1 for a root; radius of its domain; state; the length
# of the path to it, where a search is bounded by that.
CAPACITY, SIZE, LIVE, DOF, JOINTS, POINTS, ROWS, VALUES, PARENTS, RADII, STATES, COSTS = range(12)
CERTAIN, OPEN, CUT = 0, 1, 2  # of the motion from the parent: free, undecided, or not free
NO_PARENT = -1  # of a root
