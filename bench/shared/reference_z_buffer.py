"""Reference rasteriser in double precision, one triangle after the other: slow, and it judges `overlay.rasterizer`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.pilot.overlay.rasterizer import FARTHEST_DRAWN, Placed
from rrtik_ompl.sensing.cameras.camera import Camera

ROUNDING = 1e-3  # of a vertex's pixel in single precision, with what is folded into the matrix [pixels]


def reference_z_buffer(camera: Camera, figure: Placed) -> tuple[Matrix, NDArray[np.bool_]]:
    """Depths of a figure that lies before a camera without distortion, and where rounding may decide.

    A pixel belongs to a triangle if its centre does; triangles that are seen from inside are left out.

    Returns:
        Depth of the nearest triangle at every pixel's centre, `FARTHEST_DRAWN` if none, and whether that centre is
        within `ROUNDING` of an edge. Shapes (height, width).
    """
    depths = np.full((camera.height, camera.width), FARTHEST_DRAWN)
    doubtful = np.zeros((camera.height, camera.width), dtype=bool)
    points = figure.points.astype(np.float64)
    pixels = points[:, :2] / points[:, 2:] * np.diag(camera.matrix)[:2] + camera.matrix[:2, 2]
    for face in figure.faces:
        corners = pixels[face]
        low = np.maximum(np.ceil(corners.min(axis=0) - ROUNDING), 0).astype(int)
        high = np.minimum(np.floor(corners.max(axis=0) + ROUNDING), (camera.width - 1, camera.height - 1)).astype(int)
        edges = np.roll(corners, -1, axis=0) - corners
        area = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
        if area >= 0.0 or (high < low).any():  # seen from inside, for pixels have y downwards; or between pixels
            continue
        u, v = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        inwards = [edge[1] * (u - at[0]) - edge[0] * (v - at[1]) for edge, at in zip(edges, corners, strict=True)]
        away = np.stack(inwards) / np.linalg.norm(edges, axis=1)[:, None, None]
        box = np.s_[low[1] : high[1] + 1, low[0] : high[0] + 1]
        doubtful[box] |= np.abs(away.min(axis=0)) < ROUNDING
        shares = np.roll(np.stack(inwards), -1, axis=0) / -area  # of the corner that lies opposite to the edge
        depth = 1.0 / np.tensordot(1.0 / points[face, 2], shares, axes=1)
        inside = (away >= 0.0).all(axis=0)
        depths[box] = np.where(inside, np.minimum(depths[box], depth), depths[box])
    return depths, doubtful
