"""A camera with a lens model, which converts points to pixels and back. Immutable."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, finite_number, frozen, not_negative
from rrtik_ompl.base.copies import as_value, set_fields
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.files.kinds import read, write
from rrtik_ompl.sensing.cameras.lenses import LENSES

MOST_MISSED = 0.01  # pixels by which a ray may miss its pixel
_NEAREST_DEPTH = 1e-3  # of a direction of length 1, in the view of a pinhole to the middle of all
_ROUNDED = 1e-6  # error of correlations that are written to files


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics of a camera in OpenCV's conventions: integer coordinates are at the centre of a pixel.

    Attributes:
        matrix: Camera matrix with fx, fy, cx, cy in pixels, shape (3, 3); skew is not modelled and must be 0.
        distortion: Coefficients of the lens, shape (k,): Brown's k1, k2, p1, p2, k3 [59]; of the rational model [83]
            also k4, k5, k6; of a fisheye k1, k2, k3, k4 of Kannala and Brandt [84].
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.
        sigmas: Standard deviations of fx, fy, cx, cy [pixels] and of the distortion coefficients, shape (4 + k,);
            0 where the calibration gives none.
        tone: How the camera codes light as grey values (`markers.lighting`); None to estimate it for each marker.
        lens: The lens model: "brown", "rational" or "fisheye".
        correlation: Correlations of the errors whose standard deviations are ``sigmas``, shape (4 + k, 4 + k).
        readout: Time from the first row of a picture to the last one [s]; 0 for all rows at once (global shutter).

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
    lens: str
    correlation: Matrix
    readout: float

    __reduce__ = as_value

    def __init__(
        self,
        matrix: ArrayLike,
        width: float,
        height: float,
        distortion: ArrayLike | None = None,
        *,
        sigmas: ArrayLike | None = None,
        tone: float | None = None,
        lens: str = "brown",
        correlation: ArrayLike | None = None,
        readout: float = 0.0,
    ) -> None:
        """Check and copy the intrinsics.

        Args:
            matrix: See `Camera`.
            width: See `Camera`.
            height: See `Camera`.
            distortion: None for a lens whose coefficients are 0.
            sigmas: None if nothing is uncertain.
            tone: See `Camera`.
            lens: See `Camera`.
            correlation: None if the errors are independent.
            readout: See `Camera`.

        Raises:
            InputError: If the matrix is not that of a pinhole, a number is not finite, the size is not positive, there
                is no such lens model, it has another number of coefficients, a standard deviation or the readout
                is negative, or the correlations are none.
        """
        given = finite_array(matrix, (3, 3), "camera matrix")
        expected = [[given[0, 0], 0.0, given[0, 2]], [0.0, given[1, 1], given[1, 2]], [0.0, 0.0, 1.0]]
        if not np.array_equal(given, expected) or given[0, 0] <= 0.0 or given[1, 1] <= 0.0:
            raise InputError("camera matrix must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0, no skew")
        sides = [finite_number(side, "camera size") for side in (width, height)]
        if any(side != int(side) or side < 1 for side in sides):
            raise InputError(f"camera size must be two positive whole numbers, got {width} x {height}")

        if not isinstance(lens, str) or lens not in LENSES:
            raise UnknownNameError("lens model", lens, LENSES)
        count = len(LENSES[lens].names)
        coefficients = finite_array(
            np.zeros(count) if distortion is None else distortion, (count,), "camera distortion"
        )
        doubts = finite_array(np.zeros(4 + count) if sigmas is None else sigmas, (4 + count,), "camera sigmas")
        if (doubts < 0.0).any():
            raise InputError(f"camera sigmas must be 0 or more, got {doubts.min():g}")

        set_fields(
            self,
            matrix=frozen(given),
            distortion=frozen(coefficients),
            width=int(width),
            height=int(height),
            sigmas=frozen(doubts),
            tone=None if tone is None else finite_number(tone, "camera tone"),
            lens=lens,
            correlation=frozen(np.eye(4 + count) if correlation is None else _correlations(correlation, 4 + count)),
            readout=not_negative(readout, "camera readout"),
        )

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

    @property
    def is_pinhole(self) -> bool:
        """Whether straight lines are straight in its pictures."""
        return self.lens != "fisheye" and not self.distortion.any()

    def project(self, points: ArrayLike) -> Matrix:
        """Project points in the camera frame, shape (m, 3) [m], to pixels, shape (m, 2)."""
        return self._pixels(self.distorted(finite_array(points, (None, 3), "points to project")))

    def distorted(self, points: Matrix) -> Matrix:
        """Return where points in the camera frame, shape (m, 3) [m], appear on the plane z = 1, shape (m, 2)."""
        return LENSES[self.lens].distorted(np.ascontiguousarray(points, dtype=np.float64), self.distortion)

    def directions(self, pixels: Matrix) -> Matrix:
        """Return the directions that pixels show, shape (m, 3): of any length, and wrong where there is no ray."""
        places = (np.asarray(pixels, dtype=np.float64) - self.matrix[:2, 2]) / self._focal
        return LENSES[self.lens].directions(places, self.distortion)

    def seen_by_pinhole(self, pixels: Matrix) -> tuple[Matrix, Matrix]:
        """Return a view from the camera's place to the middle of pixels, and what a pinhole that looks there sees.

        Returns:
            ``R_camera_view``, and the pixels' rays on the plane z = 1 of the view, shape (m, 2).
        """
        directions = self.directions(pixels)
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        view: Matrix = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), directions.mean(axis=0)).matrix()
        turned = directions @ view
        return view, turned[:, :2] / np.maximum(turned[:, 2:], _NEAREST_DEPTH)

    def rays(self, pixels: ArrayLike) -> Matrix:
        """Return where the rays of pixels, shape (m, 2), meet the plane z = 1 of the camera frame, shape (m, 2).

        Rows are NaN for pixels that no ray reaches. A strong lens model folds back at some distance from the axis:
        beyond its fold there is no picture, though the formula has values. Neither do rays of a fisheye meet that plane
        which are a right angle or more from the axis.
        """
        rows = finite_array(pixels, (None, 2), "pixels")
        directions = self.directions(rows)
        with np.errstate(all="ignore"):  # a pixel that no ray reaches may have any direction
            rays = np.asarray(directions[:, :2] / directions[:, 2:], dtype=np.float64)
            if self.is_pinhole:
                return rays
            missed = np.abs(rows - self._pixels(self.distorted(np.nan_to_num(directions))))
            reached = (missed < MOST_MISSED).all(axis=1) & (directions[:, 2] > 0.0)
            reached &= LENSES[self.lens].within_fold(directions, self.distortion)
        rays[~reached] = np.nan
        return rays

    def jacobian(self, points: ArrayLike, translation: ArrayLike) -> Matrix:
        """Return the Jacobian of the pixels of an object's points with respect to its pose, shape (2 m, 6).

        Args:
            points: Relative to the object's origin, in the axes of the camera (``R @ p_object``), shape (m, 3) [m].
            translation: Origin of the object in the camera frame, shape (3,) [m].

        Returns:
            d pixel / d (translation [m], small rotation about the axes of the camera [rad]).
        """
        rows = np.ascontiguousarray(points, dtype=np.float64)
        by_point, _ = LENSES[self.lens].slopes(rows + np.asarray(translation, dtype=np.float64), self.distortion)
        shifts = self._focal[:, None] * by_point
        turns = np.cross(
            rows[:, None], shifts
        )  # a small rotation w moves a point p by w x p, and g (w x p) = (p x g) w
        return np.concatenate([shifts, turns], axis=2).reshape(-1, 6)

    def own_slopes(self, points: ArrayLike) -> Matrix:
        """Return the Jacobian of the pixels of points with respect to the intrinsics, shape (2 m, 4 + k).

        Args:
            points: In the camera frame, shape (m, 3) [m].

        Returns:
            d pixel / d (fx, fy, cx, cy [pixels], coefficients of the lens).
        """
        rows = np.ascontiguousarray(points, dtype=np.float64)
        _, by_coefficient = LENSES[self.lens].slopes(rows, self.distortion)
        by_focal = self.distorted(rows)[:, :, None] * np.eye(2)
        by_middle = np.broadcast_to(np.eye(2), by_focal.shape)
        slopes = np.concatenate([by_focal, by_middle, self._focal[:, None] * by_coefficient], axis=2)
        return np.asarray(slopes.reshape(2 * len(rows), -1), dtype=np.float64)

    def doubt(self, points: ArrayLike) -> Matrix:
        """Return the covariance of the pixels of points that results from `sigmas`, shape (2 m, 2 m) [pixels^2]."""
        each = self.own_slopes(points) * self.sigmas
        return np.asarray(each @ self.correlation @ each.T, dtype=np.float64)

    def lateness(self, pixels: Matrix) -> Vector:
        """Return how much later than the middle row the rows of pixels, shape (m, 2), are taken, shape (m,) [s]."""
        return np.asarray(self.readout * ((pixels[:, 1] + 0.5) / self.height - 0.5), dtype=np.float64)

    @property
    def _focal(self) -> Vector:
        """Focal lengths, shape (2,) [pixels]."""
        return self.matrix[[0, 1], [0, 1]]

    def _pixels(self, places: Matrix) -> Matrix:
        """Return the pixels of places on the plane z = 1, shape (m, 2)."""
        return np.asarray(places * self._focal + self.matrix[:2, 2], dtype=np.float64)


def _correlations(values: ArrayLike, count: int) -> Matrix:
    """Check correlations of that many errors.

    Raises:
        InputError: If they are not those of any errors.
    """
    found = finite_array(values, (count, count), "camera correlation")
    least = np.linalg.eigvalsh(0.5 * (found + found.T))[0]
    if np.abs(found - found.T).max() > _ROUNDED or np.abs(np.diag(found) - 1.0).max() > _ROUNDED or least < -_ROUNDED:
        raise InputError("camera correlation must be symmetric, with 1 on its diagonal and no negative eigenvalue")
    return found
