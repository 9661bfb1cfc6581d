"""Pictures of printed squares as a camera would take them, with poses that are known exactly.

Every photosite is the mean of the rays through it; then blur, light, noise and rounding to 8 bits. No real camera is
better than that, most are worse: what fails here fails under water too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.sensing.cameras.camera import Camera

PUBLISHED_MATRIX = ((877.6915, 0.0, 320.6451), (0.0, 869.8953, 242.8119), (0.0, 0.0, 1.0))
BLACK, WHITE, GREY = 0.12, 0.85, 0.55  # of full scale: ink, paper, what is behind
FEW_RAYS = 3  # through a photosite, squared: as many are kept from picture to picture


@dataclass(frozen=True, slots=True, eq=False)
class Print:
    """A flat print: cells of grey, the middle of the sheet at its origin, x right, y up, z out of it.

    Attributes:
        cells: Brightness of each cell, 0 to 255. Shape (rows, columns).
        cell: Side of a cell [m].
    """

    cells: NDArray[np.uint8]
    cell: float

    @property
    def half(self) -> Matrix:
        """Half width and half height [m]. Shape (2,)."""
        rows, columns = self.cells.shape
        return 0.5 * self.cell * np.array([columns, rows])


def marker_print(cells: NDArray[np.uint8], side: float) -> Print:
    """A marker of a given side [m] with a white rim of one cell."""
    return Print(np.pad(cells, 1, constant_values=255), side / len(cells))


def published_camera(distortion: Sequence[float] = (0.0,) * 5) -> Camera:
    """The camera of the experiments in [1, ch. 4]: 640 x 480."""
    return Camera(PUBLISHED_MATRIX, 640, 480, distortion)


def clean_picture(
    camera: Camera,
    prints: Sequence[tuple[pin.SE3, Print]],
    rays: int = 10,
    behind: float | NDArray[np.float32] = GREY,
) -> NDArray[np.float32]:
    """Prints in the picture of an ideal camera. Shape (height, width), 0 to 1.

    Args:
        camera: The camera.
        prints: Pairs of ``T_camera_print`` and the print; later ones cover earlier ones.
        rays: Through each photosite, squared.
        behind: Brightness of what is behind, one number or a picture.
    """
    picture = np.full((camera.height, camera.width), behind, dtype=np.float32)
    for pose, sheet in prints:
        _draw(picture, camera, pose, sheet, rays)
    return picture


def photograph(
    clean: NDArray[np.float32],
    rng: np.random.Generator,
    *,
    noise: float = 0.01,
    blur: float = 0.6,
    gradient: float = 0.0,
    flicker: float = 0.0,
    motion: float = 0.0,
    jpeg: int | None = None,
) -> NDArray[np.uint8]:
    """The picture of a real sensor, made from an ideal one.

    Args:
        clean: From `clean_picture`.
        rng: Of the noise.
        noise: Standard deviation, of full scale.
        blur: Standard deviation of the lens's spot [pixels].
        gradient: Share of the light that is lost from left to right.
        flicker: Standard deviation of the brightness from picture to picture.
        motion: Length of a blur along x [pixels].
        jpeg: Quality of a compression, or None.
    """
    picture = clean * (np.float32(1.0) - np.float32(gradient) * np.linspace(0.0, 1.0, clean.shape[1], dtype=np.float32))
    if blur > 0.0:
        picture = cv2.GaussianBlur(picture, (0, 0), blur)
    if motion >= 1.0:
        picture = cv2.blur(picture, (round(motion), 1))

    grain = rng.standard_normal(picture.shape, dtype=np.float32)
    picture = picture * np.float32(1.0 + flicker * rng.standard_normal()) + np.float32(noise) * grain

    taken: NDArray[np.uint8] = np.clip(np.rint(np.float32(255.0) * picture), 0, 255).astype(np.uint8)
    if jpeg is None:
        return taken

    _, packed = cv2.imencode(".jpg", taken, [cv2.IMWRITE_JPEG_QUALITY, jpeg])
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def _draw(picture: NDArray[np.float32], camera: Camera, pose: pin.SE3, sheet: Print, rays: int) -> None:
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * sheet.half
    around = np.c_[corners, np.zeros(4)] @ pose.rotation.T + pose.translation
    if (around[:, 2] <= 0.0).any():
        return

    pixels = camera.project(around)
    left, top = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 3, 0)
    right, bottom = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 4, (camera.width, camera.height))

    brightness = (BLACK + (WHITE - BLACK) * sheet.cells / 255.0).astype(np.float32)
    for row in range(top, bottom if right > left else top):  # one row of photosites at a time, for the memory's sake
        if rays <= FEW_RAYS:
            through_row = _rays_of_row(camera, row, rays)[:, left * rays : right * rays].reshape(-1, 2)
        else:
            through_row = _rays(camera, row, left, right, rays)
        seen = _seen(through_row, pose, sheet, brightness)

        # What rays miss stays as it was drawn before.
        seen = seen.reshape(rays, right - left, rays)
        share = np.isfinite(seen).mean(axis=(0, 2))
        picture[row, left:right] = np.nansum(seen, axis=(0, 2)) / rays**2 + (1.0 - share) * picture[row, left:right]


def _rays(camera: Camera, row: int, left: int, right: int, rays: int) -> Matrix:
    """Where the rays through some photosites of a row meet the plane z = 1, line by line. Shape (m, 2)."""
    within = (np.arange(rays) + 0.5) / rays - 0.5
    u, v = np.meshgrid((np.arange(left, right)[:, None] + within).ravel(), row + within)
    return camera.rays(np.c_[u.ravel(), v.ravel()])


@lru_cache(maxsize=1024)
def _rays_of_row(camera: Camera, row: int, rays: int) -> NDArray[np.float64]:
    """The same of a whole row, shape (rays, width times rays, 2): the lens takes most of the time of a picture."""
    return _rays(camera, row, 0, camera.width, rays).reshape(rays, -1, 2)


def _seen(rays: Matrix, pose: pin.SE3, sheet: Print, brightness: NDArray[np.float32]) -> NDArray[np.float32]:
    """Brightness of the print where rays meet it, NaN where they miss it. Shape (m,)."""
    directions = np.c_[rays, np.ones(len(rays))]
    normal = pose.rotation[:, 2]
    with np.errstate(divide="ignore"):
        depth = (normal @ pose.translation) / (directions @ normal)
    points = (directions * depth[:, None] - pose.translation) @ pose.rotation

    column = np.floor((points[:, 0] + sheet.half[0]) / sheet.cell)
    row = np.floor((sheet.half[1] - points[:, 1]) / sheet.cell)
    rows, columns = sheet.cells.shape

    hit = (depth > 0.0) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    value = np.full(len(rays), np.nan, dtype=np.float32)
    value[hit] = brightness[row[hit].astype(int), column[hit].astype(int)]
    return value
