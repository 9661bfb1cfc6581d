"""Parts of bodies as the verifier of certificates has them: nodes of a tree that cuts make, with balls and boxes.

Points 3.3, 3.4, 7.1 and 7.3 of ``docs/science/certificate.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.elements import Elements

FEW_POINTS = 60_000  # elements of a body whose parts are remembered
MOST_KNOWN = 256  # bodies whose parts are
PRODUCTS_AT_ONCE = 2_000_000  # points times directions that are computed together


class Parts:
    """A body, divided into parts by cuts: the nodes of a tree, of which number 0 is the whole body.

    Attributes:
        elements: The elements of its shape.
        children: Both children of each node, -1 for leaves, shape (nodes, 2).
        spans: First and end of each node's elements in ``order``, shape (nodes, 2).
        order: The elements' numbers, those of each node together.
        bounded: Whether it has balls and boxes.
        low, high: Box around each node in the shape's frame, shape (nodes, 3) each [m].
        centres, radii: Ball around each node, shapes (nodes, 3) and (nodes,) [m].

    Raises:
        InputError: If a cut divides no leaf.
    """

    def __init__(self, elements: Elements, cuts: Sequence[tuple[int, int, float]]) -> None:
        self.elements = elements
        self.bounded = elements.known and elements.key != "half_space"
        points = elements.points
        half = 0.0 if elements.half is None else elements.half
        self.children = np.full((1 + 2 * len(cuts), 2), -1)
        self.spans = np.zeros((1 + 2 * len(cuts), 2), dtype=np.int64)
        self.spans[0, 1] = len(points)
        self.order = np.arange(len(points))

        # A single point of an element is its least and its greatest one, as in clouds and piles of boxes.
        several = points.shape[1] > 1
        least = points.min(axis=1) if several else points[:, 0]
        greatest = points.max(axis=1) if several else points[:, 0]
        middles = np.ascontiguousarray(0.5 * (least + greatest).T)
        for k, (node, axis, coordinate) in enumerate(cuts):
            if node > 2 * k or self.children[node, 0] >= 0:
                raise InputError(f"cut {k} of a body divides node {node}, which is no leaf")
            begin, end = self.spans[node].tolist()
            own = self.order[begin:end]
            below = middles[axis, own] < coordinate
            middle = begin + int(np.count_nonzero(below))
            self.order[begin:end] = np.concatenate([own[below], own[~below]])
            self.children[node] = 2 * k + 1, 2 * k + 2
            self.spans[2 * k + 1 : 2 * k + 3] = [[begin, middle], [middle, end]]

        self._reaches: dict[bytes, tuple[float, float]] = {}
        self._points = points[self.order]
        self._half = None if elements.half is None else elements.half[self.order]
        self._bound((least - half)[self.order], (greatest + half)[self.order])

    def _bound(self, least: Matrix, greatest: Matrix) -> None:
        """Put boxes and balls around all nodes (point 7.1)."""
        count = len(self.spans)
        thickness = self.elements.radius + self.elements.disc * np.array([1.0, 1.0, 0.0])
        around = self.elements.radius + self.elements.disc
        self.low = np.full((count, 3), np.inf)
        self.high = np.full((count, 3), -np.inf)
        self.radii = np.zeros(count)

        leaves = np.flatnonzero((self.children[:, 0] < 0) & ~self.empty)
        leaves = leaves[np.argsort(self.spans[leaves, 0])]
        starts = self.spans[leaves, 0]
        self.low[leaves] = np.minimum.reduceat(least, starts) - thickness
        self.high[leaves] = np.maximum.reduceat(greatest, starts) + thickness
        for node in range(count - 1, -1, -1):
            if self.children[node, 0] >= 0:
                self.low[node] = self.low[self.children[node]].min(axis=0)
                self.high[node] = self.high[self.children[node]].max(axis=0)
        with np.errstate(invalid="ignore"):
            self.centres = np.where(self.empty[:, None], 0.0, 0.5 * (self.low + self.high))

        owner = np.repeat(leaves, self.spans[leaves, 1] - starts)
        self.radii[leaves] = np.maximum.reduceat(self._distances(self.centres[owner]), starts) + around
        for node in range(count - 1, 0, -1):
            if self.children[node, 0] >= 0:
                own = self.children[node][~self.empty[self.children[node]]]
                steps = np.linalg.norm(self.centres[own] - self.centres[node], axis=1)
                self.radii[node] = (steps + self.radii[own]).max(initial=0.0)
        self.radii[0] = self._distances(self.centres[[0]]).max() + around

    def _distances(self, centres: Matrix) -> Vector:
        """Return how far the farthest point of each element is from a point, shape (elements, 3) or (1, 3)."""
        ways = np.abs(self._points - centres[:, None])
        if self._half is not None:
            ways = ways + self._half[:, None]
        squares = np.einsum("nkj,nkj->nk", ways, ways)
        return np.asarray(np.sqrt(squares.max(axis=1) if squares.shape[1] > 1 else squares[:, 0]))

    @cached_property
    def empty(self) -> Mask:
        """Which nodes have no element, shape (nodes,)."""
        return np.asarray(self.spans[:, 0] == self.spans[:, 1])

    def elements_of_leaves(self, chosen: Mask) -> NDArray[np.int64]:
        """Return the numbers of the elements of the leaves among some nodes, shape (nodes,)."""
        leaves = self.spans[chosen & (self.children[:, 0] < 0)].tolist()
        return np.concatenate([self.order[:0], *(self.order[begin:end] for begin, end in leaves)])

    def support(self, node: int, directions: Matrix) -> Vector:
        """Return the support function [m] of a node at unit vectors in the shape's frame, (n, 3) -> (n,)."""
        begin, end = self.spans[node].tolist()
        points = self._points[begin:end].reshape(-1, 3)
        half = None if self._half is None else self._half[begin:end]
        highest = np.full(len(directions), -np.inf)
        step = max(1, PRODUCTS_AT_ONCE // max(1, len(directions)))
        for first in range(0, len(points), step):
            heights = directions @ points[first : first + step].T
            if half is not None:
                heights += np.abs(directions) @ half[first : first + step].T
            highest = np.maximum(highest, heights.max(axis=1))
        sines = np.hypot(directions[:, 0], directions[:, 1])
        return np.asarray(highest + self.elements.disc * sines + self.elements.radius)

    def reaches(self, pose: Matrix, axis: Vector) -> tuple[float, float]:
        """Return how far points of the body are at most from the origin and from an axis of its joint's frame [m].

        The points of the elements are looked at; the disc and the radius around them are added.

        Args:
            pose: Pose of the shape in the joint's frame, shape (4, 4).
            axis: Unit vector, shape (3,).
        """
        key = pose.tobytes() + axis.tobytes()
        if key not in self._reaches:
            self._reaches[key] = self._largest_lengths(pose, axis)
        return self._reaches[key]

    def _largest_lengths(self, pose: Matrix, axis: Vector) -> tuple[float, float]:
        if not self.bounded:
            return np.inf, np.inf
        x, y, z = placed = pose[:3, :3] @ self._points.reshape(-1, 3).T + pose[:3, 3:]
        a, b, c = axis
        around = np.stack([b * z - c * y, c * x - a * z, a * y - b * x])
        thickness = self.elements.disc + self.elements.radius
        half = 0.0 if self._half is None else np.linalg.norm(self._half, axis=1)
        far, off = (float((np.sqrt((ways * ways).sum(axis=0)) + half).max()) for ways in (placed, around))
        return far + thickness, off + thickness


def is_remembered(elements: Elements) -> bool:
    """Whether what is made of a body is remembered: it is small, and its geometry has the same elements each time.

    Those of a pile of boxes are made anew each time.
    """
    return elements.half is None and len(elements.points) < FEW_POINTS


def parts_of(elements: Elements, cuts: Sequence[tuple[int, int, float]]) -> Parts:
    """Return the parts of a body; those of small ones, such as links, are remembered.

    Raises:
        InputError: If a cut divides no leaf.
    """
    return _known_parts(elements, tuple(cuts)) if is_remembered(elements) else Parts(elements, cuts)


@lru_cache(maxsize=MOST_KNOWN)
def _known_parts(elements: Elements, cuts: tuple[tuple[int, int, float], ...]) -> Parts:
    return Parts(elements, cuts)


def enclosed(own: NDArray[np.float64], placed: NDArray[np.float64], inside: Mask) -> Iterator[Vector]:
    """Yield a point of each connected part of a mesh that is wholly inside a box.

    Args:
        own: Corners of its triangles in its own frame, shape (n, 3, 3), by which triangles are connected.
        placed: The same corners in another frame.
        inside: Which triangles are inside the box, shape (n,).
    """
    if not inside.any():
        return
    _, names = np.unique((own + 0.0).reshape(-1, 3).view("V24"), return_inverse=True)
    corners = names.reshape(-1, 3)
    reached = np.zeros(int(corners.max()) + 1, dtype=bool)
    reached[corners[~inside]] = True
    left = np.flatnonzero(inside)
    while True:
        # What is connected with a triangle that was dealt with needs no point of its own.
        while (touched := reached[corners[left]].any(axis=1)).any():
            reached[corners[left[touched]]] = True
            left = left[~touched]
        if len(left) == 0:
            return
        yield placed[left[0], 0]
        reached[corners[left[0]]] = True


def inside_mesh(corners: NDArray[np.float64], point: Vector) -> bool:
    """Check whether a point is inside a mesh: whether the solid angles of its triangles add up to more than 2 pi.

    The solid angle of a triangle is van Oosterom and Strackee's formula [37].

    Args:
        corners: Of the triangles, shape (n, 3, 3).
        point: Shape (3,).
    """
    a, b, c = (corners[:, k] - point for k in range(3))
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = x * y * z + np.einsum("ij,ij->i", a, b) * z
    denominator += np.einsum("ij,ij->i", b, c) * x + np.einsum("ij,ij->i", c, a) * y
    return bool(abs(2.0 * np.arctan2(numerator, denominator).sum()) > 2.0 * np.pi)
