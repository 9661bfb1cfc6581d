"""What the lens bends within a marker: a homography keeps straight lines straight.

Alignment fits bends along with the homography (`corner_spread`), so that of the lens the homography's part is left.
"""

from __future__ import annotations

import cv2
import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners

_PLACES = 9  # in a row, on the marker and its rim, at which the lens is looked at
_OF_HOMOGRAPHIES = 8  # of the motions that are fitted; the others are the bends that alignment fits, too
_RIM = 1.1  # of the marker's side, with its rim


def lens_bend(camera: Camera, corners: Matrix, side: float) -> Matrix:
    """How far the corners of an aligned marker lie off, because the lens is not a homography [pixels]. Shape (4, 2).

    Args:
        camera: Of the picture.
        corners: Of the marker, shape (4, 2) [pixels].
        side: Of the marker [m].
    """
    if not camera.distortion.any():
        return np.zeros((4, 2))

    at = pose_of_square(camera, corners, side).T_camera_object
    row = 0.5 * _RIM * side * np.linspace(-1.0, 1.0, _PLACES)
    x, y = (each.ravel() for each in np.meshgrid(row, row))
    flat = np.c_[x, y]

    square = square_corners(side)
    pixels = camera.project(np.c_[flat, np.zeros(len(flat))] @ at.rotation.T + at.translation)

    homography, _ = cv2.findHomography(flat, pixels, 0)
    back = cv2.perspectiveTransform(np.ascontiguousarray(pixels)[:, None], np.linalg.inv(homography))[:, 0]

    # What the lens adds to a homography, as small motions on the marker.
    scale = 0.5 * side
    shift, *_ = np.linalg.lstsq(np.vstack(_motions(flat / scale)), (back - flat).T.ravel(), rcond=None)

    # Alignment takes the bends among them for bends, and only the others move its corners.
    on_marker = square[:, :2] / scale
    moved = square[:, :2] + np.stack([part[:, :_OF_HOMOGRAPHIES] @ shift[:_OF_HOMOGRAPHIES]
                                      for part in _motions(on_marker)], axis=1)  # fmt: skip

    straight = cv2.perspectiveTransform(moved[:, None].copy(), homography)[:, 0]
    return np.asarray(straight - camera.project(square @ at.rotation.T + at.translation), dtype=np.float64)


def _motions(places: Matrix) -> tuple[Matrix, Matrix]:
    """Small motions of a plane, x and y by themselves: those of homographies, then four bends. Shapes (m, 12)."""
    u, v = places.T
    none = np.zeros(len(u))
    one = np.ones(len(u))

    along = [one, u, v, none, none, none, u * u, u * v, v * v, none, u * u, u * v]
    across = [none, none, none, one, u, v, u * v, v * v, none, u * u, -u * v, -v * v]

    return np.stack(along, axis=1), np.stack(across, axis=1)
