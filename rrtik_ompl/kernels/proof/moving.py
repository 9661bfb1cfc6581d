"""Obstacles of a proof's table that are moved in place: no body is packed again."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.groups import BLOCK
from rrtik_ompl.kernels.proof.packing import ProofPairs, cloud_bodies, cloud_poses
from rrtik_ompl.kernels.proof.placed import NOTHING, corner_blocks, reaches_of, size_rows, solid_kind
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.cloud_layout import LEAF
from rrtik_ompl.kernels.tables.cloud_tables import cloud_table
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid, block_count, convex_solids, placed_bodies

NO_LIMIT = 1 << 62
_BALL = slice(layout.BALL_CENTRE, layout.BALL_CENTRE + 3)
_AXES = slice(layout.BOX_AXES, layout.BOX_AXES + 9)
_MIDDLE = slice(layout.BOX_MIDDLE, layout.BOX_MIDDLE + 3)
_HALF = slice(layout.BOX_HALF, layout.BOX_HALF + 3)
_DISC_AXIS = slice(layout.DISC_AXIS, layout.DISC_AXIS + 3)


class MovedObstacles:
    """The obstacles of a table, and where they were when it was packed.

    Args:
        packed: The table.
        bodies: Those that it was packed for.
    """

    def __init__(self, packed: ProofPairs, bodies: Sequence[Body]) -> None:
        self._packed = packed
        self._numbers = [k for k, body in enumerate(bodies) if body.kind == "obstacle"]
        self._back = [bodies[k].placement.inverse() for k in self._numbers]
        place = {k: number for number, k in enumerate(self._numbers)}
        below = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PAIR_OTHER]
        solids = dict(zip(below.tolist(), packed.sides[:, 2].tolist(), strict=True))  # what stands still is below
        owners = {solid: place[body] for solid, body in sorted(solids.items()) if body in place}
        self._solids, self._owners = (np.array(list(some), dtype=np.int64) for some in (owners, owners.values()))
        records = packed.table.solids.reshape(-1, layout.SOLID_SIZE)[self._solids]
        counts = records[:, layout.END_BLOCK] - records[:, layout.FIRST_BLOCK]
        spans = [np.arange(*ends) for ends in records[:, [layout.FIRST_BLOCK, layout.END_BLOCK]].tolist()]
        self._block_places = np.concatenate([np.zeros(0, dtype=np.int64), *spans])
        self._block_owners = np.repeat(self._owners, counts)
        self._half = records[:, layout.SOLID_KIND] == layout.HALF_SPACE
        self._sizes: Matrix = packed.table.sizes.reshape(-1, layout.SIZE_COUNT)[self._solids]
        self._blocks: NDArray[np.float64] = packed.table.corners.reshape(-1, 3, WIDTH)[self._block_places]
        sides = [(row, place[k]) for row, pair in enumerate(packed.bodies.tolist()) for k in pair if k in place]
        self._pairs: NDArray[np.int64] = np.array(sides, dtype=np.int64).reshape(-1, 2)
        obstacles = np.array([bodies[k].margin for k in self._numbers])
        # The margins of obstacles do not apply to bodies that are in contact with them.
        self._margins_apply = ~np.isin(self._pairs[:, 0], packed.touching)
        own_margins = obstacles[self._pairs[:, 1]] * self._margins_apply
        self._paddings = packed.margins[self._pairs[:, 0]] - own_margins  # of what moves

    def within(self, packed: ProofPairs) -> MovedObstacles:
        """Return the same obstacles in a copy of the table, wherever they are there."""
        other = copy(self)
        other._packed = packed
        return other

    def put(self, bodies: Sequence[Body], room: Sequence[float]) -> None:
        """Put the obstacles where they are now.

        Args:
            bodies: As at the beginning, obstacles with other placements and margins.
            room: For each body what is to be kept from it beside its margin [m]; read for obstacles.
        """
        packed = self._packed
        margins, rooms = np.array([(bodies[k].margin, room[k]) for k in self._numbers]).reshape(-1, 2).T
        own_margins = margins[self._pairs[:, 1]] * self._margins_apply
        packed.margins[self._pairs[:, 0]] = own_margins + rooms[self._pairs[:, 1]] + self._paddings
        packed.kept = (float("nan"), packed.kept[1])  # so that margins are written anew
        changes = [bodies[k].placement * back for k, back in zip(self._numbers, self._back, strict=True)]
        turns = np.array([change.rotation for change in changes]).reshape(-1, 3, 3)
        shifts = np.array([change.translation for change in changes]).reshape(-1, 3)
        turn = turns[self._owners]
        shift = shifts[self._owners]
        rows = self._sizes.copy()
        rows[:, _BALL] = _turned(turn, rows[:, _BALL]) + shift
        axes = rows[:, _AXES].reshape(-1, 3, 3) @ turn.transpose(0, 2, 1)
        rows[:, _AXES] = axes.reshape(-1, 9)
        rows[:, _MIDDLE] += _turned(axes, shift)
        rows[:, _DISC_AXIS] = _turned(turn, rows[:, _DISC_AXIS])
        rows[:, layout.DISC] += self._half * (rows[:, _DISC_AXIS] * shift).sum(axis=1)
        packed.table.sizes.reshape(-1, layout.SIZE_COUNT)[self._solids] = rows
        blocks = turns[self._block_owners] @ self._blocks + shifts[self._block_owners][:, :, None]
        packed.table.corners.reshape(-1, 3, WIDTH)[self._block_places] = blocks
        self._put_clouds(bodies)
        packed.spread_sizes()

    def _put_clouds(self, bodies: Sequence[Body]) -> None:
        """Put the clouds where they are now, and other points in their place where these have changed."""
        table = self._packed.table
        numbers = cloud_bodies(bodies)
        if not numbers:
            return
        table.cloud_poses[:] = cloud_poses(bodies).ravel()
        self._packed.clouds = [cloud_table(bodies[k].geometry.cloud) for k in numbers]
        table.clouds[:] = [cloud.address for cloud in self._packed.clouds]
        sizes = table.sizes.reshape(-1, layout.SIZE_COUNT)
        kinds = table.solids.reshape(-1, layout.SOLID_SIZE)[:, layout.SOLID_KIND]
        places = [bodies[k].placement.homogeneous for k in numbers]
        around = placed_bodies([convex_solids(bodies[k].geometry) for k in numbers], np.array(places))
        turns = np.array([place[:3, :3] for place in places])
        sizes[np.flatnonzero(kinds >= layout.CLOUD)] = size_rows([solids.around for solids in around], turns)


class MovedSolids:
    """Bodies of a table, put in place one after the other: elsewhere on their joint, or others of the same kind.

    No other body is packed again.

    Args:
        packed: The table.
    """

    def __init__(self, packed: ProofPairs) -> None:
        self._packed = packed
        table = packed.table
        self._records = table.solids.reshape(-1, layout.SOLID_SIZE)
        self._sizes = table.sizes.reshape(-1, layout.SIZE_COUNT)
        self._blocks = table.corners.reshape(-1, 3, WIDTH)
        self._left = len(packed.firsts) if packed.groups else NO_LIMIT  # moves until neighbours are better found anew
        self._groups: dict[int, list[int]] = {}
        for group, members in enumerate(packed.groups):
            for member in members:
                self._groups.setdefault(member, []).append(group)

    def put(self, number: int, body: Body) -> bool:
        """Put a body where it is now; whether it was done. If not, all has to be packed anew.

        Args:
            number: Of the body.
            body: The one that is there now.
        """
        pose = np.asarray(body.placement.homogeneous)[None]
        own = placed_bodies([convex_solids(body.geometry)], pose)[0].around or (NOTHING,)
        first = self._packed.firsts[number]
        end = self._packed.firsts[number + 1]
        parts = self._parts(number)
        kinds = [solid_kind(body, solid) for solid in own]
        known = np.minimum(self._records[parts, layout.SOLID_KIND], layout.CLOUD).tolist()
        if self._left == 0 or kinds != known:
            return False
        if body.joint > 0 and any(len(self._packed.groups[k]) > BLOCK for k in self._groups.get(number, ())):
            return False  # what is around them would not be what packing makes
        if layout.CLOUD in kinds:
            self._put_cloud(parts[0], body)
        firsts = self._records[parts, layout.FIRST_BLOCK]
        ends = self._records[parts, layout.END_BLOCK]
        if [block_count(solid.corners) for solid in own] != (ends - firsts).tolist():
            return False
        self._left -= 1
        whole = [own] if end - first > len(own) else []
        groups = [*whole, *((solid,) for solid in own)]
        self._sizes[first:end] = size_rows(groups, pose[:, :3, :3].repeat(len(groups), axis=0))
        blocks = slice(self._records[parts[0], layout.FIRST_BLOCK], self._records[parts[-1], layout.END_BLOCK])
        self._blocks[blocks] = corner_blocks([solid.corners for solid in own])
        for group in self._groups.get(number, ()):
            members = self._packed.groups[group]
            place = self._packed.firsts[-1] + group
            if len(members) > BLOCK:  # what is around what was there and what is new is around all
                self._sizes[place] = size_rows([[_box(self._sizes[place]), *own]], np.eye(3)[None])
            else:
                self._sizes[place] = self._around([k for member in members for k in self._parts(member)])
        around = [self._packed.firsts[-1] + group for group in self._groups.get(number, ())]
        self._packed.spread_sizes([*range(first, end), *around])
        if body.joint > 0:
            packed = self._packed
            packed.sweeps = packed.sweeps.with_body(number, reaches_of(packed.chain, [body], [own], packed.strokes)[0])
            packed.table.reaches[:] = packed.sweeps.lanes().ravel()
        return True

    def _put_cloud(self, solid: int, body: Body) -> None:
        """Put the points of a cloud in the place of others; its solid has room for all of a block's again."""
        table = self._packed.table
        record = self._records[solid]
        record[layout.END_BLOCK] = record[layout.FIRST_BLOCK] + LEAF // WIDTH
        place = int(record[layout.SOLID_KIND]) - layout.CLOUD
        clouds = list(self._packed.clouds)
        clouds[place] = cloud_table(body.geometry.cloud)
        self._packed.clouds = clouds
        table.clouds[place] = clouds[place].address
        table.cloud_poses.reshape(-1, layout.FRAME_SIZE)[place] = cloud_poses([body])[0]

    def _parts(self, number: int) -> range:
        """The solids of a body, without the one that stands for all of them."""
        first = self._packed.firsts[number]
        end = self._packed.firsts[number + 1]
        return range(first + (end - first > 1), end)

    def _around(self, solids: Sequence[int]) -> Vector:
        """The measures of several solids as one: a row as :func:`size_rows` makes it, with the axes of the frame.

        Nothing has to be turned, and coordinates lie one after the other: links may have thousands of corners.
        """
        records = self._records[solids]
        sizes = self._sizes[solids]
        spans = [np.arange(*ends) for ends in records[:, [layout.FIRST_BLOCK, layout.END_BLOCK]].tolist()]
        owners = np.repeat(np.arange(len(solids)), [len(span) for span in spans])
        x, y, z = self._blocks[np.concatenate(spans)].transpose(1, 0, 2).copy()
        rounds = sizes[:, layout.DISC] + sizes[:, layout.ROUND]
        axes = sizes[:, _DISC_AXIS]
        across = sizes[:, [layout.DISC]] * np.sqrt(np.maximum(0.0, 1.0 - axes**2)) + sizes[:, [layout.ROUND]]
        beside = across[owners].T[:, :, None]
        low = np.array([(along - wide).min() for along, wide in zip((x, y, z), beside, strict=True)])
        high = np.array([(along + wide).max() for along, wide in zip((x, y, z), beside, strict=True)])
        middle = 0.5 * (low + high)
        away = np.sqrt((x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2) + rounds[owners][:, None]

        row = np.zeros(layout.SIZE_COUNT)
        row[_BALL] = middle
        row[layout.BALL_RADIUS] = away.max()
        row[_AXES] = np.eye(3).ravel()
        row[_MIDDLE] = middle
        row[_HALF] = 0.5 * (high - low)
        row[layout.DISC :] = sizes[0, layout.DISC :]
        return row


def _box(sizes: Vector) -> ConvexSolid:
    """The box around several bodies, whose axes are those of the world."""
    ends = sizes[_MIDDLE] + np.array([[-1.0], [1.0]]) * sizes[_HALF]
    return ConvexSolid(np.array(list(product(*ends.T))))


def _turned(turns: NDArray[np.float64], a: Matrix) -> Matrix:
    return np.asarray((turns @ a[:, :, None])[:, :, 0])
