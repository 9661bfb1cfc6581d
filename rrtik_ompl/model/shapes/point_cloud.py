"""Point clouds as measured by depth cameras, laser scanners and sonars."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import (
    LARGEST,
    Mask,
    Vector,
    bounded_array,
    frozen,
    length,
    not_negative,
    number_rows,
    positive,
    truths,
)
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import CloudWarning, InputError, at_most, require
from rrtik_ompl.files.kinds import read, write
from rrtik_ompl.model.shapes.point_tree import PointTree, extremes, point_tree
from rrtik_ompl.model.shapes.shape import Shape
from rrtik_ompl.model.shapes.surfaces import Triangles

MOST_POINTS = 20_000_000
WIDEST = 200.0  # [m] extent above which a cloud is suspected to be in millimetres
MOST_DRAWN = 20_000  # largest number of points in a drawn surface
RADIUS = 0.01  # [m] default radius of a point

Invalid: TypeAlias = Literal["refuse", "drop"]
Points: TypeAlias = NDArray[np.float32]


class Cloud:
    """Points with equal balls or cubes around them, and what is derived from them on first use and kept.

    Attributes:
        points: Shape (n, 3) [m], float32.
        radius: Of the balls [m].
        half: Half a side of the cubes, which lie along the axes of the cloud's frame [m].
    """

    __slots__ = ("_tree", "solid", "table")

    points: Points
    radius: float
    half: float

    _tree: PointTree
    solid: Callable[[], Any]  # a weak reference to its collision geometry
    table: object  # the kernels' table of its tree

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """Lowest and highest coordinates of the balls or cubes [m], shape (3,) each."""
        low, high = (end.astype(np.float64) for end in self.tree.bounds)
        return low - self.radius, high + self.radius

    @property
    def tree(self) -> PointTree:
        """Its points in a tree, built on first use (10 ms for 100,000 points)."""
        if not hasattr(self, "_tree"):
            object.__setattr__(self, "_tree", point_tree(self.points, self.half))
        return self._tree


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud(Cloud, Shape):
    """A cloud of points, each of which is exactly a ball of the given radius.

    Points are stored in single precision, as sensors and files provide them, with a relative error of at most 6e-8.

    Attributes:
        points: The centres of the balls, shape (n, 3) [m], float32.
        radius: Radius of each ball [m]. Choose it so that balls of neighbouring points overlap, and add the error of
            the sensor.
        source: Path of the file it was read from, or "" if it was changed since.
        scale: Factor that was applied to the file's numbers; it is written back with the scene.
        dropped: Number of points that were left out because they were not finite.

    Args:
        points: Shape (n, 3), or (rows, columns, 3) as depth cameras give them [m].
        radius: See above.
        invalid: Whether points that are not finite are refused or dropped; if None, they are dropped with a warning
            that says how many.
        source: See above.
        scale: See above.

    Raises:
        InputError: If there are no points, points are not numbers, none is finite, or the radius is not positive.

    Warns:
        CloudWarning: If points were dropped without being asked to, or if the cloud is wider than 200 m, as it is
            probably in millimetres.

    Example:
        >>> import numpy as np
        >>> from rrtik_ompl import PointCloud
        >>> PointCloud(np.zeros((3, 3)), radius=0.005).bounding_radius
        0.005
    """

    key = "cloud"
    movable = False
    smooth = True
    sensed = True
    half = 0.0

    points: Points
    radius: float
    source: str
    scale: float
    dropped: int

    __reduce__ = as_value

    def __init__(
        self,
        points: ArrayLike,
        radius: float = RADIUS,
        *,
        invalid: Invalid | None = None,
        source: str = "",
        scale: float = 1.0,
    ) -> None:
        require(source, str, "source of a cloud")
        what = f"cloud {source}" if source else "cloud"
        known_choice("drop" if invalid is None else invalid, what)
        rows, dropped = _usable(points, invalid, what)
        if dropped and invalid is None:
            counted = f"{dropped} of {dropped + len(rows)} points are not finite and left out"
            warnings.warn(f"{what}: {counted}; invalid='drop' says that this is meant", CloudWarning, 2)

        object.__setattr__(self, "points", rows)
        object.__setattr__(self, "radius", length(radius, f"{what}: radius"))
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "scale", positive(scale, f"{what}: scale"))
        object.__setattr__(self, "dropped", dropped)

        low, high = extremes(rows)
        if (extent := high - low).max() > WIDEST:
            sides = " x ".join(f"{side:.4g}" for side in extent)
            warnings.warn(f"{what}: it is {sides} m wide; if that is millimetres, scale it by 0.001", CloudWarning, 2)

    def save(self, file: str | os.PathLike[str]) -> PointCloud:
        """Write the points as ``.npy`` or ``.ply``, whole or not at all.

        Returns:
            The cloud with that file as its source, so that a scene with it can be written.

        Raises:
            InputError: If the name has another ending, or the file cannot be written.

        Example:
            >>> cloud = rrtik.PointCloud(np.eye(3), radius=0.01)
            >>> cloud.save("scan.ply").points.shape
            (3, 3)
        """
        saved: PointCloud = write(self, file)
        return saved

    @staticmethod
    def load(
        file: str | os.PathLike[str],
        radius: float | None = None,
        *,
        scale: float = 1.0,
        invalid: Invalid | None = None,
    ) -> PointCloud:
        """Read a cloud of points: ``.npy``, ``.npz``, ``.ply``, ``.pcd``, ``.bt``, ``.ot``, ``.xyz`` (text).

        An array of numpy has shape (n, 3) or (rows, columns, 3); in an ``.npz`` it is called "points", or is the only
        one. From a map of OctoMap (``.bt``, ``.ot``) the centre of each occupied cell is taken; unless a radius is
        given, the points have balls that cover the cells, of half the cells' diagonal.

        Args:
            file: The file.
            radius: Radius of the ball at each point [m]; if None, 0.01, or what covers the cells of a map.
            scale: Metres per unit of the file; 0.001 for millimetres.
            invalid: Whether points that are not finite are refused or dropped; if None, they are dropped with a
                warning that says how many.

        Raises:
            InputError: If the file cannot be read, is broken, or has no usable point; one line.

        Warns:
            CloudWarning: If points were dropped, or the cloud is so large that it is probably in millimetres.

        Example:
            >>> cloud = rrtik.PointCloud.load("scan.ply", radius=0.01).voxel(0.01)  # doctest: +SKIP
        """
        return read(PointCloud, file, radius, scale=scale, invalid=invalid)

    def __repr__(self) -> str:
        return f"PointCloud({len(self.points)} points, radius={self.radius:g} m)"

    @property
    def bounding_radius(self) -> float:
        """Distance of its farthest point from its origin plus the radius of a point [m]."""
        squares = np.einsum("ni,ni->n", self.points, self.points, dtype=np.float64)
        return float(np.sqrt(squares.max())) + self.radius

    def surface(self) -> Triangles:
        """Return an octahedron around each point, or around every n-th point if there are many."""
        some = self.points[:: -(-len(self.points) // MOST_DRAWN)].astype(np.float64)
        tips = self.radius * np.concatenate([np.eye(3), -np.eye(3)])
        faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
        numbers = faces + len(tips) * np.arange(len(some))[:, None, None]
        return Triangles((some[:, None] + tips).reshape(-1, 3), numbers.reshape(-1, 3))

    def grown(self, margin: float) -> PointCloud:
        """Return the cloud with the radius of its points enlarged by a margin [m]."""
        return PointCloud(self.points, self.radius + not_negative(margin, "margin"))

    def voxel(self, size: float) -> PointCloud:
        """Return a thinned cloud with one point for each occupied cube of a grid, at the mean of its points.

        The radius is enlarged so that the new balls cover all old ones.

        Args:
            size: Side of a cube [m].

        Raises:
            InputError: If the size is not positive, or so small that the grid has too many cubes.
        """
        size = length(size, "voxel size")
        low, high = (end.astype(np.float64) for end in extremes(self.points))
        extent = float((high - low).max())
        # A coordinate has 21 bits in a key; one is left, as the last cube may be reached by rounding.
        if extent / size >= 1 << 20:
            raise InputError(f"voxel size {size:g} m is too small for a cloud {extent:.4g} m wide")

        # Sort the points by the keys of their cubes, 21 bits for each coordinate.
        cells = ((self.points - low) / size).astype(np.int64)
        keys = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
        order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[order], prepend=-1))

        ordered = self.points[order].astype(np.float64)
        counts = np.diff(np.append(starts, len(order)))
        middles = (np.add.reduceat(ordered, starts) / counts[:, None]).astype(np.float32)
        moved = float(np.linalg.norm(ordered - np.repeat(middles, counts, axis=0), axis=1).max())
        return PointCloud(middles, self.radius + moved)

    def cropped(self, low: ArrayLike, high: ArrayLike) -> PointCloud:
        """Return the points within a box.

        ``low`` and ``high`` are its lowest and highest coordinates in the cloud's frame, shape (3,) each [m].

        Raises:
            InputError: If no point is left.
        """
        ends = bounded_array(low, (3,), "cropped: low"), bounded_array(high, (3,), "cropped: high")
        inside: Mask = np.all((self.points >= ends[0]) & (self.points <= ends[1]), axis=1)
        return self.only(inside, "cropped")

    def only(self, chosen: Mask, what: str = "cloud") -> PointCloud:
        """Return a cloud of some of its points, selected by a mask, shape (n,).

        Raises:
            InputError: If none is left.
        """
        chosen = truths(chosen, f"{what}: points to keep")
        if len(chosen) != len(self.points):
            raise InputError(f"{what}: there are {len(self.points)} points, but the mask has {len(chosen)}")
        if not chosen.any():
            raise InputError(f"{what}: none of the {len(self.points)} points is left; leave the obstacle out")
        return self if chosen.all() else PointCloud(self.points[chosen], self.radius)


def known_choice(invalid: Invalid, what: str) -> None:
    """Refuse a value of ``invalid`` other than "refuse" or "drop"."""
    if not isinstance(invalid, str) or invalid not in ("refuse", "drop"):
        raise InputError(f"{what}: invalid must be 'refuse' or 'drop', got {invalid!r}")


def _usable(points: ArrayLike, invalid: Invalid | None, what: str) -> tuple[Points, int]:
    """Validate the points of a cloud.

    Args:
        points: Shape (n, 3) or (rows, columns, 3) [m].
        invalid: Whether points that are not finite are refused; else they are dropped.
        what: Name of the cloud, for messages.

    Returns:
        The points as read-only float32, shape (m, 3), and the number of dropped points.
    """
    given = points if isinstance(points, np.ndarray) and points.dtype == np.float32 else number_rows(points, what)
    if given.ndim == 3 and given.shape[2] == 3:
        given = given.reshape(-1, 3)
    if given.ndim != 2 or given.shape[1] != 3:
        raise InputError(f"{what}: expected points of shape (any, 3), got shape {given.shape}")
    at_most(len(given), MOST_POINTS, f"{what}: points", "thin it out before, or crop it")

    finite = np.isfinite(given[:, 0]) & np.isfinite(given[:, 1]) & np.isfinite(given[:, 2])
    bad = len(given) - int(np.count_nonzero(finite))
    if bad and invalid == "refuse":
        raise InputError(f"{what}: {bad} of {len(given)} points are not finite; invalid='drop' leaves them out")

    rows = given[finite] if bad else given
    if len(rows) == 0:
        raise InputError(f"{what}: it has no {'finite ' if bad else ''}point; leave the obstacle out")
    if (largest := max(float(rows.max()), -float(rows.min()))) > LARGEST:
        raise InputError(f"{what}: found {largest:g}, more than {LARGEST:g}; check units: metres")
    return frozen(rows, np.float32), bad
