"""Read mesh files (STL text and binary, OBJ, DAE) as `shapes.Mesh`, by assimp through coal."""

from __future__ import annotations

import os
import re
import warnings
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, positive
from rrtik_ompl.base.errors import InputError, MeshWarning
from rrtik_ompl.files.notice import tell_once
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.model.shapes import Mesh

SUFFIXES = (".stl", ".obj", ".dae")
MAX_BYTES = 256 * 1024 * 1024
LONG_BYTES = 20e6  # size of a file above which the user is told to wait
# Matches nan, inf, and numbers that overflow float32 (in which assimp reads), in a text file.
_NOT_FINITE = re.compile(
    rb"[\s>][-+]?(?:(?:nan|inf)(?:inity)?|[0-9.]+e\+?0*(?:[0-9]{3,}|[4-9][0-9]|39)|[0-9]{39,}[0-9.]*)(?=[\s<]|$)",
    re.IGNORECASE,
)


def read_mesh(file: str | os.PathLike[str], scale: float = 1.0) -> Mesh:
    """Read a triangle mesh; see :meth:`Mesh.load`.

    Raises:
        InputError: If the file cannot be read, is broken, or holds no triangle.
    """
    factor = positive(scale, f"{file_name(file)}: scale")
    if Path(file).suffix.lower() not in SUFFIXES:
        raise InputError(f"{file}: unknown kind of mesh; have {', '.join(SUFFIXES)}; export it as STL")

    data = read_bytes(file, MAX_BYTES)
    if not data:
        raise InputError(f"{file}: the file is empty; export the mesh again")
    if not finite_numbers(data):
        raise InputError(f"{file}: not a usable mesh: it holds numbers that are not finite; export it again")

    if len(data) > LONG_BYTES:
        tell_once(f"reading {os.fspath(file)}, {len(data) / 1e6:.0f} MB: about ten seconds for a million triangles")

    vertices, triangles = _read(file, factor * stated_unit(file, data))
    mesh = Mesh(vertices, triangles, source=os.path.abspath(file), scale=factor)
    if not mesh.closed:
        message = f"{file}: {mesh.open_edges} open edges; the mesh is treated as a surface, not as a solid"
        warnings.warn(message, MeshWarning, stacklevel=2)
    elif _volume(mesh) < 0.0:
        mesh = Mesh(mesh.vertices, mesh.triangles[:, ::-1], source=mesh.source, scale=factor)
    return mesh


def _read(path: str | os.PathLike[str], scale: float) -> tuple[Matrix, NDArray[np.int64]]:
    try:
        model = coal.MeshLoader().load(os.fspath(path), np.full(3, scale))
    except (ValueError, RuntimeError) as error:
        raise InputError(f"{path}: not a usable mesh: {_reason(error)}; export it again as STL, OBJ or DAE") from error

    corners: list[Any] = [model.tri_indices(k) for k in range(model.num_tris)]
    triangles = np.array([(t[0], t[1], t[2]) for t in corners], dtype=np.int64).reshape(-1, 3)
    return np.array(model.vertices(), dtype=np.float64), triangles


def _reason(error: Exception) -> str:
    """Return assimp's message without paths, hints and places in its source."""
    lines = [line.strip().removeprefix("message: ") for line in str(error).splitlines() if line.strip()]
    noise = ("From file:", "in function:", "at line:", "Could not load resource", "Hint:")
    said = [line for line in lines if not line.startswith(noise)]
    if not said or any("No meshes" in line for line in lines):
        return "no triangles in it"
    return said[-1].rstrip(".")


def stated_unit(path: str | os.PathLike[str], data: bytes) -> float:
    """Return the metres per unit that a COLLADA file states; 1 for other formats.

    Coal ignores this unit, but RViz and Gazebo do not.

    Args:
        path: Name of the file.
        data: Contents of the file.

    Raises:
        InputError: If the file is not XML, or its unit is not a number greater than 0.
    """
    if Path(path).suffix.lower() != ".dae":
        return 1.0

    try:
        asset = _asset(data)
        unit = None if asset is None else asset.find("{*}unit")
        metres = 1.0 if unit is None else float(unit.get("meter", "1"))
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # LookupError: an encoding nobody knows
        raise InputError(f"{path}: not a usable mesh: {error}; export it again as STL, OBJ or DAE") from error

    if not 0.0 < metres < float("inf"):
        raise InputError(f"{path}: its unit must be greater than 0 metres, found {metres:g}; export it again")
    return metres


def _asset(data: bytes) -> ElementTree.Element | None:
    """Return the element <asset> of a COLLADA file; None if there is none.

    It is usually at the beginning, and the megabytes after it are not parsed.
    """
    depth = 0
    element: ElementTree.Element
    for event, element in ElementTree.iterparse(BytesIO(data), ("start", "end")):
        depth += 1 if event == "start" else -1
        if event == "end" and depth == 1 and element.tag.rpartition("}")[2] == "asset":
            return element
    return None


def _volume(mesh: Mesh) -> float:
    """Return the signed volume [m^3], by the divergence theorem: positive if the triangles face outwards."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def finite_numbers(data: bytes) -> bool:
    """Check whether a mesh file is free of NaN and infinity, which would make the C++ library write to the terminal.

    Normals of a binary STL are ignored: some programs write NaN for triangles without area.
    """
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:  # A binary STL has twelve floats and two bytes per triangle.
        rows = np.frombuffer(data, dtype=[("normal", "<f4", 3), ("corners", "<f4", 9), ("rest", "<u2")], offset=84)
        return bool(np.isfinite(rows["corners"]).all())
    return _NOT_FINITE.search(data) is None
