"""Primitives as a flat table for the kernels: sorted by kind, with their bounding boxes, and boxes around neighbours.

The outer primitives of a scene (they contain its bodies) and the inner ones (the bodies contain them) have tables of
the same layout, so that one kernel serves both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.layout import (
    BLOCK,
    BOX_RUNS,
    BY_BALLS,
    CLOUD,
    END_PLANE,
    FIRST_PLANE,
    HEAD_INTS,
    HIGH_X,
    HIGH_Z,
    KIND,
    KINDS,
    LOW_X,
    PLANE_FLOATS,
    SHAPE_FLOATS,
    STANDING_BODY,
    PrimitiveTable,
)
from rrtik_ompl.kernels.tables.cloud_layout import CloudTable
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.kernels.tables.z_order import z_order

MANY = 64  # primitives, from which on those that are near each other are looked at as a block first
UNBOUNDED_COORDINATE = 1e30  # [m]

Detail: TypeAlias = Matrix | CloudTable | None
Grow: TypeAlias = float | Vector  # 1: a little larger, -1: smaller; a number or one for each


@dataclass(frozen=True, slots=True, eq=False)
class Primitives:
    """n solids of the layout's kinds.

    Attributes:
        bodies: Places of the bodies that they stand for, shape (n,).
        kinds: Shape (n,).
        numbers: Shape (n, SHAPE_FLOATS).
        lows, highs: Their bounds in the world, shape (n, 3) each.
        details: Of each its planes, shape (m, PLANE_FLOATS), or the table of its cloud; None if it has neither.
    """

    bodies: NDArray[np.int64]
    kinds: NDArray[np.int64]
    numbers: Matrix
    lows: Matrix
    highs: Matrix
    details: tuple[Detail, ...]

    def __len__(self) -> int:
        return len(self.kinds)

    def only(self, chosen: NDArray[np.int64] | Mask) -> Primitives:
        """Some of them, by their numbers or by a mask."""
        places = np.arange(len(self))[chosen]
        return Primitives(
            self.bodies[places],
            self.kinds[places],
            self.numbers[places],
            self.lows[places],
            self.highs[places],
            tuple(self.details[k] for k in places.tolist()),
        )


def joined(parts: Sequence[Primitives]) -> Primitives:
    """Primitives one after the other; those of a body stay in their order."""
    whole = np.zeros(0, dtype=np.int64)
    points = np.zeros((0, 3))
    return Primitives(
        np.concatenate([whole, *(part.bodies for part in parts)]),
        np.concatenate([whole, *(part.kinds for part in parts)]),
        np.concatenate([np.zeros((0, SHAPE_FLOATS)), *(part.numbers for part in parts)]),
        np.concatenate([points, *(part.lows for part in parts)]),
        np.concatenate([points, *(part.highs for part in parts)]),
        tuple(detail for part in parts for detail in part.details),
    )


def primitive_table(primitives: Primitives, checked: NDArray[np.int32] | Mask) -> PrimitiveTable:
    """Table of primitives; ``checked``: how each pair is, shape (moving bodies, standing bodies).

    The kind of balls comes first, so that the last primitive of a body is the one with its formula, if it has one.

    Raises:
        InputError: If a primitive is of a kind that the kernels do not know.
    """
    unknown = sorted(set(primitives.kinds.tolist()) - set(KINDS))
    if unknown:
        raise InputError(f"primitives for kernels: unknown kind {unknown[0]}; have {KINDS.start} to {KINDS.stop - 1}")
    order = _order(primitives)
    ordered = primitives.only(order)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    heads = np.zeros((len(ordered), HEAD_INTS), dtype=np.int32)
    planes = [detail for detail in ordered.details if isinstance(detail, np.ndarray)]
    clouds = [detail for detail in ordered.details if isinstance(detail, CloudTable)]
    ends = np.cumsum([0, *(len(each) if isinstance(each, np.ndarray) else 0 for each in ordered.details)])
    heads[:, KIND] = ordered.kinds
    heads[:, STANDING_BODY] = ordered.bodies
    heads[:, FIRST_PLANE] = ends[:-1]
    heads[:, END_PLANE] = ends[1:]
    heads[ordered.kinds == CLOUD, FIRST_PLANE] = np.arange(len(clouds))
    own = np.full(checked.shape[1], -1, dtype=np.int32)
    by_kind = np.argsort(primitives.kinds, kind="stable")  # whatever stands near, the same one of a body's balls
    own[primitives.bodies[by_kind]] = place[by_kind]  # the last one of a body remains
    boxes = _bounding_boxes(ordered.lows, ordered.highs)
    blocks = _blocks(ordered)

    return packed(
        PrimitiveTable,
        count=len(ordered),
        padded_count=boxes.shape[1],
        boxes=boxes,
        shapes=ordered.numbers.astype(np.float32),
        heads=heads,
        planes=np.concatenate([np.zeros((0, PLANE_FLOATS)), *planes]).astype(np.float32),
        standing_count=checked.shape[1],
        checked=checked.astype(np.int32),
        excluding=np.asarray((checked != BY_BALLS).any(axis=1), dtype=np.int32),
        own=own,
        clouds=clouds,
        block_count=blocks.shape[1],
        block_boxes=blocks,
    )


def _bounding_boxes(lows: Matrix, highs: Matrix) -> NDArray[np.float32]:
    """Sides of boxes, a run for each side, filled up with boxes that nothing meets."""
    padded = -(-len(lows) // BLOCK) * BLOCK
    boxes = np.empty((len(BOX_RUNS), padded), dtype=np.float32)
    low = boxes[LOW_X : HIGH_Z + 1 : 2]
    high = boxes[HIGH_X : HIGH_Z + 1 : 2]
    low[:] = UNBOUNDED_COORDINATE
    high[:] = -UNBOUNDED_COORDINATE
    low[:, : len(lows)] = below(lows.T)
    high[:, : len(highs)] = above(highs.T)

    return boxes


def below(numbers: Matrix) -> NDArray[np.float32]:
    """Numbers of half the precision that are smaller."""
    return np.nextafter(numbers.astype(np.float32), np.float32(-np.inf))


def above(numbers: Matrix) -> NDArray[np.float32]:
    """Numbers of half the precision that are larger."""
    return np.nextafter(numbers.astype(np.float32), np.float32(np.inf))


def _blocks(primitives: Primitives) -> NDArray[np.float32]:
    """Boxes around each BLOCK primitives; none where these are few."""
    if len(primitives) < MANY:
        return _bounding_boxes(primitives.lows[:0], primitives.highs[:0])
    firsts = np.arange(0, len(primitives), BLOCK)
    return _bounding_boxes(np.minimum.reduceat(primitives.lows, firsts), np.maximum.reduceat(primitives.highs, firsts))


def _order(primitives: Primitives) -> NDArray[np.int64]:
    """By kind, then by body, or where there are many so that neighbours come one after the other."""
    if len(primitives) < MANY:
        return np.lexsort((primitives.bodies, primitives.kinds))
    order = z_order(0.5 * primitives.lows + 0.5 * primitives.highs)
    return order[np.argsort(primitives.kinds[order], kind="stable")]
