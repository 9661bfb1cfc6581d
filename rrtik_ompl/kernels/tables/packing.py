"""Bodies, pairs and covers as the tables that checks read: what depends on the arm alone, and what on the scene."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Vector, distinct
from rrtik_ompl.geometry.collision.bodies import Body, kept_apart, pair_array
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.kernels.layout import (
    BY_BALLS,
    CELLS_APART,
    IGNORED,
    LOOKED_UP,
    PAIR_INTS,
    PAIR_ONE,
    PAIR_OTHER,
    ArmTable,
    BallTable,
    BoundTable,
    PrimitiveTable,
    SolidTable,
)
from rrtik_ompl.kernels.tables.motion_bounds import bounds_table
from rrtik_ompl.kernels.tables.neighbour_tables import Cells
from rrtik_ompl.kernels.tables.primitive_tables import Primitives, joined, primitive_table
from rrtik_ompl.kernels.tables.robot_tables import (
    MovingBody,
    Spheres,
    arm_table,
    axis_turns,
    ball_table,
    moving_body,
    rounding_margin,
    usable_cover,
)
from rrtik_ompl.kernels.tables.scene_tables import inner_primitives, outer_primitives
from rrtik_ompl.kernels.tables.solid_tables import Solids, placed_bodies, solid_table
from rrtik_ompl.model.robot import Chain

MOST_LOOKED_UP = 62  # kernels hold a set of them as the bits of a signed 64-bit number


@dataclass(frozen=True, slots=True, eq=False)
class ArmTables:
    """All that depends on the moving bodies alone."""

    bodies: tuple[Body, ...]
    sizes: tuple[int, ...]
    covers: tuple[Spheres, ...]
    solids_of: tuple[Solids, ...]
    pairs: tuple[tuple[int, int], ...]
    looked_up: tuple[tuple[int, int], ...]
    strokes: Vector
    margin: float
    arm: ArmTable
    balls: tuple[BallTable, BallTable]
    bounds: BoundTable
    solids: SolidTable
    wider_solids: SolidTable

    def serves(
        self,
        bodies: Sequence[Body],
        sizes: Sequence[int],
        covers: Sequence[Spheres],
        solids_of: Sequence[Solids],
        pairs: Sequence[tuple[int, int]],
        looked_up: Sequence[tuple[int, int]],
        strokes: Vector,
    ) -> bool:
        """Whether the tables of these bodies would be the same."""
        return (
            len(bodies) == len(self.bodies)
            and tuple(sizes) == self.sizes
            and tuple(solids_of) == self.solids_of
            and tuple(pairs) == self.pairs
            and tuple(looked_up) == self.looked_up
            and np.array_equal(strokes, self.strokes)
            and all(_same(a, b) for a, b in zip(bodies, self.bodies, strict=True))
            and all(a is b or np.array_equal(a, b) for a, b in zip(covers, self.covers, strict=True))
        )


def partners(bodies: Sequence[Body], pairs: Sequence[tuple[int, int]]) -> dict[int, Mask]:
    """For each moving body that a pair names the bodies that it must not touch, shape (bodies,)."""
    listed = pair_array(pairs)
    named = [k for k in distinct(listed).tolist() if bodies[k].joint > 0]
    row = np.full(len(bodies), -1)
    row[named] = np.arange(len(named))
    found = np.zeros((len(named), len(bodies)), dtype=bool)

    for first, second in (listed.T, listed.T[::-1]):
        moves = row[first] >= 0
        found[row[first[moves]], second[moves]] = True

    return dict(zip(named, found, strict=True))


def alike(bodies: Sequence[Body], keeps_clear: Mapping[int, Mask]) -> list[tuple[int, ...]]:
    """Numbers of the moving bodies in sets that one joint carries and that have the same bodies to keep clear of.

    To the kernels a set is one body: a link of many small solids costs no more than one with a cover of as many balls.
    """
    sets: dict[tuple[int, bytes], list[int]] = {}
    for k, others in keeps_clear.items():
        sets.setdefault((bodies[k].joint, others.tobytes()), []).append(k)
    return [tuple(members) for members in sets.values()]


def arm_tables(
    chain: Chain,
    bodies: Sequence[Body],
    moving: Sequence[tuple[int, ...]],
    pairs: Sequence[tuple[int, int]],
    outer: Sequence[Spheres],
    inner: Sequence[Spheres],
    solids: Sequence[Solids],
    limits: Vector,
    *,
    looked_up: Collection[tuple[int, int]] = (),
    like: Iterable[ArmTables] = (),
) -> ArmTables:
    """Tables of the moving bodies (see :func:`alike`); those among ``like`` that are the same, if there are any.

    Balls do not look at the pairs ``looked_up``, of the first bodies of sets.
    """
    place = {body: k for k, members in enumerate(moving) for body in members}
    listed = pair_array(pairs)
    both = np.sort(listed[np.isin(listed, list(place)).all(axis=1)], axis=1).tolist()
    own = tuple(dict.fromkeys((place[i], place[j]) for i, j in both))
    by_cells = tuple(pair for pair in own if tuple(sorted(moving[k][0] for k in pair)) in looked_up)
    carried = tuple(bodies[k] for members in moving for k in members)
    sizes = tuple(map(len, moving))
    covers = tuple(np.asarray(s[k], dtype=np.float64) for members in moving for k in members for s in (outer, inner))
    solids_of = tuple(solids[k] for members in moving for k in members)
    for known in like:
        if known.serves(carried, sizes, covers, solids_of, own, by_cells, limits):
            return known

    reaches = [(bodies[k].joint, _reach(bodies[k], outer[k])) for members in moving for k in members]
    margin = rounding_margin(chain, reaches, limits)
    packed = [
        as_one([moving_body(chain, bodies[k], outer[k], inner[k], margin) for k in members]) for members in moving
    ]
    kept = max((body.margin for body in carried), default=0.0)  # one for all of them
    balls = (
        ball_table(packed, own, inner=False, kept=kept, looked_up=by_cells),
        ball_table(packed, own, inner=True, kept=kept),
    )
    bounds = bounds_table(chain, balls[0], limits, margin)
    turns = axis_turns(chain)
    poses = np.zeros((len(carried), 4, 4))

    for pose, body in zip(poses, carried, strict=True):  # in the turned frames of their joints
        pose[:] = body.placement.homogeneous
        pose[:3] = turns[body.joint - 1].T @ pose[:3]

    frames = [bodies[members[0]].joint for members in moving]
    thick = body_arrays(carried).paddings
    single = _solids(solids_of, poses, frames, sizes, kept=thick, slack=margin)
    wider = single if kept == 0.0 else _solids(solids_of, poses, frames, sizes, kept=thick + kept, slack=margin)
    joints = arm_table(chain)

    kinds = carried, sizes, covers, solids_of, own, by_cells, limits, margin
    return ArmTables(*kinds, joints, balls, bounds, single, wider)


def _solids(
    bodies: Sequence[Solids],
    poses: NDArray[np.float64],
    frames: Sequence[int],
    sizes: Sequence[int],
    *,
    kept: Vector,
    slack: float,
) -> SolidTable:
    """Table of the solids of bodies that joints carry, ``sizes`` bodies in each frame, each grown by ``kept`` [m]."""
    parts = iter(placed_bodies(bodies, poses, margins=kept, slack=slack))
    return solid_table([(frame, [next(parts) for _ in range(size)]) for frame, size in zip(frames, sizes, strict=True)])


def as_one(parts: Sequence[MovingBody]) -> MovingBody:
    """Bodies that one joint carries as a single one."""
    outer = np.concatenate([p.outer for p in parts])
    inner = np.concatenate([p.inner for p in parts])
    return MovingBody(parts[0].frame, outer, inner)


def checked_table(
    moving: Sequence[tuple[int, ...]],
    standing: Sequence[int],
    keeps_clear: Mapping[int, Mask],
    looked_up: Collection[tuple[int, int]],
) -> NDArray[np.int32]:
    """How pairs of moving and standing bodies are checked, IGNORED where they may touch, shape (moving, standing)."""
    rows = [keeps_clear[members[0]][standing] for members in moving]
    table = np.where(np.array(rows, dtype=bool).reshape(len(moving), len(standing)), BY_BALLS, IGNORED)
    for pair in looked_up:
        places = [standing.index(k) for k in pair if k in standing]
        for place in places:
            table[[members[0] in pair for members in moving], place] = LOOKED_UP
    return table.astype(np.int32)


def standing_tables(
    bodies: Sequence[Body],
    standing: Sequence[int],
    checked: NDArray[np.int32],
    outer: Sequence[Spheres],
    inner: Sequence[Spheres],
) -> tuple[PrimitiveTable, PrimitiveTable]:
    """Primitives that contain what stands still, and primitives inside it."""
    still = [bodies[k] for k in standing]
    around, inside = ([each[k] for k in standing] for each in (outer, inner))
    made = outer_primitives(still, around), inner_primitives(still, inside)
    return primitive_table(made[0], checked), primitive_table(made[1], checked != IGNORED)


class PlacedPrimitives:
    """Primitives around standing bodies; those of a body that has not changed are kept."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Body, float]] = {}
        self._made = joined([])

    def primitives(
        self, bodies: Sequence[Body], standing: Sequence[int], outer: Sequence[Spheres], inflation: Sequence[float]
    ) -> Primitives:
        """Primitives around all within margin and ``inflation`` [m] of bodies, with their places in ``standing``."""
        now = [(bodies[k], inflation[k]) for k in standing]
        places = [place for place, state in enumerate(now) if self._known.get(place) != state]
        if places:
            moved = [standing[place] for place in places]
            covers = [outer[k] for k in moved]
            grown = [inflation[k] for k in moved]
            made = outer_primitives([bodies[k] for k in moved], covers, grown)
            made = replace(made, bodies=np.array(places)[made.bodies])
            if len(places) < len(now):
                made = joined([self._made.only(~np.isin(self._made.bodies, places)), made])
            self._made = made
            self._known.update((place, now[place]) for place in places)

        return self._made


def standing_solids(bodies: Sequence[Body], standing: Sequence[int], solids: Sequence[Solids]) -> SolidTable:
    """Solids of what stands still, each with its margin around it."""
    poses = body_arrays(bodies).placements[standing]
    kept = [bodies[k].margin + bodies[k].padding for k in standing]
    placed = placed_bodies([solids[k] for k in standing], poses, margins=kept)
    return solid_table([(0, [each]) for each in placed])


def looked_up(
    bodies: Sequence[Body],
    moving: Sequence[tuple[int, ...]],
    pairs: Sequence[tuple[int, int]],
    cells: Mapping[tuple[int, int], Cells],
) -> dict[tuple[int, int], Cells]:
    """The sets of bodies, each by its first one, whose cells tell enough.

    All of their pairs have the same cells, and no more to keep than ``CELLS_APART``. Those beyond ``MOST_LOOKED_UP``
    are compared like all others.
    """
    if not cells:
        return {}
    checked = {(min(pair), max(pair)) for pair in pairs}
    sets = {k: members for members in moving for k in members}
    found = {}
    for pair, own in cells.items():
        units = sorted(sets.get(k, (k,)) for k in pair)
        each = [(min(i, j), max(i, j)) for i, j in product(*units)]
        same = all(pair in checked and cells.get(pair) is own for pair in each)
        if same and all(kept_apart(bodies[i], bodies[j]) <= CELLS_APART for i, j in each):
            found[units[0][0], units[1][0]] = own
    return dict(islice(found.items(), MOST_LOOKED_UP))


class Flags:
    """For each flag that the kernels can set the pairs that it stands for.

    Args:
        keeps_clear: See :func:`partners`.
        arm: What moves.
        moving: Sets of bodies that move, standing: bodies that do not.
    """

    def __init__(
        self,
        keeps_clear: Mapping[int, Mask],
        arm: ArmTables,
        moving: Sequence[tuple[int, ...]],
        standing: Sequence[int],
    ) -> None:
        self._keeps_clear = keeps_clear
        self._moving = moving
        self._standing = standing
        self._own = arm.balls[0].pairs.reshape(-1, PAIR_INTS)

    def number(self, pair: tuple[int, int]) -> int:
        """The flag of two bodies, each the first of its set or standing still."""
        place = {members[0]: k for k, members in enumerate(self._moving)}
        rows = [place[k] for k in pair if k in place]
        if len(rows) == 1:
            return rows[0] * len(self._standing) + next(self._standing.index(k) for k in pair if k not in place)
        listed = np.sort(self._own[:, [PAIR_ONE, PAIR_OTHER]], axis=1).tolist()
        among: int = listed.index(sorted(rows))
        return len(self._moving) * len(self._standing) + among

    def __getitem__(self, flag: int) -> list[tuple[int, int]]:
        """Pairs of bodies by number, the smaller one first; those of the arm come after the others."""
        crossing = len(self._moving) * len(self._standing)
        if flag < crossing:
            members, place = divmod(flag, len(self._standing))
            first = self._moving[members]
            second = (self._standing[place],)
        else:
            pair = self._own[flag - crossing]
            first = self._moving[pair[PAIR_ONE]]
            second = self._moving[pair[PAIR_OTHER]]

        return [(min(i, j), max(i, j)) for i in first for j in second if self._keeps_clear[i][j]]


def _reach(body: Body, outer: Spheres) -> float:
    """Distance of the farthest point of a body's outer spheres from its joint's frame [m]."""
    spheres = usable_cover(body.geometry, outer)
    centres = spheres[:, :3] @ np.array(body.placement.rotation).T + np.array(body.placement.translation)
    return float((np.linalg.norm(centres, axis=1) + spheres[:, 3]).max()) + body.padding


def _same(first: Body, second: Body) -> bool:
    """Whether two bodies are the same solid on the same joint, placed alike, with the same margin and padding."""
    return first is second or (
        first.joint == second.joint
        and (first.margin, first.padding) == (second.margin, second.padding)
        and first.geometry is second.geometry
        and np.array_equal(first.placement.homogeneous, second.placement.homogeneous)
    )
