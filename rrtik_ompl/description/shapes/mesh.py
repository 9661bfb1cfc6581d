"""Read mesh files: STL, OBJ, DAE, PLY, GLB and glTF, by assimp through coal.

STL that it would refuse is read by ourselves, files of several parts that it would garble by trimesh.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Hashable
from io import BytesIO
from pathlib import Path
from weakref import WeakValueDictionary
from xml.etree import ElementTree

import coal
import numpy as np

from rrtik_ompl.base.arrays import Vector, bounded_array, distinct, positive
from rrtik_ompl.base.errors import EmptyMeshError, InputError, MeshWarning
from rrtik_ompl.description.package_path import MESH_SUFFIXES
from rrtik_ompl.description.shapes.by_trimesh import joined, meshes_in, triangles_of
from rrtik_ompl.files.notice import tell_once
from rrtik_ompl.files.point_files import ply_mesh, stated_faces
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.geometry.collision.solids import bvh, mesh_arrays
from rrtik_ompl.model.shapes import Mesh
from rrtik_ompl.model.shapes.mesh import open_edges_told
from rrtik_ompl.model.shapes.surfaces import Triangles

MAX_BYTES = 256 * 1024 * 1024
LONG_BYTES = 20e6  # size of a file above which the user is told to wait
COARSEST = 1e-5  # [m] largest distance of neighbouring numbers of single precision with which a shape is read
FINEST = 1e-6  # the same as a share of the size of the mesh
AGAIN = "export it again as STL, OBJ or DAE"
_WHERE = ("From file:", "in function:", "at line:", "Could not load resource", "Hint:")  # begins lines of coal's errors
_BINARY_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
_CORNER = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_VERTEX = re.compile(rb"^([ \t]*v[ \t]+)(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
_BY_TRIMESH = (".ply", ".glb", ".gltf")  # assimp reads beyond the end of a PLY that is cut off
_OF_SEVERAL = (".obj", ".dae")  # kinds of files that may hold several parts
_TEXT = re.compile(rb"ply\s+format ascii\b")
_PART = re.compile(rb"^[ \t]*(usemtl|mtllib|g|o)\b.*$", re.MULTILINE)
# Matches in a DAE what is no number in a list of whole numbers; assimp reads it for ever, until the memory is full.
_NO_INDEX = re.compile(rb"<(?:p|h|v|vcount)(?:\s[^>]*)?>[\s0-9-]*[^\s0-9<-]")
# Matches nan, inf, and numbers that overflow float32 (in which assimp reads), in a text file.
_NOT_FINITE = re.compile(
    rb"[\s>][-+]?(?:(?:nan|inf)(?:inity)?|[0-9.]+e\+?0*(?:[0-9]{3,}|[4-9][0-9]|39)|[0-9]{39,}[0-9.]*)(?=[\s<]|$)",
    re.IGNORECASE,
)

_surfaces: WeakValueDictionary[Hashable, coal.BVHModelBase] = WeakValueDictionary()  # those that somebody has


def read_mesh(file: str | os.PathLike[str], scale: float = 1.0) -> Mesh:
    """Read a triangle mesh; see :meth:`Mesh.load`.

    Raises:
        InputError: If the file cannot be read, is broken, or holds no triangle.
    """
    factor = positive(scale, f"{file_name(file)}: scale")
    path = Path(file)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(f"{file}: unknown kind of mesh; have {', '.join(MESH_SUFFIXES)}; export it as STL")

    vertices, triangles = mesh_arrays(load_surface(path, np.full(3, factor)))
    mesh = Mesh(vertices, triangles, source=os.path.abspath(file), scale=factor)
    if not mesh.closed:
        warnings.warn(f"{file}: {open_edges_told(mesh)}", MeshWarning, stacklevel=2)
    elif _volume(mesh) < 0.0:
        mesh = Mesh(mesh.vertices, mesh.triangles[:, ::-1], source=mesh.source, scale=factor)
    return mesh


def shared_surface(path: Path, scale: tuple[float, float, float]) -> coal.BVHModelBase:
    """Read a mesh file as :func:`load_surface` does; as long as anybody has the surface of it, that is returned.

    A robot with its fingers elsewhere is another robot of the same meshes, whose hulls and covers are kept with them.
    """
    try:
        state = os.stat(path)
    except OSError:
        return load_surface(path, np.array(scale))  # which says what is wrong
    key = (os.path.abspath(path), state.st_mtime_ns, state.st_size, scale)
    surface = _surfaces.get(key)
    if surface is None:
        _surfaces[key] = surface = load_surface(path, np.array(scale))
    return surface


def load_surface(path: Path, scale: Vector) -> coal.BVHModelBase:
    """Read a mesh file as a coal mesh, in metres.

    Args:
        path: The file.
        scale: Metres per unit of the file along each axis, shape (3,), where the file states no unit.

    Raises:
        InputError: If the file cannot be read, is broken, holds no triangle, or lies so far from its origin that single
            precision does not keep its shape.
    """
    if os.path.isfile(path) and os.path.getsize(path) > MAX_BYTES:
        size = os.path.getsize(path) // 2**20
        most = MAX_BYTES // 2**20
        raise InputError(
            f"{path}: a mesh of {size} MiB, more than {most} MiB, the most that is read; simplify it (a robot's link "
            "needs some thousand triangles)"
        )
    data = read_bytes(path, MAX_BYTES)
    if not data:
        raise InputError(f"{path}: the file is empty; export the mesh again")
    if len(data) > LONG_BYTES:
        tell_once(f"reading {path}, {len(data) / 1e6:.0f} MB: about ten seconds for a million triangles")

    kind = path.suffix.lower()
    if kind == ".stl" and len(data) in (80, 84) and not any(data[80:]):
        raise EmptyMeshError(f"{path}: not a usable mesh: no triangles in it; {AGAIN}")
    if kind == ".stl" and len(data) != _length_of_stl(data):
        return _by_ourselves(path, data, scale)
    if not _finite(data, kind):
        raise InputError(f"{path}: not a usable mesh: it holds numbers that are not finite; export it again")

    if kind == ".dae" and _NO_INDEX.search(data):
        raise InputError(f"{path}: not a usable mesh: a list of indices holds what is no number; export it again")

    scale = scale * stated_unit(path, data)
    surface = _by_trimesh(path, data, scale) if kind in _BY_TRIMESH else _by_assimp(path, scale)
    if kind in _OF_SEVERAL and _unused(surface):
        surface = _of_one_part(data, scale) if kind == ".obj" else _by_trimesh(path, data, scale)
    size = np.abs(bounded_array(surface.vertices(), (None, 3), f"{path}: vertices")).max(axis=0) / np.abs(scale)
    coarse = float((np.spacing(size.astype(np.float32)) * np.abs(scale)).max())
    extent = float((np.ptp(surface.vertices(), axis=0)).max())
    if coarse <= max(COARSEST, FINEST * extent):
        return surface
    if kind == ".obj":
        return _from_afar(data, scale)
    raise InputError(
        f"{path}: not a usable mesh: so far from its origin its points lie on a grid of {1e3 * coarse:.2g} mm; "
        "move it there, and give its place by the pose of the obstacle"
    )


def _by_assimp(path: Path, scale: Vector) -> coal.BVHModelBase:
    try:
        return coal.MeshLoader().load(os.fspath(path), scale)
    except (ValueError, RuntimeError) as error:
        raise InputError(f"{path}: not a usable mesh: {_reason(path, error)}; {AGAIN}") from error


def _unused(surface: coal.BVHModelBase) -> bool:
    """Check whether vertices of a mesh are in no triangle.

    Coal 3.0 numbers the vertices of each part of a node, and of each child of a node, from the first one of the node:
    the triangles of a second part are then between vertices of the first, and its own vertices remain.
    """
    vertices, triangles = mesh_arrays(surface)
    return len(distinct(triangles)) < len(vertices)


def _of_one_part(data: bytes, scale: Vector) -> coal.BVHModelBase:
    """Read an OBJ without its division into objects, groups and materials."""
    return _by_assimp_from(_PART.sub(b"", data), scale)


def _by_trimesh(path: Path, data: bytes, scale: Vector) -> coal.BVHModelBase:
    """Read a PLY, or a file of several parts, whose bytes are given, too."""
    is_ply = path.suffix.lower() == ".ply"
    if is_ply and not _TEXT.match(data):
        pieces = [_of_ply(data, path)]
    else:
        pieces = [triangles_of(mesh) for mesh in meshes_in(path)]
    if not any(len(piece.faces) for piece in pieces):
        raise EmptyMeshError(f"{path}: not a usable mesh: no triangles in it; {AGAIN}")

    vertices, faces = joined(pieces, scale)
    stated = stated_faces(data) if is_ply else 0
    if len(faces) < stated:
        raise InputError(f"{path}: not a usable mesh: {len(faces)} of {stated} faces are there; is it cut off?")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path}: not a usable mesh: a triangle names a vertex that is not there; {AGAIN}")
    return bvh(vertices, faces)


def _of_ply(data: bytes, path: Path) -> Triangles:
    """Read a PLY of bytes, of which assimp reads beyond the end, and trimesh no faces of several numbers of corners."""
    points, polygons = ply_mesh(data, f"{path}: not a usable mesh")
    faces = [polygon[[0, k, k + 1]] for polygon in polygons for k in range(1, len(polygon) - 1)]
    return Triangles(points.astype(np.float64), np.array(faces, dtype=np.int64).reshape(-1, 3))


def _by_assimp_from(data: bytes, scale: Vector) -> coal.BVHModelBase:
    """Read the text of an OBJ."""
    import tempfile  # few files need it, and it loads random numbers

    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy.obj"
        copy.write_bytes(data)
        return _by_assimp(copy, scale)


def _reason(path: Path, error: Exception) -> str:
    """Return what is wrong with a file that assimp refuses; what it says is of its own words and places."""
    if isinstance(error, UnicodeError):
        return "its name, or that of its folder, is not UTF-8"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    said = [line for line in lines if not line.startswith(_WHERE)]
    if not said or any("No meshes" in line for line in lines):
        return "no triangles in it"
    if "index out of range" in said[-1]:
        return "a triangle names a vertex that is not there"
    return f"it is damaged, cut off, or no {path.suffix.lower().removeprefix('.').upper()} file"


def _length_of_stl(data: bytes) -> int:
    """Return the length that a file has if it is a binary STL: a header, a count, and the triangles."""
    return 84 + _BINARY_TRIANGLE.itemsize * int.from_bytes(data[80:84], "little")


def _by_ourselves(path: Path, data: bytes, scale: Vector) -> coal.BVHModelBase:
    """Read an STL of text, in double precision, or a binary one whose length is not the usual one.

    Programs write bytes after the last triangle, and leave the count at 0 or -1.
    """
    if data.lstrip()[:5].lower() == b"solid" and _CORNER.search(data):
        found = _CORNER.findall(data)
        facets = len(re.findall(rb"\bendfacet\b", data, re.IGNORECASE))
        if len(found) != 3 * facets:
            raise InputError(f"{path}: not a usable mesh: {len(found)} corners of {facets} triangles; is it cut off?")
        try:
            corners = np.array(found).astype(np.float64)
        except ValueError:
            raise InputError(f"{path}: not a usable mesh: a corner is not of three numbers; export it again") from None
    else:
        there = max(0, len(data) - 84) // _BINARY_TRIANGLE.itemsize
        stated = int.from_bytes(data[80:84], "little")
        count = there if stated in (0, 2**32 - 1) else stated
        if not 0 < count <= there:
            said = f"it states {count} triangles and holds {there}" if count else "no triangles in it"
            raise InputError(f"{path}: not a usable mesh: {said}; {AGAIN}")
        corners = np.frombuffer(data, _BINARY_TRIANGLE, count, 84)["corners"].reshape(-1, 3).astype(np.float64)

    if not np.isfinite(corners).all():
        raise InputError(f"{path}: not a usable mesh: it holds numbers that are not finite; export it again")
    points, number = np.unique(corners * scale, axis=0, return_inverse=True)
    bounded_array(points, (None, 3), f"{path}: vertices")
    return bvh(points, np.asarray(number, dtype=np.int64).reshape(-1, 3))


def _from_afar(data: bytes, scale: Vector) -> coal.BVHModelBase:
    """Read an OBJ that is far from its origin: it is moved there, in double precision, and back once it is read."""
    rows = [match.groups()[1:] for match in _VERTEX.finditer(data)]
    offset: Vector = np.array(rows[:1]).astype(np.float64)[0]

    def moved(match: re.Match[bytes]) -> bytes:
        values = np.array(match.groups()[1:]).astype(np.float64) - offset
        return match[1] + b" ".join(repr(float(value)).encode() for value in values)

    vertices, triangles = mesh_arrays(_by_assimp_from(_PART.sub(b"", _VERTEX.sub(moved, data)), np.ones(3)))
    return bvh((vertices + offset) * scale, triangles)


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
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # LookupError: an encoding nobody knows
        raise InputError(f"{path}: not a usable mesh: {error}; {AGAIN}") from error

    stated = "1" if unit is None else unit.get("meter", "1")
    try:
        metres = float(stated)
    except ValueError:
        raise InputError(f"{path}: not a usable mesh: its unit '{stated}' is no number of metres; {AGAIN}") from None
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


def _finite(data: bytes, kind: str) -> bool:
    """Check whether a mesh file is free of NaN and infinity, which would make the C++ library write to the terminal.

    Normals of a binary STL are ignored: some programs write NaN for triangles without area. Of an OBJ only vertices are
    looked at, as names and comments may be any words. Formats of bytes are checked once they are read.
    """
    if kind == ".stl":
        return bool(np.isfinite(np.frombuffer(data, _BINARY_TRIANGLE, offset=84)["corners"]).all())
    if kind in (".glb", ".gltf", ".ply") or _NOT_FINITE.search(data) is None:
        return True
    vertices = _VERTEX.finditer(data) if kind == ".obj" else ()
    return kind == ".obj" and not any(_NOT_FINITE.search(b" " + b" ".join(row.groups()[1:])) for row in vertices)
