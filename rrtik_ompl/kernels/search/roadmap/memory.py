"""Memory of roadmaps in kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.tree_layout import CAPACITY
from rrtik_ompl.kernels.search.tree_memory import grow
from rrtik_ompl.kernels.simd.halton import inverse_bases
from rrtik_ompl.kernels.tables.memory import Table, aligned, table, whole_lanes

_BY_VERTEX = {layout.HEADS: np.int32, layout.COSTS: np.float64, layout.AHEAD: np.float64, layout.CAME: np.int32}
_BY_HALF = {layout.TO: np.int32, layout.NEXT: np.int32, layout.HEAP: np.int32, layout.KEYS: np.float64}
_BY_EDGE = {layout.LENGTHS: np.float64, layout.STATES: np.int32}


def roadmap_table(
    motions: FastMotions, vertices: Table, box: tuple[Vector, Vector], near: int, halves: int, *, resolve: bool
) -> Table:
    """The table of an empty roadmap.

    Args:
        motions: How motions are checked.
        vertices: Memory for these, a tree.
        box: Lower and upper bounds, shapes (n,).
        near: With how many vertices a new one is joined.
        halves: How many halves of edges there is room for, an even number.
        resolve: Whether undecided motions are asked for.
    """
    dof, room = motions.dof, int(vertices.header[CAPACITY])
    fields: dict[int, int | NDArray[Any]] = dict.fromkeys(range(layout.FIELD_COUNT), 0)
    fields |= {layout.MOTIONS: motions.address, layout.VERTICES: vertices.address}
    fields |= {layout.RESOLVE: int(resolve), layout.NEAR: near}
    fields |= {layout.LOWER: box[0], layout.UPPER: box[1], layout.ROW_VALUES: np.zeros(motions.joints)}
    fields |= {layout.INVERSE_BASES: whole_lanes(np.array(inverse_bases(dof)))}
    fields |= {place: whole_lanes(np.zeros(dof)) for place in (layout.ROW, layout.POINT)}
    fields |= {layout.QUERY: np.zeros(dof, dtype=np.float32)}
    fields |= {layout.NEAR_VERTICES: np.zeros(near, dtype=np.int32)}
    fields |= {layout.NEAR_SQUARES: np.zeros(near, dtype=np.float32)}
    fields |= {layout.QUESTIONS: np.zeros(layout.MAX_QUESTIONS, dtype=np.int32)}
    made = table(fields | _arrays(room, halves))
    if motions.identity:
        made.header[layout.ROW_VALUES] = made.header[layout.ROW]
    return made


def make_room(roadmap: Table, vertices: Table, rows: int, halves: int) -> None:
    """Let there be room for so many vertices and halves; addresses of the tables stay."""
    while int(vertices.header[CAPACITY]) < rows:
        grow(vertices)
    for place, larger in _arrays(int(vertices.header[CAPACITY]), max(halves, len(roadmap[layout.TO]))).items():
        kept = roadmap[place]
        if len(larger) > len(kept):
            roadmap.arrays[place] = roomy = aligned(larger)
            roomy[: len(kept)] = kept
            roadmap.header[place] = roomy.ctypes.data


def _arrays(vertices: int, halves: int) -> dict[int, NDArray[Any]]:
    found: dict[int, NDArray[Any]] = {}
    for size, kinds in ((vertices, _BY_VERTEX), (halves, _BY_HALF), (halves // 2, _BY_EDGE)):
        found |= {place: np.zeros(size, dtype=kind) for place, kind in kinds.items()}
    return found
