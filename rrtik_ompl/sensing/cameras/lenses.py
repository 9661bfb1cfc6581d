"""Lens models: where a lens shows a point on the plane z = 1 of a pinhole, and the ray that it shows at a place there.

All conventions are OpenCV's. `PolynomialLens` is Brown's model [59] with five coefficients, or the rational one of
Claus and Fitzgibbon [83] with eight; `FisheyeLens` is that of Kannala and Brandt [84], which kalibr and ROS call
equidistant. It has a picture of points beside and behind the camera, too.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.sensing.cameras.models import Model

ORIGIN = np.zeros(3)
PINHOLE = np.eye(3)
MOST_STEPS = 30  # of Newton's method
LONGEST_STEP = 0.2  # on the plane z = 1, or [rad], so that none jumps over the fold of a lens
CONVERGED = 1e-12  # on the plane z = 1
_TINY = 1e-12  # least distance of a point from the axis, for divisions


class Lens(Protocol):
    """A lens model."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its coefficients."""
        ...

    def distorted(self, points: Matrix, coefficients: Vector) -> Matrix:
        """Return where points in the camera frame, shape (m, 3) [m], appear on the plane z = 1, shape (m, 2)."""
        ...

    def slopes(self, points: Matrix, coefficients: Vector) -> tuple[Matrix, Matrix]:
        """Return the slopes of these places by the points, shape (m, 2, 3), and by the coefficients, (m, 2, k)."""
        ...

    def directions(self, places: Matrix, coefficients: Vector) -> Matrix:
        """Return the directions of the points that appear at places, shape (m, 2); wrong where there are none."""
        ...

    def within_fold(self, directions: Matrix, coefficients: Vector) -> NDArray[np.bool_]:
        """Check that directions, shape (m, 3), lie within the fold, at which a strong lens model turns back."""
        ...


class PolynomialLens:
    """k1, k2, p1, p2, k3 of Brown; also k4, k5, k6 of the denominator of the rational model."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def distorted(self, points: Matrix, coefficients: Vector) -> Matrix:
        """Return the places of points; see `Lens`."""
        places, _ = cv2.projectPoints(points[:, None], ORIGIN, ORIGIN, PINHOLE, coefficients)
        return np.asarray(places, dtype=np.float64)[:, 0]

    def slopes(self, points: Matrix, coefficients: Vector) -> tuple[Matrix, Matrix]:
        """Return the slopes of places; see `Lens`."""
        _, slopes = cv2.projectPoints(points[:, None], ORIGIN, ORIGIN, PINHOLE, coefficients)
        both = np.asarray(slopes, dtype=np.float64).reshape(len(points), 2, -1)
        # OpenCV's columns: rotation, translation, fx and fy, cx and cy, coefficients.
        return both[:, :, 3:6], both[:, :, 10 : 10 + len(coefficients)]

    def directions(self, places: Matrix, coefficients: Vector) -> Matrix:
        """Return directions by Newton's method with bounded steps, from the ray of a lens without distortion."""
        rays = places.copy()
        with np.errstate(all="ignore"):  # a place that no ray reaches may lead anywhere
            for _ in range(MOST_STEPS if coefficients.any() else 0):
                found, (a, b, d) = self._bent(rays, coefficients)
                off = places - found
                if (np.abs(off) < CONVERGED).all():
                    break
                step = np.column_stack([d * off[:, 0] - b * off[:, 1], a * off[:, 1] - b * off[:, 0]])
                step /= (a * d - b * b)[:, None]
                rays += step * np.minimum(1.0, LONGEST_STEP / np.linalg.norm(step, axis=1))[:, None]
        return np.column_stack([rays, np.ones(len(rays))])

    def within_fold(self, directions: Matrix, coefficients: Vector) -> NDArray[np.bool_]:
        """Check that directions lie within the fold or the pole of the radial distortion; see `Lens`."""
        above, below = _fraction(coefficients)
        square = np.poly1d([1.0, 0.0])
        slope = above * below + 2.0 * square * (above.deriv() * below - above * below.deriv())  # of r above / below
        roots = np.concatenate([slope.roots, below.roots])
        turns = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
        return np.asarray(np.einsum("ni,ni->n", directions[:, :2], directions[:, :2]) < turns.min(initial=np.inf))

    @staticmethod
    def _bent(rays: Matrix, coefficients: Vector) -> tuple[Matrix, tuple[Vector, Vector, Vector]]:
        """Return the places of rays on the plane z = 1, shape (m, 2), and dx'/dx, dx'/dy = dy'/dx and dy'/dy."""
        above, below = _fraction(coefficients)
        _, _, p1, p2, _ = coefficients[:5]
        x, y = rays.T
        square = x * x + y * y
        factor = above(square) / below(square)
        slope = 2.0 * (above.deriv()(square) - factor * below.deriv()(square)) / below(square)

        bent_x = x * factor + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
        bent_y = y * factor + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
        xx = factor + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        xy = x * y * slope + 2.0 * (p1 * x + p2 * y)
        yy = factor + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        return np.column_stack([bent_x, bent_y]), (xx, xy, yy)


class FisheyeLens:
    """The angle t from the axis appears at the distance t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) from the middle."""

    names = ("k1", "k2", "k3", "k4")

    def distorted(self, points: Matrix, coefficients: Vector) -> Matrix:
        """Return the places of points; see `Lens`."""
        across = np.maximum(np.hypot(points[:, 0], points[:, 1]), _TINY)
        distance = _radial(coefficients)(np.arctan2(across, points[:, 2]))
        return np.asarray((distance / across)[:, None] * points[:, :2], dtype=np.float64)

    def slopes(self, points: Matrix, coefficients: Vector) -> tuple[Matrix, Matrix]:
        """Return the slopes of places; see `Lens`."""
        radial = _radial(coefficients)
        z = points[:, 2]
        across = np.maximum(np.hypot(points[:, 0], points[:, 1]), _TINY)
        angle = np.arctan2(across, z)
        outwards = points[:, :2] / across[:, None]
        square = across**2 + z**2

        # Outwards a place moves as the angle does, sideways as the point does about the axis.
        along = radial.deriv()(angle) / square
        aside = radial(angle) / across
        both = outwards[:, :, None] * outwards[:, None]
        in_plane = (along * z)[:, None, None] * both + aside[:, None, None] * (np.eye(2) - both)
        in_depth = -(along * across)[:, None] * outwards

        powers = angle[:, None] ** (3.0 + 2.0 * np.arange(len(coefficients)))
        return np.dstack([in_plane, in_depth]), outwards[:, :, None] * powers[:, None]

    def directions(self, places: Matrix, coefficients: Vector) -> Matrix:
        """Return directions, at most opposite to the camera's, by Newton's method with bounded steps; see `Lens`."""
        radial = _radial(coefficients)
        distance = np.hypot(places[:, 0], places[:, 1])
        angle = distance.copy()
        with np.errstate(all="ignore"):  # a place that no ray reaches may lead anywhere
            for _ in range(MOST_STEPS):
                off = distance - radial(angle)
                if (np.abs(off) < CONVERGED).all():
                    break
                step = np.clip(off / radial.deriv()(angle), -LONGEST_STEP, LONGEST_STEP)
                angle = np.clip(angle + step, 0.0, np.pi)

        outwards = places / np.maximum(distance, _TINY)[:, None]
        return np.column_stack([np.sin(angle)[:, None] * outwards, np.cos(angle)])

    def within_fold(self, directions: Matrix, coefficients: Vector) -> NDArray[np.bool_]:
        """Check that directions lie within the angle at which the distance no longer grows; see `Lens`."""
        roots = _radial(coefficients).deriv().roots
        turns = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
        angle = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])
        return np.asarray(angle < turns.min(initial=np.inf))


def _fraction(coefficients: Vector) -> tuple[np.poly1d, np.poly1d]:
    """Return numerator and denominator of a polynomial lens's radial factor, in the square of the radius."""
    k1, k2, _, _, k3, k4, k5, k6 = np.pad(coefficients, (0, 8 - len(coefficients)))
    return np.poly1d([k3, k2, k1, 1.0]), np.poly1d([k6, k5, k4, 1.0])


def _radial(coefficients: Vector) -> np.poly1d:
    """Return a fisheye's distance from the middle, in the angle."""
    k1, k2, k3, k4 = coefficients
    return np.poly1d([k4, 0.0, k3, 0.0, k2, 0.0, k1, 0.0, 1.0, 0.0])


LENSES: MappingProxyType[str, Lens] = MappingProxyType(
    {
        Model.brown.value: PolynomialLens("k1", "k2", "p1", "p2", "k3"),
        Model.rational.value: PolynomialLens("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
        Model.fisheye.value: FisheyeLens(),
    }
)
