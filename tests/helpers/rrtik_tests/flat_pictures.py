"""Pictures of flat prints made by warping, which share no code with the rays of `synthetic_camera`."""

import cv2
import numpy as np

from rrtik_ompl.sensing.markers.dictionaries import marker_cells

FINE = 6  # pixels of the large picture in one of the small one, along each side
CELL = 24  # pixels of a cell in a print


def warped_picture(camera, prints, rng, noise=2.0):
    """A grey picture of markers seen by a camera without distortion, with noise [grey values].

    Args:
        camera: The camera.
        prints: Dictionary, number, side [m] and ``T_camera_marker`` of each; later ones cover earlier ones.
        rng: Of the noise.
        noise: Standard deviation.
    """
    assert camera.is_pinhole
    size = (camera.width * FINE, camera.height * FINE)
    picture = np.full(size[::-1], 120, np.uint8)
    grown = np.array([[FINE, 0, 0.5 * (FINE - 1)], [0, FINE, 0.5 * (FINE - 1)], [0, 0, 1.0]])
    for dictionary, number, side, pose in prints:
        cells = np.pad(marker_cells(dictionary, number), 1, constant_values=255)
        sheet = np.kron(cells, np.ones((CELL, CELL), np.uint8))
        # A pixel of the sheet is a point of the marker's plane: rows go down, its y goes up.
        metres = side / ((len(cells) - 2) * CELL)
        middle = 0.5 * (len(sheet) - 1)
        to_plane = np.array([[metres, 0, -metres * middle], [0, -metres, metres * middle], [0, 0, 1.0]])
        to_camera = np.column_stack([pose.rotation[:, :2], pose.translation])
        whole = grown @ camera.matrix @ to_camera @ to_plane
        cv2.warpPerspective(sheet, whole, size, picture, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT)

    small = cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(small, (0, 0), 0.5).astype(float)
    # From 8 bits of full scale to a print that is neither black nor white.
    light = 20.0 + 200.0 * blurred / 255.0 + noise * rng.standard_normal(blurred.shape)
    gray = np.clip(np.rint(light), 0, 255).astype(np.uint8)
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)
