"""Read mesh files by trimesh (and pycollada for DAE) for what coal's reader does not tell or misreads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.interrupts import interruptible
from rrtik_ompl.model.shapes.surfaces import Triangles

if TYPE_CHECKING:
    from trimesh import Trimesh


def meshes_in(path: Path) -> list[Trimesh]:
    """Return the meshes of a file as trimesh has them, each where its node puts it, in units of the file.

    Args:
        path: The file.

    Raises:
        InputError: If trimesh cannot read the file.
    """
    try:
        with interruptible():
            import trimesh

            found = trimesh.load_scene(str(path), process=False).dump()
            return [each for each in found if isinstance(each, trimesh.Trimesh)]  # others are lines or points
    except Exception as error:  # whatever it meets with in a damaged file
        kind = path.suffix.lower().removeprefix(".").upper()
        raise InputError(
            f"{path}: not a usable mesh: it is damaged, cut off, or no {kind} file that trimesh reads; export it again"
        ) from error


def triangles_of(mesh: Trimesh) -> Triangles:
    """Return the triangles of a mesh of trimesh."""
    return Triangles(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def joined(pieces: list[Triangles], scale: Vector) -> Triangles:
    """Return several sets of triangles as one, with each axis scaled."""
    first = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    faces = [piece.faces + start for piece, start in zip(pieces, first, strict=False)]
    return Triangles(np.concatenate([piece.vertices for piece in pieces]) * scale, np.concatenate(faces))
