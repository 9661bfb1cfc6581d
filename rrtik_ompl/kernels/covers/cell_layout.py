"""What Python and the kernels that cut a surface into cells both know."""

from __future__ import annotations

KERNELS = "covers.cell_kernels"  # their library
# [cells] Points closer than this to an edge or a plane are doubtful; elements take them as inside.
EDGE_TOLERANCE = 1e-9
MOST_DOUBT = 0.1  # [cells] uncertainty of a crossing from which its whole line is doubtful
CORNERS = 20  # most corners of a polygon: a triangle that is cut has nine
POLYGON = 1 + 3 * CORNERS
POLYGONS = 6  # that are cut at once: two for each axis
