"""Maps of OctoMap (.bt): the occupied cells of their octree.

Each node is two bytes, two bits for each of its eight children, the lowest first: unknown, free, occupied, or a node of
its own, which follows. The lowest bit of a child's number says on which side along x it lies, the next ones y and z.
"""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, positive
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.model.shapes.octree import Octree
from rrtik_ompl.model.shapes.point_cloud import MOST_POINTS

FIRST_LINE = b"# Octomap OcTree binary file"
OCCUPIED = 2  # two bits of a child; 3 is a node of its own
DEPTH = 16  # levels of cells below the root
MAX_BYTES = 256 * 1024 * 1024


def load_octree(path: str | os.PathLike[str], *, scale: float = 1.0) -> Octree:
    """Read a map of OctoMap, a ``.bt`` file: its occupied cells as cubes.

    Args:
        path: The file.
        scale: Metres per unit of the file.

    Raises:
        InputError: If the file cannot be read, is broken, or has no occupied cell or too many; one line.

    Example:
        >>> map = load_octree("rooms.bt")  # doctest: +SKIP
    """
    factor = positive(scale, f"{file_name(path)}: scale")
    centres, sides = octree_cells(read_bytes(path, MAX_BYTES), str(path))
    return Octree(factor * centres, factor * sides, source=os.path.abspath(path), scale=factor)


def octree_cells(data: bytes, what: str) -> tuple[Matrix, Vector]:
    """Centres, shape (n, 3), and side lengths, shape (n,), of the occupied cells of a ``.bt`` file.

    Raises:
        InputError: If it is none, or ends too early.
    """
    places, levels, resolution, _ = _occupied(data, what)
    return _cells(places, levels, resolution)


def cells_of_tree(body: bytes, resolution: float, kind: str, what: str) -> tuple[Matrix, Vector]:
    """As :func:`octree_cells`, of the tree alone, as ROS sends it: without the header of a file.

    Args:
        body: The tree.
        resolution: Side of the finest cells [m].
        kind: Type of the tree, "OcTree".
        what: Its name, for messages.

    Raises:
        InputError: If it is none, or ends too early.
    """
    places, levels, side, end = _cells_in(body, {"id": kind or "OcTree", "res": str(resolution)}, what)
    if end != len(body):
        raise InputError(f"{what}: not a tree of OctoMap: it ends after {end} of {len(body)} bytes")
    return _cells(places, levels, side)


def _cells(places: NDArray[np.float64], levels: NDArray[np.float64], resolution: float) -> tuple[Matrix, Vector]:
    """Centres and side lengths of cells."""
    sides = resolution * np.exp2(DEPTH - levels)
    lows = resolution * (places - float(1 << (DEPTH - 1)))
    return lows + 0.5 * sides[:, None], sides


def octree_points(data: bytes, what: str) -> Matrix:
    """Centres of all occupied cells of the finest resolution, shape (n, 3), of a ``.bt`` file.

    Raises:
        InputError: If it is none, ends too early, or has too many.
    """
    places, levels, resolution, _ = _occupied(data, what)
    widths = np.exp2(DEPTH - levels)

    if (count := float((widths**3).sum())) > MOST_POINTS:
        raise InputError(f"{what}: {count:.0f} occupied cells, more than {MOST_POINTS}; take it as an octree instead")

    corners = [np.zeros((0, 3))]
    for width in np.unique(widths).astype(int).tolist():
        offsets = np.indices((width, width, width)).reshape(3, -1).T
        corners.append((places[widths == width][:, None] + offsets).reshape(-1, 3))

    return resolution * (np.concatenate(corners) + 0.5 - float(1 << (DEPTH - 1)))


def octree_resolution(data: bytes, what: str) -> float:
    """Side of the finest cells of a ``.bt`` file [unit of the file].

    Raises:
        InputError: If it is none.
    """
    return _resolution(_header(data, what)[0], what)


def _header(data: bytes, what: str) -> tuple[dict[str, str], bytes]:
    """What the header of a file says, and the tree after it."""
    head, separator, body = data.partition(b"\ndata\n")
    if not data.startswith(FIRST_LINE) or not separator:
        raise InputError(f"{what}: not a map of OctoMap: expected '{FIRST_LINE.decode()}' and a line 'data'")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    return {line[0]: line[1] for line in lines if len(line) == 2 and line[0] != "#"}, body


def _resolution(header: dict[str, str], what: str) -> float:
    """Side of the finest cells [unit of the file]."""
    try:
        return positive(float(header["res"]), f"{what}: res")
    except (KeyError, ValueError):
        raise InputError(f"{what}: its header needs a line 'res' with the size of a cell") from None


def _occupied(data: bytes, what: str) -> tuple[NDArray[np.float64], NDArray[np.float64], float, int]:
    """Lowest corners of the occupied cells in finest cells, their levels, the size of the finest, the tree's end."""
    header, body = _header(data, what)
    return _cells_in(body, header, what)


def _cells_in(
    body: bytes, header: dict[str, str], what: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, int]:
    """The same, of a tree and what its header says."""
    if header.get("id", "OcTree") != "OcTree":
        raise InputError(f"{what}: a tree of type '{header['id'][:20]}' is unknown; write it as OcTree")
    resolution = _resolution(header, what)

    occupied: list[tuple[int, int, int, int]] = []
    unvisited = [(0, 0, 0, 0)] if body else []
    position = 0
    while unvisited:
        x, y, z, level = unvisited.pop()
        if level == DEPTH or position + 2 > len(body):
            raise InputError(f"{what}: the tree {'is too deep' if level == DEPTH else 'ends too early'}; save it again")

        bits = body[position] | body[position + 1] << 8
        position += 2
        half = 1 << (DEPTH - 1 - level)
        inner_nodes: list[tuple[int, int, int, int]] = []
        for child in range(8):
            kind = bits >> (2 * child) & 3
            if kind >= OCCUPIED:
                child_node = (x + half * (child & 1), y + half * (child >> 1 & 1), z + half * (child >> 2), level + 1)
                (occupied if kind == OCCUPIED else inner_nodes).append(child_node)
        unvisited += inner_nodes[::-1]  # the first one follows first

    rows = np.array(occupied, dtype=np.float64).reshape(-1, 4)
    return rows[:, :3], rows[:, 3], resolution, position
