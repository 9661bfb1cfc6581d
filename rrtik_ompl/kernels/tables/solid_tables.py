"""Bodies as convex solids for the kernels that compare solids: corners, a disc and a ball, added up.

The core of a solid is the hull of its corners, each with a disc around it (of a cylinder); the solid is all that is no
farther from its core than a radius. A body that is not convex lies in the union of its solids, so that it can be proven
apart from others but never to overlap them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import coal
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.shape_table import core_of
from rrtik_ompl.geometry.collision.solids import is_mesh, once_per_geometry
from rrtik_ompl.kernels.covers.cache import cached_convex_pieces
from rrtik_ompl.kernels.layout import (
    AROUND_END,
    AROUND_FIRST,
    AXIS,
    BOUND_CENTRE,
    BOUND_RADIUS,
    CLOUD_SOLID,
    CONVEX_SOLID,
    DISC,
    END_BLOCK,
    FIRST_BLOCK,
    HALF_SPACE_SOLID,
    INSIDE_END,
    INSIDE_FIRST,
    IS_INSIDE,
    MERE_CORNERS,
    ROUND,
    SIZE_COUNT,
    SLACK,
    SOLID_INTS,
    SOLID_KIND,
    SPAN_FRAME,
    SPAN_INTS,
    UNKNOWN_SOLID,
    SolidTable,
)
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.cloud_layout import LEAF
from rrtik_ompl.kernels.tables.memory import packed

MAX_COMPARED_SIZE = 1e4  # [m]; what is larger or farther away is not compared
SLACK_PER_METRE = 2e-6  # rounding of corners and of their heights in float32, relative to the coordinates


@dataclass(frozen=True, slots=True, eq=False)
class ConvexSolid:
    """A convex solid, or a half-space, in some frame.

    Attributes:
        corners: Of its core, shape (n, 3).
        inside: Whether the body contains it.
        disc: Radius of the disc around every corner, across ``axis``; of a half-space its offset along ``axis``.
        axis: Unit vector, shape (3,).
        radius: Of the ball around every point of the core.
        slack: How far rounding may misplace its points [m].
        kind: CONVEX_SOLID, HALF_SPACE_SOLID, UNKNOWN_SOLID, MERE_CORNERS: points of a body, or CLOUD_SOLID.
    """

    corners: Matrix
    inside: bool = True
    disc: float = 0.0
    axis: Vector = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    radius: float = 0.0
    slack: float = 0.0
    kind: int = CONVEX_SOLID


UNKNOWN = ConvexSolid(np.zeros((1, 3)), inside=False, kind=UNKNOWN_SOLID)


@dataclass(frozen=True, slots=True, eq=False)
class Solids:
    """Convex solids whose union contains a body, and convex solids inside it: the same ones for a convex body."""

    around: tuple[ConvexSolid, ...] = ()
    inside: tuple[ConvexSolid, ...] = ()


NO_SOLIDS = Solids()


@once_per_geometry
def convex_solids(geometry: coal.CollisionGeometry) -> Solids:
    """Convex solids around and inside a coal geometry, in its frame; none for a kind that is not known here."""
    if isinstance(geometry, CloudSolid):
        return _cloud(geometry)
    if is_mesh(geometry):
        around, inside, points = cached_convex_pieces(geometry)
        held = (*map(ConvexSolid, inside), *(ConvexSolid(p, kind=MERE_CORNERS) for p in points))
        return Solids(tuple(ConvexSolid(p, inside=False) for p in around), held)

    own = _own_solid(geometry)
    return NO_SOLIDS if own is None else Solids((own,), (own,))


def _cloud(solid: CloudSolid) -> Solids:
    """What has room for as many points of a cloud as a kernel compares at once; until then the corners of its box."""
    low, high = solid.cloud.tree.bounds
    corners = np.where(np.indices((2, 2, 2)).reshape(3, -1).T == 0, low, high).astype(np.float64)
    every = ConvexSolid(np.tile(corners, (LEAF // len(corners), 1)), radius=solid.cloud.radius, kind=CLOUD_SOLID)
    return Solids((every,), (every,))


def _own_solid(solid: coal.CollisionGeometry) -> ConvexSolid | None:
    """A convex geometry itself."""
    if isinstance(solid, coal.Halfspace):
        if solid.getSweptSphereRadius() != 0.0:
            return None
        return ConvexSolid(np.zeros((1, 3)), disc=float(solid.d), axis=np.array(solid.n), kind=HALF_SPACE_SOLID)

    core = core_of(solid)
    if core is not None:
        radius = core.radius + float(solid.getSweptSphereRadius())
        return ConvexSolid(core.corners, disc=core.disc or 0.0, radius=radius)

    if isinstance(solid, coal.ConvexBase):
        points = np.array(solid.points(), dtype=np.float64).reshape(-1, 3)
        return ConvexSolid(points, radius=float(solid.getSweptSphereRadius()))

    return None


def placed_solids(
    solids: Sequence[ConvexSolid], poses: NDArray[np.float64], *, margins: ArrayLike = 0.0, slack: float = 0.0
) -> list[ConvexSolid]:
    """Solids in other frames; what is too large or too far away for comparisons is unknown.

    Args:
        solids: n of them.
        poses: Of the frames that they are in, seen from the others, shape (n, 4, 4).
        margins: All that is no farther than this from a solid belongs to it too [m], a number or shape (n,).
        slack: How far their points are misplaced beside their own slack [m].
    """
    if not solids:
        return []

    owner, starts = _runs([len(s.corners) for s in solids])
    turns = poses[:, :3, :3]
    origins = poses[:, :3, 3]
    corners = np.einsum("nij,nj->ni", turns[owner], np.concatenate([s.corners for s in solids])) + origins[owner]
    axes = np.einsum("nij,nj->ni", turns, np.array([s.axis for s in solids]))
    discs, radii, slacks = np.array([(s.disc, s.radius, s.slack) for s in solids]).T
    endless = np.array([s.kind == HALF_SPACE_SOLID for s in solids])
    discs = discs + np.where(endless, margins + np.einsum("ni,ni->n", axes, origins), 0.0)
    radii = radii + np.where(endless, 0.0, margins)
    sizes = np.maximum.reduceat(np.abs(corners).max(axis=1), starts[:-1]) + discs + radii
    slacks = slacks + slack + SLACK_PER_METRE * (1.0 + np.where(endless, np.abs(discs), sizes))
    compared = endless | (sizes < MAX_COMPARED_SIZE)

    return [
        ConvexSolid(s.corners if plane else corners[a:b], s.inside, disc, axis, radius, own_slack, s.kind)
        if near
        else UNKNOWN
        for s, near, plane, a, b, disc, axis, radius, own_slack in zip(
            solids,
            *(each.tolist() for each in (compared, endless, starts[:-1], starts[1:], discs)),
            axes,
            *(each.tolist() for each in (radii, slacks)),
            strict=True,
        )
    ]


def placed_bodies(
    bodies: Sequence[Solids], poses: NDArray[np.float64], *, margins: ArrayLike = 0.0, slack: float = 0.0
) -> list[Solids]:
    """The solids of bodies in other frames; see :func:`placed_solids`."""
    own = [each.around if each.inside == each.around else each.around + each.inside for each in bodies]
    owner, starts = _runs(list(map(len, own)))
    grown = np.broadcast_to(margins, len(bodies))[owner]
    placed = placed_solids([solid for each in own for solid in each], poses[owner], margins=grown, slack=slack)
    made = []

    for each, first, end in zip(bodies, starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        middle = first + len(each.around)
        around = tuple(placed[first:middle])
        made.append(Solids(around, around if middle == end and each.inside else tuple(placed[middle:end])))

    return made


def _runs(counts: Sequence[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The owner of each of sum(counts) things in runs, and where the runs start and the last one ends."""
    return np.repeat(np.arange(len(counts)), counts), np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])


def solid_table(bodies: Sequence[tuple[int, Sequence[Solids]]]) -> SolidTable:
    """Table of bodies: for each the frame that carries it and the solids of its parts in that frame.

    A part without solids around it leaves the body unknown.
    """
    solids: list[ConvexSolid] = []
    spans = []
    for frame, parts in bodies:
        around = [solid for part in parts for solid in part.around or (UNKNOWN,)]
        inside = [solid for part in parts for solid in part.inside]
        start = len(solids)
        middle = len(solids) + len(around)
        solids += around if inside == around else around + inside
        first_inside = start if inside == around else middle
        spans.append((frame, start, middle, first_inside, len(solids)))

    counts = np.array([len(solid.corners) for solid in solids], dtype=np.int64)
    blocks = np.concatenate([[0], np.cumsum(-(-counts // WIDTH))])
    numbers = np.zeros((len(solids), SOLID_INTS), dtype=np.int32)
    numbers[:, FIRST_BLOCK] = blocks[:-1]
    numbers[:, END_BLOCK] = blocks[1:]
    numbers[:, SOLID_KIND] = [s.kind for s in solids]
    numbers[:, IS_INSIDE] = [s.inside for s in solids]
    records = np.zeros((len(spans), SPAN_INTS), dtype=np.int32)
    records[:, [SPAN_FRAME, AROUND_FIRST, AROUND_END, INSIDE_FIRST, INSIDE_END]] = np.reshape(spans, (-1, SPAN_INTS))

    return packed(
        SolidTable,
        spans=records,
        solids=numbers,
        sizes=solid_sizes(solids),
        corners=corner_blocks(solids).astype(np.float32),
    )


def solid_sizes(solids: Sequence[ConvexSolid]) -> Matrix:
    """Numbers for the kernels, see the layout, shape (n, SIZE_COUNT)."""
    made = np.zeros((len(solids), SIZE_COUNT))
    if solids:
        corners = np.concatenate([solid.corners for solid in solids])
        owner, starts = _runs([len(solid.corners) for solid in solids])
        low, high = (end.reduceat(corners, starts[:-1]) for end in (np.minimum, np.maximum))
        centres = 0.5 * (low + high)
        away = np.maximum.reduceat(np.linalg.norm(corners - centres[owner], axis=1), starts[:-1])
        made[:, DISC], made[:, ROUND], made[:, SLACK] = np.array([(s.disc, s.radius, s.slack) for s in solids]).T
        made[:, AXIS : AXIS + 3] = [solid.axis for solid in solids]
        made[:, BOUND_CENTRE : BOUND_CENTRE + 3] = centres
        made[:, BOUND_RADIUS] = away + np.abs(made[:, DISC]) + made[:, ROUND]

    return made


def block_count(corners: Matrix) -> int:
    """How many blocks the corners of a solid take, shape (k, 3)."""
    return -(-len(corners) // WIDTH)


def corner_blocks(solids: Sequence[ConvexSolid]) -> NDArray[np.float64]:
    """Corners ``WIDTH`` at a time, shape (blocks, 3, WIDTH); the first one of a solid fills up its last block."""
    counts = np.array([len(solid.corners) for solid in solids], dtype=np.int64)
    owner, _ = _runs((-(-counts // WIDTH) * WIDTH).tolist())
    starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
    within = np.arange(len(owner)) - np.searchsorted(owner, owner)
    corners = np.concatenate([np.zeros((0, 3)), *(solid.corners for solid in solids)])
    padded = corners[starts[owner] + np.where(within < counts[owner], within, 0)]

    return np.asarray(padded.reshape(-1, WIDTH, 3).transpose(0, 2, 1))
