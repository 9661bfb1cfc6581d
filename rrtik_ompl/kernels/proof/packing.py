"""What the kernels of proofs read, made from bodies and the pairs of them that must not touch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.kernels.layout import CONVEX_SOLID
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.groups import MANY, Levels, Members, compared_as_one, group_rows, neighbours
from rrtik_ompl.kernels.proof.layout import CLOUD, HALF_SPACE, NODES, UNKNOWN, WHOLE_BODY, ProofTable
from rrtik_ompl.kernels.proof.placed import PlacedBodies, bodies_in_place
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.cloud_layout import CloudTable
from rrtik_ompl.kernels.tables.cloud_tables import cloud_table
from rrtik_ompl.kernels.tables.memory import packed, with_own_arrays
from rrtik_ompl.kernels.tables.neighbour_tables import Cells, neighbour_table
from rrtik_ompl.kernels.tables.solid_tables import Solids
from rrtik_ompl.model.robot import Chain

LISTED = 64  # lists of pairs that are kept: numbers of a robot, and of what it holds and what stands around it
SHORTEST_RUN = 4  # pairs that are compared in lanes
ROOM = 1e-8  # [m] for rounding: float64 misplaces points of an arm of 30 joints and 100 m by less than a tenth of it
REMEMBERED = ("margins", "stamps", "ways", "way_stamps", "chord_stamps", "log", "log_ways")  # from proof to proof
COMPUTED = (*REMEMBERED, "frames", "angles", "bends", "lists", "counts", "stack", "chords", "seen")
PLACED = ("sizes", "corners", "reaches", "still", "clouds", "cloud_poses")  # where solids stand


@dataclass(frozen=True, slots=True, eq=False)
class Sweeps:
    """What moves bodies as seen from the frames that their pairs are seen from.

    Attributes:
        members: The bodies of each sweep.
        carries: Which joints carry them there, shape (sweeps, joints).
        reaches: How far points of each body come from the axis of each joint, see :class:`PlacedBodies`.
    """

    members: Sequence[Members]
    carries: NDArray[np.bool_]
    reaches: Matrix

    def with_body(self, number: int, reaches: Vector) -> Sweeps:
        """Return the same sweeps with another reach of a body, shape (joints,) [m]."""
        changed = self.reaches.copy()
        changed[number] = reaches
        return replace(self, reaches=changed)

    def lanes(self) -> NDArray[np.float64]:
        """Return how far points come from the axes of the joints that carry them, as the kernels read it [m]."""
        joints = self.reaches.shape[1]
        farthest = np.array([self.reaches[list(them)].max(axis=0) for them in self.members]).reshape(-1, joints)
        return _in_lanes(np.where(self.carries, farthest, 0.0))


@dataclass(slots=True, eq=False)
class ProofPairs:
    """The table of a proof, and what its pairs are.

    Attributes:
        table: For the kernels.
        clouds: Tables whose addresses it holds.
        still: Numbers of the solids at rest that its blocks hold, shape (blocks, WIDTH).
        bodies: Numbers of the two bodies of each of the table's pairs, shape (n, 2).
        sides: The same pairs as the kernels have them: body above the plane, its part, body below, its part, shape
            (n, 4); part -1 is a body of several parts as a whole.
        margins: How far each must stay apart [m], shape (n,).
        beside_obstacle: Which pairs are of what moves and an obstacle, or of several bodies with one, shape (n,).
        clear: Which of these are not in contact, and keep a clearance, shape (n,).
        touching: Numbers of the pairs that are in contact.
        firsts: The first solid of each body, and the end of them.
        groups: Bodies that are one solid together; these solids come last.
        first_group: Number of the first pair of several bodies, which come last.
        sweeps: What moves the bodies of its pairs.
        chain: The tree of joints.
        strokes: The largest values of sliding joints [m], shape (joints,).
        kept: What the kernels keep now beside the margins [m]: a clearance from obstacles, nan before the first
            :meth:`keep`, and what they keep between all bodies for rounding and slack.
    """

    table: ProofTable
    clouds: Sequence[CloudTable]
    still: NDArray[np.int64]
    bodies: NDArray[np.int64]
    sides: NDArray[np.int64]
    margins: Vector
    beside_obstacle: NDArray[np.bool_]
    clear: NDArray[np.bool_]
    touching: Sequence[int]
    firsts: Sequence[int]
    groups: Sequence[Members]
    first_group: int
    sweeps: Sweeps
    chain: Chain
    strokes: Vector
    kept: tuple[float, float] = (float("nan"), ROOM)

    def keep(self, clearance: float, slack: float = 0.0) -> None:
        """Let the kernels keep a clearance from obstacles beside the margins, and a slack between all bodies [m]."""
        if (clearance, ROOM + slack) != self.kept:
            self.kept = clearance, ROOM + slack
            self.table.margins[: len(self.margins)] = self.margins + self.kept[1] + clearance * self.clear

    def spread_sizes(self, solids: Sequence[int] | None = None) -> None:
        """Let the blocks hold the sizes of some solids, or of all, as they are now."""
        blocks: slice | NDArray[np.bool_] = slice(None)
        if solids is not None:
            written = np.zeros(len(self.table.sizes) // layout.SIZE_COUNT, dtype=bool)
            written[solids] = True
            blocks = np.asarray(written[self.still].any(axis=1))
        sizes = self.table.sizes.reshape(-1, layout.SIZE_COUNT)[self.still[blocks], : layout.STILL_SIZE]
        self.table.still.reshape(-1, layout.STILL_SIZE, WIDTH)[blocks] = sizes.transpose(0, 2, 1)

    def for_thread(self, *, placing: bool = False, same_thread: bool = False) -> ProofPairs:
        """The same pairs in a table with memory of its own to compute in.

        Args:
            placing: Whether its obstacles may be put elsewhere than those of this table.
            same_thread: Whether it is for the thread of this table alone. Both then compute in the same place what no
                proof finds there from an earlier one; stamps tell each whether it has made a frame or a chord itself.
        """
        copied: list[str] = []
        if self.clouds:  # points that are compared stand among the solids
            copied += ["solids", "corners"]
        if placing:
            copied += PLACED
        blank = REMEMBERED if same_thread else COMPUTED
        table = with_own_arrays(self.table, blank, **{name: getattr(self.table, name) for name in copied})
        table.log_room = 0  # which the thread of this one may just have given to a log of its own
        return replace(self, table=table, margins=self.margins.copy(), kept=(float("nan"), ROOM))

    def with_contacts(self, bodies: Sequence[Body]) -> ProofPairs:
        """The same pairs of bodies that are in contact, in the memory of this object.

        Args:
            bodies: The same bodies, but for their contacts.
        """
        margins, touching = _kept_apart(bodies, self.bodies, self.table.pairs, self.first_group)
        return replace(
            self,
            margins=margins,
            clear=self.beside_obstacle & ~touching,
            touching=np.flatnonzero(touching).tolist(),
            kept=(float("nan"), ROOM),
        )

    def forget_planes(self) -> None:
        """Forget the planes of earlier proofs, with which the next ones would begin."""
        self.table.ways[:] = 0.0
        self.table.way_stamps[:] = 0

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
    links: PlacedBodies | None = None,
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
        links: The first bodies in their places, if these are known.
    """
    joints = len(chain.parent)
    links = links or bodies_in_place(chain, (), (), strokes)
    first = len(links.parts)
    placed = links.followed_by(bodies_in_place(chain, bodies[first:], solids[first:], strokes))
    listed = _listed_pairs(chain, bodies, pairs, placed, fixed=fixed)
    sweeps = listed.sweeps
    count = len(listed.whole) + len(listed.of_parts)
    records, sizes = _solid_arrays(bodies, placed, links, listed.together)

    rows = np.concatenate([_as_rows(listed.whole), listed.of_parts, _as_rows(listed.of_groups)])
    rows[: len(listed.whole), layout.PARTS_FIRST : layout.PARTS_END + 1] += len(listed.whole)
    sides = rows[:, layout.PAIR_CHORD :]
    named = np.sort(sides[:, ::2], axis=1)

    known = list({id(own): own for own in cells.values()}.values())
    numbers = {pair: known.index(own) for pair, own in cells.items()}

    def looked_up_of(row: int) -> int:
        """The number among the neighbours of all that a row stands for, -1 if these have none or several."""
        own = [row] if row < len(listed.whole) else range(rows[row, layout.PARTS_FIRST], rows[row, layout.PARTS_END])
        found = {numbers.get((int(named[k, 0]), int(named[k, 1])), -1) for k in own}
        return found.pop() if len(found) == 1 and max(own) < len(listed.whole) else -1

    chord_keys, chords = _chords(rows, records[:, layout.SOLID_KIND], joints)
    top = np.array(listed.top, dtype=np.int64)
    looked_up = np.array([looked_up_of(k) for k in listed.top], dtype=np.int32)
    lengths, blocks, still = _runs(rows, chords[:, 0], top, top[looked_up >= 0])
    clouds = [cloud_table(bodies[k].geometry.cloud) for k in cloud_bodies(bodies)]
    carries = np.array([_carried(chain, bodies[k].joint, base) for (k, *_), base in sweeps]).reshape(-1, joints)
    swept = Sweeps([them for them, _ in sweeps], carries, placed.reaches)
    made = packed(
        ProofTable,
        joint_count=joints,
        parents=(chain.parent + 1).astype(np.int32),
        sliding=chain.prismatic.astype(np.int32),
        joints=joint_rows(chain),
        solids=records,
        sizes=sizes,
        corners=placed.corners,
        sweep_count=len(sweeps),
        sweeps=np.array([(bodies[k].joint, base) for (k, *_), base in sweeps], dtype=np.int32),
        reaches=swept.lanes(),
        carries=_in_lanes(carries),
        body_pair_count=len(listed.whole),
        pair_count=len(rows),
        pairs=np.column_stack([rows[:, : layout.PAIR_CHORD], chords, lengths, blocks]).astype(np.int32),
        margins=np.zeros(len(rows) + WIDTH),
        still=np.zeros(still.size * layout.STILL_SIZE),
        top_count=len(top),
        top_pairs=top.astype(np.int32),
        looked_up=looked_up,
        neighbours=neighbour_table([(own, 0) for own in known]),
        chord_count=len(chord_keys),
        chord_keys=chord_keys.astype(np.int32),
        frames=np.zeros(NODES * (joints + 1) * layout.FRAME_SIZE),
        stamps=np.zeros(NODES, dtype=np.int32),
        angles=angle_lanes(joints),
        bends=np.zeros(len(sweeps) + -len(sweeps) % WIDTH),
        ways=np.zeros(3 * len(rows)),
        way_stamps=np.zeros(len(rows), dtype=np.int32),
        lists=np.zeros((layout.DEEPEST + 2) * len(rows), dtype=np.int32),
        counts=np.zeros(layout.DEEPEST + 2, dtype=np.int32),
        stack=np.zeros(2 * (layout.DEEPEST + 3), dtype=np.int32),
        chords=np.zeros(len(chord_keys) * layout.CHORD_SIZE),
        chord_stamps=np.zeros(len(chord_keys), dtype=np.int32),
        seen=np.zeros(4 * layout.FRAME_SIZE),
        log=np.zeros(0, dtype=np.int32),
        log_ways=np.zeros(0),
        clouds=np.array([cloud.address for cloud in clouds], dtype=np.int64),
        cloud_poses=cloud_poses(bodies),
    )

    beside = np.asarray(body_arrays(bodies).obstacles[named].any(axis=1))
    for number, parts in _groups_of(made.pairs, count):
        beside[number] = beside[parts].any()
    margins, touching = _kept_apart(bodies, named, made.pairs, count)

    pairs_of_bodies = ProofPairs(
        table=made,
        still=still,
        clouds=clouds,
        bodies=named,
        sides=sides,
        margins=margins,
        beside_obstacle=beside,
        clear=beside & ~touching,
        touching=np.flatnonzero(touching).tolist(),
        firsts=placed.firsts,
        groups=listed.together,
        first_group=count,
        sweeps=swept,
        chain=chain,
        strokes=np.broadcast_to(np.asarray(strokes, dtype=np.float64), joints),
    )
    pairs_of_bodies.spread_sizes()
    return pairs_of_bodies


def _kept_apart(
    bodies: Sequence[Body], named: NDArray[np.int64], pairs: NDArray[np.int32], first_group: int
) -> tuple[Vector, NDArray[np.bool_]]:
    """How far each pair must stay apart [m], and which pairs are in contact, shapes (n,).

    Args:
        bodies: All bodies.
        named: Numbers of the two bodies of each pair, shape (n, 2).
        pairs: The pairs as the kernels read them.
        first_group: Number of the first pair of several bodies: these keep the largest distance of theirs, and are in
            contact if all of theirs are.
    """
    arrays = body_arrays(bodies)
    margins = arrays.kept_apart(named)
    touching = arrays.in_contact(named)
    for number, parts in _groups_of(pairs, first_group):
        margins[number] = margins[parts].max()
        touching[number] = touching[parts].all()
    return margins, touching


def _groups_of(pairs: NDArray[np.int32], first_group: int) -> Iterator[tuple[int, slice]]:
    """The pairs of several bodies, from the first one on, each with the pairs that it stands for, which come before."""
    rows = pairs.reshape(-1, layout.PAIR_SIZE)
    for number in range(first_group, len(rows)):
        yield number, slice(*rows[number, layout.PARTS_FIRST : layout.PARTS_END + 1].tolist())


class _ListedPairs(NamedTuple):
    """Pairs as rows of the table, behind each of them its sides, see :class:`ProofPairs`.

    ``whole``: of bodies, with spans of ``of_parts``. ``of_parts``: of what these consist of. ``of_groups``: of several
    bodies, with spans of all rows. ``sweeps``: bodies, and the frame from which they are seen. ``together``: bodies
    that are one solid. ``top``: rows to begin with.
    """

    whole: list[tuple[int, ...]]
    of_parts: NDArray[np.int64]
    of_groups: list[tuple[int, ...]]
    sweeps: dict[tuple[Members, int], int]
    together: Sequence[Members]
    top: Sequence[int]


def _listed_pairs(
    chain: Chain,
    bodies: Sequence[Body],
    pairs: Sequence[tuple[int, int]],
    placed: PlacedBodies,
    *,
    fixed: bool,
) -> _ListedPairs:
    """The pairs of bodies, of their parts, and of groups of bodies; arguments as of :func:`proof_pairs`."""
    joints = tuple(body.joint for body in bodies)
    parts = placed.parts
    what = _Listing(
        tuple(chain.parent.tolist()),
        joints,
        tuple(body.padding for body in bodies),
        tuple(all(solid.kind == CONVEX_SOLID for solid in own) for own in parts),
        tuple(map(len, parts)),
        tuple(placed.firsts),
        tuple((i, j) for i, j in pairs if joints[i] or joints[j]),
    )
    blocks = partial(neighbours, parts) if fixed and joints.count(0) >= MANY else None
    return _listed(what) if blocks is None else _list(what, blocks)


class _Listing(NamedTuple):
    """What pairs are listed from, mere numbers, one for each body; ``parents`` of the joints."""

    parents: tuple[int, ...]
    joints: tuple[int, ...]
    paddings: tuple[float, ...]
    convex: tuple[bool, ...]
    counts: tuple[int, ...]
    firsts: tuple[int, ...]
    moving: tuple[tuple[int, int], ...]


@lru_cache(maxsize=LISTED)
def _listed(what: _Listing) -> _ListedPairs:
    """The pairs of a scene with few obstacles: the same wherever these are, and whatever they measure."""
    return _list(what, None)


def _list(what: _Listing, blocks: Callable[[Sequence[int]], Levels] | None) -> _ListedPairs:
    """The pairs; ``blocks`` as of :func:`compared_as_one`."""
    joints = what.joints
    counts_of = what.counts
    firsts = what.firsts
    moving = what.moving
    common = cache(partial(_common, what.parents))

    # those that groups are made of come first
    groups = compared_as_one(joints, what.paddings, what.convex, moving, common, blocks)
    grouped = {(k, s): None for members, (blocks, *_) in groups for block in blocks for k in members for s in block}
    others = [pair for pair in moving if pair not in grouped and pair[::-1] not in grouped]
    others = [(i, j) if common(joints[i], joints[j]) == joints[j] else (j, i) for i, j in others]

    sweeps: dict[tuple[Members, int], int] = {}
    whole: list[tuple[int, ...]] = []
    several: list[tuple[int, ...]] = []  # their solids, the frame, and their sweeps
    begin = 0
    for one, other in [*grouped, *sorted(others)]:  # what stands still, seen from there, is below
        base = common(joints[one], joints[other])
        own = [sweeps.setdefault(((k,), base), len(sweeps)) if joints[k] != base else -1 for k in (one, other)]
        counts = [counts_of[k] for k in (one, other)]
        end = begin
        if max(counts) > 1:
            end += counts[0] * counts[1]
            several.append((*(firsts[k + 1] - counts_of[k] for k in (one, other)), base, *own, one, other, *counts))
        numbers = [-1 if count > 1 else 0 for count in counts]
        whole.append((firsts[one], firsts[other], base, *own, begin, end, one, numbers[0], other, numbers[1]))
        begin = end

    of_groups, together, top = group_rows(groups, joints, firsts, sweeps, len(whole) + begin)
    top += range(len(grouped), len(whole))
    return _ListedPairs(whole, _parts_of(several), of_groups, sweeps, list(together), top)


def _parts_of(several: Sequence[tuple[int, ...]]) -> NDArray[np.int64]:
    """Rows of all parts of pairs: the first solid of each body, the frame, the sweeps, the bodies, how many parts."""
    pairs = np.array(several, dtype=np.int64).reshape(-1, 9)
    first, second, base, sweep, other_sweep, one, other, _, width = pairs.T
    counts = pairs[:, 7] * width
    owner = np.repeat(np.arange(len(pairs)), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    a, b = np.divmod(within, width[owner])
    none = np.zeros_like(within)
    solids = first[owner] + a, second[owner] + b
    seen = base[owner], sweep[owner], other_sweep[owner]
    return np.column_stack([*solids, *seen, none, none, one[owner], a, other[owner], b])


def _as_rows(pairs: Sequence[tuple[int, ...]]) -> NDArray[np.int64]:
    """Pairs and their sides, shape (n, PAIR_CHORD + 4)."""
    return np.array(pairs, dtype=np.int64).reshape(-1, layout.PAIR_CHORD + 4)


def _solid_arrays(
    bodies: Sequence[Body], placed: PlacedBodies, links: PlacedBodies, groups: Sequence[Members]
) -> tuple[NDArray[np.int32], Matrix]:
    """What is said of all solids, and their measures; those around several bodies come last."""
    records = [(bodies[members[0]].joint, 0, 0, WHOLE_BODY) for members in groups]
    solids = np.concatenate([placed.solids, np.array(records, dtype=np.int32).reshape(-1, layout.SOLID_SIZE)])
    clouds = np.flatnonzero(solids[:, layout.SOLID_KIND] == CLOUD)
    solids[clouds, layout.SOLID_KIND] += np.arange(len(clouds), dtype=np.int32)

    of_links = [members for members in groups if max(members) < len(links.parts)]
    of_others = [members for members in groups if max(members) >= len(links.parts)]
    around = dict(zip(of_links, links.around(of_links), strict=True))
    around |= zip(of_others, placed.around(of_others), strict=True)
    sizes = np.array([around[members] for members in groups]).reshape(-1, layout.SIZE_COUNT)
    return solids, np.concatenate([placed.sizes, sizes])


def _chords(
    rows: NDArray[np.int64], kinds: NDArray[np.int32], joints: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The chords that balls are compared by, shape (chords, CHORD_KEY_SIZE), and the numbers of each pair's, or -1."""
    solids = rows[:, [layout.PAIR_ONE, layout.PAIR_OTHER]]
    has_balls = ((kinds != HALF_SPACE) & (kinds != UNKNOWN))[solids].all(axis=1)
    compared = np.column_stack([has_balls, has_balls & (rows[:, layout.OTHER_SWEEP] >= 0)])
    seen = (solids * (joints + 1) + rows[:, [layout.PAIR_BASE]])[compared]
    keys, numbers = np.unique(seen, return_inverse=True)
    chords = np.full(solids.shape, -1)
    chords[compared] = numbers
    return np.column_stack(np.divmod(keys, joints + 1)), chords


def _carried(chain: Chain, frame: int, base: int) -> NDArray[np.bool_]:
    """Which joints move a frame as seen from another one that carries it, shape (joints,)."""
    moved = np.zeros(len(chain.parent), dtype=bool)
    while frame != base:
        moved[frame - 1] = True
        frame = int(chain.parent[frame - 1]) + 1
    return moved


def _in_lanes(rows: NDArray[Any]) -> NDArray[np.float64]:
    """Numbers of some rows, shape (n, k), in blocks of as many rows as there are lanes, shape (blocks, k, WIDTH)."""
    filled = np.zeros((len(rows) + -len(rows) % WIDTH, rows.shape[1]))
    filled[: len(rows)] = rows
    return filled.reshape(-1, WIDTH, rows.shape[1]).transpose(0, 2, 1)


def angle_lanes(joints: int) -> NDArray[np.float64]:
    """Room for values, sines and cosines of joints in lanes, shape (3, n)."""
    return np.zeros((3, joints + -joints % WIDTH))


def _runs(
    rows: NDArray[np.int64], chords: NDArray[np.int64], top: NDArray[np.int64], looked_up: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Find the runs: pairs that kernels compare in lanes.

    Args:
        rows: All pairs, shape (n, PAIR_CHORD or more).
        chords: The chord of the first solid of each, or -1, shape (n,).
        top: Numbers of the pairs to begin with.
        looked_up: Those of them that are no part of a run.

    Returns:
        For each pair how many there are in the run that it begins, 1 if it begins none, and the number of the block of
        the others in it, shapes (n,); for each block the numbers of its solids, shape (blocks, WIDTH).
    """
    count = len(rows)
    lengths = np.ones(count, dtype=np.int64)
    blocks = np.zeros(count, dtype=np.int64)
    compared = (chords >= 0) & (rows[:, layout.OTHER_SWEEP] < 0)
    compared[looked_up] = False

    # a run ends where another chord or another list of pairs begins
    listed = np.zeros(count + 1, dtype=np.int64)
    listed[rows[:, layout.PARTS_FIRST : layout.PARTS_END + 1].ravel()] = 1
    listed[top[np.diff(top, prepend=-2) != 1]] = 1
    listed[top[np.diff(top, append=-2) != 1] + 1] = 1
    keys = np.column_stack([chords, rows[:, layout.ONE_SWEEP], listed[:-1].cumsum(), ~compared])
    begins = np.diff(keys, axis=0, prepend=-2).any(axis=1)
    within = np.arange(count) - np.maximum.accumulate(np.where(begins, np.arange(count), 0))
    starts = np.flatnonzero(within % WIDTH == 0)
    own = np.diff(starts, append=count)
    worth = compared[starts] & (own >= SHORTEST_RUN)
    starts, own = starts[worth], own[worth]

    lengths[starts] = own
    places = np.minimum(np.arange(WIDTH), own[:, None] - 1)
    others = rows[starts[:, None] + places, layout.PAIR_OTHER]
    still, numbers = np.unique(others, axis=0, return_inverse=True)
    blocks[starts] = numbers.ravel()
    return lengths, blocks, still


def common_frame(chain: Chain, first: int, second: int) -> int:
    """The last frame that carries both of two frames."""
    return _common(chain.parent, first, second)


def _common(parents: Sequence[int] | NDArray[np.int64], first: int, second: int) -> int:
    """The last frame that carries both of two frames, by the parents of the joints."""
    while first != second:  # parents have smaller numbers
        first, second = min(first, second), int(parents[max(first, second) - 1]) + 1
    return first


def joint_rows(chain: Chain) -> Matrix:
    """The joints as the kernels read them, shape (joints, JOINT_SIZE)."""
    turns = chain.placement[:, :3, :3].reshape(-1, 9)
    return np.concatenate([turns, chain.placement[:, :3, 3], chain.axis], axis=1)


def cloud_bodies(bodies: Sequence[Body]) -> list[int]:
    """Numbers of the bodies that are clouds."""
    return [k for k, body in enumerate(bodies) if isinstance(body.geometry, CloudSolid)]


def cloud_poses(bodies: Sequence[Body]) -> Matrix:
    """Frames of the clouds as the kernels read them, shape (clouds, FRAME_SIZE)."""
    places = [bodies[k].placement for k in cloud_bodies(bodies)]
    return np.array([[*place.rotation.ravel(), *place.translation] for place in places]).reshape(-1, layout.FRAME_SIZE)
