"""What Python and the kernels of the search for a cover both know."""

from __future__ import annotations

KERNELS = "covers.search_kernels"  # their library
BOX_POINTS = 32  # points of the surface in a box
FAR = 1e37  # more than any squared distance
CENTRE, DEPTH, MOVED = 0, 3, 4  # of a ball that is moved
