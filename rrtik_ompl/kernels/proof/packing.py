"""What the kernels of proofs read, made from bodies and the pairs of them that must not touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.kernels.layout import CLOUD_SOLID, HALF_SPACE_SOLID
from rrtik_ompl.kernels.layout import CONVEX_SOLID as IS_CONVEX
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.groups import Members, compared_as_one, group_rows
from rrtik_ompl.kernels.proof.layout import CLOUD, CONVEX_SOLID, HALF_SPACE, NODES, UNKNOWN, WHOLE_BODY, ProofTable
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.cloud_layout import CloudTable
from rrtik_ompl.kernels.tables.cloud_tables import cloud_table
from rrtik_ompl.kernels.tables.memory import packed, with_own
from rrtik_ompl.kernels.tables.neighbour_tables import Cells, neighbour_table
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid, Solids, placed_bodies
from rrtik_ompl.model.robot import Chain

ROOM = 1e-8  # [m] for rounding: float64 misplaces points of an arm of 30 joints and 100 m by less than a tenth of it
KINDS = {IS_CONVEX: CONVEX_SOLID, HALF_SPACE_SOLID: HALF_SPACE, CLOUD_SOLID: CLOUD}
SIZED = (IS_CONVEX, CLOUD_SOLID)  # have a ball and a box around them
COMPUTED = ("margins", "frames", "stamps", "bends", "ways", "lists", "counts", "stack", "seen", "log", "log_ways")


@dataclass(slots=True, eq=False)
class ProofPairs:
    """The table of a proof, and what its pairs are.

    Attributes:
        table: For the kernels.
        clouds: Tables whose addresses it holds.
        bodies: Numbers of the two bodies of each of the table's pairs, shape (n, 2).
        sides: The same pairs as the kernels have them: body above the plane, its part, body below, its part, shape
            (n, 4); part -1 is a body of several parts as a whole.
        margins: How far each must stay apart [m], shape (n,).
        beside_obstacle: Which pairs are of what moves and an obstacle, shape (n,).
        clear: Which of these are not in contact, and keep a clearance, shape (n,).
        touching: Numbers of the pairs that are in contact.
        firsts: The first solid of each body, and the end of them.
        groups: Bodies that are one solid together; these solids come last.
        kept: What the kernels keep now beside the margins [m]: a clearance from obstacles, nan before the first
            :meth:`keep`, and what they keep between all bodies for rounding and slack.
    """

    table: ProofTable
    clouds: Sequence[CloudTable]
    bodies: NDArray[np.int64]
    sides: NDArray[np.int64]
    margins: Vector
    beside_obstacle: NDArray[np.bool_]
    clear: NDArray[np.bool_]
    touching: Sequence[int]
    firsts: Sequence[int]
    groups: Sequence[Members]
    kept: tuple[float, float] = (float("nan"), ROOM)

    def keep(self, clearance: float, slack: float = 0.0) -> None:
        """Let the kernels keep a clearance from obstacles beside the margins, and a slack between all bodies [m]."""
        if (clearance, ROOM + slack) != self.kept:
            self.kept = clearance, ROOM + slack
            self.table.margins[:] = self.margins + self.kept[1] + clearance * self.clear

    def for_thread(self) -> ProofPairs:
        """The same pairs in a table with memory of its own to compute in."""
        own = {name: np.zeros_like(getattr(self.table, name)) for name in COMPUTED}
        if self.clouds:  # points that are compared stand among the solids
            own |= {name: getattr(self.table, name) for name in ("solids", "corners")}
        memory = with_own(self.table.memory, {ProofTable.places[name]: array for name, array in own.items()})
        return replace(self, table=ProofTable(memory), kept=(float("nan"), ROOM))

    def intact(self) -> bool:
        """Whether no kernel has written beyond an array."""
        return self.table.intact() and all(cloud.intact() for cloud in self.clouds)


@collector_waits()
def proof_pairs(
    chain: Chain,
    bodies: Sequence[Body],
    pairs: Sequence[tuple[int, int]],
    solids: Sequence[Solids],
    strokes: ArrayLike,
    *,
    fixed: bool = True,
    cells: Mapping[tuple[int, int], Cells] = MappingProxyType({}),
) -> ProofPairs:
    """Pack a proof.

    Args:
        chain: The tree of joints.
        bodies: All bodies.
        pairs: Numbers of those that must not touch; pairs that both stand still are left out.
        solids: For each body convex solids around it, in its own frame.
        strokes: Largest value of sliding joints [m], a number or shape (joints,).
        fixed: Whether obstacles stay where they are; neighbours among many are compared as one then.
        cells: Of neighbours of the arm, by their numbers, the smaller one first, where they are apart.
    """
    joints = len(chain.parent)
    parts = [own.around or (NOTHING,) for own in placed_bodies(solids, body_arrays(bodies).placements)]
    reached = _reaches(chain, bodies, parts, np.broadcast_to(strokes, joints))
    firsts = np.cumsum([0, *(len(part) + (len(part) > 1) for part in parts)]).tolist()
    listed = _listed_pairs(chain, bodies, pairs, parts, firsts, fixed=fixed)
    sweeps = listed.sweeps
    count = len(listed.whole) + len(listed.of_parts)

    rows = np.array([*listed.whole, *listed.of_parts, *listed.of_groups], dtype=np.int64)
    rows = rows.reshape(-1, layout.PAIR_SIZE + 4)
    rows[: len(listed.whole), layout.PARTS_FIRST : layout.PARTS_END + 1] += len(listed.whole)
    sides = rows[:, layout.PAIR_SIZE :]
    named = np.sort(sides[:, ::2], axis=1)

    numbers = {pair: number for number, pair in enumerate(cells)}

    def looked_up(row: int) -> int:
        """The number among the neighbours; rows beyond those of two bodies stand for more."""
        return numbers.get((int(named[row, 0]), int(named[row, 1])), -1) if row < len(listed.whole) else -1

    clouds = [cloud_table(bodies[k].geometry.cloud) for k in cloud_bodies(bodies)]
    made = packed(
        ProofTable,
        joint_count=joints,
        parents=(chain.parent + 1).astype(np.int32),
        sliding=chain.prismatic.astype(np.int32),
        joints=_joint_rows(chain),
        **_solid_arrays(bodies, parts, listed.together),
        sweep_count=len(sweeps),
        sweeps=np.array([(bodies[k].joint, base) for (k, *_), base in sweeps], dtype=np.int32),
        reaches=np.array([reached[list(them)].max(axis=0) for them, _ in sweeps]),
        body_pair_count=len(listed.whole),
        pair_count=len(rows),
        pairs=rows[:, : layout.PAIR_SIZE].astype(np.int32),
        margins=np.zeros(len(rows)),
        top_count=len(listed.top),
        top_pairs=np.array(listed.top, dtype=np.int32),
        looked_up=np.array([looked_up(k) for k in listed.top], dtype=np.int32),
        neighbours=neighbour_table([(own, 0) for own in cells.values()]),
        frames=np.zeros(NODES * (joints + 1) * layout.FRAME_SIZE),
        stamps=np.zeros(NODES, dtype=np.int32),
        bends=np.zeros(len(sweeps)),
        ways=np.zeros(3 * len(rows)),
        lists=np.zeros((layout.DEEPEST + 2) * len(rows), dtype=np.int32),
        counts=np.zeros(layout.DEEPEST + 2, dtype=np.int32),
        stack=np.zeros(2 * (layout.DEEPEST + 3), dtype=np.int32),
        seen=np.zeros(4 * layout.FRAME_SIZE),
        log=np.zeros(0, dtype=np.int32),
        log_ways=np.zeros(0),
        clouds=np.array([cloud.address for cloud in clouds], dtype=np.int64),
        cloud_poses=cloud_poses(bodies),
    )

    arrays = body_arrays(bodies)
    beside = np.asarray(arrays.obstacles[named].any(axis=1))
    touching = arrays.in_contact(named)
    margins = arrays.kept_apart(named)
    for number, row in enumerate(listed.of_groups, count):
        margins[number] = margins[row[layout.PARTS_FIRST] : row[layout.PARTS_END]].max()

    return ProofPairs(
        table=made,
        clouds=clouds,
        bodies=named,
        sides=sides,
        margins=margins,
        beside_obstacle=beside,
        clear=beside & ~touching,
        touching=np.flatnonzero(touching).tolist(),
        firsts=firsts,
        groups=listed.together,
    )


class _ListedPairs(NamedTuple):
    """Pairs as rows of the table, behind each of them its sides, see :class:`ProofPairs`.

    ``whole``: of bodies, with spans of ``of_parts``. ``of_parts``: of what these consist of. ``of_groups``: of several
    bodies, with spans of all rows. ``sweeps``: bodies, and the frame from which they are seen. ``together``: bodies
    that are one solid. ``top``: rows to begin with.
    """

    whole: list[tuple[int, ...]]
    of_parts: list[tuple[int, ...]]
    of_groups: list[tuple[int, ...]]
    sweeps: dict[tuple[Members, int], int]
    together: Sequence[Members]
    top: Sequence[int]


def _listed_pairs(
    chain: Chain,
    bodies: Sequence[Body],
    pairs: Sequence[tuple[int, int]],
    parts: Sequence[Sequence[ConvexSolid]],
    firsts: Sequence[int],
    *,
    fixed: bool,
) -> _ListedPairs:
    """The pairs of bodies, of their parts, and of groups of bodies; arguments as of :func:`proof_pairs`."""
    joints = [body.joint for body in bodies]
    common = cache(partial(common_frame, chain))
    moving = [(i, j) for i, j in pairs if joints[i] or joints[j]]

    # those that groups are made of come first
    groups = compared_as_one(bodies, parts, moving, common, fixed=fixed)
    grouped = {(k, s): None for members, (blocks, *_) in groups for block in blocks for s in block for k in members}
    others = [pair for pair in moving if pair not in grouped and pair[::-1] not in grouped]

    sweeps: dict[tuple[Members, int], int] = {}
    whole: list[tuple[int, ...]] = []
    of_parts: list[tuple[int, ...]] = []
    for i, j in [*grouped, *others]:
        base = common(joints[i], joints[j])
        one, other = (i, j) if base == joints[j] else (j, i)  # what stands still, seen from there, is below
        own = [sweeps.setdefault(((k,), base), len(sweeps)) if joints[k] != base else -1 for k in (one, other)]
        begin = len(of_parts)
        if len(parts[one]) > 1 or len(parts[other]) > 1:
            first, second = (firsts[k] + (len(parts[k]) > 1) for k in (one, other))
            of_parts += [
                (first + a, second + b, base, *own, 0, 0, one, a, other, b)
                for a in range(len(parts[one]))
                for b in range(len(parts[other]))
            ]
        numbers = [-1 if len(parts[k]) > 1 else 0 for k in (one, other)]
        span = begin, len(of_parts)
        whole.append((firsts[one], firsts[other], base, *own, *span, one, numbers[0], other, numbers[1]))

    of_groups, together, top = group_rows(groups, joints, firsts, sweeps, len(whole) + len(of_parts))
    top += range(len(grouped), len(whole))
    return _ListedPairs(whole, of_parts, of_groups, sweeps, list(together), top)


NOTHING = ConvexSolid(np.zeros((1, 3)), inside=False, kind=-1)


def solid_kind(body: Body, solid: ConvexSolid) -> int:
    """What the kernels take a solid for; a half-space that moves is not known to them."""
    kind = KINDS.get(solid.kind, UNKNOWN)
    return UNKNOWN if kind == HALF_SPACE and body.joint > 0 else kind


def common_frame(chain: Chain, first: int, second: int) -> int:
    """The last frame that carries both of two frames."""
    while first != second:  # parents have smaller numbers
        first, second = min(first, second), int(chain.parent[max(first, second) - 1]) + 1
    return first


def _joint_rows(chain: Chain) -> Matrix:
    """The joints as the kernels read them, shape (joints, JOINT_SIZE)."""
    turns = chain.placement[:, :3, :3].reshape(-1, 9)
    return np.concatenate([turns, chain.placement[:, :3, 3], chain.axis], axis=1)


def _reaches(chain: Chain, bodies: Sequence[Body], parts: Sequence[Sequence[ConvexSolid]], strokes: Vector) -> Matrix:
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


def _solid_arrays(
    bodies: Sequence[Body], parts: Sequence[Sequence[ConvexSolid]], groups: Sequence[Members]
) -> dict[str, NDArray[np.int32] | NDArray[np.float64]]:
    """The arrays of all solids by their fields.

    A body of several parts comes before these, as a whole; groups of bodies come last.
    """
    numbers: list[tuple[int, ...]] = []
    solids: list[Sequence[ConvexSolid]] = []
    corners: list[Matrix] = []
    count = 0
    owners: list[int] = []
    for k, (body, own) in enumerate(zip(bodies, parts, strict=True)):
        if len(own) > 1:
            known = all(solid.kind == IS_CONVEX for solid in own)
            numbers.append((body.joint, 0, 0, WHOLE_BODY if known else UNKNOWN))
            solids.append(own)
        for solid in own:
            numbers.append((body.joint, count, count + block_count(solid.corners), solid_kind(body, solid)))
            solids.append((solid,))
            corners.append(solid.corners)
            count += block_count(solid.corners)
        owners += [k] * (len(numbers) - len(owners))
    turns = body_arrays(bodies).placements[owners, :3, :3]
    for members in groups:
        numbers.append((bodies[members[0]].joint, 0, 0, WHOLE_BODY))
        solids.append([solid for k in members for solid in parts[k]])
    turns = np.concatenate([turns, np.tile(np.eye(3), (len(groups), 1, 1))])
    records = np.array(numbers, dtype=np.int32).reshape(-1, layout.SOLID_SIZE)  # none where all is free
    clouds = np.flatnonzero(records[:, layout.SOLID_KIND] == CLOUD)
    records[clouds, layout.SOLID_KIND] += np.arange(len(clouds), dtype=np.int32)
    return {"solids": records, "sizes": size_rows(solids, turns), "corners": corner_blocks(corners)}


def block_count(corners: Matrix) -> int:
    """How many blocks the corners of a solid take, shape (k, 3)."""
    return -(-len(corners) // WIDTH)


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


def corners_in(blocks: NDArray[np.float64]) -> Matrix:
    """The corners in blocks, shape (k, 3), those that fill up among them."""
    return np.asarray(blocks.transpose(0, 2, 1).reshape(-1, 3))


def cloud_bodies(bodies: Sequence[Body]) -> list[int]:
    """Numbers of the bodies that are clouds."""
    return [k for k, body in enumerate(bodies) if isinstance(body.geometry, CloudSolid)]


def cloud_poses(bodies: Sequence[Body]) -> Matrix:
    """Frames of the clouds as the kernels read them, shape (clouds, FRAME_SIZE)."""
    places = [bodies[k].placement for k in cloud_bodies(bodies)]
    return np.array([[*place.rotation.ravel(), *place.translation] for place in places]).reshape(-1, layout.FRAME_SIZE)
