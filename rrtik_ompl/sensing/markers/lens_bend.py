"""What the lens bends within a marker: a homography, by which a marker is aligned, keeps straight lines straight."""

from __future__ import annotations

import cv2
import numpy as np

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners

_PLACES = 9  # in a row, on the marker and its rim, at which the lens is looked at
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
    flat, square = np.c_[x, y], square_corners(side)
    pixels = camera.project(np.c_[flat, np.zeros(len(flat))] @ at.rotation.T + at.translation)
    homography, _ = cv2.findHomography(flat, pixels, 0)
    straight = cv2.perspectiveTransform(square[:, None, :2].copy(), homography)[:, 0]
    return np.asarray(straight - camera.project(square @ at.rotation.T + at.translation), dtype=np.float64)
