"""Read maps of OctoMap (.bt, .ot): the occupied cells of their octree.

Both kinds of file store nodes depth first, each node before its children. The lowest bit of a child's number says on
which side along x it lies, the next ones along y and z.

- ``.bt``: each inner node has two bytes, with two bits for each of its eight children, the lowest bits first: unknown,
  free, occupied, or an inner node, which follows later.
- ``.ot``: each node has a log-odds value (float32), in maps with colours three bytes more, and one byte with a bit for
  each of its eight children, which follow. A node without children is a cell, occupied if its value is at least 0 [75].
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, positive
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.model.shapes.octree import COARSER, MOST_CELLS, Octree, tell_size
from rrtik_ompl.model.shapes.point_cloud import MOST_POINTS

BINARY = b"# Octomap OcTree binary file"
FULL = b"# Octomap OcTree file"
VALUE_BYTES = {"OcTree": 4, "ColorOcTree": 7}  # of a node in a full file, beside the byte of its children
OCCUPIED = 2  # value of a child's two bits
INNER = 3
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
    """Return the centres, shape (n, 3), and side lengths, shape (n,), of the occupied cells of a file.

    Raises:
        InputError: If it is not such a file, or ends too early.
    """
    return _occupied(data, what).measured()


def cells_of_tree(
    body: bytes, resolution: float, kind: str, what: str, *, binary: bool = True
) -> tuple[Matrix, Vector]:
    """Return the same as :func:`octree_cells` for a tree without the header of a file, as ROS sends it.

    Args:
        body: The tree.
        resolution: Side of the finest cells [m].
        kind: Type of the tree, "OcTree".
        what: Its name, for messages.
        binary: Whether it is stored as in a ``.bt`` file, not as in an ``.ot`` file.

    Raises:
        InputError: If it is not a tree, or ends too early.
    """
    return _cells_in(body, {"id": kind or "OcTree", "res": str(resolution)}, binary, what).measured()


def octree_points(data: bytes, what: str) -> Matrix:
    """Return the centres of all occupied cells of a file at the finest resolution, shape (n, 3).

    Raises:
        InputError: If it is not such a file, ends too early, or has too many cells.
    """
    cells = _occupied(data, what)
    widths = np.exp2(DEPTH - cells.levels)

    if (count := float((widths**3).sum())) > MOST_POINTS:
        raise InputError(f"{what}: {count:.0f} occupied cells, more than {MOST_POINTS}; take it as an octree instead")

    corners = [np.zeros((0, 3))]
    for width in np.unique(widths).astype(int).tolist():
        offsets = np.indices((width, width, width)).reshape(3, -1).T
        corners.append((cells.places[widths == width][:, None] + offsets).reshape(-1, 3))

    return cells.resolution * (np.concatenate(corners) + 0.5 - float(1 << (DEPTH - 1)))


def octree_resolution(data: bytes, what: str) -> float:
    """Return the side of the finest cells of a file [unit of the file].

    Raises:
        InputError: If it is not such a file.
    """
    return _resolution(_header(data, what)[0], what)


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells of a tree.

    Attributes:
        places: Their lowest corners in finest cells, from the lowest corner of the map, shape (n, 3).
        levels: Their levels below the root, shape (n,).
        resolution: The side of the finest cells.
    """

    places: NDArray[np.int64]
    levels: NDArray[np.int64]
    resolution: float

    def measured(self) -> tuple[Matrix, Vector]:
        """Return their centres, shape (n, 3), and side lengths, shape (n,)."""
        sides = self.resolution * np.exp2(DEPTH - self.levels)
        lows = self.resolution * (self.places - float(1 << (DEPTH - 1)))
        return lows + 0.5 * sides[:, None], sides


def _header(data: bytes, what: str) -> tuple[dict[str, str], bytes]:
    """Return the entries of a file's header, and the tree after it."""
    head, separator, body = data.partition(b"\ndata\n")
    if not data.startswith((BINARY, FULL)) or not separator:
        first = f"'{BINARY.decode()}' or '{FULL.decode()}'"
        raise InputError(f"{what}: not a map of OctoMap: expected {first} and a line 'data'")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    return {line[0]: line[1] for line in lines if len(line) == 2 and line[0] != "#"}, body


def _resolution(header: dict[str, str], what: str) -> float:
    """Return the side of the finest cells [unit of the file]."""
    try:
        return positive(float(header["res"]), f"{what}: res")
    except (KeyError, ValueError):
        raise InputError(f"{what}: its header needs a line 'res' with the size of a cell") from None


def _occupied(data: bytes, what: str) -> _Cells:
    """Return the occupied cells of a file."""
    header, body = _header(data, what)
    return _cells_in(body, header, data.startswith(BINARY), what)


def _cells_in(body: bytes, header: dict[str, str], binary: bool, what: str) -> _Cells:
    """Return the occupied cells of a tree.

    Args:
        body: The tree.
        header: The entries of its header.
        binary: Whether it is stored as in a ``.bt`` file.
        what: Its name, for messages.
    """
    kind = header.get("id", "OcTree")
    if kind not in VALUE_BYTES:
        raise InputError(f"{what}: a tree of type '{kind[:20]}' is unknown; write it as OcTree")
    resolution = _resolution(header, what)
    size = 2 if binary else VALUE_BYTES[kind] + 1
    if len(body) % size != 0:
        early = f"the tree ends too early, within a node of {size} bytes"
        raise InputError(f"{what}: not a tree of OctoMap: {early}; save it again")

    nodes = np.frombuffer(body, dtype=np.uint8).reshape(-1, size)
    at_most(len(nodes), MOST_CELLS, f"{what}: nodes of its tree", COARSER)
    if binary:
        bits = nodes[:, 0].astype(np.uint16) | nodes[:, 1].astype(np.uint16) << 8
        kinds = (bits[:, None] >> (2 * np.arange(8, dtype=np.uint16)) & 3).astype(np.uint8)  # of children, shape (n, 8)
        _bounded(int(np.count_nonzero(kinds == OCCUPIED)), what)
        follows = kinds == INNER
        places, levels = _walked(follows, DEPTH - 1, what)
        node, child = np.nonzero(kinds == OCCUPIED)
        return _Cells(_of_children(places[node], levels[node], child), levels[node] + 1, resolution)

    follows = (nodes[:, -1:] >> np.arange(8, dtype=np.uint8) & 1).astype(bool)
    values = np.ascontiguousarray(nodes[:, :4]).view("<f4")[:, 0]
    cells = ~follows.any(axis=1) & (values >= 0.0)
    _bounded(int(np.count_nonzero(cells)), what)
    places, levels = _walked(follows, DEPTH, what)
    return _Cells(places[cells], levels[cells], resolution)


def _bounded(count: int, what: str) -> None:
    """Refuse too many cells before they are made, and say what many take."""
    at_most(count, MOST_CELLS, f"{what}: cells", COARSER)
    tell_size(count)


def _walked(follows: NDArray[np.bool_], deepest: int, what: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where the nodes of a tree are that are stored depth first.

    Args:
        follows: Which of its eight children of each node are stored behind it, shape (n, 8).
        deepest: Last level on which nodes may be.
        what: Name of the tree, for messages.

    Returns:
        Lowest corners in finest cells, shape (n, 3), and levels below the root, shape (n,).
    """
    count = len(follows)
    places = np.zeros((count, 3), dtype=np.int64)
    levels = np.zeros(count, dtype=np.int64)
    if count == 0:
        return places, levels

    ends = _subtree_ends(follows.sum(axis=1), what)
    here = np.zeros(1, dtype=np.int64)  # the nodes of a level
    for level in range(deepest + 1):
        after = here + 1  # where the next child of each of them is stored
        found = []
        for child in range(8):
            has = follows[here, child]
            children = after[has]
            if len(children) and level == deepest:
                raise InputError(f"{what}: the tree is too deep; save it again")
            places[children] = _of_children(places[here[has]], levels[here[has]], np.full(len(children), child))
            levels[children] = level + 1
            after[has] = ends[children]
            found.append(children)
        here = np.concatenate(found)
        if len(here) == 0:
            break
    return places, levels


def _of_children(places: NDArray[np.int64], levels: NDArray[np.int64], child: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the lowest corners of children, shape (n, 3), from those of their nodes, and the children's numbers."""
    half = np.left_shift(1, np.maximum(DEPTH - 1 - levels, 0))
    corners: NDArray[np.int64] = places + half[:, None] * (child[:, None] >> np.arange(3) & 1)
    return corners


def _subtree_ends(counts: NDArray[np.int64], what: str) -> NDArray[np.int64]:
    """Return the number of the node behind all that is below each node, from how many children each has.

    Behind node k, ``open_[k]`` nodes are announced and not yet stored. All below a node is stored where that is for the
    first time one less than before the node; as it falls by one at most, that is where it is this number again.
    """
    open_ = np.cumsum(counts - 1) + 1
    if open_[-1] > 0:
        raise InputError(f"{what}: the tree ends too early; save it again")
    end = int(np.argmax(open_ == 0)) + 1
    if end < len(counts):
        raise InputError(f"{what}: not a tree of OctoMap: it ends after {end} of {len(counts)} nodes")

    numbers = np.arange(len(counts))
    keys = open_ * len(counts) + numbers
    order = np.argsort(keys, kind="stable")
    before = np.concatenate([[1], open_[:-1]])
    wanted = (before - 1) * len(counts) + numbers
    ends: NDArray[np.int64] = order[np.searchsorted(keys[order], wanted)] + 1
    return ends
