"""A solid cut into small convex elements, so that a ball covers an element if it holds the element's corners.

The box around the solid is cut into cells. The part of a solid in a cell lies in the convex hull of (a) the corners
of the surface pieces in the cell and (b) the corners of the cell that are inside: an extreme point of that part is
either on the surface or has a whole neighbourhood in the solid, and then it can only be a corner of the cell. The
hulls leave no gap, and a ball, being convex, holds a hull if it holds its corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.fast.cover_solids import Solid, Triangles

NEAR = 1e-9  # in cells: closer than this to an edge or a plane counts as doubtful, and doubt counts as inside
MOST_CELLS = 120_000
MOST_RIM_WORK = 20_000_000
MARGINS = (0.0171, 0.0233, 0.0197)  # of a cell: keeps the faces of axis-aligned solids off the planes between cells
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """Convex elements whose union contains the solid.

    Attributes:
        points: Balls (small ones, often points) whose hull contains the element, shape (p, 3).
        radii: Their radii, shape (p,).
        start: Number of the first point of every element, shape (e,).
        inside: Lattice points that are surely inside the solid (an open one with its caps), shape (k, 3).
        on_surface: A point at or near the surface for every element that the surface crosses, shape (s, 3).
    """

    points: Matrix
    radii: Vector
    start: NDArray[np.int64]
    inside: Matrix
    on_surface: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Cells of equal size."""

    origin: Vector
    size: Vector
    shape: tuple[int, int, int]

    def to_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points, shape (..., 3), counted in cells."""
        return np.asarray((points - self.origin) / self.size)

    def from_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points, shape (..., 3), in the solid's frame."""
        return np.asarray(self.origin + points * self.size)


def elements(solid: Solid, crossed: int, detail: int = 4) -> Elements:
    """Cut a solid into elements.

    Args:
        solid: The solid.
        crossed: About how many cells the surface may cross.
        detail: Points of an element closer than a cell over ``detail`` are put together into one small ball.
    """
    grid = _grid(solid.triangles, crossed)
    pieces, cell = _pieces(grid.to_cells(solid.triangles), grid.shape)
    crossed_cells = np.zeros(grid.shape, dtype=bool)
    crossed_cells.ravel()[cell] = True
    count, doubtful = _winding(grid.to_cells(np.concatenate([solid.triangles, solid.rim])), grid.shape)
    corner_inside = (count != 0) | doubtful
    full = ~crossed_cells & _all_corners(corner_inside)
    whole = np.zeros_like(full)
    if len(solid.rim):
        corner_inside, full, whole = _open_cells(grid, solid.rim, count, doubtful, crossed_cells)
    points, owner = _corner_points(crossed_cells & ~whole, corner_inside)
    boxes = [_boxes(*level) for level in _blocks(full | whole)]
    parts = np.concatenate([pieces.reshape(-1, 3), points])
    owners = np.concatenate([np.repeat(cell, 3), owner])
    parts, radii, owners = _thinned(parts, owners, detail, grid)
    return _assembled(grid, parts, radii, owners, np.concatenate(boxes), np.argwhere((count != 0) & ~doubtful))


def _grid(triangles: Triangles, crossed: int) -> Grid:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    extent = np.maximum(high - low, 1e-9)
    a, b, c = (triangles[:, k] for k in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    box = 2.0 * float(extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0])
    step = max(np.sqrt(1.5 * min(0.5 * area, 2.0 * box) / crossed), float(np.prod(extent) / MOST_CELLS) ** (1.0 / 3.0))
    number = np.maximum(np.ceil(extent / step), 1.0)
    while np.prod(number) > 4 * MOST_CELLS:
        number = np.maximum(np.ceil(number / 2.0), 1.0)
    size = extent / (number - 2.0 * np.array(MARGINS) * 0.999)
    origin = low - size * MARGINS
    return Grid(origin, size, (int(number[0]), int(number[1]), int(number[2])))


def _pieces(triangles: Triangles, shape: tuple[int, int, int]) -> tuple[Triangles, NDArray[np.int64]]:
    """Triangles (in cells) cut along the planes between cells, and the number of the cell that each piece is in."""
    for axis in range(3):
        done, rest = [], triangles
        while len(rest):
            low, high = rest[:, :, axis].min(axis=1), rest[:, :, axis].max(axis=1)
            first = np.floor(low + NEAR) + 1.0
            spans = high > first + NEAR
            done.append(rest[~spans])
            last = np.ceil(high[spans] - NEAR) - 1.0
            rest = _cut(rest[spans], axis, np.floor(0.5 * (first[spans] + last)))
        triangles = np.concatenate(done)
    return _placed(triangles, shape)


def _cut(triangles: Triangles, axis: int, plane: Vector) -> Triangles:
    """Cut triangles in three by planes that pass through each."""
    if not len(triangles):
        return triangles
    beyond = triangles[:, :, axis] > plane[:, None]
    lone = np.where((beyond.sum(axis=1) == 1)[:, None], beyond, ~beyond).argmax(axis=1)
    row = np.arange(len(triangles))
    a, b, c = (triangles[row, (lone + k) % 3] for k in range(3))
    ab, ac = _meet(a, b, axis, plane), _meet(a, c, axis, plane)
    return np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ac), (ab, b, c), (ab, c, ac))])


def _meet(a: Matrix, b: Matrix, axis: int, plane: Vector) -> Matrix:
    share = np.clip((plane - a[:, axis]) / (b[:, axis] - a[:, axis]), 0.0, 1.0)
    point = np.asarray(a + share[:, None] * (b - a))
    point[:, axis] = plane
    return point


def _placed(pieces: Triangles, shape: tuple[int, int, int]) -> tuple[Triangles, NDArray[np.int64]]:
    """Cell of every piece; a piece that lies in the plane between two cells belongs to both."""
    index = np.floor(pieces.mean(axis=1))
    for axis in range(3):
        level = np.round(pieces[:, 0, axis])
        flat = np.abs(pieces[:, :, axis] - level[:, None]).max(axis=1) <= 2.0 * NEAR
        for side in (-1.0, 0.0):
            twin = index[: len(flat)][flat]
            twin[:, axis] = level[flat] + side
            pieces, index = np.concatenate([pieces, pieces[: len(flat)][flat]]), np.concatenate([index, twin])
    index = np.clip(index, 0, np.array(shape) - 1).astype(np.int64)
    return pieces, np.ravel_multi_index((index[:, 0], index[:, 1], index[:, 2]), shape)


def _winding(triangles: Triangles, shape: tuple[int, int, int]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Winding number of a closed surface at every corner of the grid, and where it is doubtful.

    Counted along the lines of corners parallel to x, with sign; a line that comes close to an edge is doubtful.
    """
    corners = (shape[0] + 1, shape[1] + 1, shape[2] + 1)
    passed = np.zeros(corners, dtype=np.int64)
    doubtful = np.zeros(corners, dtype=bool)
    which, y, z = _lines_near(triangles, corners)
    a, b, c = (triangles[which, k] for k in range(3))
    line = np.column_stack([y, z]).astype(np.float64)
    offs = [_off_edge(p, q, line) for p, q in ((a, b), (b, c), (c, a))]
    off = np.stack(offs)
    hit = (off > NEAR).all(axis=0) | (off < -NEAR).all(axis=0)
    near = ~hit & ((off >= -NEAR).all(axis=0) | (off <= NEAR).all(axis=0))
    doubtful[:, y[near], z[near]] = True
    a, b, c, y, z, line = a[hit], b[hit], c[hit], y[hit], z[hit], line[hit]
    if len(a):
        x, blur = _crossing(a, b, c, line)
        sign = np.where(off[0, hit] > 0.0, 1, -1)
        before = np.clip(np.ceil(x), 0, corners[0]).astype(np.int64)  # corners with a smaller x see this crossing
        some = before > 0
        np.add.at(passed, (before[some] - 1, y[some], z[some]), sign[some])
        close = np.round(x)
        at = (np.abs(x - close) <= blur) & (close >= 0) & (close < corners[0])
        doubtful[close[at].astype(np.int64), y[at], z[at]] = True
        doubtful[:, y[blur > 0.1], z[blur > 0.1]] = True
    return np.asarray(passed[::-1].cumsum(axis=0)[::-1]), doubtful


def _lines_near(triangles: Triangles, corners: tuple[int, int, int]) -> tuple[NDArray[np.int64], ...]:
    """Pairs of a triangle and a line of corners that passes through the box around it, seen along x."""
    low = np.ceil(triangles[:, :, 1:].min(axis=1) - NEAR).astype(np.int64)
    high = np.floor(triangles[:, :, 1:].max(axis=1) + NEAR).astype(np.int64)
    low, high = np.maximum(low, 0), np.minimum(high, np.array(corners[1:]) - 1)
    count = np.maximum(high - low + 1, 0)
    total = count.prod(axis=1)
    which = np.repeat(np.arange(len(triangles)), total)
    place = np.arange(len(which)) - np.repeat(np.cumsum(total) - total, total)
    return which, low[which, 0] + place // count[which, 1], low[which, 1] + place % count[which, 1]


def _off_edge(p: Matrix, q: Matrix, line: Matrix) -> Vector:
    """Signed distance of lines along x from the edge p q, seen along x."""
    side, away = q[:, 1:] - p[:, 1:], line - p[:, 1:]
    length = np.linalg.norm(side, axis=1)
    cross = side[:, 0] * away[:, 1] - side[:, 1] * away[:, 0]
    return np.asarray(np.where(length > NEAR, cross / np.maximum(length, NEAR), 0.0))


def _crossing(a: Matrix, b: Matrix, c: Matrix, line: Matrix) -> tuple[Vector, Vector]:
    """Where lines along x pass through triangles, and how uncertain that is."""
    normal = np.cross(b - a, c - a)
    x = a[:, 0] - ((line - a[:, 1:]) * normal[:, 1:]).sum(axis=1) / normal[:, 0]
    steep = np.abs(normal[:, 0]) / np.linalg.norm(normal, axis=1)
    return x, NEAR / np.maximum(steep, 1e-12)


def _all_corners(flag: NDArray[np.bool_]) -> NDArray[np.bool_]:
    found = np.ones(tuple(n - 1 for n in flag.shape), dtype=bool)
    for x, y, z in CORNERS:
        found &= flag[x : flag.shape[0] - 1 + x, y : flag.shape[1] - 1 + y, z : flag.shape[2] - 1 + z]
    return found


def _open_cells(
    grid: Grid, rim: Triangles, count: NDArray[np.int64], doubtful: NDArray[np.bool_], crossed: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """What is inside an open surface: corners inside, cells wholly inside, cells to be taken whole for safety.

    With its caps the surface is closed and the winding number a whole number; the caps' own share is taken off again.
    Away from the surface the winding number changes no faster than the open edges pull (Biot and Savart's law).
    """
    if count.size * len(rim) > MOST_RIM_WORK:
        return np.ones_like(doubtful), ~crossed, np.ones_like(crossed)
    corners = grid.from_cells(np.indices(count.shape).reshape(3, -1).T.astype(np.float64))
    reach = float(np.linalg.norm(grid.size))
    share, change = _share_of(rim, corners, reach)
    share, change = share.reshape(count.shape), change.reshape(count.shape)
    winding = count - share
    unclear = doubtful | (np.abs(share - np.round(share)) + change >= 0.49)
    maybe = doubtful | (np.abs(winding) + change >= 0.49)
    inside = maybe | (np.round(winding) != 0)
    # one clear corner speaks for its whole cell; where the surface crosses an unclear cell the whole cell is taken
    clear_cell = ~_all_corners(unclear)
    outside_cell = ~_all_corners(maybe)
    full = ~crossed & ~outside_cell
    return inside, full, crossed & ~clear_cell


def _share_of(caps: Triangles, points: Matrix, reach: float) -> tuple[Vector, Vector]:
    """Winding number of the caps, and a bound of its change within ``reach``."""
    share, change = np.zeros(len(points)), np.zeros(len(points))
    for apex, p, q in caps:
        a, b, c = apex - points, p - points, q - points
        la, lb, lc = (np.sqrt(np.einsum("ij,ij->i", v, v)) for v in (a, b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
        above = np.einsum("ij,ij->i", a, np.cross(b, c))
        share += np.arctan2(above, la * lb * lc + ab * lc + bc * la + ca * lb)
        length = float(np.linalg.norm(q - p))
        gap = np.maximum(np.linalg.norm(0.5 * (p + q) - points, axis=1) - 0.5 * length - reach, 1e-9)
        change += length / gap**2
    return share / (2.0 * np.pi), change * reach / (4.0 * np.pi)


def _corner_points(cells: NDArray[np.bool_], inside: NDArray[np.bool_]) -> tuple[Matrix, NDArray[np.int64]]:
    """Corners of the given cells that are inside, and the cell of each."""
    index = np.argwhere(cells)
    number = np.flatnonzero(cells)
    corner = index[:, None] + CORNERS
    keep = inside[corner[..., 0], corner[..., 1], corner[..., 2]]
    return corner[keep].astype(np.float64), np.repeat(number, 8).reshape(-1, 8)[keep]


def _blocks(full: NDArray[np.bool_]) -> list[tuple[Matrix, int]]:
    """Full cells put together into cubes of 4, 2 and 1 cells: lowest corners and sizes."""
    found, rest = [], full.copy()
    for size in (4, 2, 1):
        pad = [(0, -n % size) for n in rest.shape]
        tiles = np.pad(rest, pad)
        nx, ny, nz = (n // size for n in tiles.shape)
        together = tiles.reshape(nx, size, ny, size, nz, size).all(axis=(1, 3, 5))
        found.append((np.argwhere(together).astype(np.float64) * size, size))
        taken = together.repeat(size, axis=0).repeat(size, axis=1).repeat(size, axis=2)
        rest &= ~taken[: rest.shape[0], : rest.shape[1], : rest.shape[2]]
    return found


def _boxes(low: Matrix, size: int) -> NDArray[np.float64]:
    return np.asarray(low[:, None] + CORNERS * float(size))


def _thinned(
    points: Matrix, owner: NDArray[np.int64], detail: int, grid: Grid
) -> tuple[Matrix, Vector, NDArray[np.int64]]:
    """Points of one cell that are close together replaced by one ball around them."""
    cell = np.column_stack(np.unravel_index(owner, grid.shape))
    within = np.clip(np.floor((points - cell) * detail).astype(np.int64), 0, detail - 1)
    key = ((owner * detail + within[:, 0]) * detail + within[:, 1]) * detail + within[:, 2]
    _, group = np.unique(key, return_inverse=True)
    group = group.ravel()
    order = np.argsort(group, kind="stable")
    start = np.flatnonzero(np.r_[True, np.diff(group[order]) > 0])
    sorted_points = points[order]
    middle = 0.5 * (np.minimum.reduceat(sorted_points, start) + np.maximum.reduceat(sorted_points, start))
    away = np.linalg.norm((sorted_points - middle[group[order]]) * grid.size, axis=1)
    return middle, np.maximum.reduceat(away, start), owner[order][start]


def _assembled(
    grid: Grid,
    points: Matrix,
    radii: Vector,
    owner: NDArray[np.int64],
    boxes: NDArray[np.float64],
    sure: NDArray[np.int64],
) -> Elements:
    """Elements in the solid's frame; the radii make up for surface that pokes into a cell by less than ``NEAR``."""
    poke = 4.0 * NEAR * float(np.linalg.norm(grid.size))
    start = np.flatnonzero(np.r_[True, np.diff(owner) > 0])
    middle = np.add.reduceat(points, start) / np.diff(np.r_[start, len(points)])[:, None]
    return Elements(
        grid.from_cells(np.concatenate([points, boxes.reshape(-1, 3)])),
        np.concatenate([radii, np.zeros(8 * len(boxes))]) + poke,
        np.concatenate([start, len(points) + 8 * np.arange(len(boxes))]),
        grid.from_cells(sure.astype(np.float64)),
        grid.from_cells(middle),
    )
