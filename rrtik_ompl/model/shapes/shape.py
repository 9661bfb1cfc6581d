"""The interface of shapes, by which files, pictures and the rest of the library treat all shapes alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from rrtik_ompl.model.shapes.surfaces import Triangles

# A length [m] is more than 0; a vector has three numbers; points are three or more pairs of numbers.
MeasureKind: TypeAlias = Literal["length", "three lengths", "number", "vector", "points"]


@dataclass(frozen=True, slots=True)
class Measure:
    """A number, or list of numbers, that describes a shape.

    Attributes:
        name: Attribute of the shape, argument of its class, key in YAML, attribute in URDF.
        kind: Which values are accepted.
        text: Its description in the schema of YAML files; None if the name is sufficient.
        default: Value used if a file does not give it; None if a file must.
    """

    name: str
    kind: MeasureKind = "length"
    text: str | None = "[m]"
    default: float | None = None


class Shape(ABC):
    """A solid in its own frame, in metres; immutable.

    Attributes:
        key: Its key in YAML files, and its tag or type in URDF and MoveIt's messages if these support it.
        measures: The numbers that a file gives; empty if files do not describe it by numbers.
        grouped: Whether the measures are keys below ``key`` in YAML. Otherwise the first one is the value of ``key``,
            and the others are keys beside it.
        in_urdf: Whether URDF supports it.
        moveit: Names of its measures in the order of MoveIt's ``dimensions``; empty if MoveIt does not support it.
        bounded: Whether it is bounded in all directions.
        movable: Whether it can be attached to a link.
        smooth: Whether its surface has no edges.
        fine: Whether its surface may have more triangles than a picture needs.
        sensed: Whether a sensor measured it. Then it may have other points in the next scene, and points of the arm may
            be among them.
    """

    __slots__ = ()

    key: ClassVar[str]
    measures: ClassVar[tuple[Measure, ...]] = ()
    grouped: ClassVar[bool] = True
    in_urdf: ClassVar[bool] = False
    moveit: ClassVar[tuple[str, ...]] = ()
    bounded: ClassVar[bool] = True
    movable: ClassVar[bool] = True
    smooth: ClassVar[bool] = False
    fine: ClassVar[bool] = False
    sensed: ClassVar[bool] = False

    @property
    @abstractmethod
    def bounding_radius(self) -> float:
        """Largest distance of a point of the shape from its origin [m]."""

    @abstractmethod
    def surface(self) -> Triangles:
        """Return its surface as triangles; smooth surfaces are approximated.

        Raises:
            InputError: If the shape is unbounded.
        """

    def grown(self, margin: float) -> Shape | Triangles | None:
        """Return all points within a margin [m] of it as a shape or a surface; None if that is not implemented.

        Raises:
            InputError: If the margin is negative or not a finite number.
        """
        del margin
        return None


def same_shape(first: Shape, second: Shape) -> bool:
    """Check whether two shapes are of the same kind and have equal fields."""
    return first is second or (
        type(first) is type(second)
        and all(np.array_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))  # type: ignore[arg-type]
    )


def same_but_for_points(first: Shape, second: Shape) -> bool:
    """Check whether two shapes are the same, or measured by a sensor in the same way, where their points may differ."""
    return (first.sensed and type(first) is type(second)) or same_shape(first, second)
