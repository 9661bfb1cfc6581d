"""Detected objects drawn into the picture: outlines, numbers, axes and the uncertainty of their poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.sight import Sighting

GOOD, DOUBTFUL, REFUSED = (80, 200, 60), (0, 170, 255), (60, 60, 230)  # blue, green, red
AXES = ((0, 0, 255), (0, 200, 0), (255, 80, 0))  # x red, y green, z blue


def annotated(
    picture: NDArray[np.uint8], camera: Camera, sightings: Sequence[Sighting], axis_length: float = 0.06
) -> NDArray[np.uint8]:
    """A copy of a picture with every detected object. Shape (height, width, 3).

    Args:
        picture: Shape (height, width) or (height, width, 3).
        camera: Of the picture.
        sightings: From `detect_objects`.
        axis_length: Of the drawn frames [m].
    """
    drawn: Any = np.array(picture if picture.ndim == 3 else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    for each in sightings:
        colour = REFUSED if each.refused else DOUBTFUL if each.pose.ambiguous else GOOD
        for marker in each.markers:
            outline = np.rint(16.0 * marker.corners).astype(np.int32)
            cv2.polylines(drawn, [outline[:, None]], True, colour, 2, cv2.LINE_AA, 4)
        _draw_axes(drawn, camera, each, axis_length)
        _write(drawn, _caption(each), np.vstack([m.corners for m in each.markers]), colour)

    return np.asarray(drawn, dtype=np.uint8)


def _caption(sight: Sighting) -> str:
    if sight.refused:
        return f"{sight.object.name}: {sight.refused}"
    distance = float(np.linalg.norm(sight.pose.T_camera_object.translation))
    doubt = ", two poses fit" if sight.pose.ambiguous else ""
    return f"{sight.object.name} {distance:.3f} m +- {1e3 * sight.pose.position_sigma:.1f} mm{doubt}"


def _draw_axes(drawn: NDArray[np.uint8], camera: Camera, sight: Sighting, length: float) -> None:
    pose = sight.pose.T_camera_object
    tips = np.vstack([np.zeros(3), length * np.eye(3)]) @ pose.rotation.T + pose.translation
    if (tips[:, 2] <= 0.01).any():
        return

    pixels = np.clip(np.rint(16.0 * camera.project(tips)), -(2**20), 2**20).astype(int)
    for k, colour in enumerate(AXES):
        cv2.line(drawn, tuple(pixels[0]), tuple(pixels[k + 1]), colour, 2, cv2.LINE_AA, 4)


def _write(drawn: NDArray[np.uint8], text: str, corners: NDArray[np.float64], colour: tuple[int, int, int]) -> None:
    """A caption below the markers, inside the picture, on a dark ground."""
    height, width = drawn.shape[:2]
    (wide, high), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    x = int(np.clip(corners[:, 0].min(), 2, max(width - wide - 4, 2)))
    y = int(np.clip(corners[:, 1].max() + high + 10, high + 4, height - below - 2))

    cv2.rectangle(drawn, (x - 2, y - high - 3), (x + wide + 2, y + below), (30, 30, 30), -1)
    cv2.putText(drawn, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)
