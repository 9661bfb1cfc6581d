"""Angles of SO(2) unrolled onto a line, so that searches need not handle circles.

A search moves from the first start up to one turn to either side. Each goal has one image for each way round. Motions
are checked, and put into paths, in pieces of less than half a turn, which OMPL interpolates in the same direction.
"""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.units import wrapped

LONGEST = 0.75 * np.pi  # [rad] largest turn in a piece of a motion
MOST_GOALS = 64  # limit of the images of all goals


def on_circles(q: Vector, turning: Mask) -> Vector:
    """Return q, shape (n,), with its angles in [-pi, pi]; angles that are in this range stay the same bit for bit."""
    beyond = turning & (np.abs(q) > np.pi)
    return np.where(beyond, wrapped(q), q) if beyond.any() else q


def near_image(q: Vector, base: Vector, turning: Mask) -> Vector:
    """Return q, shape (n,), with each angle moved by full turns until it is nearest to ``base``."""
    turns = np.round((q - base) / TAU) * TAU
    return np.where(turning & (turns != 0.0), q - turns, q)


def pieces(a: Vector, b: Vector, turning: Mask) -> Matrix:
    """Divide a straight motion from a to b into pieces in which no angle turns by more than `LONGEST`.

    Returns:
        Points of the motion, the first a and the last b, shape (k, n).
    """
    count = int(np.ceil(np.abs(b - a)[turning].max(initial=0.0) / LONGEST))
    if count < 2:
        return np.stack([a, b])

    points = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
    points[-1] = b
    return points


class Unrolled:
    """Starts and goals of one search on a line.

    Attributes:
        starts: Shape (s, n), each angle within half a turn of that of the first start.
        goals: Shape (g, n), first the nearest image of each goal, then those for the other ways round.

    Args:
        starts: Shape (s, n), s at least 1, angles in [-pi, pi].
        goals: Shape (g, n), angles in [-pi, pi].
        turning: Which coordinates are angles, shape (n,).
    """

    def __init__(self, starts: Matrix, goals: Matrix, turning: Mask) -> None:
        base = starts[0]
        self._turning = turning
        self._base = base
        self._end_of_image: dict[bytes, Vector] = {}

        self.starts = np.array([self._remember(self._near(row), row) for row in starts])
        images_per_goal = max(1, MOST_GOALS // max(len(goals), 1))
        images_of_goals = [
            [self._remember(row, goal) for row in self._images(goal)[:images_per_goal]] for goal in goals
        ]
        nearest = [image for images in images_of_goals for image in images[:1]]
        others = [image for images in images_of_goals for image in images[1:]]
        self.goals = np.array(nearest + others).reshape(-1, len(base))

    def bounds(self, lower: Vector, upper: Vector) -> tuple[Vector, Vector]:
        """Return the bounds of the search on the line, shapes (n,).

        They are the given ones, but for angles a turn to either side of the first start.
        """
        return (
            np.where(self._turning, self._base - TAU, lower),
            np.where(self._turning, self._base + TAU, upper),
        )

    def path(self, rows: Matrix) -> Matrix:
        """Return a path on the line, shape (k, n), as one whose angles turn the short way.

        Its ends are the given start and goal, bit for bit.
        """
        path = self.divided(rows)
        for end in (0, -1):
            path[end] = self._end_of_image.get(path[end].tobytes(), path[end])
        return path

    def divided(self, rows: Matrix) -> Matrix:
        """Divide a path on the line, shape (k, n), into pieces in which no angle turns by more than `LONGEST`."""
        return np.vstack([rows[:1], *(pieces(a, b, self._turning)[1:] for a, b in pairwise(rows))])

    def _remember(self, image: Vector, end: Vector) -> Vector:
        """Record the start or goal that an image belongs to, and return the image."""
        self._end_of_image[image.tobytes()] = end
        return image

    def _near(self, row: Vector) -> Vector:
        """Return the image of a row that is nearest to the first start, shape (n,)."""
        return near_image(row, self._base, self._turning)

    def _images(self, row: Vector) -> list[Vector]:
        """Return the images of a row within a turn of the first start, the nearest ones first.

        With many angles only the nearest image and those with one angle the other way round are returned.
        """
        nearest = self._near(row)
        turn_back = np.where(nearest > self._base, -TAU, TAU)
        axes = np.flatnonzero(self._turning)

        if 2 ** len(axes) <= MOST_GOALS:
            flips_of_images = [np.array(flips) for flips in product((False, True), repeat=len(axes))]
        else:
            flips_of_images = [np.zeros(len(axes), dtype=bool), *np.eye(len(axes), dtype=bool)]

        images = []
        for flips in flips_of_images:
            image = nearest.copy()
            image[axes[flips]] += turn_back[axes[flips]]
            images.append(image)

        return sorted(images, key=lambda image: float(np.linalg.norm(image - self._base)))
