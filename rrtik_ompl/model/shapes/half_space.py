"""Half-spaces: floors and walls without end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, bounded_array, finite_number, frozen
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.shapes.shape import Measure, Shape
from rrtik_ompl.model.shapes.surfaces import Triangles


@dataclass(frozen=True, slots=True, eq=False)
class HalfSpace(Shape):
    """The filled side of a plane: points with ``normal . x <= offset``; the free side is ``normal . x > offset``.

    ``normal`` is stored with unit length, and ``offset`` [m] is scaled with it.

    Example:
        >>> floor = rrtik.HalfSpace([0.0, 0.0, 2.0], offset=0.2)
        >>> floor.normal, floor.offset
        (array([0., 0., 1.]), 0.1)
    """

    key = "half_space"
    measures = (Measure("normal", "vector", None), Measure("offset", "number", default=0.0))
    bounded = False
    movable = False

    normal: Vector
    offset: float

    __reduce__ = as_value

    def __init__(self, normal: ArrayLike, offset: float = 0.0) -> None:
        direction = bounded_array(normal, (3,), "half-space normal")
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise InputError("half-space normal must not be the zero vector")
        scaled = finite_number(offset, "half-space offset") / length
        object.__setattr__(self, "normal", frozen(direction / length))
        object.__setattr__(self, "offset", float(bounded_array(scaled, (), "half-space offset")))

    @property
    def bounding_radius(self) -> float:
        """Infinite."""
        return float("inf")

    def surface(self) -> Triangles:
        """None: see :func:`rrtik_ompl.viewer.drawing.meshes.half_space_plate`.

        Raises:
            InputError: Always.
        """
        raise InputError("a HalfSpace cannot be drawn as a bounded solid")
