"""What a shape says of itself, so that files, pictures and the rest of the library treat all shapes alike."""

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
    """One of the numbers, or lists of numbers, that give a shape.

    Attributes:
        name: Attribute of the shape, argument of its class, key in YAML, attribute in URDF.
        kind: What may be given.
        text: Its description in the schema of YAML files, None if its name says all.
        default: What stands for it in a file that does not give it; None if a file must.
    """

    name: str
    kind: MeasureKind = "length"
    text: str | None = "[m]"
    default: float | None = None


class Shape(ABC):
    """A solid in its own frame, in metres. Frozen.

    Attributes:
        key: Its key in YAML files, and its tag or type in URDF and MoveIt's messages, if those know it.
        measures: What a file gives of it; none if no file gives it in numbers.
        grouped: Whether YAML has the measures as keys below ``key``; else the first one is the value of ``key``, and
            the others stand beside it.
        in_urdf: Whether URDF knows it.
        moveit: Names of its measures in the order of MoveIt's ``dimensions``; none if MoveIt does not know it.
        bounded: Whether it has an end in all directions.
        movable: Whether a link can hold it.
        smooth: Whether its surface has no edges.
        fine: Whether its surface may have more triangles than a picture needs.
        sensed: Whether a sensor measured it: the next scene may have other points of it, and the arm's own may be
            among them.
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
        """Its surface as triangles, of a smooth one close to it.

        Raises:
            InputError: If the shape has no end.
        """

    def grown(self, margin: float) -> Shape | Triangles | None:
        """Return all that is within a margin [m] of it, as a shape or as a surface; None if neither is at hand.

        Raises:
            InputError: If the margin is negative, or no finite number.
        """
        del margin
        return None


def same_shape(first: Shape, second: Shape) -> bool:
    """Check whether two shapes are of one kind and one size."""
    return first is second or (
        type(first) is type(second)
        and all(np.array_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))  # type: ignore[arg-type]
    )
