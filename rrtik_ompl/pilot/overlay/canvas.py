"""Colours and depths of a picture, into which placed figures are drawn. OpenCV's rasteriser does the work.

The rasteriser takes an opening angle alone; focal lengths, the picture's centre and half a pixel go into the matrix.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.pilot.overlay.figure import Placed
from rrtik_ompl.sensing.cameras.camera import Camera

NEAREST_DRAWN = 0.05  # [m]
FARTHEST_DRAWN = 50.0  # [m]


class Canvas:
    """A picture that figures are drawn into, from the view of a camera.

    Attributes:
        colors: Red, green, blue from 0 to 1, of something else where nothing was drawn. Shape (height, width, 3).
        depths: Along the optical axis [m]; `FARTHEST_DRAWN` where nothing was drawn. Shape (height, width).
    """

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self._view, self._angle = _matrix(camera)
        self.colors: NDArray[np.float32] = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
        self.depths: NDArray[np.float32] = np.full((camera.height, camera.width), FARTHEST_DRAWN, dtype=np.float32)

    def clear(self) -> None:
        """Empty it again."""
        self.depths.fill(FARTHEST_DRAWN)

    @property
    def drawn(self) -> NDArray[np.bool_]:
        """Where something was drawn. Shape (height, width)."""
        return np.asarray(self.depths < 0.999 * FARTHEST_DRAWN)

    def draw(self, figure: Placed, both_sides: bool = False) -> None:
        """Draw a figure; what lies behind what is there already stays hidden.

        Args:
            figure: What to draw.
            both_sides: Draw triangles that are seen from inside, too: for surfaces that are not closed.
        """
        if len(figure.faces) == 0:
            return

        culling = cv2.RASTERIZE_CULLING_NONE if both_sides else cv2.RASTERIZE_CULLING_CW
        settings: Any = cv2.TriangleRasterizeSettings()
        settings = settings.setShadingType(cv2.RASTERIZE_SHADING_SHADED).setCullingMode(culling)

        points = np.ascontiguousarray(_bent(figure.points, self.camera), dtype=np.float32)
        rasterize: Any = cv2.triangleRasterize
        self.colors, self.depths = rasterize(
            points,
            figure.faces,
            figure.colors,
            self.colors,
            self.depths,
            self._view,
            self._angle,
            NEAREST_DRAWN,
            FARTHEST_DRAWN,
            settings,
        )


def half_as_fine(camera: Camera) -> Camera:
    """The same view with half as many pixels a side."""
    matrix = np.array(camera.matrix)
    matrix[:2, :2] *= 0.5
    matrix[:2, 2] = 0.5 * (matrix[:2, 2] + 0.5) - 0.5
    return Camera(matrix, (camera.width + 1) // 2, (camera.height + 1) // 2, camera.distortion)


def _matrix(camera: Camera) -> tuple[NDArray[np.float64], float]:
    """World to OpenGL's camera (y up, looking along -z), the intrinsics folded in, and the opening angle [rad]."""
    (fx, _, cx), (_, fy, cy), _ = camera.matrix

    fold = np.eye(4)
    fold[0, 0] = fx / fy
    fold[0, 2] = (cx + 0.5 - 0.5 * camera.width) / fy
    fold[1, 2] = (cy + 0.5 - 0.5 * camera.height) / fy
    return np.diag([1.0, -1.0, -1.0, 1.0]) @ fold, float(2.0 * np.arctan(0.5 * camera.height / fy))


def _bent(points: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Points moved aside so that a pinhole shows them where the lens does; edges between them stay straight."""
    if not camera.distortion.any():
        return points

    k1, k2, p1, p2, k3 = camera.distortion.astype(np.float32)
    depth = np.maximum(points[:, 2], NEAREST_DRAWN)
    x = points[:, 0] / depth
    y = points[:, 1] / depth
    square = np.minimum(x * x + y * y, 4.0)  # far outside the picture the polynomial turns back
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))

    bent = points.copy()
    bent[:, 0] = depth * (x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x))
    bent[:, 1] = depth * (y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y)
    return bent
