"""Keep covers on disk, so that each geometry is covered only once per machine.

There is one file per geometry, parameters and version of the algorithm, named by a hash of all three. The package
brings the covers of its own robots, written by ``python -m bench ship_covers``. Nothing here raises an error: if the
cache cannot be used, the cover is computed again.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

import coal
import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, distinct, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.cache import cache_folder, nobody_else_s, write_whole
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.notice import COVERING, tell_once
from rrtik_ompl.geometry.collision.shape_table import numbers_of
from rrtik_ompl.geometry.collision.solids import around, fills_its_hull, is_mesh

LAYOUT = 1
ALGORITHM = 3  # counts up when rrtik_ompl.kernels.covers.spheres makes other spheres of the same geometry
PIECES = 2  # counts up when rrtik_ompl.kernels.covers.mesh_pieces makes other pieces of the same mesh
CELLS = 1  # counts up when rrtik_ompl.kernels.proof.neighbours finds other cells for the same bodies
STORE = Path(__file__).with_name("shipped.npz")
COLUMNS = 4  # numbers in a row of a cover


def cached_outer_cover(geometry: coal.CollisionGeometry, *, protrusion: float | None = None) -> Matrix:
    """Return the ``outer_cover`` of a geometry, from the cache if it is there.

    A mesh that nearly fills its convex hull is replaced by the hull, whose cover is tighter.
    """
    solid = around(geometry) if fills_its_hull(geometry) else geometry

    def make() -> Matrix:
        # Imported late, as it loads scipy, which takes longer than reading covers from the cache.
        from rrtik_ompl.kernels.covers.spheres import outer_cover

        return outer_cover(solid, protrusion=protrusion)

    return _cached(solid, f"outer {protrusion!r}", make)


def cached_inner_spheres(geometry: coal.CollisionGeometry, *, count: int | None = None) -> Matrix:
    """Return the ``inner_spheres`` of a geometry, from the cache if they are there."""

    def make() -> Matrix:
        from rrtik_ompl.kernels.covers.spheres import inner_spheres

        return inner_spheres(geometry, count=count)

    return _cached(geometry, f"inner {count!r}", make)


def cached_convex_pieces(mesh: coal.BVHModelBase) -> tuple[list[Matrix], ...]:
    """Return the ``convex_pieces`` of a mesh, from the cache if they are there.

    The cache holds them as rows of a corner and a number, which is 3 times the index of the piece plus the index of its
    kind.
    """

    def make() -> Matrix:
        from rrtik_ompl.kernels.covers.mesh_pieces import convex_pieces

        kinds = convex_pieces(mesh)
        rows = [np.empty((0, 4))]
        for kind, pieces in enumerate(kinds):
            for k, corners in enumerate(pieces):
                number = float(len(kinds) * k + kind)
                rows.append(np.column_stack([corners, np.full(len(corners), number)]))
        return np.concatenate(rows)

    rows = _cached(mesh, f"convex pieces {PIECES}", make)
    numbers = distinct(rows[:, 3])
    return tuple([rows[rows[:, 3] == k, :3] for k in numbers if k % 3 == kind] for kind in range(3))


def cached_cells(
    geometries: Sequence[coal.CollisionGeometry], place: ArrayLike, size: int, make: Callable[[], Mask | None]
) -> Mask | None:
    """Return cells that depend on two geometries and on some numbers, from the cache if they are there.

    Args:
        geometries: The two geometries.
        place: The numbers.
        size: How many rows and columns of cells there are.
        make: Function that makes them, shape (size, size), or None if there are none; that is not kept.
    """
    keys = [cover_key(geometry, f"cells {CELLS} {size}") for geometry in geometries]
    numbers = np.ascontiguousarray(place, dtype=np.float64).tobytes()
    folder = cache_folder("covers")
    if folder is None or None in keys:
        return make()
    key = sha256(b"\0".join([*map(str.encode, map(str, keys)), numbers])).hexdigest()
    file = folder / f"{key}.npz"
    rows = _read(file, key) if nobody_else_s(file) else None
    if rows is not None and rows.size == size * size:
        return np.asarray(rows.reshape(size, size) != 0.0)
    cells = make()
    if cells is not None:
        _write(file, key, cells.astype(np.float64).reshape(-1, COLUMNS))
    return cells


def geometry_bytes(geometry: coal.CollisionGeometry) -> bytes | None:
    """Return all data of a geometry on which a cover depends, or None for a kind that is not cached."""
    numbers = numbers_of(geometry)
    if numbers is None:
        return None

    swept = geometry.getSweptSphereRadius() if hasattr(geometry, "getSweptSphereRadius") else 0.0
    parts = [f"{type(geometry).__name__} {swept!r}".encode()]
    for array in numbers:
        parts += [f"{array.dtype} {array.shape}".encode(), np.ascontiguousarray(array).tobytes()]
    return b"\0".join(parts)


def cover_key(geometry: coal.CollisionGeometry, parameters: str) -> str | None:
    """Return a hash of the geometry, the parameters and the algorithm's version; None for a kind that is not cached."""
    data = geometry_bytes(geometry)
    if data is None:
        return None
    head = f"layout {LAYOUT} algorithm {ALGORITHM} {parameters}\0".encode()
    return sha256(head + data).hexdigest()


def _cached(geometry: coal.CollisionGeometry, parameters: str, make: Callable[[], Matrix]) -> Matrix:
    """Return a cover from the package or from the user's cache, or compute it and store it in that cache.

    Args:
        geometry: The geometry that is covered.
        parameters: Text that describes how; part of the key.
        make: Function that computes the cover, shape (n, 4).
    """
    folder = cache_folder("covers")
    key = cover_key(geometry, parameters)

    if key is not None and (shipped := shipped_cover(key)) is not None:
        return shipped

    file = None if folder is None or key is None else folder / f"{key}.npz"
    cover = _read(file, key) if file is not None and key is not None and nobody_else_s(file) else None
    if cover is not None:
        return cover

    if needs_long(geometry):
        tell_once(COVERING)
    cover = make()
    if file is not None and key is not None:
        _write(file, key, cover)
    return cover


def needs_long(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a cover takes so long (some tenths of a second) that the user is told: for meshes and hulls."""
    return is_mesh(geometry) or isinstance(geometry, coal.ConvexBase)


def _read(file: Path, key: str) -> Matrix | None:
    """Return the spheres in a file, shape (n, 4); None if it is absent, damaged or belongs to another key."""
    try:
        stored = NamedArrays(file)
        spheres = stored["spheres"]
        stored_key = str(stored["key"])
        checksum = str(stored["check"])
    except InputError:
        return None
    has_shape = spheres.dtype == np.float64 and spheres.ndim == 2 and spheres.shape[1] == 4
    if not has_shape or stored_key != key or checksum != _check(spheres):
        return None

    is_valid = np.isfinite(spheres[:, :3]).all() and (spheres[:, 3] >= 0.0).all()
    return np.asarray(spheres) if is_valid else None


def _check(spheres: Matrix) -> str:
    return sha256(np.ascontiguousarray(spheres).tobytes()).hexdigest()


def _write(file: Path, key: str, spheres: Matrix) -> None:
    key_array = np.array(key)
    checksum = np.array(_check(spheres))
    write_whole(file, lambda stream: np.savez(stream, spheres=spheres, key=key_array, check=checksum))


def shipped_cover(key: str, file: Path = STORE) -> Matrix | None:
    """Return the cover with that hash from the package, shape (n, 4), read-only; None if there is none."""
    packed = _stored(file).get(key)
    return None if packed is None else _unpacked(packed)


def write_store(covers: Mapping[str, Matrix], file: Path = STORE) -> None:
    """Write covers by their hashes into one file; the same covers always give the same file.

    Each cover is compressed separately: a robot needs few of them, and to decompress all would take longer than loading
    the robot.
    """
    keys = sorted(covers)
    packed = [zlib.compress(np.ascontiguousarray(covers[key].T, dtype=np.float64).tobytes(), 9) for key in keys]
    ends = np.cumsum([len(part) for part in packed], dtype=np.int64)
    hashes = np.frombuffer(bytes.fromhex("".join(keys)), dtype=np.uint8)
    data = np.frombuffer(b"".join(packed), dtype=np.uint8)
    np.savez(file, keys=hashes.reshape(len(keys), -1), ends=ends, packed=data)


@cache
def _stored(file: Path) -> dict[str, bytes]:
    """Return all covers of a file by their hashes, still compressed; none if the file is absent or damaged."""
    try:
        stored = NamedArrays(file)
        keys = stored["keys"]
        ends = stored["ends"].tolist()
        packed = stored["packed"].tobytes()
    except InputError:
        return {}

    starts = [0, *ends[:-1]]
    return {key.tobytes().hex(): packed[a:b] for key, a, b in zip(keys, starts, ends, strict=True)}


@cache
def _unpacked(packed: bytes) -> Matrix | None:
    """Decompress a cover, shape (n, 4); None if it is damaged."""
    try:
        columns = np.frombuffer(zlib.decompress(packed)).reshape(COLUMNS, -1)
    except (zlib.error, ValueError):
        return None
    return frozen(columns).T
