"""Repair surfaces of triangles as programs write them: doubled and turned triangles, edges that meet in a T."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix

Faces = NDArray[np.int64]
ROUNDS = 8  # most times that triangles are cut at vertices on their edges
MOST_OPEN = 20_000  # most open edges of a surface that is mended; one with more is torn, not badly written
NEAR = 1e-6  # distance from an edge, as a share of the mesh's size, up to which a vertex lies on it


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of a surface.

    Attributes:
        ends: Indices of both vertices of each edge, the lower one first, shape (e, 2).
        number: Number of the edge of each side of each triangle, from its k-th corner to the next, shape (m, 3).
        surplus: How much more often triangles pass an edge upwards than downwards, shape (e,).
    """

    ends: Faces
    number: Faces
    surplus: NDArray[np.int64]

    @property
    def open(self) -> Mask:
        """Whether triangles do not pass an edge equally often in both directions, shape (e,)."""
        is_open: Mask = self.surplus != 0
        return is_open


def edges_of(faces: Faces) -> Edges:
    """Return the edges of triangles, shape (m, 3)."""
    end = np.roll(faces, -1, axis=1)
    size = int(faces.max()) + 1
    keys, number = np.unique(np.minimum(faces, end) * size + np.maximum(faces, end), return_inverse=True)
    number = np.asarray(number).reshape(-1, 3)
    surplus = np.bincount(number.ravel(), weights=np.sign(end - faces).ravel(), minlength=len(keys))
    return Edges(np.column_stack([keys // size, keys % size]), number, np.rint(surplus).astype(np.int64))


def repaired(points: Matrix, faces: Faces) -> Faces:
    """Return triangles that close a surface, if small mistakes alone keep it from being closed.

    Of triangles with the same corners one is kept; triangles are cut where a vertex lies on an open edge; in each part
    triangles are turned like most of it. A surface that is closed is left as it is.

    Args:
        points: Vertices, no two of them equal, shape (n, 3).
        faces: Indices of the vertices of each triangle, shape (m, 3).
    """
    edges = edges_of(faces)
    for repair in (_without_doubles, _cut_at_vertices, _turned_alike):
        if not 0 < np.count_nonzero(edges.open) <= MOST_OPEN:
            break
        faces, edges = repair(points, faces, edges)
    return faces


def _without_doubles(_: Matrix, faces: Faces, edges: Edges) -> tuple[Faces, Edges]:
    """Keep one of the triangles with the same corners, whichever way they are turned, where an edge of them is open."""
    doubtful = np.flatnonzero(edges.open[edges.number].any(axis=1))
    _, first = np.unique(np.sort(faces[doubtful], axis=1), axis=0, return_index=True)
    surplus = np.delete(doubtful, first)
    if not len(surplus):
        return faces, edges
    kept = np.delete(faces, surplus, axis=0)
    return kept, edges_of(kept)


def _cut_at_vertices(points: Matrix, faces: Faces, edges: Edges) -> tuple[Faces, Edges]:
    """Cut triangles at vertices that lie on their open edges, until there are no such vertices."""
    for _ in range(ROUNDS):
        cuts = _vertices_on(points, edges) if edges.open.any() else {}
        if not cuts:
            break
        faces = _cut(faces, edges, cuts)
        edges = edges_of(faces)
    return faces, edges


def _vertices_on(points: Matrix, edges: Edges) -> dict[int, list[int]]:
    """Return the ends of open edges that lie on other open edges, by number of that edge, in order along it."""
    open_edges = np.flatnonzero(edges.open)
    vertices = np.unique(edges.ends[open_edges])
    vertices = vertices[np.argsort(points[vertices, 0], kind="stable")]
    near = NEAR * float(np.ptp(points[vertices], axis=0).max())

    # Of the vertices, sorted along x, only those between the ends of an edge are compared with it.
    ends = points[edges.ends[open_edges]]
    begin = np.searchsorted(points[vertices, 0], ends[:, :, 0].min(axis=1) - near)
    stop = np.searchsorted(points[vertices, 0], ends[:, :, 0].max(axis=1) + near)

    cuts: dict[int, list[int]] = {}
    for edge, (start, end), low, high in zip(open_edges, ends, begin, stop, strict=True):
        candidates = vertices[low:high]
        along = end - start
        offset = points[candidates] - start
        size = float(np.linalg.norm(along))
        share = offset @ along / size**2
        apart = np.linalg.norm(offset - share[:, None] * along, axis=1)
        inside = (apart <= near) & (share * size > near) & ((1.0 - share) * size > near)
        if inside.any():
            cuts[int(edge)] = candidates[inside][np.argsort(share[inside])].tolist()
    return cuts


def _cut(faces: Faces, edges: Edges, cuts: dict[int, list[int]]) -> Faces:
    """Divide each triangle with vertices on an edge into a fan from the corner opposite to it; one edge of each."""
    is_cut = np.isin(edges.number, list(cuts))
    pieces = [faces[~is_cut.any(axis=1)]]
    for row in np.flatnonzero(is_cut.any(axis=1)):
        side = int(np.argmax(is_cut[row]))
        a, b, c = np.roll(faces[row], -side)
        edge = int(edges.number[row, side])
        between = cuts[edge] if a == edges.ends[edge, 0] else cuts[edge][::-1]
        chain = [a, *between, b]
        pieces.append(np.array([(p, q, c) for p, q in pairwise(chain)], dtype=np.int64))
    return np.concatenate(pieces)


def _turned_alike(_: Matrix, faces: Faces, edges: Edges) -> tuple[Faces, Edges]:
    """Turn triangles so that in each part, whose triangles are joined by edges of two, all face the same side.

    The side is that of most triangles of the part. A part without such a side, as a Moebius strip, stays open.
    """
    side_edges = edges.number.ravel()
    by_edge = np.argsort(side_edges, kind="stable")
    sides = by_edge[(np.bincount(side_edges) == 2)[side_edges[by_edge]]].reshape(-1, 2)
    # Neighbours that pass their edge in the same direction face different sides.
    differs = edges.surplus[side_edges[sides[:, 0]]] != 0
    if not differs.any():
        return faces, edges

    first, second = (sides // 3).T
    part = _components(len(faces), first, second)
    affected = np.isin(part[first], part[first[differs]])
    neighbours: dict[int, list[tuple[int, bool]]] = {}
    for one, other, differ in zip(*(rows[affected].tolist() for rows in (first, second, differs)), strict=True):
        neighbours.setdefault(one, []).append((other, differ))
        neighbours.setdefault(other, []).append((one, differ))

    turn = np.zeros(len(faces), dtype=bool)
    reached: set[int] = set()
    for begin in neighbours:
        if begin in reached:
            continue
        reached.add(begin)
        members = [begin]
        for face in members:  # The list grows while it is walked through.
            for other, differ in neighbours[face]:
                if other not in reached:
                    reached.add(other)
                    members.append(other)
                    turn[other] = turn[face] ^ differ
        if 2 * np.count_nonzero(turn[members]) > len(members):
            turn[members] = ~turn[members]
    turned = np.where(turn[:, None], faces[:, ::-1], faces)
    return turned, edges_of(turned)


def in_closed_parts(faces: Faces) -> Mask:
    """Return which triangles belong to a part of the surface without an open edge, shape (m,).

    Parts have no vertex in common.
    """
    edges = edges_of(faces)
    part = _components(int(faces.max()) + 1, *edges.ends.T)
    closed: Mask = ~np.isin(part[faces[:, 0]], part[edges.ends[edges.open, 0]])
    return closed


def _components(count: int, first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number for each of ``count`` things, the same for those that links join, directly or by others.

    Each thing takes the least number among those next to it, and then that of the thing with this number, until nothing
    changes.
    """
    label = np.arange(count)
    while True:
        least = np.minimum(label[first], label[second])
        lower = label.copy()
        for ends in (first, second):
            np.minimum.at(lower, label[ends], least)
            np.minimum.at(lower, ends, least)
        lower = lower[lower]
        if np.array_equal(lower, label):
            return label
        label = lower
