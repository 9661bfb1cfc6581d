"""Divide a mesh into a few convex pieces whose union contains it and everything that it encloses.

Planes along the axes divide space into cells. An extreme point of the solid's part in a cell lies on the surface or is
a corner of the cell: any other point of the solid is the middle of a segment in that part. Therefore the convex hull of
the surface within the cell and of the cell's corners inside the solid contains that part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from rrtik_ompl.base.arrays import Matrix, Vector, bounds_of, box_of, products, welded
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import inside_mesh, is_closed, mesh_arrays, most_different
from rrtik_ompl.kernels.covers.cuts import cut_volumes, has_kernels, hull_volume
from rrtik_ompl.kernels.covers.points import IN_DOUBT, extreme_points, inside_by_rays

if TYPE_CHECKING:
    import coal


MAX_PIECES = 12
MAX_TRIANGLES = 300_000
SMALLEST_GAIN = 0.01  # least volume that a cut must remove, as a share of the whole hull's
SHARES = (0.25, 0.5, 0.75)  # positions of possible cuts, as shares of a cell's length
GRID = 24  # steps along the longest side of the grid to which the sketch of a mesh is rounded
MAX_PLANES = 90  # most planes of the hull that are used to bound an inner piece
SHRINKAGE = 1e-6  # distance that an inner piece keeps from the surface, as a share of the cell's size
THINNEST = 1e-3  # [m] Inner pieces that do not contain a ball of this radius are dropped.
MOST_EXCHANGES = 200  # steps in the search for the largest ball in a body
DIRECTIONS = 100  # number of directions in which extreme points are sought
NO_BOXES = np.empty((0, 2, 3))
# For each of a box's 8 corners, whether it is at the upper end along each axis, shape (8, 3).
CORNER_IS_HIGH = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)

Triangles = NDArray[np.float64]  # shape (m, 3, 3): triangle, corner, coordinate


@dataclass(frozen=True, eq=False)
class _Cell:
    """A box-shaped cell and the part of the mesh in it.

    Attributes:
        low: Lowest corner of the cell, shape (3,).
        high: Highest corner of the cell, shape (3,).
        surface: Triangles of the surface within the cell, shape (m, 3, 3).
        boxes: Boxes inside the solid within the cell, as pairs of lowest and highest corner, shape (k, 2, 3).
        shell: Number of the closed surface that the cell belongs to.
    """

    low: Vector
    high: Vector
    surface: Triangles
    boxes: NDArray[np.float64]
    shell: int = 0

    @cached_property
    def points(self) -> Matrix:
        """Return the corners of the surface's triangles and of the boxes, each once, shape (n, 3)."""
        box_corners = np.where(CORNER_IS_HIGH, self.boxes[:, None, 1], self.boxes[:, None, 0])
        corners = np.concatenate([self.surface.reshape(-1, 3), box_corners.reshape(-1, 3)])
        return np.asarray(corners[welded(corners)[0]])

    @cached_property
    def volume(self) -> float:
        """Return the approximate volume of the convex hull of the points [m^3]; 0 if they lie in a plane."""
        if not len(self.points):
            return 0.0
        if has_kernels():
            return hull_volume(_extreme_points(self.points))
        try:
            return float(ConvexHull(_extreme_points(self.points)).volume)
        except (QhullError, ValueError):  # flat
            return 0.0

    @cached_property
    def halves(self) -> tuple[_Cell, _Cell]:
        """Return the lower and the upper cell of the best cut, whose hulls have the least total volume."""
        if has_kernels():
            axis, number = np.unravel_index(self._volumes.argmin(), self._volumes.shape)
            return self._cut(int(axis), SHARES[number])
        cuts = [self._cut(axis, share) for axis in range(3) for share in SHARES]
        return min(cuts, key=lambda pair: pair[0].volume + pair[1].volume)

    @property
    def gain(self) -> float:
        """Return the volume that the best cut removes from the hulls [m^3]."""
        if has_kernels():
            return self.volume - float(self._volumes.min())
        return self.volume - self.halves[0].volume - self.halves[1].volume

    @cached_property
    def _volumes(self) -> Matrix:
        """Return the approximate volume of both hulls of each possible cut [m^3], shape (3, len(SHARES))."""
        return cut_volumes(self.surface, self.points, self.boxes, (self.low, self.high), SHARES, _unit_directions())

    def _cut(self, axis: int, share: float) -> tuple[_Cell, _Cell]:
        """Divide the cell by a plane at a share of its length along an axis; return the lower and the upper cell."""
        coordinate = float((1.0 - share) * self.low[axis] + share * self.high[axis])
        surface_below, surface_above = clipped(self.surface, axis, coordinate)

        boxes_below = self.boxes[self.boxes[:, 0, axis] < coordinate]
        boxes_above = self.boxes[self.boxes[:, 1, axis] > coordinate]
        boxes_below[:, 1, axis] = np.minimum(boxes_below[:, 1, axis], coordinate)
        boxes_above[:, 0, axis] = np.maximum(boxes_above[:, 0, axis], coordinate)

        lower_high = self.high.copy()
        lower_high[axis] = coordinate
        upper_low = self.low.copy()
        upper_low[axis] = coordinate
        lower = replace(self, high=lower_high, surface=surface_below, boxes=boxes_below)
        upper = replace(self, low=upper_low, surface=surface_above, boxes=boxes_above)
        return lower, upper


def convex_pieces(mesh: coal.BVHModelBase) -> tuple[list[Matrix], list[Matrix], list[Matrix]]:
    """Divide a coal mesh into convex pieces that contain it, and find convex pieces inside it.

    Starting with the box around each closed surface, the cell whose cut removes most volume from the hulls is cut first
    (compare [44]), until cuts gain little or there are enough pieces. The cuts are chosen on a coarse sketch of the
    mesh; the pieces are then made from the mesh itself. For a mesh that is not closed nothing is known to be inside.
    There are no pieces for a mesh that is a single point or has more than ``MAX_TRIANGLES`` triangles.

    Returns:
        Three lists of arrays of shape (n, 3) [m]: the corners of each outer piece, whose union contains the mesh and
        what it encloses; the corners of each inner piece; and for each cell some extreme points of the mesh's surface
        in it.
    """
    vertices, triangles = mesh_arrays(mesh)
    surface = vertices[triangles]

    if not 0 < len(surface) <= MAX_TRIANGLES or not np.isfinite(surface).all():
        return [], [], []
    low, high = box_of(surface.reshape(-1, 3))
    if not (high > low).any():
        return [], [], []

    if not is_closed(mesh):
        boxes = np.stack(enclosure(mesh).boxes(), axis=1)
        cells = [_with_whole_surface(cell, surface) for cell in _split_into_cells([_first_cell(surface, boxes)])]
        surface_points = [_extreme_points(cell.surface.reshape(-1, 3)) for cell in cells]
        outer_pieces = [_hull(cell.points)[1] for cell in cells]
        return _without_empty(outer_pieces), [], _without_empty(surface_points)

    return _closed_pieces(_shells(vertices, triangles))


def _without_empty(pieces: list[Matrix]) -> list[Matrix]:
    return [corners for corners in pieces if len(corners)]


def _closed_pieces(shells: list[Triangles]) -> tuple[list[Matrix], list[Matrix], list[Matrix]]:
    """Make the pieces of a mesh whose surfaces are all closed; see `convex_pieces`.

    The sign of the total volume tells the orientation of the mesh's triangles. A shell of that orientation bounds a
    solid, one of the opposite orientation bounds a cavity; what is inside a shell that bounds a solid, and in no
    cavity, is inside the mesh.
    """
    volumes = np.array([_signed_volume(shell) for shell in shells])
    orientation = volumes * volumes.sum()
    bounds_solid = orientation > 0.0
    bounds_cavity = orientation < 0.0
    cavities = [shell for shell, is_cavity in zip(shells, bounds_cavity, strict=True) if is_cavity]

    outer_pieces = []
    inner_pieces = []
    surface_points = []
    cells = _split_into_cells([_first_cell(shell, NO_BOXES, number) for number, shell in enumerate(shells)])
    for cell in cells:
        shell = shells[cell.shell]
        cell_with_surface = _with_whole_surface(cell, shell)
        corners = np.where(CORNER_IS_HIGH, cell.high, cell.low)
        corner_is_inside = _inside(shell, corners)
        planes, hull_corners = _hull(np.concatenate([cell_with_surface.points, corners[corner_is_inside]]))
        outer_pieces.append(hull_corners)
        # Only points of the surface are used, as a corner of the cell may lie in the cavity of another shell.
        surface_points.append(_extreme_points(cell_with_surface.surface.reshape(-1, 3)))
        if not len(planes) or not bounds_solid[cell.shell]:
            continue

        cavity_walls = [_clipped_to_box(cavity, cell.low, cell.high) for cavity in cavities]
        obstacles = np.concatenate([cell_with_surface.surface, *cavity_walls])
        body_corners = _convex_body_inside(planes, replace(cell, surface=obstacles))
        if body_corners is None:
            continue
        centre = body_corners.mean(axis=0)[None]
        if _inside(shell, centre)[0] and not any(_inside(cavity, centre)[0] for cavity in cavities):
            inner_pieces.append(body_corners)

    return _without_empty(outer_pieces), inner_pieces, _without_empty(surface_points)


def _shells(vertices: Matrix, triangles: NDArray[np.int64]) -> list[Triangles]:
    """Divide a surface into its connected parts; if there are too many, return the whole surface as one."""
    corners = welded(vertices)[1][triangles]

    edge_ends = corners.ravel(), np.roll(corners, 1, axis=1).ravel()
    size = int(corners.max()) + 1
    _, label = connected_components(coo_matrix((np.ones(corners.size), edge_ends), shape=(size, size)), directed=False)

    shell_numbers = np.unique(label[corners[:, 0]])
    if len(shell_numbers) > MAX_PIECES:
        return [vertices[triangles]]
    return [vertices[triangles[label[corners[:, 0]] == number]] for number in shell_numbers]


def _signed_volume(shell: Triangles) -> float:
    return float(np.einsum("ij,ij->i", shell[:, 0], np.cross(shell[:, 1], shell[:, 2])).sum()) / 6.0


def _inside(shell: Triangles, points: Matrix) -> NDArray[np.bool_]:
    """Check which points, shape (n, 3), are inside a closed surface: by rays, or by angles where these are in doubt."""
    is_inside = inside_by_rays(shell, points)
    for k in np.flatnonzero(is_inside == IN_DOUBT):
        is_inside[k] = inside_mesh(shell.reshape(-1, 3), np.arange(3 * len(shell)).reshape(-1, 3), points[k])
    return np.asarray(is_inside == 1)


def _first_cell(surface: Triangles, boxes: NDArray[np.float64], shell: int = 0) -> _Cell:
    """Return the cell around a whole surface and some boxes, which holds a coarse sketch of the surface."""
    bounds = np.concatenate([surface.reshape(-1, 3), boxes.reshape(-1, 3)])
    return _Cell(*box_of(bounds), _sketch(surface), boxes, shell)


def _with_whole_surface(cell: _Cell, surface: Triangles) -> _Cell:
    """Return a cell whose sketch is replaced by the part of the actual surface within it."""
    return replace(cell, surface=_clipped_to_box(surface, cell.low, cell.high))


def _split_into_cells(cells: list[_Cell]) -> list[_Cell]:
    """Cut the cell with the largest gain again and again, until gains are small or there are ``MAX_PIECES`` cells."""
    min_gain = SMALLEST_GAIN * sum(cell.volume for cell in cells)
    while len(cells) < MAX_PIECES:
        best = max(cells, key=lambda cell: cell.gain)
        if best.gain <= min_gain:
            break
        cells.remove(best)
        cells += best.halves
    return cells


def _sketch(surface: Triangles) -> Triangles:
    """Return a coarse version of a surface: corners rounded to a grid, without flat and repeated triangles."""
    low, high = box_of(surface.reshape(-1, 3))
    grid_step = max(float((high - low).max()) / GRID, 1e-12)

    grid_points = np.round((surface - low) / grid_step).astype(np.int64)
    corner_numbers = np.sort(grid_points @ ((GRID + 1) ** np.arange(3)), axis=1)
    distinct_rows, _ = welded(corner_numbers)
    has_area = (corner_numbers[distinct_rows, 1:] != corner_numbers[distinct_rows, :-1]).all(axis=1)
    return np.asarray(low + grid_step * grid_points[distinct_rows[has_area]])


def _clipped_to_box(surface: Triangles, low: Vector, high: Vector) -> Triangles:
    """Return the parts of triangles inside a box, as triangles, shape (m, 3, 3)."""
    lowest, highest = bounds_of(surface)
    x, y, z = ((lowest[:, axis] <= high[axis]) & (highest[:, axis] >= low[axis]) for axis in range(3))
    surface = surface[x & y & z]
    for axis in range(3):
        _, surface = clipped(surface, axis, float(low[axis]))
        surface, _ = clipped(surface, axis, float(np.nextafter(high[axis], np.inf)))
    return surface


def clipped(surface: Triangles, axis: int, coordinate: float) -> tuple[Triangles, Triangles]:
    """Divide triangles by the plane where a coordinate has a given value.

    A triangle that the plane crosses has one corner alone on its side: the part with this corner is a triangle, and the
    other part, a quadrilateral, becomes two.

    Args:
        surface: Triangles, shape (m, 3, 3).
        axis: Index of the coordinate.
        coordinate: Its value in the plane.

    Returns:
        The triangles below the plane and those above it, shape (k, 3, 3) each.
    """
    above = surface[:, :, axis] >= coordinate
    count = above[:, 0].astype(np.int8) + above[:, 1] + above[:, 2]
    crossing = (count == 1) | (count == 2)
    lone_above = count[crossing] == 1
    lone_corner = np.where(lone_above[:, None], above[crossing], ~above[crossing]).argmax(axis=1)

    rows = np.arange(len(lone_corner))
    a, b, c = (surface[crossing][rows, (lone_corner + k) % 3] for k in range(3))
    p = _plane_crossings(a, b, axis, coordinate)
    q = _plane_crossings(a, c, axis, coordinate)

    corner_triangles = np.stack([a, p, q], axis=1)
    quad_triangles = np.stack([p, b, c], axis=1), np.stack([p, c, q], axis=1)
    low = [surface[count == 0], corner_triangles[~lone_above], *(triangles[lone_above] for triangles in quad_triangles)]
    high = [
        surface[count == 3],
        corner_triangles[lone_above],
        *(triangles[~lone_above] for triangles in quad_triangles),
    ]

    return np.concatenate(low), np.concatenate(high)


def _plane_crossings(first: Matrix, second: Matrix, axis: int, coordinate: float) -> Matrix:
    """Return the points where edges cross the plane, shape (k, 3).

    Args:
        first: First ends of the edges, shape (k, 3).
        second: Second ends, on the other side of the plane, shape (k, 3).
        axis: Index of the coordinate that is constant in the plane.
        coordinate: Its value in the plane.
    """
    first_offset = first[:, axis] - coordinate
    second_offset = second[:, axis] - coordinate
    share = first_offset / (first_offset - second_offset)
    points: Matrix = first + share[:, None] * (second - first)
    points[:, axis] = coordinate
    return points


def _hull(points: Matrix) -> tuple[Matrix, Matrix]:
    """Return the planes of the convex hull of points and the points that span it.

    Args:
        points: The points, shape (n, 3).

    Returns:
        Outward unit normals and offsets of the planes, shape (k, 4), and the spanning points, shape (m, 3). If the
        points are too flat for a hull, there are no planes, and all points are returned.
    """
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.empty((0, 4)), points
    return hull.equations * (1.0, 1.0, 1.0, -1.0), np.asarray(points[hull.vertices])


def _convex_body_inside(planes: Matrix, cell: _Cell) -> Matrix | None:
    """Return the corners of a convex body in a cell that no surface reaches into, shape (n, 3); None if there is none.

    The body is bounded by the planes of the cell and of the hull. For each triangle, the plane that needs the smallest
    inward shift to exclude the triangle is shifted by that much.

    Args:
        planes: Outward unit normals and offsets of the hull, shape (k, 4).
        cell: The cell, with all surfaces that the body must not reach.
    """
    cell_planes = np.concatenate([np.column_stack([np.eye(3), cell.high]), np.column_stack([-np.eye(3), -cell.low])])
    all_planes = np.concatenate([cell_planes, most_different(planes, MAX_PLANES)])

    # Least coordinate of each triangle along each normal, shape (triangles, planes).
    a, b, c = (products(cell.surface[:, k], all_planes[:, :3]) for k in range(3))
    lowest = np.minimum(np.minimum(a, b), c)
    nearest = (all_planes[:, 3] - lowest).argmin(axis=1)
    offsets = all_planes[:, 3].copy()
    np.minimum.at(offsets, nearest, lowest[np.arange(len(nearest)), nearest])
    offsets -= SHRINKAGE * float((cell.high - cell.low).max())

    # Qhull needs a point inside the body: the centre of the largest ball that is behind all planes.
    largest_ball = _largest_ball(all_planes[:, :3], offsets)
    if largest_ball is None or not largest_ball[3] > THINNEST:
        return None

    try:
        return np.asarray(
            HalfspaceIntersection(np.column_stack([all_planes[:, :3], -offsets]), largest_ball[:3]).intersections
        )
    except (QhullError, ValueError):
        return None


def _largest_ball(normals: Matrix, offsets: Vector) -> Vector | None:
    """Return centre and radius of the largest ball behind all planes, shape (4,); None if it is not found.

    This is a linear program of four unknowns, solved by the dual simplex method: the ball that touches four planes, and
    cannot grow between them, is replaced by the one that touches the plane that it violates most, while there is one.

    Args:
        normals: Unit vectors, shape (n, 3): first those along the axes, then their opposites.
        offsets: Of the planes, shape (n,).
    """
    rows = np.column_stack([normals, np.ones(len(normals))])
    axis = int((offsets[:3] + offsets[3:6]).argmin())
    touched = np.array([axis, axis + 3, (axis + 1) % 3, (axis + 2) % 3])
    shares = np.array([0.5, 0.5, 0.0, 0.0])  # of the touched planes' normals, which add up to nothing

    for _ in range(MOST_EXCHANGES):
        try:
            ball = np.linalg.solve(rows[touched], offsets[touched])
            violation = rows @ ball - offsets
            worst = int(violation.argmax())
            if violation[worst] <= 1e-12 * (1.0 + np.abs(offsets).max()):
                return np.asarray(ball)
            change = np.linalg.solve(rows[touched].T, rows[worst])
        except np.linalg.LinAlgError:
            return None
        ratios = np.where(change > 1e-12, shares / np.where(change > 1e-12, change, 1.0), np.inf)
        leaving = int(ratios.argmin())
        if not np.isfinite(ratios[leaving]):
            return None
        shares = shares - ratios[leaving] * change
        shares[leaving] = ratios[leaving]
        touched[leaving] = worst
    return None


def _extreme_points(points: Matrix) -> Matrix:
    """Return the points that lie farthest in one of a fixed set of directions, each once."""
    return extreme_points(points, _unit_directions())


@cache
def _unit_directions() -> Matrix:
    """Return unit vectors that are spread evenly over all directions, shape (DIRECTIONS, 3)."""
    z = (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS - 1.0
    azimuth = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(DIRECTIONS)
    radius = np.sqrt(1.0 - z * z)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z])
