"""What Python and the kernels that choose cuts both know."""

from __future__ import annotations

KERNELS = "covers.cut_kernels"  # their library
MOST_POINTS = 128  # of a hull; at least as many as there are directions
MOST_FACES = 8 * MOST_POINTS  # of a hull while it is made
FACE = 4  # whole numbers of a face: three points, and whether it is one
PLANE = 4  # numbers of a plane: normal and offset
