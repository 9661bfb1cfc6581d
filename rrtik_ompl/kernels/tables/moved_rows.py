"""The rows of one standing body in the tables of a scene, written anew in place where it is elsewhere or another one.

The rows are those that packing all bodies would make; only their order, and with it the boxes around neighbours, stay
as they were. After as many moves as there are rows the tables are better made anew, for neighbours are none any more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.shape_table import Core, core_of
from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.layout import PrimitiveTable, SolidTable
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.cloud_layout import CloudTable
from rrtik_ompl.kernels.tables.moved_boxes import BoxNumbers, box_numbers
from rrtik_ompl.kernels.tables.primitive_tables import MANY, Primitives, above, below
from rrtik_ompl.kernels.tables.robot_tables import Spheres
from rrtik_ompl.kernels.tables.scene_tables import (
    MAKERS,
    ROUNDED,
    fits,
    inner_primitives,
    outer_primitives,
    primitive_kind,
)
from rrtik_ompl.kernels.tables.solid_tables import (
    UNKNOWN,
    ConvexSolid,
    Solids,
    block_count,
    corner_blocks,
    placed_bodies,
    solid_sizes,
)

NO_LIMIT = 1 << 62
_OUTWARD_AND_INWARD = np.array([1.0, -1.0])
_TWO = np.arange(2)


class MovedRows:
    """The rows of standing bodies in the tables of a world.

    Args:
        outer, inner: Tables of primitives.
        solids: Of what stands still.
    """

    def __init__(self, outer: PrimitiveTable, inner: PrimitiveTable, solids: SolidTable) -> None:
        self._primitives = (_PrimitiveRows(outer), _PrimitiveRows(inner))
        self._solids = _SolidRows(solids)
        bodies = len(solids.spans) // layout.SPAN_INTS
        self._left = bodies if bodies >= MANY else NO_LIMIT  # moves until all is better made anew

    def put(self, place: int, body: Body, spheres: tuple[Spheres, Spheres], solids: Solids) -> bool:
        """Put a body where it is now.

        Args:
            place: Its number among the standing ones.
            body: The body that is there now: the one of before, or another one that has no spheres.
            spheres: Around and inside it, in its own frame.
            solids: Likewise.

        Returns:
            Whether it was done; if not, nothing has changed and all has to be packed anew.
        """
        core = core_of(body.geometry)
        if core is not None and core.half_sides is not None and self._left and self._put_box(place, body, core):
            self._left -= 1
            return True

        made = _primitives(body, spheres)
        (placed,) = placed_bodies([solids], _pose(body), margins=np.array([body.margin + body.padding]))
        around = placed.around or (UNKNOWN,)
        parts = around if placed.inside == around else around + placed.inside
        rows = [own.slots(place, new) for own, new in zip(self._primitives, made, strict=True)]
        span = self._solids.span(place, parts)
        if self._left == 0 or span is None or rows[0] is None or rows[1] is None:
            return False

        self._left -= 1
        for own, slots, new in zip(self._primitives, rows, made, strict=True):
            if slots is not None and len(new):
                own.write(slots, new)

        self._solids.write(*span, parts)
        return True

    def _put_box(self, place: int, body: Body, core: Core) -> bool:
        """Put a box where it is now; whether it was done."""
        box = box_numbers(core, body.placement, body.margin + body.padding)
        slots = [own.only_slot(place, layout.BOX) for own in self._primitives]
        solid = self._solids.only_solid(place, core)
        if box is None or solid is None or slots[0] is None or slots[1] is None:
            return False
        for own, slot, numbers, bounds in zip(self._primitives, slots, (box.outer, box.inner), box.bounds, strict=True):
            own.write_one(int(slot or 0), numbers, bounds)
        self._solids.write_one(solid, box)
        return True


class _PrimitiveRows:
    """Rows of a table of primitives by their bodies."""

    def __init__(self, table: PrimitiveTable) -> None:
        self._table = table
        self._heads = table.heads.reshape(-1, layout.HEAD_INTS)
        owners = self._heads[:, layout.STANDING_BODY]
        self._by_body = np.argsort(owners, kind="stable")
        self._firsts = np.searchsorted(owners[self._by_body], np.arange(table.standing_count + 1))
        self._kinds = self._heads[:, layout.KIND].copy()
        self._numbers = table.shapes.reshape(-1, layout.SHAPE_FLOATS)
        self._own = table.own
        self._planes = table.planes.reshape(-1, layout.PLANE_FLOATS)
        self._boxes = table.boxes.reshape(3, 2, -1)
        self._blocks = table.block_boxes.reshape(3, 2, -1)

    def slots(self, place: int, made: Primitives) -> NDArray[np.int64] | None:
        """Where the primitives of a body stand, None unless there are as many of the same kinds."""
        slots = self._by_body[self._firsts[place] : self._firsts[place + 1]]
        if len(slots) != len(made) or (self._kinds[slots] != np.sort(made.kinds)).any():
            return None
        return slots

    def only_slot(self, place: int, kind: int) -> int | None:
        """Where the one primitive of a body stands; None if there are others, or if it is of another kind."""
        first, end = self._firsts[place : place + 2].tolist()
        slot = int(self._by_body[first]) if end == first + 1 else -1
        return slot if slot >= 0 and self._kinds[slot] == kind else None

    def write_one(self, slot: int, numbers: list[float], bounds: NDArray[np.float32]) -> None:
        """Write a primitive, and the box around its neighbours."""
        self._numbers[slot] = numbers
        self._boxes[:, :, slot] = bounds
        if self._blocks.size:
            self._bound(slot // layout.BLOCK)

    def write(self, slots: NDArray[np.int64], made: Primitives) -> None:
        """Write primitives, and the boxes around the neighbours of each."""
        made = made if len(made) == 1 else made.only(np.argsort(made.kinds, kind="stable"))
        self._numbers[slots] = made.numbers
        self._own[self._heads[slots[0], layout.STANDING_BODY]] = slots[-1]
        self._boxes[:, 0, slots] = below(made.lows.T)
        self._boxes[:, 1, slots] = above(made.highs.T)

        for slot, detail in zip(slots, made.details, strict=True):
            if isinstance(detail, np.ndarray):
                self._planes[slice(*self._heads[slot, layout.FIRST_PLANE : layout.END_PLANE + 1])] = detail
            elif detail is not None:
                self._exchange_cloud(int(self._heads[slot, layout.FIRST_PLANE]), detail)

        if self._blocks.size:
            for block in set((slots // layout.BLOCK).tolist()):
                self._bound(block)

    def _exchange_cloud(self, number: int, cloud: CloudTable) -> None:
        """Let the table have another cloud in the place of one."""
        place = PrimitiveTable.places["clouds"]
        clouds = list(self._table.clouds)
        clouds[number] = cloud
        self._table.tables[place] = tuple(clouds)
        self._table.memory[place][number] = cloud.address

    def _bound(self, block: int) -> None:
        """Write the box around some neighbours."""
        near = self._boxes[:, :, layout.BLOCK * block : layout.BLOCK * (block + 1)]
        self._blocks[:, 0, block] = near[:, 0].min(axis=1)
        self._blocks[:, 1, block] = near[:, 1].max(axis=1)


class _SolidRows:
    """Rows of a table of solids by their bodies."""

    def __init__(self, table: SolidTable) -> None:
        self._spans = table.spans.reshape(-1, layout.SPAN_INTS)
        self._solids = table.solids.reshape(-1, layout.SOLID_INTS)
        self._sizes = table.sizes.reshape(-1, layout.SIZE_COUNT)
        self._corners = table.corners.reshape(-1, 3, WIDTH)

    def span(self, place: int, parts: Sequence[ConvexSolid]) -> tuple[int, int] | None:
        """The first of a body's solids and the end of them; None if their number, kinds or blocks of corners differ."""
        first = int(self._spans[place, layout.AROUND_FIRST])
        end = int(self._spans[place, layout.INSIDE_END])
        solids = self._solids[first:end]
        kinds = solids[:, layout.SOLID_KIND].tolist()
        blocks = (solids[:, layout.END_BLOCK] - solids[:, layout.FIRST_BLOCK]).tolist()
        fits = kinds == [part.kind for part in parts] and blocks == [block_count(part.corners) for part in parts]

        return (first, end) if fits else None

    def only_solid(self, place: int, core: Core) -> int | None:
        """The one solid of a body; None if there are others, or if it is none of a core with one block of corners."""
        span = self._spans[place].tolist()
        first = span[layout.AROUND_FIRST]
        record = self._solids[first].tolist()
        alone = span[layout.INSIDE_END] == first + 1 and record[layout.SOLID_KIND] == layout.CONVEX_SOLID
        fits = record[layout.END_BLOCK] == record[layout.FIRST_BLOCK] + 1 and len(core.corners) <= WIDTH

        return first if alone and fits else None

    def write_one(self, number: int, box: BoxNumbers) -> None:
        """Write a solid of one block of corners."""
        block = self._corners[self._solids[number, layout.FIRST_BLOCK]]
        self._sizes[number] = box.sizes
        block.T[:] = [*box.corners, *box.corners[:1] * (WIDTH - len(box.corners))]

    def write(self, first: int, end: int, parts: Sequence[ConvexSolid]) -> None:
        """Write the solids of a body."""
        if first == end:
            return
        blocks = slice(int(self._solids[first, layout.FIRST_BLOCK]), int(self._solids[end - 1, layout.END_BLOCK]))
        self._sizes[first:end] = solid_sizes(parts)
        self._corners[blocks] = corner_blocks(parts)


def _primitives(body: Body, spheres: tuple[Spheres, Spheres]) -> tuple[Primitives, Primitives]:
    """Primitives that contain a body, and primitives inside it."""
    kind = primitive_kind(body.geometry)
    core = core_of(body.geometry)
    if kind in MAKERS and core is not None:  # both by one call of its formula
        kept = body.margin + body.padding
        beside = np.array([kept, kept if kind in ROUNDED else 0.0])
        pose = _pose(body)
        both = MAKERS[kind](_TWO, pose.repeat(2, axis=0), (core, core), _OUTWARD_AND_INWARD, beside)
        if len(both) == 2 and fits(both).all():
            return both.only(_TWO[:1]), both.only(_TWO[1:])

    return outer_primitives([body], spheres[:1]), inner_primitives([body], spheres[1:])


def _pose(body: Body) -> NDArray[np.float64]:
    return np.asarray(body.placement.homogeneous)[None]
