"""A mesh as a few convex pieces whose union contains it and all that it encloses.

Planes along the axes cut space into cells. Within a cell, an extreme point of a solid lies on the surface or is a
corner of the cell: from any other point of the solid there is a way on in some direction and back. So the hull of the
surface within a cell, and of the cell's corners that are inside the solid, contains what the cell holds of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import inside_mesh, is_closed, mesh_arrays
from rrtik_ompl.geometry.covers.planes import most_different

if TYPE_CHECKING:
    import coal


MAX_PIECES = 12
MAX_TRIANGLES = 300_000
SMALLEST_GAIN = 0.01  # of the whole hull's volume: what a cut takes away at least
SHARES = (0.25, 0.5, 0.75)  # of a cell, where it may be cut
GRID = 24  # steps along the longest side, to which corners are moved for a sketch of a mesh
MAX_PLANES = 90  # of a piece inside
SHRINKAGE = 1e-6  # of a cell's size, by which a piece inside keeps away from the surface
THINNEST = 1e-3  # [m] radius of the largest ball in a piece inside that is worth the while
FREELY = [(None, None)] * 4
DIRECTIONS = 100  # in which extreme points are sought where volumes are compared
NO_BOXES = np.empty((0, 2, 3))
OCTANTS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)  # corners of a box: low or high along each axis

Triangles = NDArray[np.float64]  # shape (m, 3, 3): triangle, corner, coordinate


@dataclass(frozen=True, eq=False)
class _Part:
    """What a cell (``low``, ``high``) holds: surface, and boxes inside the solid, shape (k, 2, 3): low, high.

    ``shell`` is the number of the closed surface that it belongs to.
    """

    low: Vector
    high: Vector
    surface: Triangles
    boxes: NDArray[np.float64]
    shell: int = 0

    @cached_property
    def points(self) -> Matrix:
        """Corners of the surface and of the boxes, shape (n, 3)."""
        of_boxes = np.where(OCTANTS, self.boxes[:, None, 1], self.boxes[:, None, 0])
        return np.unique(np.concatenate([self.surface.reshape(-1, 3), of_boxes.reshape(-1, 3)]), axis=0)

    @cached_property
    def volume(self) -> float:
        """About the volume of the hull of the points [m^3]."""
        if not len(self.points):
            return 0.0
        try:
            return float(ConvexHull(_outermost(self.points)).volume)
        except (QhullError, ValueError):  # flat
            return 0.0

    @cached_property
    def halves(self) -> tuple[_Part, _Part]:
        """The two parts of the best cut."""
        cuts = [self._cut(axis, share) for axis in range(3) for share in SHARES]
        return min(cuts, key=lambda pair: pair[0].volume + pair[1].volume)

    @property
    def gain(self) -> float:
        """How much volume the best cut takes away."""
        return self.volume - self.halves[0].volume - self.halves[1].volume

    def _cut(self, axis: int, share: float) -> tuple[_Part, _Part]:
        place = float((1.0 - share) * self.low[axis] + share * self.high[axis])
        below, above = clipped(self.surface, axis, place)

        first = self.boxes[self.boxes[:, 0, axis] < place]
        second = self.boxes[self.boxes[:, 1, axis] > place]
        first[:, 1, axis] = np.minimum(first[:, 1, axis], place)
        second[:, 0, axis] = np.maximum(second[:, 0, axis], place)

        ends = self.high.copy()
        ends[axis] = place
        starts = self.low.copy()
        starts[axis] = place
        lower = replace(self, high=ends, surface=below, boxes=first)
        upper = replace(self, low=starts, surface=above, boxes=second)
        return lower, upper


def convex_pieces(mesh: coal.BVHModelBase) -> tuple[list[Matrix], list[Matrix], list[Matrix]]:
    """Convex pieces whose union contains a coal mesh and what it encloses, convex pieces inside it, and points of it.

    The cell whose pieces come out smallest is cut first (compare [44]), until cuts gain little. A
    sketch of the mesh is enough to choose the cuts. Nothing is known to be inside a mesh that is not closed, and
    there are no pieces of a mesh that is a point or has more than ``MAX_TRIANGLES``.

    Returns:
        Corners of the pieces around and of those inside, and points of the solid by cells, shape (n, 3) each.
    """
    vertices, triangles = mesh_arrays(mesh)
    surface = vertices[triangles]

    if not 0 < len(surface) <= MAX_TRIANGLES or not np.isfinite(surface).all():
        return [], [], []
    if not np.ptp(surface, axis=(0, 1)).max() > 0.0:
        return [], [], []

    if not is_closed(mesh):
        boxes = np.stack(enclosure(mesh).boxes(), axis=1)
        parts = [_whole(part, surface) for part in _cut_up([_start(surface, boxes)])]
        points = [_outermost(part.surface.reshape(-1, 3)) for part in parts]
        return _not_empty([_hull(part.points)[1] for part in parts]), [], _not_empty(points)

    return _closed_pieces(_shells(vertices, triangles))


def _not_empty(pieces: list[Matrix]) -> list[Matrix]:
    return [corners for corners in pieces if len(corners)]


def _closed_pieces(shells: list[Triangles]) -> tuple[list[Matrix], list[Matrix], list[Matrix]]:
    """Pieces of closed surfaces: what is in one of them, and not in one turned inside out, is inside the mesh."""
    volumes = np.array([_signed_volume(shell) for shell in shells])
    inverted = [shell for shell, turned in zip(shells, volumes * volumes.sum() < 0.0, strict=True) if turned]

    around = []
    inside = []
    points = []
    for part in _cut_up([_start(shell, NO_BOXES, number) for number, shell in enumerate(shells)]):
        shell = shells[part.shell]
        whole = _whole(part, shell)
        corners = np.where(OCTANTS, part.high, part.low)
        held = np.array([_holds(shell, corner) for corner in corners])
        planes, span = _hull(np.concatenate([whole.points, corners[held]]))
        around.append(span)
        points.append(_outermost(whole.surface.reshape(-1, 3)))  # a corner of a cell may lie in another shell's hollow
        if not len(planes) or not volumes[part.shell] * volumes.sum() > 0.0:
            continue

        obstacles = np.concatenate([whole.surface, *(_within(other, part.low, part.high) for other in inverted)])
        kernel = _kernel(planes, replace(part, surface=obstacles))
        if kernel is None:
            continue
        centre = kernel.mean(axis=0)
        if _holds(shell, centre) and not any(_holds(other, centre) for other in inverted):
            inside.append(kernel)

    return _not_empty(around), inside, _not_empty(points)


def _shells(vertices: Matrix, triangles: NDArray[np.int64]) -> list[Triangles]:
    """The connected parts of a surface; all of it if there are many."""
    _, welded = np.unique(vertices, axis=0, return_inverse=True)
    corners = np.asarray(welded).ravel()[triangles]

    ends = corners.ravel(), np.roll(corners, 1, axis=1).ravel()
    size = int(corners.max()) + 1
    _, label = connected_components(coo_matrix((np.ones(corners.size), ends), shape=(size, size)), directed=False)

    numbers = np.unique(label[corners[:, 0]])
    if len(numbers) > MAX_PIECES:
        return [vertices[triangles]]
    return [vertices[triangles[label[corners[:, 0]] == number]] for number in numbers]


def _signed_volume(shell: Triangles) -> float:
    return float(np.einsum("ij,ij->i", shell[:, 0], np.cross(shell[:, 1], shell[:, 2])).sum()) / 6.0


def _holds(shell: Triangles, point: Vector) -> bool:
    return inside_mesh(shell.reshape(-1, 3), np.arange(3 * len(shell)).reshape(-1, 3), point)


def _start(surface: Triangles, boxes: NDArray[np.float64], shell: int = 0) -> _Part:
    """A sketch of a surface as one part."""
    bounds = np.concatenate([surface.reshape(-1, 3), boxes.reshape(-1, 3)])
    return _Part(bounds.min(axis=0), bounds.max(axis=0), _sketch(surface), boxes, shell)


def _whole(part: _Part, surface: Triangles) -> _Part:
    """A part with the surface itself for its sketch."""
    return replace(part, surface=_within(surface, part.low, part.high))


def _cut_up(parts: list[_Part]) -> list[_Part]:
    """Parts after the best cuts, the one that takes most away first, while that is worth it."""
    least = SMALLEST_GAIN * sum(part.volume for part in parts)
    while len(parts) < MAX_PIECES:
        best = max(parts, key=lambda part: part.gain)
        if best.gain <= least:
            break
        parts.remove(best)
        parts += best.halves
    return parts


def _sketch(surface: Triangles) -> Triangles:
    """Fewer triangles of about the same shape: corners moved to a grid, what coincides left out."""
    low = surface.min(axis=(0, 1))
    size = max(float(np.ptp(surface, axis=(0, 1)).max()) / GRID, 1e-12)

    steps = np.round((surface - low) / size).astype(np.int64)
    numbers = np.sort(steps @ ((GRID + 1) ** np.arange(3)), axis=1)
    first = np.unique(numbers, axis=0, return_index=True)[1]
    distinct = (numbers[first, 1:] != numbers[first, :-1]).all(axis=1)
    return np.asarray(low + size * steps[first[distinct]])


def _within(surface: Triangles, low: Vector, high: Vector) -> Triangles:
    """The parts of triangles inside a cell."""
    near = (surface.min(axis=1) <= high) & (surface.max(axis=1) >= low)
    surface = surface[near.all(axis=1)]
    for axis in range(3):
        _, surface = clipped(surface, axis, float(low[axis]))
        surface, _ = clipped(surface, axis, float(np.nextafter(high[axis], np.inf)))
    return surface


def clipped(surface: Triangles, axis: int, place: float) -> tuple[Triangles, Triangles]:
    """The parts of triangles on both sides of a plane across an axis, as triangles: below, above."""
    above = surface[:, :, axis] >= place
    count = above.sum(axis=1)
    crossing = (count == 1) | (count == 2)
    lone_above = count[crossing] == 1
    lone = np.where(lone_above[:, None], above[crossing], ~above[crossing]).argmax(axis=1)

    rows = np.arange(len(lone))
    a, b, c = (surface[crossing][rows, (lone + k) % 3] for k in range(3))
    p = _crossed(a, b, axis, place)
    q = _crossed(a, c, axis, place)

    tips = np.stack([a, p, q], axis=1)
    rests = np.stack([p, b, c], axis=1), np.stack([p, c, q], axis=1)
    low = [surface[count == 0], tips[~lone_above], *(rest[lone_above] for rest in rests)]
    high = [surface[count == 3], tips[lone_above], *(rest[~lone_above] for rest in rests)]

    return np.concatenate(low), np.concatenate(high)


def _crossed(first: Matrix, second: Matrix, axis: int, place: float) -> Matrix:
    """Where edges cross the plane; their ends lie on different sides."""
    from_first = first[:, axis] - place
    from_second = second[:, axis] - place
    share = from_first / (from_first - from_second)
    points: Matrix = first + share[:, None] * (second - first)
    points[:, axis] = place
    return points


def _hull(points: Matrix) -> tuple[Matrix, Matrix]:
    """Planes (outward unit normal, offset) of the hull of points and the points that span it.

    No planes and all of the points if they are too flat to decide.
    """
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.empty((0, 4)), points
    return hull.equations * (1.0, 1.0, 1.0, -1.0), np.asarray(points[hull.vertices])


def _kernel(planes: Matrix, part: _Part) -> Matrix | None:
    """Corners of a convex body in the cell that no surface reaches into, shape (n, 3); None if there is none.

    Each triangle is kept out by the plane that has to move inwards least for it.
    """
    sides = np.concatenate([np.column_stack([np.eye(3), part.high]), np.column_stack([-np.eye(3), -part.low])])
    kept = np.concatenate([sides, most_different(planes, MAX_PLANES)])

    # Of each triangle along each normal.
    lowest = np.min([part.surface[:, k] @ kept[:, :3].T for k in range(3)], axis=0)
    nearest = (kept[:, 3] - lowest).argmin(axis=1)
    offsets = kept[:, 3].copy()
    np.minimum.at(offsets, nearest, lowest[np.arange(len(nearest)), nearest])
    offsets -= SHRINKAGE * float((part.high - part.low).max())

    # The largest ball behind all planes: its centre is a point inside, which qhull asks for.
    found = linprog([0.0, 0.0, 0.0, -1.0], np.column_stack([kept[:, :3], np.ones(len(kept))]), offsets, bounds=FREELY)
    if found.status != 0 or not found.x[3] > THINNEST:
        return None

    try:
        return np.asarray(HalfspaceIntersection(np.column_stack([kept[:, :3], -offsets]), found.x[:3]).intersections)
    except (QhullError, ValueError):
        return None


def _outermost(points: Matrix) -> Matrix:
    """Some of the points that lie farthest in some direction."""
    return points[np.unique((points @ _directions().T).argmax(axis=0))] if len(points) else points


def _directions() -> Matrix:
    """Unit vectors spread over all directions, shape (DIRECTIONS, 3)."""
    z = (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS - 1.0
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(DIRECTIONS)
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])
