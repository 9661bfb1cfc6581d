"""A virtual camera: the view from outside, turned and zoomed by the pilot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.colors import fractions
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.viewer.drawing import palette


def pinhole_camera(width: int = 640, height: int = 480, opening: float = np.deg2rad(45.0)) -> Camera:
    """Return a camera without distortion and with a vertical opening angle [rad]."""
    focal = 0.5 * height / float(np.tan(0.5 * opening))
    matrix = [[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]]
    return Camera(matrix, width, height)


def orbit_pose(centre: ArrayLike, distance: float, azimuth: float, elevation: float) -> pin.SE3:
    """Return ``T_world_camera`` of a camera that looks at a point, with the world's z axis upwards in the picture.

    Args:
        centre: The point, shape (3,) [m].
        distance: Distance of the camera from it [m].
        azimuth: Direction of the camera seen from the centre, from the x axis towards y [rad].
        elevation: Angle above the horizon [rad]; for a view straight down, the azimuth defines the picture's right.
    """
    level = np.cos(elevation)
    back = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    down = np.cross(-back, right)
    return pin.SE3(np.stack([right, down, -back], 1), np.asarray(centre) + distance * back)


def background(camera: Camera) -> NDArray[np.uint8]:
    """Return a pale background with a vertical gradient, shape (height, width, 3), blue, green, red."""
    ends = np.array([fractions(c)[::-1] for c in (palette.BACKGROUND_TOP, palette.BACKGROUND_BOTTOM)])

    share = np.linspace(0.0, 1.0, camera.height)[:, None]
    rows = np.rint(255.0 * ((1.0 - share) * ends[0] + share * ends[1])).astype(np.uint8)
    return np.repeat(rows[:, None], camera.width, axis=1)
