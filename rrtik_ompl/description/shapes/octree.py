"""Read maps of OctoMap (.bt): the occupied cells of their octree.

Each node has two bytes, with two bits for each of its eight children, the lowest bits first: unknown, free, occupied,
or an inner node, which follows later. The lowest bit of a child's number says on which side along x it lies, the next
ones along y and z.
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
OCCUPIED = 2  # value of a child's two bits; 3 is an inner node
DEPTH = 16  # number of levels below the root
MAX_BYTES = 256 * 1024 * 1024


def read_octree(file: str | os.PathLike[str], *, scale: float = 1.0) -> Octree:
    """Read a map of OctoMap; see :meth:`Octree.load`.

    Raises:
        InputError: If the file cannot be read, is broken, or has no occupied cell or too many; one line.
    """
    factor = positive(scale, f"{file_name(file)}: scale")
    centres, sides = octree_cells(read_bytes(file, MAX_BYTES), str(file))
    return Octree(factor * centres, factor * sides, source=os.path.abspath(file), scale=factor)


def octree_cells(data: bytes, what: str) -> tuple[Matrix, Vector]:
    """Return the centres, shape (n, 3), and side lengths, shape (n,), of the occupied cells of a ``.bt`` file.

    Raises:
        InputError: If it is not such a file, or ends too early.
    """
    places, levels, resolution, _ = _occupied(data, what)
    return _cells(places, levels, resolution)


def cells_of_tree(body: bytes, resolution: float, kind: str, what: str) -> tuple[Matrix, Vector]:
    """Return the same as :func:`octree_cells` for a tree without the header of a file, as ROS sends it.

    Args:
        body: The tree.
        resolution: Side of the finest cells [m].
        kind: Type of the tree, "OcTree".
        what: Its name, for messages.

    Raises:
        InputError: If it is not a tree, or ends too early.
    """
    places, levels, side, end = _cells_in(body, {"id": kind or "OcTree", "res": str(resolution)}, what)
    if end != len(body):
        raise InputError(f"{what}: not a tree of OctoMap: it ends after {end} of {len(body)} bytes")
    return _cells(places, levels, side)


def _cells(places: NDArray[np.float64], levels: NDArray[np.float64], resolution: float) -> tuple[Matrix, Vector]:
    """Return centres, shape (n, 3), and side lengths, shape (n,), of cells.

    Args:
        places: Lowest corners, in finest cells from the lowest corner of the map, shape (n, 3).
        levels: Level of each cell below the root, shape (n,).
        resolution: Side of the finest cells.
    """
    sides = resolution * np.exp2(DEPTH - levels)
    lows = resolution * (places - float(1 << (DEPTH - 1)))
    return lows + 0.5 * sides[:, None], sides


def octree_points(data: bytes, what: str) -> Matrix:
    """Return the centres of all occupied cells of a ``.bt`` file at the finest resolution, shape (n, 3).

    Raises:
        InputError: If it is not such a file, ends too early, or has too many cells.
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
    """Return the side of the finest cells of a ``.bt`` file [unit of the file].

    Raises:
        InputError: If it is not such a file.
    """
    return _resolution(_header(data, what)[0], what)


def _header(data: bytes, what: str) -> tuple[dict[str, str], bytes]:
    """Return the entries of a file's header, and the tree after it."""
    head, separator, body = data.partition(b"\ndata\n")
    if not data.startswith(FIRST_LINE) or not separator:
        raise InputError(f"{what}: not a map of OctoMap: expected '{FIRST_LINE.decode()}' and a line 'data'")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    return {line[0]: line[1] for line in lines if len(line) == 2 and line[0] != "#"}, body


def _resolution(header: dict[str, str], what: str) -> float:
    """Return the side of the finest cells [unit of the file]."""
    try:
        return positive(float(header["res"]), f"{what}: res")
    except (KeyError, ValueError):
        raise InputError(f"{what}: its header needs a line 'res' with the size of a cell") from None


def _occupied(data: bytes, what: str) -> tuple[NDArray[np.float64], NDArray[np.float64], float, int]:
    """Return the occupied cells of a file, as :func:`_cells_in` does."""
    header, body = _header(data, what)
    return _cells_in(body, header, what)


def _cells_in(
    body: bytes, header: dict[str, str], what: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, int]:
    """Return the occupied cells of a tree.

    The nodes are stored depth first, so a stack of unvisited inner nodes is kept.

    Args:
        body: The tree.
        header: The entries of its header.
        what: Its name, for messages.

    Returns:
        Lowest corners in finest cells, shape (n, 3); levels below the root, shape (n,); the side of the finest cells;
        and the number of bytes read.
    """
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
        unvisited += inner_nodes[::-1]  # The first inner node is stored next.

    rows = np.array(occupied, dtype=np.float64).reshape(-1, 4)
    return rows[:, :3], rows[:, 3], resolution, position
