"""Read files of points as `shapes.PointCloud`, and write them."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import positive
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.description.shapes.octree import octree_points, octree_resolution
from rrtik_ompl.files.point_files import AXES, npy_rows, pcd_points, ply_points, text_rows
from rrtik_ompl.files.text import file_name, read_bytes, write_bytes
from rrtik_ompl.model.shapes import PointCloud
from rrtik_ompl.model.shapes.point_cloud import RADIUS, Invalid

MAX_BYTES = 1024 * 1024 * 1024
PLY_HEADER = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)


def load_cloud(
    path: str | os.PathLike[str],
    radius: float | None = None,
    *,
    scale: float = 1.0,
    invalid: Invalid = "refuse",
) -> PointCloud:
    """Read a cloud of points: ``.npy`` (an array of shape (n, 3)), ``.ply``, ``.pcd``, ``.bt``, ``.xyz`` (text).

    From a map of OctoMap (``.bt``) the centre of each occupied cell is taken; unless a radius is given, the points have
    balls that cover the cells, of half the cells' diagonal.

    Args:
        path: The file.
        radius: Radius of the ball at each point [m]; if None, 0.01, or what covers the cells of a map.
        scale: Metres per unit of the file; 0.001 for millimetres.
        invalid: Whether points that are not finite are refused or dropped.

    Raises:
        InputError: If the file cannot be read, is broken, or has no usable point; one line.

    Warns:
        CloudWarning: If the cloud is so large that it is probably in millimetres.

    Example:
        >>> cloud = load_cloud("scan.ply", radius=0.01).voxel(0.01)  # doctest: +SKIP
    """
    file_name(path)
    factor = positive(scale, f"{path}: scale")
    suffix = Path(path).suffix.lower()
    if suffix not in _READERS:
        raise InputError(f"{path}: unknown kind of cloud; have {', '.join(_READERS)}; export it as PLY")

    data = read_bytes(path, MAX_BYTES)
    points = _READERS[suffix](data, str(path))

    if factor != 1.0:
        points = points * factor

    if radius is None and suffix == ".bt":
        radius = factor * 0.5 * np.sqrt(3.0) * octree_resolution(data, str(path))
        # Points are stored in float32, so their rounding is added.
        radius += float(np.finfo(np.float32).eps) * float(np.abs(points).max(initial=0.0))
    elif radius is None:
        radius = RADIUS

    return PointCloud(points, radius, invalid=invalid, source=os.path.abspath(path), scale=factor)


def save_cloud(cloud: PointCloud, path: str | os.PathLike[str]) -> PointCloud:
    """Write the points of a cloud as ``.npy`` or ``.ply``, whole or not at all.

    Returns:
        The cloud with that file as its source, so that a scene with it can be written.

    Raises:
        InputError: If the name has another ending, or the file cannot be written.

    Example:
        >>> cloud = rrtik.PointCloud(np.eye(3), radius=0.01)
        >>> rrtik.save_cloud(cloud, "scan.ply").points.shape
        (3, 3)
    """
    require(cloud, PointCloud, "cloud to save")
    suffix = file_name(path).suffix.lower()
    if suffix == ".npy":
        stream = io.BytesIO()
        np.save(stream, cloud.points)
        data = stream.getvalue()
    elif suffix == ".ply":
        data = (PLY_HEADER.format(len(cloud.points)) + "end_header\n").encode() + cloud.points.astype("<f4").tobytes()
    else:
        raise InputError(f"{path}: a cloud is written as .npy or .ply")
    write_bytes(path, data)
    return PointCloud(cloud.points, cloud.radius, source=os.path.abspath(path))


def _npy_points(data: bytes, what: str) -> NDArray[Any]:
    return npy_rows(data, what, len(AXES))


def _xyz_points(data: bytes, what: str) -> NDArray[Any]:
    return text_rows(data, (0, 1, 2), what)


_READERS: dict[str, Callable[[bytes, str], NDArray[Any]]] = {
    ".npy": _npy_points,
    ".ply": ply_points,
    ".pcd": pcd_points,
    ".xyz": _xyz_points,
    ".bt": octree_points,
}
