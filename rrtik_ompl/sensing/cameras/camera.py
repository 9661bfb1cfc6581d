"""A pinhole camera with lens distortion, which converts points to pixels and back. Immutable."""

from __future__ import annotations

import os
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, finite_number, frozen
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.kinds import read, write

ORIGIN = np.zeros(3)
MOST_STEPS = 30  # of Newton's method
LONGEST_STEP = 0.2  # on the plane z = 1, so that none jumps over the fold of a lens
CONVERGED = 1e-12  # on the plane z = 1
MOST_MISSED = 0.01  # pixels by which a ray may miss its pixel


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics of a camera in OpenCV's conventions: integer coordinates are at the centre of a pixel.

    Attributes:
        matrix: Camera matrix with fx, fy, cx, cy in pixels, shape (3, 3); skew is not modelled and must be 0.
        distortion: Brown's k1, k2, p1, p2, k3 [59], shape (5,).
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.
        sigmas: Standard deviations of fx, fy, cx, cy [pixels] and of the five distortion coefficients, shape (9,);
            0 where the calibration gives none.
        tone: How the camera codes light as grey values (`markers.lighting`); None to estimate it for each marker.

    Example:
        >>> camera = rrtik.sensing.Camera([[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]], 640, 480)
        >>> camera.project([[0.1, 0.0, 1.0]])
        array([[380., 240.]])
    """

    matrix: Matrix
    distortion: Vector
    width: int
    height: int
    sigmas: Vector
    tone: float | None

    __reduce__ = as_value

    def __init__(
        self,
        matrix: ArrayLike,
        width: float,
        height: float,
        distortion: ArrayLike = (0.0,) * 5,
        *,
        sigmas: ArrayLike = (0.0,) * 9,
        tone: float | None = None,
    ) -> None:
        """Check and copy the intrinsics.

        Raises:
            InputError: If the matrix is not that of a pinhole, a number is not finite, the size is not positive, or a
                standard deviation is negative.
        """
        given = finite_array(matrix, (3, 3), "camera matrix")
        expected = [[given[0, 0], 0.0, given[0, 2]], [0.0, given[1, 1], given[1, 2]], [0.0, 0.0, 1.0]]
        if not np.array_equal(given, expected) or given[0, 0] <= 0.0 or given[1, 1] <= 0.0:
            raise InputError("camera matrix must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0, no skew")
        sides = [finite_number(side, "camera size") for side in (width, height)]
        if any(side != int(side) or side < 1 for side in sides):
            raise InputError(f"camera size must be two positive whole numbers, got {width} x {height}")

        doubts = finite_array(sigmas, (9,), "camera sigmas")
        if (doubts < 0.0).any():
            raise InputError(f"camera sigmas must be 0 or more, got {doubts.min():g}")

        object.__setattr__(self, "matrix", frozen(given))
        object.__setattr__(self, "sigmas", frozen(doubts))
        object.__setattr__(self, "distortion", frozen(finite_array(distortion, (5,), "camera distortion")))
        object.__setattr__(self, "tone", None if tone is None else finite_number(tone, "camera tone"))
        object.__setattr__(self, "width", int(width))
        object.__setattr__(self, "height", int(height))

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the camera as YAML; if writing fails, no incomplete file is left.

        Raises:
            InputError: If the file cannot be written.
        """
        write(self, file)

    @staticmethod
    def load(file: str | os.PathLike[str]) -> Camera:
        """Read a camera file: our own format, or one of OpenCV, ROS (camera_info) or kalibr.

        Raises:
            InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
        """
        return read(Camera, file)

    def project(self, points: ArrayLike) -> Matrix:
        """Project points in the camera frame, shape (m, 3) [m], to pixels, shape (m, 2)."""
        rows = finite_array(points, (None, 3), "points to project")
        pixels, _ = cv2.projectPoints(rows[:, None], ORIGIN, ORIGIN, self.matrix, self.distortion)
        return np.asarray(pixels, dtype=np.float64)[:, 0]

    def rays(self, pixels: ArrayLike) -> Matrix:
        """Return where the rays of pixels, shape (m, 2), meet the plane z = 1 of the camera frame, shape (m, 2).

        Rows are NaN for pixels that no ray reaches. A strong lens model folds back at some distance from the axis:
        beyond its fold there is no picture, though the formula has values.
        """
        rows = finite_array(pixels, (None, 2), "pixels")
        if not self.distortion.any():
            return (rows - self.matrix[:2, 2]) / np.diag(self.matrix)[:2]

        # Newton's method with bounded steps, from the ray of a lens without distortion.
        bent = (rows - self.matrix[:2, 2]) / np.diag(self.matrix)[:2]
        rays = bent.copy()
        with np.errstate(all="ignore"):  # a pixel that no ray reaches may lead anywhere
            for _ in range(MOST_STEPS):
                found, (a, b, d) = _bent(rays, self.distortion)
                off = bent - found
                if (np.abs(off) < CONVERGED).all():
                    break
                step = np.column_stack([d * off[:, 0] - b * off[:, 1], a * off[:, 1] - b * off[:, 0]])
                step /= (a * d - b * b)[:, None]
                rays += step * np.minimum(1.0, LONGEST_STEP / np.linalg.norm(step, axis=1))[:, None]
            missed = np.abs(bent - _bent(rays, self.distortion)[0]) * np.diag(self.matrix)[:2]
            reached = (missed < MOST_MISSED).all(axis=1) & (np.einsum("ni,ni->n", rays, rays) < self._fold())
        rays[~reached] = np.nan
        return rays

    def _fold(self) -> float:
        """Return the square of the radius, on the plane z = 1, at which the radial distortion turns back."""
        k1, k2, _, _, k3 = self.distortion
        roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])  # derivative of r (1 + k1 r^2 + k2 r^4 + k3 r^6)
        turns = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
        return float(turns.min(initial=np.inf))

    def jacobian(self, points: ArrayLike, translation: ArrayLike) -> Matrix:
        """Return the Jacobian of the pixels of an object's points with respect to its pose, shape (2 m, 6).

        Args:
            points: Relative to the object's origin, in the axes of the camera (``R @ p_object``), shape (m, 3) [m].
            translation: Origin of the object in the camera frame, shape (3,) [m].

        Returns:
            d pixel / d (translation [m], small rotation about the axes of the camera [rad]).
        """
        rows = np.ascontiguousarray(points, dtype=np.float64)
        shift = np.ascontiguousarray(translation, dtype=np.float64)
        _, slopes = cv2.projectPoints(rows[:, None], ORIGIN, shift, self.matrix, self.distortion)
        return np.hstack([slopes[:, 3:6], slopes[:, :3]])

    def own_slopes(self, points: ArrayLike) -> Matrix:
        """Return the Jacobian of the pixels of points with respect to the intrinsics, shape (2 m, 9).

        Args:
            points: In the camera frame, shape (m, 3) [m].

        Returns:
            d pixel / d (fx, fy, cx, cy [pixels], k1, k2, p1, p2, k3).
        """
        rows = np.ascontiguousarray(points, dtype=np.float64)
        _, slopes = cv2.projectPoints(rows[:, None], ORIGIN, ORIGIN, self.matrix, self.distortion)
        return np.asarray(slopes[:, 6:15], dtype=np.float64)

    def doubt(self, points: ArrayLike) -> Matrix:
        """Return the covariance of the pixels of points that results from `sigmas`, shape (2 m, 2 m) [pixels^2]."""
        each = self.own_slopes(points) * self.sigmas
        return np.asarray(each @ each.T, dtype=np.float64)


def _bent(rays: Matrix, distortion: Vector) -> tuple[Matrix, tuple[Vector, Vector, Vector]]:
    """Return where a lens bends rays to by Brown's formula [59], on the plane z = 1, shape (m, 2), and its slopes.

    The slopes are dx'/dx, dx'/dy = dy'/dx and dy'/dy, shape (m,) each.
    """
    k1, k2, p1, p2, k3 = distortion
    x, y = rays.T
    square = x * x + y * y
    factor = 1.0 + square * (k1 + square * (k2 + square * k3))
    slope = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))

    bent_x = x * factor + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
    bent_y = y * factor + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
    xx = factor + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
    xy = x * y * slope + 2.0 * (p1 * x + p2 * y)
    yy = factor + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
    return np.column_stack([bent_x, bent_y]), (xx, xy, yy)
