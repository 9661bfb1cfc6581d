"""Shapes that are unions of many boxes along the axes of one frame, each of which is checked and proven like a box."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import at_most
from rrtik_ompl.model.shapes.shape import Shape
from rrtik_ompl.model.shapes.surfaces import Triangles, extruded

MOST_BOXES = 20_000
ONE = extruded(np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]), 1.0)  # a cube of side 1


class BoxPile(Shape):
    """A union of boxes."""

    __slots__ = ()
    movable = False

    @property
    @abstractmethod
    def boxes(self) -> tuple[Matrix, Matrix]:
        """Centres and full side lengths of the boxes [m], shape (n, 3) each."""

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest corner from the origin [m]."""
        centres, sizes = self.boxes
        return float(np.linalg.norm(np.abs(centres) + 0.5 * sizes, axis=1).max())

    def surface(self) -> Triangles:
        """Return the sides of all boxes as triangles."""
        return surface_of_boxes(*self.boxes)


def surface_of_boxes(centres: Matrix, sizes: Matrix) -> Triangles:
    """Return the sides of boxes as triangles, from their centres and full side lengths, shape (n, 3) each."""
    corners = centres[:, None] + ONE.vertices * sizes[:, None]
    faces = ONE.faces + len(ONE.vertices) * np.arange(len(centres))[:, None, None]
    return Triangles(corners.reshape(-1, 3), faces.reshape(-1, 3))


def few_enough(count: int, what: str, remedy: str) -> None:
    """Refuse more boxes than a scene can hold.

    Raises:
        InputError: The message ends with the remedy.
    """
    at_most(count, MOST_BOXES, f"{what}: boxes", remedy)


def merged(heights: Matrix) -> NDArray[np.int64]:
    """Divide a grid into rectangles of equal numbers; NaN is in none of them.

    Runs of equal numbers within rows are found first, then equal runs in consecutive rows are merged.

    Returns:
        First row, end row, first column and end column of each rectangle, shape (n, 4); the ends are exclusive.
    """
    done: list[tuple[int, int, int, int]] = []
    open_: dict[tuple[int, int, float], int] = {}
    for row, numbers in enumerate([*heights, np.full(heights.shape[1], np.nan)]):
        ends = np.flatnonzero(np.diff(numbers) != 0.0) + 1  # NaN differs from every number, also from itself
        starts = np.concatenate([[0], ends]).tolist()
        known = zip(starts, [*ends.tolist(), len(numbers)], numbers[starts].tolist(), strict=True)
        now = {(a, b, height): open_.get((a, b, height), row) for a, b, height in known if height == height}
        done += [(first, row, a, b) for (a, b, height), first in open_.items() if (a, b, height) not in now]
        open_ = now
    return np.array(done, dtype=np.int64).reshape(-1, 4)
