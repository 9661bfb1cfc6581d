"""Round the corners of a path: curves of continuous curvature that stay within a given distance of the path.

A path is the sum of a line and one bend per corner. Each bend is replaced by its weighted mean over a stretch of the
path; the weights form a triangle whose half width is the corner's radius. The result is a cubic in three pieces whose
second derivative is continuous. Roundings may overlap, so that many near corners become one smooth curve, as the sum
remains valid. The idea of rounding corners is that of [20].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.reference import timing as reference
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of
from rrtik_ompl.kernels.timing.layout import KERNELS, CurveTable
from rrtik_ompl.kernels.timing.run_layout import LEAST_STEPS, SAME_PLACE, STEPS_PER_LINE, STEPS_PER_RADIUS
from rrtik_ompl.motion.trajectory.corners import Polyline
from rrtik_ompl.motion.trajectory.cubics import even_parts


class Samples(NamedTuple):
    """A curve at m places: position, and first and second derivative with respect to the place.

    Attributes:
        values: The three of them side by side, n columns each, shape (m, 3 n).
    """

    values: Matrix

    @property
    def positions(self) -> Matrix:
        """Return the positions, shape (m, n)."""
        return self.values[:, : self.values.shape[1] // 3]

    @property
    def slopes(self) -> Matrix:
        """Return the first derivatives, shape (m, n)."""
        n = self.values.shape[1] // 3
        return self.values[:, n : 2 * n]

    @property
    def bends(self) -> Matrix:
        """Return the second derivatives, shape (m, n)."""
        return self.values[:, 2 * (self.values.shape[1] // 3) :]


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A run through rounded corners, from rest to rest. A place on it is a distance along the path [rad or m].

    Attributes:
        line: The path.
        radii: Radii of the corners, shape (k,); 0 at both ends.
    """

    line: Polyline
    radii: Vector

    @classmethod
    def of(cls, line: Polyline, radii: Vector) -> Curve:
        """Make the curve along a path whose inner vertices are rounded with radii, shape (k - 2,).

        No radius exceeds the distance to an end of the path.
        """
        along = line.along
        widths = np.zeros(len(along))
        widths[1:-1] = np.minimum(radii, np.minimum(along[1:-1], along[-1] - along[1:-1]))
        return cls(line, widths)

    @property
    def vertices(self) -> Matrix:
        """Return the vertices of the path, shape (k, n)."""
        return self.line.vertices

    @property
    def along(self) -> Vector:
        """Return the place of each vertex, shape (k,), from 0."""
        return self.line.along

    @property
    def directions(self) -> Matrix:
        """Return unit vectors along the edges, shape (k - 1, n)."""
        return self.line.directions

    @property
    def length(self) -> float:
        """Return the length of the path [rad or m]."""
        return float(self.along[-1])

    def at(self, places: Vector) -> Samples:
        """Return the curve's position and derivatives at places, shape (m,), which must not decrease."""
        kernels = library(KERNELS)
        n = self.vertices.shape[1]
        if kernels is None:
            values = reference.sample_curve(self.vertices, self.along, self.directions, self.radii, places)
        else:
            task = curve_table(len(self.along), n, len(places))
            self.put_into(task)
            task.at[:] = places
            kernels.sample_curve(task.address)
            values = task.values.reshape(-1, 3 * n)
        return Samples(values)

    def put_into(self, table: CurveTable) -> None:
        """Write the curve into a table for kernels that has room for its vertices, or more."""
        count, n = self.vertices.shape
        table.vertices[: count * n] = self.vertices.ravel()
        table.along[:count] = self.along
        table.directions[: (count - 1) * n] = self.directions.ravel()
        table.radii[:count] = self.radii
        table.widest = float(self.radii.max())
        table.vertex_count = count

    def edges(self, places: Vector) -> NDArray[np.int64]:
        """Return the indices of the edges on which places lie, shape (m,)."""
        return np.clip(np.searchsorted(self.along, places, side="right") - 1, 0, len(self.along) - 2)

    def path_at(self, places: Vector) -> Matrix:
        """Return the path itself, without rounding, at places, shape (m, n)."""
        edge = self.edges(places)
        from_vertex: Vector = (places - self.along[edge])[:, None]
        return self.vertices[edge] + from_vertex * self.directions[edge]

    def classes(self) -> Vector:
        """Return the radii rounded down to steps of a quarter of an octave, of which there are few, shape (k,)."""
        return np.exp2(0.25 * np.floor(4.0 * np.log2(np.maximum(self.radii, 1e-300))))

    def tightest(self, places: Vector) -> Vector:
        """Return for each place the smallest radius of the roundings in which it lies, shape (m,); inf if in none.

        The radius is rounded down, by at most a sixth.
        """
        corner_places = self.along[1:-1]
        radii = self.radii[1:-1]
        classes = self.classes()[1:-1]
        tightest = np.full(len(places), np.inf)

        for radius in np.unique(classes)[::-1]:
            in_step = classes == radius
            starts = np.sort(corner_places[in_step] - radii[in_step])
            ends = np.sort(corner_places[in_step] + radii[in_step])
            tightest[np.searchsorted(starts, places) > np.searchsorted(ends, places)] = radius
        return tightest

    def grid(self) -> tuple[Vector, Vector]:
        """Return places from the beginning to the end of the curve, spaced closely where it bends.

        The grid includes all places where the third derivative jumps.

        Returns:
            Places, shape (m,), and for each the approximate smallest radius of the corners within which it lies,
            shape (m,); see :meth:`tightest`.
        """
        corner_places = self.along[1:-1]
        radii = self.radii[1:-1]
        knots = np.sort(
            np.concatenate([corner_places - radii, corner_places, corner_places + radii, self.along[[0, -1]]])
        )
        knots = knots[np.concatenate([[True], knots[1:] - knots[:-1] > SAME_PLACE * self.length])]
        knots[-1] = self.length

        middles = 0.5 * (knots[1:] + knots[:-1])
        widths = knots[1:] - knots[:-1]
        tightest = self.tightest(middles)
        steps = np.where(np.isinf(tightest), widths / STEPS_PER_LINE, tightest / STEPS_PER_RADIUS)
        steps = np.minimum(steps, self.length / LEAST_STEPS)
        counts = np.maximum(np.ceil(widths / steps), 1.0).astype(np.int64)

        pieces, shares = even_parts(counts)
        places = np.append(knots[pieces] + shares * widths[pieces], self.length)
        return places, np.append(tightest[pieces], np.inf)


def curve_table(vertices: int, n: int, places: int) -> CurveTable:
    """Return a table for kernels with room for so many vertices of n coordinates, and for places on the curve."""
    return CurveTable(PlannedTable(_plan(vertices, n, places)))


@lru_cache(maxsize=64)
def _plan(vertices: int, n: int, places: int) -> TablePlan:
    """Return the memory layout of a curve with n coordinates and the places on it; cached."""
    return sizes_of(
        CurveTable,
        vertices=vertices * n,
        along=vertices,
        directions=(vertices - 1) * n,
        radii=vertices,
        at=places,
        values=3 * n * places,
        dof=n,
        vertex_count=vertices,
        place_count=places,
    )
