"""Cut a solid into small convex elements, so that a ball covers an element if it contains the element's corners.

The box around the solid is cut into cells. The part of the solid in a cell lies in the convex hull of (a) the corners
of the surface pieces in the cell and (b) the corners of the cell that are inside the solid. This is so because an
extreme point of that part is either on the surface or has a whole neighbourhood in the solid, and then it can only be a
corner of the cell. The hulls leave no gap, and a ball, being convex, contains a hull if it contains its corners. An
open surface has no interior but the boxes that it encloses, which are given with it.

Winding numbers at the corners of the cells decide which corners are inside: those of a closed surface are integers and
change only where the surface is crossed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, box_of
from rrtik_ompl.kernels.covers.cell_layout import EDGE_TOLERANCE, KERNELS, MOST_DOUBT, POLYGON, POLYGONS
from rrtik_ompl.kernels.covers.memory import called
from rrtik_ompl.kernels.covers.solids import CORNERS, Solid, Triangles
from rrtik_ompl.kernels.simd.library import library

MAX_CELLS = 120_000
MAX_CELLS_ALONG_AXIS = 160.0  # limited, as a long triangle is cut into many more pieces than there are cells
LATTICE_CROSSED = 1500  # number of cells that the surface crosses, in the first lattice that is tried
MOST_LATTICE_CROSSED = 25_000
LATTICE_LEAST = 4  # fewest cells along an axis of a lattice, so that even a thin solid has points inside
MARGINS = (0.0171, 0.0233, 0.0197)  # [cells] shift of the grid that keeps faces of axis-aligned solids off its planes
MOST_IN_TABLE = 50_000  # cells with points, from which on the points are sorted, as a table would be too large

Flags = NDArray[np.bool_]
Shape = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """Convex elements whose union contains the solid.

    Attributes:
        points: Centres of small balls (often of radius 0); those of one element have a hull that contains it;
            shape (p, 3).
        radii: Radii of these balls, shape (p,).
        start: Index of the first point of each element; its points run up to the next element's first; shape (e,).
        inside: Lattice points that are surely inside the solid (an open one with its caps), shape (k, 3).
        on_surface: A point at or near the surface for each element that the surface crosses, shape (s, 3).
    """

    points: Matrix
    radii: Vector
    start: NDArray[np.int64]
    inside: Matrix
    on_surface: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """A grid of equal cells: its lowest corner, the sides of a cell, and the number of cells along each axis."""

    origin: Vector
    size: Vector
    shape: Shape

    def corners(self) -> Matrix:
        """Return all corners of cells in the solid's frame, shape (k, 3), the last axis running fastest."""
        number = np.indices((self.shape[0] + 1, self.shape[1] + 1, self.shape[2] + 1))
        return self.from_cells(number.reshape(3, -1).T.astype(np.float64))

    def to_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert points of the solid's frame, shape (..., 3), to grid coordinates, in which a cell has unit sides."""
        return np.asarray((points - self.origin) / self.size)

    def from_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert points in grid coordinates, shape (..., 3), to the solid's frame."""
        return np.asarray(self.origin + points * self.size)


def elements(solid: Solid, crossed: int, detail: int = 4) -> Elements:
    """Cut a solid into convex elements.

    First the surface is cut along the planes of a grid; each cell that it crosses becomes an element, whose points are
    the corners of its surface pieces and its own corners that are inside the solid. Then cells wholly inside are merged
    into larger boxes, each of which is an element too.

    Args:
        solid: The solid.
        crossed: Approximate number of cells that the surface is to cross.
        detail: Each cell is divided into ``detail`` parts along every axis, and the points within one part are replaced
            by one small ball around them.
    """
    grid = _grid(solid.triangles, crossed)
    surface_points, cell_of_surface = _in_cells(grid.to_cells(solid.triangles), grid.shape)
    crossed_cells = np.zeros(grid.shape, dtype=bool)
    crossed_cells.ravel()[cell_of_surface] = True

    winding_numbers, doubtful = winding(grid.to_cells(np.concatenate([solid.triangles, solid.rim])), grid.shape)
    corner_inside = ((winding_numbers != 0) | doubtful) & (len(solid.rim) == 0)
    corner_points, cell_of_corner = _inner_corners(crossed_cells, corner_inside)

    boxes = np.concatenate([_boxes(*level) for level in _blocks(~crossed_cells & all_corners(corner_inside))])
    boxes = np.concatenate([boxes, grid.to_cells(solid.enclosed)])

    points = np.concatenate([surface_points, corner_points])
    cell_of_point = np.concatenate([cell_of_surface, cell_of_corner])
    points, radii, cell_of_point = _merged_within_cells(points, cell_of_point, detail, grid)

    return _as_elements(grid, points, radii, cell_of_point, boxes, np.argwhere((winding_numbers != 0) & ~doubtful))


def lattice_inside(solid: Solid, fewest: int) -> Matrix:
    """Return points of a lattice that are surely inside a closed solid, shape (k, 3).

    The lattice is refined until at least ``fewest`` points are inside or it has become too fine, as for a thin solid.
    """
    crossed = LATTICE_CROSSED
    lattice_points = np.empty((0, 3))

    while len(lattice_points) < fewest and crossed <= MOST_LATTICE_CROSSED:
        grid = _grid(solid.triangles, crossed, LATTICE_LEAST)
        winding_numbers, doubtful = winding(grid.to_cells(solid.triangles), grid.shape)
        lattice_points = grid.from_cells(np.argwhere((winding_numbers != 0) & ~doubtful).astype(np.float64))
        crossed *= 4
    return lattice_points


def _grid(triangles: Triangles, crossed: int, min_cells: int = 1) -> Grid:
    """Choose a grid around triangles such that their surface crosses about ``crossed`` cells.

    The number of cells is bounded, and the grid is shifted by ``MARGINS`` against the bounding box.
    """
    low, high = box_of(triangles.reshape(-1, 3))
    extent = np.maximum(high - low, 1e-9)

    a, b, c = (triangles[:, k] for k in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    box_area = 2.0 * float(extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0])
    cell_edge = max(
        np.sqrt(1.5 * min(0.5 * area, 2.0 * box_area) / crossed), float(np.prod(extent) / MAX_CELLS) ** (1.0 / 3.0)
    )

    cell_counts = np.maximum(np.ceil(extent / cell_edge), float(min_cells))
    cell_counts = np.minimum(cell_counts, MAX_CELLS_ALONG_AXIS)
    while np.prod(cell_counts) > 4 * MAX_CELLS:
        cell_counts = np.maximum(np.ceil(cell_counts / 2.0), float(min_cells))

    size = extent / (cell_counts - 2.0 * np.array(MARGINS) * 0.999)
    origin = low - size * MARGINS
    return Grid(origin, size, (int(cell_counts[0]), int(cell_counts[1]), int(cell_counts[2])))


def winding(triangles: Triangles, shape: Shape) -> tuple[NDArray[np.int64], Flags]:
    """Compute the winding number of a closed surface at every corner of a grid.

    Rays along x through the corners are intersected with the triangles. Each crossing adds its sign to all corners
    before it; a cumulative sum from the far end adds them up.

    Args:
        triangles: The closed surface in grid coordinates, shape (m, 3, 3).
        shape: Number of cells along each axis.

    Returns:
        The winding numbers and flags of the corners where they are doubtful, because a ray passes close to an edge or a
        corner lies close to the surface; both of shape (nx + 1, ny + 1, nz + 1).
    """
    corners = (shape[0] + 1, shape[1] + 1, shape[2] + 1)
    kernels = library(KERNELS)
    if kernels is not None:
        signs, near_surface = (np.zeros(corners, dtype=np.int32) for _ in range(2))
        near_edge = np.zeros(corners[1:], dtype=np.int32)
        surface = np.ascontiguousarray(triangles)
        called(kernels.winding_numbers, surface, len(surface), np.array(corners), signs, near_surface, near_edge)
        return np.asarray(signs[::-1].cumsum(axis=0, dtype=np.int64)[::-1]), (near_surface != 0) | (near_edge != 0)

    crossings = np.zeros(corners, dtype=np.int64)
    doubtful = np.zeros(corners, dtype=bool)

    triangle_of, y, z = _candidate_lines(triangles, corners)
    a, b, c = (triangles[triangle_of, k] for k in range(3))
    line = np.column_stack([y, z]).astype(np.float64)
    edge_distances = np.stack([_distance_from_edge(p, q, line) for p, q in ((a, b), (b, c), (c, a))])
    is_hit = (edge_distances > EDGE_TOLERANCE).all(axis=0) | (edge_distances < -EDGE_TOLERANCE).all(axis=0)
    is_near_edge = ~is_hit & (
        (edge_distances >= -EDGE_TOLERANCE).all(axis=0) | (edge_distances <= EDGE_TOLERANCE).all(axis=0)
    )
    doubtful[:, y[is_near_edge], z[is_near_edge]] = True

    a, b, c, line = (array[is_hit] for array in (a, b, c, line))
    y, z = (array[is_hit] for array in (y, z))
    if len(a):
        x, uncertainty = _line_crossings(a, b, c, line)
        sign = np.where(edge_distances[0, is_hit] > 0.0, 1, -1)
        # Corners with a smaller x see this crossing.
        corners_before = np.clip(np.ceil(x), 0, corners[0]).astype(np.int64)
        counts = corners_before > 0
        np.add.at(crossings, (corners_before[counts] - 1, y[counts], z[counts]), sign[counts])

        nearest_corner = np.round(x)
        is_at_corner = (
            (np.abs(x - nearest_corner) <= uncertainty) & (nearest_corner >= 0) & (nearest_corner < corners[0])
        )
        doubtful[nearest_corner[is_at_corner].astype(np.int64), y[is_at_corner], z[is_at_corner]] = True
        doubtful[:, y[uncertainty > MOST_DOUBT], z[uncertainty > MOST_DOUBT]] = True

    return np.asarray(crossings[::-1].cumsum(axis=0)[::-1]), doubtful


def _candidate_lines(triangles: Triangles, corners: Shape) -> tuple[NDArray[np.int64], ...]:
    """Pair each triangle with the lines of corners along x that pass through its bounding box.

    Args:
        triangles: Triangles in grid coordinates, shape (m, 3, 3).
        corners: Number of corners along each axis.

    Returns:
        Three index arrays of one entry per pair: the triangle, and the y and z coordinates of the line.
    """
    low = np.ceil(triangles[:, :, 1:].min(axis=1) - EDGE_TOLERANCE).astype(np.int64)
    high = np.floor(triangles[:, :, 1:].max(axis=1) + EDGE_TOLERANCE).astype(np.int64)
    low = np.maximum(low, 0)
    high = np.minimum(high, np.array(corners[1:]) - 1)

    line_counts = np.maximum(high - low + 1, 0)
    total = line_counts.prod(axis=1)

    triangle_of = np.repeat(np.arange(len(triangles)), total)
    position = np.arange(len(triangle_of)) - np.repeat(np.cumsum(total) - total, total)
    return (
        triangle_of,
        low[triangle_of, 0] + position // line_counts[triangle_of, 1],
        low[triangle_of, 1] + position % line_counts[triangle_of, 1],
    )


def _distance_from_edge(p: Matrix, q: Matrix, line: Matrix) -> Vector:
    """Return the signed distance of lines along x from edges p q, in projection along x.

    Args:
        p: First ends of the edges, shape (n, 3).
        q: Second ends of the edges, shape (n, 3).
        line: Coordinates y and z of the lines, shape (n, 2).
    """
    side = q[:, 1:] - p[:, 1:]
    offset = line - p[:, 1:]
    length = np.linalg.norm(side, axis=1)
    cross = side[:, 0] * offset[:, 1] - side[:, 1] * offset[:, 0]
    return np.asarray(np.where(length > EDGE_TOLERANCE, cross / np.maximum(length, EDGE_TOLERANCE), 0.0))


def _line_crossings(a: Matrix, b: Matrix, c: Matrix, line: Matrix) -> tuple[Vector, Vector]:
    """Return the x at which lines along x cross the planes of triangles, and their uncertainties; shape (n,) both."""
    normal = np.cross(b - a, c - a)
    x = a[:, 0] - ((line - a[:, 1:]) * normal[:, 1:]).sum(axis=1) / normal[:, 0]
    slope = np.abs(normal[:, 0]) / np.linalg.norm(normal, axis=1)
    return x, EDGE_TOLERANCE / np.maximum(slope, 1e-12)


def _in_cells(triangles: Triangles, shape: Shape) -> tuple[Matrix, NDArray[np.int64]]:
    """Cut triangles along all planes between cells.

    Args:
        triangles: Triangles in grid coordinates, shape (m, 3, 3).
        shape: Number of cells along each axis.

    Returns:
        The corners of the pieces, shape (k, 3), and for each the number of its cell, shape (k,). A piece that lies in
        the plane between two cells belongs to both.
    """
    kernels = library(KERNELS)
    if kernels is None:
        pieces, cell_of_piece = _cut_at_planes(triangles, shape)
        return pieces.reshape(-1, 3), np.repeat(cell_of_piece, 3)

    surface = np.ascontiguousarray(triangles)
    polygons = np.empty(POLYGONS * POLYGON + POLYGON)
    most = 8 * len(triangles) + 20_000
    while True:
        points = np.empty((most, 3))
        cells = np.empty(most, dtype=np.int64)
        numbers = np.array(shape)
        count = called(kernels.cut_at_planes, surface, len(surface), numbers, polygons, points, cells, most)
        if count <= most:
            return points[:count], cells[:count]
        most = count


def _cut_at_planes(triangles: Triangles, shape: Shape) -> tuple[Triangles, NDArray[np.int64]]:
    """Cut triangles along all planes between cells.

    Each triangle is cut at the middle one of the planes that pass through it, until none does, one axis after the
    other.

    Args:
        triangles: Triangles in grid coordinates, shape (m, 3, 3).
        shape: Number of cells along each axis.

    Returns:
        The pieces, shape (k, 3, 3), and for each the number of its cell, shape (k,). A piece that lies in the plane
        between two cells is listed for both.
    """
    for axis in range(3):
        finished = []
        unfinished = triangles
        while len(unfinished):
            low = unfinished[:, :, axis].min(axis=1)
            high = unfinished[:, :, axis].max(axis=1)
            first_plane = np.floor(low + EDGE_TOLERANCE) + 1.0
            spans_plane = high > first_plane + EDGE_TOLERANCE
            finished.append(unfinished[~spans_plane])
            last_plane = np.ceil(high[spans_plane] - EDGE_TOLERANCE) - 1.0
            unfinished = _cut(unfinished[spans_plane], axis, np.floor(0.5 * (first_plane[spans_plane] + last_plane)))
        triangles = np.concatenate(finished)

    return _with_cells(triangles, shape)


def _cut(triangles: Triangles, axis: int, plane: Vector) -> Triangles:
    """Cut each triangle into three along its own plane across an axis, which passes through it."""
    if not len(triangles):
        return triangles

    is_beyond = triangles[:, :, axis] > plane[:, None]
    # Rotate the corners so that the one that is alone on its side of the plane comes first.
    lone_corner = np.where((is_beyond.sum(axis=1) == 1)[:, None], is_beyond, ~is_beyond).argmax(axis=1)
    row = np.arange(len(triangles))
    a, b, c = (triangles[row, (lone_corner + k) % 3] for k in range(3))

    ab = _edge_crossing(a, b, axis, plane)
    ac = _edge_crossing(a, c, axis, plane)
    return np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ac), (ab, b, c), (ab, c, ac))])


def _edge_crossing(a: Matrix, b: Matrix, axis: int, plane: Vector) -> Matrix:
    fraction = np.clip((plane - a[:, axis]) / (b[:, axis] - a[:, axis]), 0.0, 1.0)
    point = np.asarray(a + fraction[:, None] * (b - a))
    point[:, axis] = plane
    return point


def _with_cells(pieces: Triangles, shape: Shape) -> tuple[Triangles, NDArray[np.int64]]:
    """Find the cell of each piece; a piece that lies in the plane between two cells is repeated, once for each of them.

    Returns:
        The pieces, shape (k, 3, 3), and the number of the cell of each, shape (k,).
    """
    cell_index = np.floor(pieces.mean(axis=1))
    for axis in range(3):
        plane = np.round(pieces[:, 0, axis])
        lies_in_plane = np.abs(pieces[:, :, axis] - plane[:, None]).max(axis=1) <= 2.0 * EDGE_TOLERANCE
        for side in (-1.0, 0.0):
            neighbour_index = cell_index[: len(lies_in_plane)][lies_in_plane]
            neighbour_index[:, axis] = plane[lies_in_plane] + side
            pieces = np.concatenate([pieces, pieces[: len(lies_in_plane)][lies_in_plane]])
            cell_index = np.concatenate([cell_index, neighbour_index])

    cell_index = np.clip(cell_index, 0, np.array(shape) - 1).astype(np.int64)
    return pieces, np.ravel_multi_index((cell_index[:, 0], cell_index[:, 1], cell_index[:, 2]), shape)


def _inner_corners(cells: Flags, inside: Flags) -> tuple[Matrix, NDArray[np.int64]]:
    """Return the corners of the flagged cells that are inside the solid, and the number of the cell of each.

    Args:
        cells: Flags of cells, shape (nx, ny, nz).
        inside: Flags of the corners that are inside, shape (nx + 1, ny + 1, nz + 1).

    Returns:
        Corners in grid coordinates, shape (k, 3), and numbers of cells, shape (k,). Cells share corners, so a corner
        may occur several times.
    """
    cell_index = np.argwhere(cells)
    cell_number = np.flatnonzero(cells)
    corner = cell_index[:, None] + CORNERS
    is_inside = inside[corner[..., 0], corner[..., 1], corner[..., 2]]
    return corner[is_inside].astype(np.float64), np.repeat(cell_number, 8).reshape(-1, 8)[is_inside]


def all_corners(flag: Flags) -> Flags:
    """Return flags of the cells all of whose corners are flagged; each axis is one shorter than in ``flag``."""
    all_flagged = np.ones(tuple(n - 1 for n in flag.shape), dtype=bool)
    for x, y, z in CORNERS:
        all_flagged &= flag[x : flag.shape[0] - 1 + x, y : flag.shape[1] - 1 + y, z : flag.shape[2] - 1 + z]
    return all_flagged


def _blocks(full: Flags) -> list[tuple[Matrix, int]]:
    """Merge flagged cells into cubes of 4, 2 and 1 cells along each edge.

    Returns:
        For each of the three sizes the lowest corners of the cubes, shape (k, 3), and the size, in cells.
    """
    cubes = []
    remaining = full.copy()
    for size in (4, 2, 1):
        pad = [(0, -n % size) for n in remaining.shape]
        tiles = np.pad(remaining, pad)
        nx, ny, nz = (n // size for n in tiles.shape)
        is_full_cube = tiles.reshape(nx, size, ny, size, nz, size).all(axis=(1, 3, 5))
        cubes.append((np.argwhere(is_full_cube).astype(np.float64) * size, size))

        covered = is_full_cube.repeat(size, axis=0).repeat(size, axis=1).repeat(size, axis=2)
        remaining &= ~covered[: remaining.shape[0], : remaining.shape[1], : remaining.shape[2]]
    return cubes


def _boxes(low: Matrix, size: int) -> NDArray[np.float64]:
    return np.asarray(low[:, None] + CORNERS * float(size))


def _merged_within_cells(
    points: Matrix, owner: NDArray[np.int64], detail: int, grid: Grid
) -> tuple[Matrix, Vector, NDArray[np.int64]]:
    """Replace points that are close together in one cell by one ball around them.

    Args:
        points: Points in grid coordinates, shape (n, 3).
        owner: Number of the cell of each point, shape (n,).
        detail: Number of parts of a cell along each axis; points within one part are merged.
        grid: The grid.

    Returns:
        Centres of the balls in grid coordinates, shape (k, 3), their radii in the solid's frame, shape (k,), and the
        number of the cell of each, shape (k,), ascending.
    """
    kernels = library(KERNELS)
    occupied = np.flatnonzero(np.bincount(owner, minlength=int(np.prod(grid.shape))))
    if kernels is not None and len(occupied) <= MOST_IN_TABLE:
        return _merged_in_table(points, owner, detail, grid, occupied)

    cell = np.column_stack(np.unravel_index(owner, grid.shape))
    subcell = np.clip(np.floor((points - cell) * detail).astype(np.int64), 0, detail - 1)
    subcell_key = ((owner * detail + subcell[:, 0]) * detail + subcell[:, 1]) * detail + subcell[:, 2]

    order = np.argsort(subcell_key, kind="stable")
    starts_group = np.r_[True, np.diff(subcell_key[order]) > 0]
    start = np.flatnonzero(starts_group)
    group = np.cumsum(starts_group) - 1

    sorted_points = points[order]
    centres = 0.5 * (np.minimum.reduceat(sorted_points, start) + np.maximum.reduceat(sorted_points, start))
    distances = np.linalg.norm((sorted_points - centres[group]) * grid.size, axis=1)
    return centres, np.maximum.reduceat(distances, start), owner[order][start]


def _merged_in_table(
    points: Matrix, owner: NDArray[np.int64], detail: int, grid: Grid, occupied: NDArray[np.int64]
) -> tuple[Matrix, Vector, NDArray[np.int64]]:
    """Do the same by a table of all parts of the ``occupied`` cells, which are numbers of cells, ascending."""
    kernels = library(KERNELS)
    assert kernels is not None
    places = np.full(int(np.prod(grid.shape)), -1)
    places[occupied] = np.arange(len(occupied))
    bounds = np.full((len(occupied) * detail**3, 2, 3), np.inf)
    bounds[:, 1] = -np.inf
    radii = np.zeros(len(bounds))

    parts = np.empty(len(points), dtype=np.int32)
    cells = np.ascontiguousarray(owner)
    corners = np.ascontiguousarray(points)
    shape = np.array(grid.shape)
    called(kernels.merge, corners, cells, len(points), places, bounds, grid.size, shape, detail, parts, radii)

    used = np.flatnonzero(bounds[:, 0, 0] < np.inf)
    return 0.5 * (bounds[used, 0] + bounds[used, 1]), radii[used], occupied[used // detail**3]


def _as_elements(
    grid: Grid,
    points: Matrix,
    radii: Vector,
    owner: NDArray[np.int64],
    boxes: NDArray[np.float64],
    inside_corners: NDArray[np.int64],
) -> Elements:
    """Assemble the elements in the solid's frame from the points of crossed cells and the boxes inside.

    All radii grow a little, as pieces of the surface may reach into a neighbouring cell by up to ``EDGE_TOLERANCE``.
    """
    protrusion = 4.0 * EDGE_TOLERANCE * float(np.linalg.norm(grid.size))
    start = np.flatnonzero(np.r_[True, np.diff(owner) > 0])
    centres = np.add.reduceat(points, start) / np.diff(np.r_[start, len(points)])[:, None]

    return Elements(
        grid.from_cells(np.concatenate([points, boxes.reshape(-1, 3)])),
        np.concatenate([radii, np.zeros(8 * len(boxes))]) + protrusion,
        np.concatenate([start, len(points) + 8 * np.arange(len(boxes))]),
        grid.from_cells(inside_corners.astype(np.float64)),
        grid.from_cells(centres),
    )
