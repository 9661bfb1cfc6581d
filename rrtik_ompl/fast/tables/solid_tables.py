"""Bodies as convex solids for the kernels that compare solids: corners, a disc and a ball, added up.

The core of a solid is the hull of its corners, each with a disc around it (of a cylinder); the solid is all that is no
farther from its core than a radius. A body that is not convex lies in the union of its solids, so that it can be proven
apart from others but never to overlap them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import accumulate
from typing import Any

import coal
import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.solids import SameObject, is_mesh
from rrtik_ompl.covers.cache import cached_convex_pieces
from rrtik_ompl.fast.simd.processor import WIDTH
from rrtik_ompl.fast.tables.layout import (
    AROUND_END,
    AROUND_FIRST,
    AXIS,
    BOUND_CENTRE,
    BOUND_RADIUS,
    CONVEX_SOLID,
    CORNERS,
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
    SIZES,
    SLACK,
    SOLID_INTS,
    SOLID_KIND,
    SOLIDS,
    SPAN_FRAME,
    SPAN_INTS,
    SPANS,
    UNKNOWN_SOLID,
)
from rrtik_ompl.fast.tables.memory import Table, record, table, whole_records

BOX_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
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
        kind: CONVEX_SOLID, HALF_SPACE_SOLID, UNKNOWN_SOLID, or MERE_CORNERS: points of a body.
    """

    corners: Matrix
    inside: bool = True
    disc: float = 0.0
    axis: Vector = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    radius: float = 0.0
    slack: float = 0.0
    kind: int = CONVEX_SOLID

    def grown(self, margin: float) -> ConvexSolid:
        """All that is no farther than ``margin`` [m] from the solid."""
        if self.kind == HALF_SPACE_SOLID:
            return replace(self, disc=self.disc + margin)
        return replace(self, radius=self.radius + margin)

    def placed(self, rotation: Matrix, origin: Vector, slack: float) -> ConvexSolid:
        """The solid moved into another frame, its points misplaced by ``slack`` more."""
        axis = rotation @ self.axis
        if self.kind == HALF_SPACE_SOLID:
            offset = self.disc + float(axis @ origin)
            return replace(self, axis=axis, disc=offset, slack=slack + SLACK_PER_METRE * (1.0 + abs(offset)))
        corners = self.corners @ rotation.T + origin
        size = float(np.abs(corners).max()) + self.disc + self.radius
        if not size < MAX_COMPARED_SIZE:
            return UNKNOWN
        return replace(self, corners=corners, axis=axis, slack=slack + SLACK_PER_METRE * (1.0 + size))

    def sizes(self) -> Vector:
        """Numbers for the kernels, see the layout."""
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        centre = 0.5 * (low + high)
        around = float(np.linalg.norm(self.corners - centre, axis=1).max()) + abs(self.disc) + self.radius
        own: dict[int, float | Vector] = {DISC: self.disc, AXIS: self.axis, ROUND: self.radius, SLACK: self.slack}
        return record(SIZE_COUNT, own | {BOUND_CENTRE: centre, BOUND_RADIUS: around})


UNKNOWN = ConvexSolid(np.zeros((1, 3)), inside=False, kind=UNKNOWN_SOLID)


@dataclass(frozen=True, slots=True, eq=False)
class Solids:
    """Convex solids whose union contains a body, and convex solids inside it: the same ones for a convex body."""

    around: tuple[ConvexSolid, ...] = ()
    inside: tuple[ConvexSolid, ...] = ()

    def grown(self, margin: float) -> Solids:
        """See :meth:`ConvexSolid.grown`."""
        if margin == 0.0:
            return self
        around = tuple(solid.grown(margin) for solid in self.around)
        same = self.inside == self.around
        return Solids(around, around if same else tuple(solid.grown(margin) for solid in self.inside))

    def placed(self, rotation: Matrix, origin: Vector, slack: float) -> Solids:
        """See :meth:`ConvexSolid.placed`."""
        around = tuple(solid.placed(rotation, origin, slack) for solid in self.around)
        if self.inside == self.around:
            return Solids(around, around)
        return Solids(around, tuple(solid.placed(rotation, origin, slack) for solid in self.inside))


NO_SOLIDS = Solids()


def convex_solids(geometry: Any) -> Solids:
    """Convex solids around and inside a coal geometry, in its frame; none for a kind that is not known here."""
    return _convex_solids(SameObject(geometry))


@lru_cache(maxsize=1024)
def _convex_solids(key: SameObject) -> Solids:
    if is_mesh(key.geometry):
        around, inside, points = cached_convex_pieces(key.geometry)
        held = (*map(ConvexSolid, inside), *(ConvexSolid(p, kind=MERE_CORNERS) for p in points))
        return Solids(tuple(ConvexSolid(p, inside=False) for p in around), held)
    own = _own_solid(key.geometry)
    return NO_SOLIDS if own is None else Solids((own,), (own,))


def _own_solid(solid: Any) -> ConvexSolid | None:
    """A convex geometry itself."""
    if isinstance(solid, coal.Halfspace):
        if solid.getSweptSphereRadius() != 0.0:
            return None
        return ConvexSolid(np.zeros((1, 3)), disc=float(solid.d), axis=np.array(solid.n), kind=HALF_SPACE_SOLID)
    if not isinstance(solid, (coal.Box, coal.Sphere, coal.Capsule, coal.Cylinder, coal.ConvexBase)):
        return None
    swept = float(solid.getSweptSphereRadius())
    if isinstance(solid, coal.Box):
        return ConvexSolid(BOX_CORNERS * np.array(solid.halfSide), radius=swept)
    if isinstance(solid, coal.ConvexBase):
        return ConvexSolid(np.array(solid.points(), dtype=np.float64).reshape(-1, 3), radius=swept)
    if isinstance(solid, coal.Sphere):
        return ConvexSolid(np.zeros((1, 3)), radius=float(solid.radius) + swept)
    ends = np.array([[0.0, 0.0, float(solid.halfLength)], [0.0, 0.0, -float(solid.halfLength)]])
    if isinstance(solid, coal.Capsule):
        return ConvexSolid(ends, radius=float(solid.radius) + swept)
    return ConvexSolid(ends, disc=float(solid.radius), radius=swept)


def solid_table(bodies: Sequence[tuple[int, Sequence[Solids]]]) -> Table:
    """Table of bodies: for each the frame that carries it and the solids of its parts in that frame.

    A part without solids around it leaves the body unknown.
    """
    solids: list[ConvexSolid] = []
    spans = []
    for frame, parts in bodies:
        around = [solid for part in parts for solid in part.around or (UNKNOWN,)]
        inside = [solid for part in parts for solid in part.inside]
        start, middle = len(solids), len(solids) + len(around)
        solids += around if inside == around else around + inside
        first_inside = start if inside == around else middle
        span = {AROUND_FIRST: start, AROUND_END: middle, INSIDE_FIRST: first_inside, INSIDE_END: len(solids)}
        spans.append({SPAN_FRAME: frame} | span)
    blocks = [_blocks(solid.corners) for solid in solids]
    starts = list(accumulate(map(len, blocks), initial=0))
    numbers = [
        {SOLID_KIND: s.kind, FIRST_BLOCK: a, END_BLOCK: b, IS_INSIDE: int(s.inside)}
        for s, a, b in zip(solids, starts[:-1], starts[1:], strict=True)
    ]
    return table(
        {
            SPANS: whole_records(SPAN_INTS, spans),
            SOLIDS: whole_records(SOLID_INTS, numbers),
            SIZES: np.array([s.sizes() for s in solids], dtype=np.float64).reshape(-1, SIZE_COUNT),
            CORNERS: np.concatenate([np.zeros((0, 3, WIDTH)), *blocks]).astype(np.float32),
        }
    )


def _blocks(corners: Matrix) -> Matrix:
    """Corners ``WIDTH`` at a time, shape (blocks, 3, WIDTH); the first one fills up the last block."""
    padded = np.concatenate([corners, np.repeat(corners[:1], -len(corners) % WIDTH, axis=0)])
    return np.asarray(padded.reshape(-1, WIDTH, 3).transpose(0, 2, 1))
