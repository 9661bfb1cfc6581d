"""Objects as trees of convex solids: what kernels descend that measure distances.

The leaves are what an object consists of: its convex solids, the triangles of a mesh that is not convex, or points of a
cloud, a block of them together. A node above triangles is the hull of their vertices, so that a vertex of it that is
nearest to something is a point of the object; a node above other leaves is a box around them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, distinct
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.shape_table import BOX_CORNERS
from rrtik_ompl.geometry.collision.solids import hull, is_mesh, mesh_arrays, once_per_geometry, vertices_of
from rrtik_ompl.kernels.distances.layout import (
    AROUND,
    BOX_AROUND,
    HULL,
    NODE_CENTRES,
    NODE_FIRST,
    NODE_KIND,
    NODE_PART,
    NODE_SECOND,
    NODE_SOLID,
    POINTS,
    SOLID,
    TRIANGLE,
)
from rrtik_ompl.kernels.layout import CONVEX_SOLID, HALF_SPACE_SOLID
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid, convex_solids, placed_solids
from rrtik_ompl.model.shapes.point_cloud import Cloud

MANY = 64  # vertices of a node, of which only those of the hull are kept
SOLID_NUMBERS = [NODE_SOLID, NODE_CENTRES, NODE_PART]
BRANCHES = [NODE_FIRST, NODE_SECOND]
LEAF = (-1, -1)

Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Convex solids, and nodes that refer to them.

    Attributes:
        solids: The solids.
        nodes: The root first, see :mod:`rrtik_ompl.kernels.distances.layout`; numbers of solids and nodes are counted
            from 0, -1 for none, shape (n, NODE_SIZE).
    """

    solids: Sequence[ConvexSolid]
    nodes: Numbers

    def behind(self, solids: int, nodes: int) -> Numbers:
        """Return the nodes as they are numbered behind so many other solids and nodes."""
        moved = self.nodes.copy()
        for places, count in ((SOLID_NUMBERS, solids), (BRANCHES, nodes)):
            moved[:, places] += np.where(moved[:, places] < 0, 0, count)
        return moved


def tree_of(bodies: Sequence[Body]) -> Tree | None:
    """Return the tree of an object's bodies, which one joint carries, in its frame; None if not all are known here."""
    placed = []
    for body in bodies:
        tree = _tree_of_geometry(body.geometry)
        if tree is None:
            return None
        solids = placed_solids(tree.solids, np.tile(body.placement.homogeneous, (len(tree.solids), 1, 1)))
        if any(solid.kind not in (CONVEX_SOLID, HALF_SPACE_SOLID) for solid in solids):
            return None
        placed.append(Tree(solids, tree.nodes))
    if len(placed) > 1 and any(tree.solids[0].kind == HALF_SPACE_SOLID for tree in placed):
        return None
    return _joined(placed)


@once_per_geometry
def _tree_of_geometry(geometry: coal.CollisionGeometry) -> Tree | None:
    """Return the tree of a geometry in its own frame; None if its kind is not known here."""
    if isinstance(geometry, CloudSolid):
        return _joined(_blocks_of(geometry.cloud))
    if is_mesh(geometry):
        return _tree_of_triangles(*mesh_arrays(geometry))
    own = convex_solids(geometry).around
    return _leaf(own[0], SOLID) if len(own) == 1 else None


def _leaf(solid: ConvexSolid, kind: int) -> Tree:
    return Tree([solid], np.array([(0, *LEAF, kind, -1, -1)]))


def _tree_of_triangles(vertices: Matrix, triangles: Numbers) -> Tree:
    """Return the tree of a mesh, halved as :func:`_above` does it.

    There may be 100,000 triangles, so all nodes of a level are halved at once.
    """
    middles = vertices[triangles].mean(axis=1)
    corners_of: list[Matrix] = [vertices[:0]] * (2 * len(triangles) - 1)
    nodes = np.tile(np.array([0, *LEAF, AROUND, -1, -1]), (len(corners_of), 1))
    nodes[:, NODE_SOLID] = np.arange(len(nodes))  # each node has the solid of its number
    nodes[0, NODE_KIND] = HULL

    # The triangles of the nodes of a level, one node after the other; where each begins, and its number.
    order = np.arange(len(triangles))
    starts = np.zeros(1, dtype=np.int64)
    places = np.zeros(1, dtype=np.int64)
    while len(order):
        sizes = np.diff(starts, append=len(order))
        whole = sizes == 1
        for place, corners in zip(places[whole].tolist(), vertices[triangles[order[starts[whole]]]], strict=True):
            corners_of[place] = corners
        nodes[places[whole], NODE_KIND] = TRIANGLE

        order = order[np.repeat(~whole, sizes)]
        sizes = sizes[~whole]
        places = places[~whole]
        starts = np.cumsum(sizes) - sizes
        for place, corners in zip(places.tolist(), _corners_of_each(vertices, triangles[order], sizes), strict=True):
            corners_of[place] = _hull_of(corners)

        if len(order):
            order = _sorted_along(middles, order, starts, sizes)
            firsts = sizes // 2
            seconds = sizes - firsts
            # The second half follows its parent, and the first half what is below the second.
            nodes[places, NODE_SECOND] = places + 1
            nodes[places, NODE_FIRST] = places + 2 * seconds
            places = nodes[places][:, BRANCHES].ravel()
            starts = np.column_stack([starts, starts + firsts]).ravel()
    return Tree([ConvexSolid(corners) for corners in corners_of], nodes)


def _corners_of_each(vertices: Matrix, triangles: Numbers, sizes: Numbers) -> list[Matrix]:
    """Return the distinct vertices of each of several runs of triangles, in their order."""
    owners = np.repeat(np.arange(len(sizes)), 3 * sizes)
    keys = distinct(owners * len(vertices) + triangles.ravel())
    corners = vertices[keys % len(vertices)]
    ends = np.searchsorted(keys, np.arange(len(sizes) + 1) * len(vertices)).tolist()
    return [corners[first:end] for first, end in pairwise(ends)]


def _sorted_along(points: Matrix, order: Numbers, starts: Numbers, sizes: Numbers) -> Numbers:
    """Return numbers of points, each of several runs sorted along the longest side of the box around its points."""
    own = points[order]
    sides = np.maximum.reduceat(own, starts) - np.minimum.reduceat(own, starts)
    along = np.repeat(sides.argmax(axis=1), sizes)
    run = np.repeat(np.arange(len(sizes)), sizes)
    return order[np.lexsort((own[np.arange(len(own)), along], run))]


def _hull_of(corners: Matrix) -> Matrix:
    """Return those of many points that are corners of their hull; all if they have none, or are few."""
    if len(corners) <= MANY:
        return corners
    try:
        found = vertices_of(hull(corners))
    except InputError:  # flat
        return corners
    return corners if found is None else found


def _blocks_of(cloud: Cloud) -> list[Tree]:
    """Return a leaf for every few points of a cloud: what is around them, they, and what stands at each."""
    cubes = cloud.half > 0.0
    part = ConvexSolid(cloud.half * BOX_CORNERS) if cubes else ConvexSolid(np.zeros((1, 3)), radius=cloud.radius)
    node = np.array([(0, *LEAF, POINTS, 1, 2)])
    made = []
    for points in _gathered(cloud.tree.blocks.transpose(0, 2, 1).astype(np.float64)):
        centres = ConvexSolid(points, radius=part.radius)
        low = points.min(axis=0) - cloud.half
        high = points.max(axis=0) + cloud.half
        made.append(Tree([_box_solid(low, high) if cubes else centres, centres, part], node))
    return made


def _gathered(blocks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return blocks of points, shape (n, size, 3), cut where the curve along which they are sorted jumps.

    A block across a jump is as wide as the room, and all that is in the room would be compared with each of its points.
    """
    size = blocks.shape[1]
    points = blocks.reshape(-1, 3)
    jumps = np.abs(np.diff(points, axis=0, append=points[-1:])).max(axis=1)
    usual = np.median(np.ptp(blocks, axis=1).max(axis=1))
    last = jumps > usual
    last[size - 1 :: size] = True
    ends = np.flatnonzero(last)
    starts = np.concatenate([[0], ends[:-1] + 1])
    return points[np.minimum(starts[:, None] + np.arange(size), ends[:, None])]


def _joined(trees: Sequence[Tree]) -> Tree:
    """Return one tree above several, whose inner nodes are boxes."""
    if len(trees) == 1:
        return trees[0]
    boxes = np.array([_box(tree.solids[0]) for tree in trees])

    def around(own: Numbers) -> tuple[ConvexSolid, int]:
        return _box_solid(boxes[own, 0].min(axis=0), boxes[own, 1].max(axis=0)), BOX_AROUND

    return _above(trees, boxes.mean(axis=1), around)


def _above(trees: Sequence[Tree], middles: Matrix, around: Callable[[Numbers], tuple[ConvexSolid, int]]) -> Tree:
    """Return one tree above several.

    They are halved again and again across the longest side of the box around their middles.

    Args:
        trees: One or more.
        middles: A point of each, shape (n, 3).
        around: Returns a solid around several of them, by their numbers, and what it is.
    """
    solids: list[ConvexSolid] = []
    nodes: list[Numbers] = []
    count = 0
    waiting: list[tuple[Numbers, Numbers | None, int]] = [(np.arange(len(trees)), None, NODE_FIRST)]
    while waiting:
        own, parent, side = waiting.pop()
        if parent is not None:
            parent[0, side] = count
        if len(own) == 1:
            tree = trees[own[0]]
            nodes.append(tree.behind(len(solids), count))
            solids += tree.solids
            count += len(tree.nodes)
            continue
        solid, kind = around(own)
        node = np.array([(len(solids), *LEAF, kind, -1, -1)])
        solids.append(solid)
        nodes.append(node)
        count += 1
        first, second = _halved(middles[own])
        waiting += [(own[first], node, NODE_FIRST), (own[second], node, NODE_SECOND)]
    return Tree(solids, np.concatenate(nodes))


def _halved(points: Matrix) -> tuple[Numbers, Numbers]:
    """Return the numbers of two halves of points, shape (n, 3), along the longest side of their box."""
    count = len(points)
    order = _sorted_along(points, np.arange(count), np.array([0]), np.array([count]))
    return order[: count // 2], order[count // 2 :]


def _box_solid(low: NDArray[np.float64], high: NDArray[np.float64]) -> ConvexSolid:
    return ConvexSolid(0.5 * (low + high) + 0.5 * (high - low) * BOX_CORNERS, inside=False)


def _box(solid: ConvexSolid) -> Matrix:
    """Return two opposite corners of a box around a convex solid, shape (2, 3)."""
    around = solid.disc * np.sqrt(np.maximum(0.0, 1.0 - solid.axis**2)) + solid.radius
    return np.array([solid.corners.min(axis=0) - around, solid.corners.max(axis=0) + around])
