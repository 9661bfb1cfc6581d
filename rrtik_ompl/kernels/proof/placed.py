"""The solids of bodies as the table of a proof has them: where they are, how large, how far from the axes of joints.

What is said here of a body depends on the arm and the body alone, so that all worlds of an arm share that of its links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.layout import CLOUD_SOLID, HALF_SPACE_SOLID
from rrtik_ompl.kernels.layout import CONVEX_SOLID as IS_CONVEX
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.groups import Members
from rrtik_ompl.kernels.proof.layout import CLOUD, CONVEX_SOLID, HALF_SPACE, UNKNOWN, WHOLE_BODY
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid, Solids, block_count, placed_bodies
from rrtik_ompl.model.robot import Chain

KINDS = {IS_CONVEX: CONVEX_SOLID, HALF_SPACE_SOLID: HALF_SPACE, CLOUD_SOLID: CLOUD}
SIZED = (IS_CONVEX, CLOUD_SOLID)  # have a ball and a box around them
NOTHING = ConvexSolid(np.zeros((1, 3)), inside=False, kind=-1)


@dataclass(frozen=True, slots=True, eq=False)
class PlacedBodies:
    """Bodies in the frames that carry them.

    A body of several parts is a solid itself, which comes before these.

    Attributes:
        parts: The convex solids of each body, at least one.
        firsts: The first solid of each body, and the end of them.
        solids: What is said of each solid, its blocks of corners counted from 0, shape (n, SOLID_SIZE).
        sizes: The measures of each solid, shape (n, SIZE_COUNT).
        corners: Shape (blocks, 3, WIDTH).
        reaches: How far points of each body come from the axis of each joint that carries it, in any posture [m], shape
            (bodies, joints).
        together: Measures of several bodies as one solid, as far as they are known, by the numbers of these bodies.
    """

    parts: Sequence[Sequence[ConvexSolid]]
    firsts: Sequence[int]
    solids: NDArray[np.int32]
    sizes: Matrix
    corners: NDArray[np.float64]
    reaches: Matrix
    together: dict[Members, Matrix] = field(default_factory=dict)

    def around(self, groups: Sequence[Members]) -> Matrix:
        """The measures of several bodies as one solid, shape (groups, SIZE_COUNT)."""
        unknown = [members for members in groups if members not in self.together]
        if unknown:
            solids = [[solid for k in members for solid in self.parts[k]] for members in unknown]
            rows = size_rows(solids, np.tile(np.eye(3), (len(unknown), 1, 1)))
            self.together.update(zip(unknown, rows, strict=True))
        return np.array([self.together[members] for members in groups]).reshape(-1, layout.SIZE_COUNT)

    def followed_by(self, others: PlacedBodies) -> PlacedBodies:
        """These bodies and others."""
        moved = others.solids.copy()
        moved[:, [layout.FIRST_BLOCK, layout.END_BLOCK]] += len(self.corners)
        return PlacedBodies(
            [*self.parts, *others.parts],
            [*self.firsts, *(self.firsts[-1] + first for first in others.firsts[1:])],
            np.concatenate([self.solids, moved]),
            np.concatenate([self.sizes, others.sizes]),
            np.concatenate([self.corners, others.corners]),
            np.concatenate([self.reaches, others.reaches]),
        )


def bodies_in_place(chain: Chain, bodies: Sequence[Body], solids: Sequence[Solids], strokes: ArrayLike) -> PlacedBodies:
    """Bring bodies into the frames that carry them.

    Args:
        chain: The tree of joints.
        bodies: The bodies.
        solids: Of each convex solids around it, in its own frame.
        strokes: Largest value of sliding joints [m], a number or shape (joints,).
    """
    poses = np.array([body.placement.homogeneous for body in bodies]).reshape(-1, 4, 4)
    placed = placed_bodies([Solids(own.around, own.around) for own in solids], poses)
    parts = [own.around or (NOTHING,) for own in placed]
    rows: list[tuple[int, ...]] = []
    groups: list[Sequence[ConvexSolid]] = []
    owners: list[int] = []
    count = 0
    for number, (body, own) in enumerate(zip(bodies, parts, strict=True)):
        if len(own) > 1:
            known = all(solid.kind == IS_CONVEX for solid in own)
            rows.append((body.joint, 0, 0, WHOLE_BODY if known else UNKNOWN))
            groups.append(own)
        for solid in own:
            end = count + block_count(solid.corners)
            rows.append((body.joint, count, end, solid_kind(body, solid)))
            groups.append((solid,))
            count = end
        owners += [number] * (len(rows) - len(owners))

    return PlacedBodies(
        parts,
        np.cumsum([0, *(len(own) + (len(own) > 1) for own in parts)]).tolist(),
        np.array(rows, dtype=np.int32).reshape(-1, layout.SOLID_SIZE),  # none where all is free
        size_rows(groups, poses[owners, :3, :3]),
        corner_blocks([solid.corners for own in parts for solid in own]),
        reaches_of(chain, bodies, parts, np.broadcast_to(strokes, len(chain.parent))),
    )


def solid_kind(body: Body, solid: ConvexSolid) -> int:
    """What the kernels take a solid for; a half-space that moves is not known to them."""
    kind = KINDS.get(solid.kind, UNKNOWN)
    return UNKNOWN if kind == HALF_SPACE and body.joint > 0 else kind


def reaches_of(chain: Chain, bodies: Sequence[Body], parts: Sequence[Sequence[ConvexSolid]], strokes: Vector) -> Matrix:
    """How far points of bodies come from the axis of each joint that carries them, in any posture, (bodies, joints)."""
    reaches = np.zeros((len(bodies), len(chain.parent)))
    convex = np.array([all(solid.kind == IS_CONVEX for solid in own) for own in parts], dtype=bool)
    carried = np.array([body.joint > 0 for body in bodies], dtype=bool)
    reaches[carried & ~convex] = np.inf
    measured = np.flatnonzero(carried & convex).tolist()
    if not measured:
        return reaches

    origins = chain.placement[:, :3, 3]
    slides = np.where(chain.prismatic, strokes, 0.0)
    steps = (np.linalg.norm(origins, axis=1) + slides).tolist()
    lifts = (np.linalg.norm(np.cross(origins, chain.axis[chain.parent]), axis=1) + slides).tolist()
    last = [bodies[k].joint - 1 for k in measured]
    far, off_axis = _farthest([parts[k] for k in measured], chain.axis[last])
    for number, joint, whole, own in zip(measured, last, far.tolist(), off_axis.tolist(), strict=True):
        reaches[number, joint] = own
        while (parent := int(chain.parent[joint])) >= 0:
            reaches[number, parent] = lifts[joint] + whole
            whole += steps[joint]
            joint = parent
    return reaches


def _farthest(groups: Sequence[Sequence[ConvexSolid]], axes: Matrix) -> tuple[Vector, Vector]:
    """Largest distances of groups' points from the frame's origin and from an axis each, shapes (n,).

    Args:
        groups: n groups of one solid or more.
        axes: Unit vectors through the origin, shape (n, 3).
    """
    solids = [solid for group in groups for solid in group]
    counts = [len(solid.corners) for solid in solids]
    around = np.repeat([solid.disc + solid.radius for solid in solids], counts)
    group_of = np.repeat(np.repeat(np.arange(len(groups)), [len(group) for group in groups]), counts)
    starts = np.searchsorted(group_of, np.arange(len(groups)))
    corners = np.concatenate([solid.corners for solid in solids])
    far = np.linalg.norm(corners, axis=1) + around
    off_axis = np.linalg.norm(np.cross(corners, axes[group_of]), axis=1) + around
    return np.maximum.reduceat(far, starts), np.maximum.reduceat(off_axis, starts)


def size_rows(groups: Sequence[Sequence[ConvexSolid]], turns: NDArray[np.float64]) -> Matrix:
    """Ball and box around groups of solids, and the measures of the first of each, shape (n, SIZE_COUNT).

    Args:
        groups: n groups of one solid or more.
        turns: Columns are the axes of the boxes, shape (n, 3, 3).
    """
    made = np.zeros((len(groups), layout.SIZE_COUNT))
    first = [group[0] for group in groups]
    made[:, layout.DISC] = [solid.disc for solid in first]
    made[:, layout.DISC_AXIS : layout.DISC_AXIS + 3] = np.reshape([solid.axis for solid in first], (-1, 3))
    known = np.array([all(solid.kind in SIZED for solid in group) for group in groups], dtype=bool)
    if not known.any():
        return made
    turns = turns[known]
    kept = [group for group, convex in zip(groups, known, strict=True) if convex]
    solids = [solid for group in kept for solid in group]
    counts = [len(solid.corners) for solid in solids]
    group_of = np.repeat(np.arange(len(kept)), [len(group) for group in kept])
    solid_of = np.repeat(np.arange(len(solids)), counts)
    starts = np.searchsorted(group_of[solid_of], np.arange(len(kept)))
    discs, rounds = np.array([(solid.disc, solid.radius) for solid in solids]).T
    axes = np.einsum("nji,nj->ni", turns[group_of], np.array([solid.axis for solid in solids]))
    across = discs[:, None] * np.sqrt(np.maximum(0.0, 1.0 - axes**2)) + rounds[:, None]
    corners = np.concatenate([solid.corners for solid in solids])
    along = np.einsum("nji,nj->ni", turns[group_of[solid_of]], corners)
    low = np.minimum.reduceat(along - across[solid_of], starts)
    high = np.maximum.reduceat(along + across[solid_of], starts)
    centres = np.einsum("nij,nj->ni", turns, 0.5 * (low + high))
    away = np.linalg.norm(corners - centres[group_of[solid_of]], axis=1) + (discs + rounds)[solid_of]
    numbers = {
        layout.BALL_CENTRE: centres,
        layout.BALL_RADIUS: np.maximum.reduceat(away, starts)[:, None],
        layout.BOX_AXES: turns.transpose(0, 2, 1).reshape(-1, 9),
        layout.BOX_MIDDLE: 0.5 * (low + high),
        layout.BOX_HALF: 0.5 * (high - low),
        layout.ROUND: np.array([[group[0].radius] for group in kept]),
    }
    for place, run in numbers.items():
        made[known, place : place + run.shape[1]] = run
    return made


def corner_blocks(solids: Sequence[Matrix]) -> NDArray[np.float64]:
    """The corners of solids, shapes (k, 3), in blocks that kernels compare at once, shape (blocks, 3, WIDTH).

    Each solid begins a block; its last one is filled up with its last corner.
    """
    counts = np.array([len(corners) for corners in solids], dtype=np.int64)
    lanes = WIDTH * -(-counts // WIDTH)
    numbers = np.arange(lanes.sum()) - np.repeat(np.cumsum(lanes) - lanes, lanes)
    numbers = np.minimum(numbers, np.repeat(counts - 1, lanes)) + np.repeat(np.cumsum(counts) - counts, lanes)
    corners = np.concatenate([np.zeros((0, 3)), *solids])[numbers]
    return np.ascontiguousarray(corners.reshape(-1, WIDTH, 3).transpose(0, 2, 1))
