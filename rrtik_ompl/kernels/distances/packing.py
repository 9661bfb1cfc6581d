"""What the kernels of distances read, made from the bodies of a world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, allocated
from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.distances import layout
from rrtik_ompl.kernels.distances.layout import DistanceTable
from rrtik_ompl.kernels.distances.trees import tree_of
from rrtik_ompl.kernels.proof.layout import FRAME_SIZE
from rrtik_ompl.kernels.proof.packing import angle_lanes, joint_rows
from rrtik_ompl.kernels.proof.placed import KINDS, block_count, corner_blocks, size_rows
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid
from rrtik_ompl.model.robot import Chain

KERNELS = "distances.kernels"

ROWS_AT_ONCE = 64  # configurations per kernel call, some hundredths of a second


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Distances of pairs of objects, one row for each configuration.

    Attributes:
        values: Signed distances [m], shape (m, p).
        points: Nearest points in the world [m], NaN where none are measured, shape (m, p, 2, 3).
        gradients: Derivatives of the distances by the coordinates, shape (m, p, dof).
        told: What is told of each, see :mod:`rrtik_ompl.kernels.distances.layout`, shape (m, p).
    """

    values: Matrix
    points: NDArray[np.float64]
    gradients: NDArray[np.float64]
    told: NDArray[np.int32]

    @classmethod
    def unknown(cls, rows: int, columns: int, dof: int) -> Measured:
        """Room for distances of which nothing is known yet."""
        shape = rows, columns
        told = np.full(shape, layout.UNKNOWN, dtype=np.int32)
        return cls(allocated(shape), allocated((*shape, 2, 3)), allocated((*shape, dof)), told)


@dataclass(frozen=True, slots=True, eq=False)
class DistanceRows:
    """Distances of objects by kernels.

    Attributes:
        table: For the kernels.
        roots: Number of the root of each object's tree, -1 for an object that the kernels do not know.
    """

    table: DistanceTable
    roots: NDArray[np.int64]

    def columns(self, pairs: NDArray[np.int64], hollow: NDArray[np.bool_]) -> NDArray[np.int32]:
        """Return pairs of objects as the kernels read them, shape (p, COLUMN_SIZE).

        Args:
            pairs: Numbers of two objects each, shape (p, 2).
            hollow: Of which pairs one may be wholly inside the other, which is a mesh, shape (p,).
        """
        return np.ascontiguousarray(np.column_stack([self.roots[pairs], hollow]), dtype=np.int32)

    def measured(self, values: Matrix, columns: NDArray[np.int32], *, within: float, keep: int) -> Measured:
        """Measure pairs of objects; what kernels cannot tell is UNKNOWN.

        Args:
            values: Rows of joint values in C order, shape (m, joints).
            columns: Which pairs, as :meth:`columns` gives them, shape (p, COLUMN_SIZE).
            within: Larger distances are not measured [m].
            keep: So many of the smallest distances of a row are wanted; 0 for all.
        """
        found = Measured.unknown(len(values), len(columns), self.table.dof)
        kernels = library(KERNELS)
        if kernels is None or found.told.size == 0:
            return found

        if keep > len(self.table.smallest):
            self.table.put(smallest=np.zeros(keep))
        self.table.within = within
        self.table.keep = keep
        sinks = found.values, found.points, found.gradients, found.told
        # Between calls Ctrl-C is seen.
        for first in range(0, len(values), ROWS_AT_ONCE):
            block = slice(first, first + ROWS_AT_ONCE)
            kernels.measure(
                self.table.address,
                values[block].ctypes.data,
                len(values[block]),
                columns.ctypes.data,
                len(columns),
                *(sink[block].ctypes.data for sink in sinks),
            )
        return found


@collector_waits()
def distance_rows(chain: Chain, objects: Sequence[Sequence[Body]]) -> DistanceRows:
    """Pack objects, each of bodies that one joint carries."""
    roots: list[int] = []
    nodes: list[NDArray[np.int64]] = []
    solids: list[ConvexSolid] = []
    joints: list[int] = []
    for bodies in objects:
        tree = tree_of(bodies)
        if tree is None:
            roots.append(-1)
            continue
        roots.append(sum(map(len, nodes)))
        nodes.append(tree.behind(len(solids), roots[-1]))
        solids += tree.solids
        joints += [bodies[0].joint] * len(tree.solids)

    solids.append(ConvexSolid(np.zeros((8, 3))))  # what stands at a point of a cloud, while that is compared
    joints.append(0)
    ends = np.cumsum([block_count(solid.corners) for solid in solids])
    records = np.column_stack([joints, [0, *ends[:-1]], ends, [KINDS[solid.kind] for solid in solids]])

    made = packed(
        DistanceTable,
        joint_count=len(chain.parent),
        parents=(chain.parent + 1).astype(np.int32),
        sliding=chain.prismatic.astype(np.int32),
        joints=joint_rows(chain),
        solids=records.astype(np.int32),
        sizes=size_rows([(solid,) for solid in solids], np.tile(np.eye(3), (len(solids), 1, 1))),
        corners=corner_blocks([solid.corners for solid in solids]),
        frames=np.zeros((len(chain.parent) + 1) * FRAME_SIZE),
        angles=angle_lanes(len(chain.parent)),
        nodes=np.concatenate([np.zeros((0, layout.NODE_SIZE)), *nodes]).astype(np.int32),
        element=len(solids) - 1,
        dof=chain.gain.shape[1],
        coordinates=_coordinates(chain.gain),
        gains=chain.gain.sum(axis=1),
        within=0.0,
        keep=0,
        twists=np.zeros(layout.TWIST_SIZE * len(chain.parent)),
        smallest=np.zeros(1),
        stack=np.zeros(layout.STACKED * layout.STACK_SIZE, dtype=np.int32),
        bounds=np.zeros(layout.STACKED * layout.BOUND_SIZE),
        points=np.zeros(layout.MOST_POINTS * layout.POINT_SIZE),
        faces=np.zeros(layout.MOST_FACES * layout.FACE_SIZE, dtype=np.int32),
        planes=np.zeros(layout.MOST_FACES * layout.PLANE_SIZE),
        edges=np.zeros(2 * 3 * layout.MOST_FACES, dtype=np.int32),
    )
    return DistanceRows(made, np.array(roots, dtype=np.int64))


def _coordinates(gain: Matrix) -> NDArray[np.int32]:
    """Return the coordinate that moves each joint, -1 if none does; a joint mimics at most one other."""
    moved = gain != 0.0
    return np.where(moved.any(axis=1), moved.argmax(axis=1), -1).astype(np.int32)
