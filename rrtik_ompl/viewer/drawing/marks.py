"""Marks: further bodies on a page, made of triangles, each with a name and a switch."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.model.shapes.surfaces import Faces, round_ended
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.meshes import look_of_triangles
from rrtik_ompl.viewer.drawing.nodes import Material, Node
from rrtik_ompl.viewer.drawing.triangles import tube

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from rrtik_ompl.ik.reach import ReachMap

TUBE_SIDES = 6  # few, because there may be thousands of tubes
BALL_SEGMENTS = 48
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])  # corners of a square face, in its plane
SQUARE_FACES = np.array([[0, 1, 2, 0, 2, 3]])  # its triangles

SCALE = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")  # colours of reachability from low to high (viridis)
MEANING = {"orientations": "of all directions", "manipulability": "manipulability", "samples": "samples"}


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A further body in the world.

    Attributes:
        name: Name in the legend.
        color: '#rrggbb'.
        vertices: Shape (k, 3) [m].
        faces: Indices of vertices, shape (m, 3).
        opacity: From 0 to 1, which is solid.
        shown: Whether the page shows it at first.
    """

    name: str
    color: str
    vertices: Matrix
    faces: Faces
    opacity: float = 1.0
    shown: bool = True


class MarkOptions(TypedDict, total=False):
    """Optional attributes of a `Mark`."""

    opacity: float
    shown: bool


def tubes(name: str, color: str, lines: Iterable[ArrayLike], radius: float, **options: Unpack[MarkOptions]) -> Mark:
    """Return a mark of lines, drawn as thin tubes because WebGL draws lines only one pixel wide.

    Args:
        name: Name in the legend.
        color: '#rrggbb'.
        lines: Each of shape (k, 3) with k at least 2 [m].
        radius: Radius of the tubes [m].
        **options: ``opacity`` and ``shown`` of the `Mark`.
    """
    return _joined(
        name, color, (tube(np.asarray(line, dtype=np.float64), radius, TUBE_SIDES) for line in lines), options
    )


def balls(name: str, color: str, centres: ArrayLike, radius: float, **options: Unpack[MarkOptions]) -> Mark:
    """Return a mark of balls of one radius [m] at points, shape (k, 3)."""
    vertices, faces = round_ended(radius, 0.0, BALL_SEGMENTS)
    points = np.asarray(centres, dtype=np.float64)
    return _joined(name, color, ((vertices + point, faces) for point in points), options)


def cubes(
    name: str, color: str, inside: NDArray[np.bool_], corner: ArrayLike, size: float, **options: Unpack[MarkOptions]
) -> Mark:
    """Return a mark of the cells of a grid, without the faces between two of them.

    Args:
        name: Name in the legend.
        color: '#rrggbb'.
        inside: Which cells are drawn, shape (x, y, z).
        corner: Corner of the first cell, shape (3,) [m].
        size: Side of a cell [m].
        **options: ``opacity`` and ``shown`` of the `Mark`.
    """
    origin = np.asarray(corner, dtype=np.float64)
    pieces = []
    filled = np.pad(inside, 1)

    for axis in range(3):
        for side in (0, 1):
            neighbour = np.roll(filled, 1 - 2 * side, axis=axis)
            # A face is drawn where a filled cell has an empty one beside it.
            places = np.argwhere(filled & ~neighbour) - 1.0
            square = np.zeros((len(places), 4, 3))
            square[..., axis] = side
            for k in (0, 1):
                square[..., (axis + 1 + k) % 3] = CORNERS[:, k]
            pieces.append(origin + size * (places[:, None] + square))

    corners = np.concatenate(pieces)
    faces = (4 * np.arange(len(corners))[:, None] + SQUARE_FACES).reshape(-1, 3)
    return Mark(name, color, frozen(corners.reshape(-1, 3)), frozen(faces, np.int64), **options)


def draw_marks(vis: Node, marks: Iterable[Mark]) -> None:
    """Draw marks under ``marks/<number>``."""
    for number, mark in enumerate(marks):
        solid = mark.opacity == 1.0
        material = Material(color=palette.number(mark.color), opacity=mark.opacity, shininess=10, hides=solid)
        vis["marks"][f"{number}"].set_object(look_of_triangles(mark.vertices, mark.faces).geometry, material)


def _joined(name: str, color: str, bodies: Iterable[tuple[Matrix, Faces]], options: MarkOptions) -> Mark:
    """Join triangle meshes to one mark."""
    vertices = [np.empty((0, 3))]
    faces = [np.empty((0, 3), dtype=np.int64)]
    count = 0

    for points, triangles in bodies:
        vertices.append(points)
        faces.append(np.asarray(triangles, dtype=np.int64) + count)
        count += len(points)

    return Mark(name, color, frozen(np.concatenate(vertices)), frozen(np.concatenate(faces), np.int64), **options)


def reach_marks(reach: ReachMap, *, cut: bool = True) -> list[Mark]:
    """Return marks of a reachability map for ``view(robot, marks=reach_marks(map))``, one for each range of values.

    Args:
        reach: The map.
        cut: Whether to leave out the quarter in front of the base, on its right, so that the inside is visible.
    """
    seen = np.array(reach.reached)
    if cut and seen.shape[2] > 1:
        x, y = (reach.centres(k) - reach.base[k] for k in (0, 1))
        seen[np.ix_(x > 0.0, y < 0.0, np.ones(seen.shape[2], dtype=bool))] = False

    most = 1.0 if reach.measure == "orientations" else float(reach.values.max(initial=0.0))
    step = most / len(SCALE)
    kind = np.minimum((reach.values / step).astype(int), len(SCALE) - 1) if most else np.zeros(seen.shape, dtype=int)

    names = [f"{k * step:.2g} to {(k + 1) * step:.2g} {MEANING[reach.measure]}" for k in range(len(SCALE))]
    return [
        cubes(name, color, seen & (kind == k), reach.corner, reach.size)
        for k, (name, color) in enumerate(zip(names, SCALE, strict=True))
    ]
