"""The table of a search tree in kernels: what each field is, and the states of a vertex."""

from __future__ import annotations

# Tree. Vertex: ``DOF`` floats in lanes, block by block; a row of ``DOF`` and one of ``JOINTS`` doubles (the joint
# values; the same memory where they are the same); the parent, -1 for a root; radius of its domain; state.
CAPACITY, SIZE, LIVE, DOF, JOINTS, POINTS, ROWS, VALUES, PARENTS, RADII, STATES = range(11)
CERTAIN, OPEN, CUT = 0, 1, 2  # of the motion from the parent: free, undecided, or not free
