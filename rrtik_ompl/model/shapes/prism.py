"""Prisms: polygons extruded along z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, bounded_array, frozen, length
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.shapes.polygons import check_simple, without_repeats
from rrtik_ompl.model.shapes.shape import Measure, Shape
from rrtik_ompl.model.shapes.surfaces import Triangles, extruded


@dataclass(frozen=True, slots=True, eq=False)
class Prism(Shape):
    """A simple polygon in the xy-plane, extruded along z and centred about z = 0.

    Attributes:
        polygon: Vertices in order (either sense), shape (k, 2), metres; convex or not, without self-crossings and
            without places where two sides touch.
        height: Full extent along z [m].

    Example:
        >>> rrtik.Prism([[0.0, 0.0], [0.4, 0.0], [0.0, 0.3]], height=0.1).polygon.shape
        (3, 2)
    """

    key = "polygon"
    measures = (
        Measure("polygon", "points", "vertices in the xy-plane [m], in order; extruded along z, centred about z = 0"),
        Measure("height", "length", "of a polygon, along z [m]; 1 if absent", 1.0),
    )
    grouped = False

    polygon: Matrix
    height: float

    __reduce__ = as_value

    def __init__(self, polygon: ArrayLike, height: float = 1.0) -> None:
        vertices = without_repeats(bounded_array(polygon, (None, 2), "polygon"))
        if len(vertices) < 3:
            raise InputError(f"polygon needs at least 3 different vertices, got {len(vertices)}")
        check_simple(vertices)
        object.__setattr__(self, "polygon", frozen(vertices))
        object.__setattr__(self, "height", length(height, "polygon height"))

    @property
    def bounding_radius(self) -> float:
        """Distance of its farthest corner from its origin [m]."""
        return float(np.hypot(np.linalg.norm(self.polygon, axis=1).max(), 0.5 * self.height))

    def surface(self) -> Triangles:
        """Its walls, floor and roof."""
        return extruded(self.polygon, self.height)
