"""Primitives as a flat table for the kernels: sorted by kind, with their bounding boxes.

The outer primitives of a scene (they contain its bodies) and the inner ones (the bodies contain them) have tables of
the same layout, so that one kernel serves both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast.tables.layout import (
    BOX_RUNS,
    BOXES,
    CHECKED,
    END_PLANE,
    EXCLUDING,
    FIRST_PLANE,
    HEAD_INTS,
    HIGH_X,
    HIGH_Z,
    KIND,
    KINDS,
    LOW_X,
    NUMBERS,
    OWN,
    PADDED_COUNT,
    PLANE_FLOATS,
    PLANES,
    PRIMITIVE_COUNT,
    PRIMITIVES,
    SHAPE_FLOATS,
    STANDING_BODY,
    STANDING_COUNT,
)
from rrtik_ompl.fast.tables.memory import Table, table, whole_records

LANE_PADDING = 16  # boxes are compared this many at a time, or half as many
UNBOUNDED_COORDINATE = 1e30  # [m]


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """One solid of a kind of the layout. ``low`` and ``high`` bound it in the world, shape (3,)."""

    kind: int
    numbers: Vector
    low: Vector
    high: Vector
    planes: Matrix | None = None


def primitive_table(primitives: Sequence[tuple[int, Primitive]], checked: NDArray[np.bool_]) -> Table:
    """Rows with the numbers of their standing bodies; ``checked`` has shape (moving bodies, standing bodies).

    The kind of balls comes first, so that the last primitive of a body is the one with its formula, if it has one.

    Raises:
        InputError: If a primitive is of a kind that the kernels do not know.
    """
    unknown = sorted({primitive.kind for _, primitive in primitives} - set(KINDS))
    if unknown:
        raise InputError(f"primitives for kernels: unknown kind {unknown[0]}; have {KINDS.start} to {KINDS.stop - 1}")
    ordered = sorted(primitives, key=lambda item: item[1].kind)
    floats = np.zeros((len(ordered), SHAPE_FLOATS), dtype=np.float32)
    heads = []
    own = np.full(checked.shape[1], -1, dtype=np.int32)
    planes: list[Matrix] = [np.zeros((0, PLANE_FLOATS))]
    end = 0
    for k, (body, primitive) in enumerate(ordered):
        floats[k] = primitive.numbers
        first, end = end, end + (0 if primitive.planes is None else len(primitive.planes))
        own[body] = k
        heads.append({KIND: primitive.kind, STANDING_BODY: body, FIRST_PLANE: first, END_PLANE: end})
        planes += [] if primitive.planes is None else [primitive.planes]
    boxes = _bounding_boxes([primitive for _, primitive in ordered])
    return table(
        {
            PRIMITIVE_COUNT: len(ordered),
            PADDED_COUNT: boxes.shape[1],
            BOXES: boxes,
            PRIMITIVES: floats,
            NUMBERS: whole_records(HEAD_INTS, heads),
            PLANES: np.concatenate(planes).astype(np.float32),
            STANDING_COUNT: checked.shape[1],
            CHECKED: checked.astype(np.int32),
            EXCLUDING: np.asarray((~checked).any(axis=1), dtype=np.int32),
            OWN: own,
        }
    )


def _bounding_boxes(primitives: Sequence[Primitive]) -> NDArray[np.float32]:
    """Sides of boxes around primitives, a run for each side, filled up with boxes that nothing meets."""
    padded = -(-len(primitives) // LANE_PADDING) * LANE_PADDING
    boxes = np.empty((len(BOX_RUNS), padded), dtype=np.float32)
    low, high = boxes[LOW_X : HIGH_Z + 1 : 2], boxes[HIGH_X : HIGH_Z + 1 : 2]
    low[:], high[:] = UNBOUNDED_COORDINATE, -UNBOUNDED_COORDINATE
    if primitives:
        lows, highs = (
            np.array(ends, dtype=np.float32).T for ends in zip(*((p.low, p.high) for p in primitives), strict=True)
        )
        low[:, : len(primitives)] = np.nextafter(lows, np.float32(-np.inf))
        high[:, : len(primitives)] = np.nextafter(highs, np.float32(np.inf))
    return boxes
