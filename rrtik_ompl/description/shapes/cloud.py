"""Read files of points as `shapes.PointCloud`, and write them."""

from __future__ import annotations

import io
import os
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import positive
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.description.shapes.octree import octree_points, octree_resolution
from rrtik_ompl.files.point_files import npy_points, pcd_points, ply_points, text_rows
from rrtik_ompl.files.text import file_name, read_bytes, write_bytes
from rrtik_ompl.model.shapes import PointCloud
from rrtik_ompl.model.shapes.point_cloud import RADIUS, Invalid

MAX_BYTES = 1024 * 1024 * 1024
POINTS = "points"  # array of an .npz file that is the cloud
PLY_HEADER = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)


def read_cloud(
    file: str | os.PathLike[str],
    radius: float | None = None,
    *,
    scale: float = 1.0,
    invalid: Invalid | None = None,
) -> PointCloud:
    """Read a cloud of points; see :meth:`PointCloud.load`.

    Raises:
        InputError: If the file cannot be read, is broken, or has no usable point; one line.
    """
    factor = positive(scale, f"{file_name(file)}: scale")
    suffix = Path(file).suffix.lower()
    if suffix not in _READERS:
        raise InputError(f"{file}: unknown kind of cloud; have {', '.join(_READERS)}; export it as PLY")

    data = read_bytes(file, MAX_BYTES)
    points = _READERS[suffix](data, str(file))

    if factor != 1.0:
        points = points * factor

    if radius is None and _READERS[suffix] is octree_points:
        radius = factor * 0.5 * np.sqrt(3.0) * octree_resolution(data, str(file))
        # Points are stored in float32, so their rounding is added.
        radius += float(np.finfo(np.float32).eps) * float(np.abs(points).max(initial=0.0))
    elif radius is None:
        radius = RADIUS

    return PointCloud(points, radius, invalid=invalid, source=os.path.abspath(file), scale=factor)


def write_cloud(cloud: PointCloud, file: str | os.PathLike[str]) -> PointCloud:
    """Write the points of a cloud; see :meth:`PointCloud.save`.

    Raises:
        InputError: If the name has another ending, or the file cannot be written.
    """
    suffix = file_name(file).suffix.lower()
    if suffix == ".npy":
        stream = io.BytesIO()
        np.save(stream, cloud.points)
        data = stream.getvalue()
    elif suffix == ".ply":
        data = (PLY_HEADER.format(len(cloud.points)) + "end_header\n").encode() + cloud.points.astype("<f4").tobytes()
    else:
        raise InputError(f"{file}: a cloud is written as .npy or .ply")
    write_bytes(file, data)
    return PointCloud(cloud.points, cloud.radius, source=os.path.abspath(file))


def _npy_points(data: bytes, what: str) -> NDArray[Any]:
    return npy_points(data, what)


def _npz_points(data: bytes, what: str) -> NDArray[Any]:
    """Read the array "points" of an ``.npz`` file, or its only one."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {Path(each.filename).stem: each for each in archive.infolist() if each.filename.endswith(".npy")}
            name = POINTS if POINTS in sizes else next(iter(sizes), "")
            if name != POINTS and len(sizes) != 1:
                names = ", ".join(sizes) or "none"
                raise InputError(f"{what}: which array has the points? call it '{POINTS}'; it has {names}")
            at_most(sizes[name].file_size, MAX_BYTES, f"{what}: bytes of '{name}'")
            return npy_points(archive.read(sizes[name]), f"{what}: array '{name}'")
    except (zipfile.BadZipFile, NotImplementedError, EOFError, zlib.error):
        raise InputError(f"{what}: not an .npz file of numpy; save it again") from None


def _xyz_points(data: bytes, what: str) -> NDArray[Any]:
    return text_rows(data, (0, 1, 2), what)


_READERS: dict[str, Callable[[bytes, str], NDArray[Any]]] = {
    ".npy": _npy_points,
    ".npz": _npz_points,
    ".ply": ply_points,
    ".pcd": pcd_points,
    ".xyz": _xyz_points,
    ".bt": octree_points,
    ".ot": octree_points,
}
