"""Memory of roadmaps in kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.roadmap import layout
from rrtik_ompl.kernels.search.roadmap.layout import RoadmapTable
from rrtik_ompl.kernels.search.tree_layout import TreeTable
from rrtik_ompl.kernels.search.tree_memory import grow
from rrtik_ompl.kernels.simd.halton import inverse_bases
from rrtik_ompl.kernels.tables.memory import aligned, packed, whole_lanes

_BY_VERTEX = {"heads": np.int32, "costs": np.float64, "ahead": np.float64, "came": np.int32}
_BY_HALF = {"to": np.int32, "next": np.int32, "heap": np.int32, "keys": np.float64}
_BY_EDGE = {"lengths": np.float64, "states": np.int32}


def roadmap_table(
    motions: FastMotions, vertices: TreeTable, box: tuple[Vector, Vector], near: int, halves: int, *, resolve: bool
) -> RoadmapTable:
    """The table of an empty roadmap.

    Args:
        motions: How motions are checked.
        vertices: Memory for these, a tree.
        box: Lower and upper bounds, shapes (n,).
        near: With how many vertices a new one is joined.
        halves: How many halves of edges there is room for, an even number.
        resolve: Whether undecided motions are asked for.
    """
    dof = motions.dof
    made = packed(
        RoadmapTable,
        motions=motions.table,
        vertices=vertices,
        lower=box[0],
        upper=box[1],
        inverse_bases=whole_lanes(np.array(inverse_bases(dof))),
        resolve=int(resolve),
        row=whole_lanes(np.zeros(dof)),
        row_values=np.zeros(motions.joints),
        query=np.zeros(dof, dtype=np.float32),
        point=whole_lanes(np.zeros(dof)),
        near=near,
        near_vertices=np.zeros(near, dtype=np.int32),
        near_squares=np.zeros(near, dtype=np.float32),
        questions=np.zeros(layout.MAX_QUESTIONS, dtype=np.int32),
        **_arrays(vertices.capacity, halves),
    )
    if motions.identity:
        made.put(row_values=made.row)
    return made


def make_room(roadmap: RoadmapTable, rows: int, halves: int) -> None:
    """Let there be room for so many vertices and halves; addresses of the tables stay."""
    while roadmap.vertices.capacity < rows:
        grow(roadmap.vertices)
    for name, larger in _arrays(roadmap.vertices.capacity, max(halves, len(roadmap.to))).items():
        kept = getattr(roadmap, name)
        if len(larger) > len(kept):
            roomy = aligned(larger)
            roomy[: len(kept)] = kept
            roadmap.put(**{name: roomy})


def _arrays(vertices: int, halves: int) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    for size, kinds in ((vertices, _BY_VERTEX), (halves, _BY_HALF), (halves // 2, _BY_EDGE)):
        found |= {name: np.zeros(size, dtype=kind) for name, kind in kinds.items()}
    return found
