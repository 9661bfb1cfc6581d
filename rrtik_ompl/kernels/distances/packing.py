"""What the kernels of distances read, made from the bodies of a world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, allocated
from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.shape_table import BOX_CORNERS
from rrtik_ompl.kernels.distances import layout
from rrtik_ompl.kernels.distances.layout import DistanceTable
from rrtik_ompl.kernels.distances.trees import Tree, tree_of
from rrtik_ompl.kernels.proof.layout import FRAME_SIZE
from rrtik_ompl.kernels.proof.packing import angle_lanes, joint_rows
from rrtik_ompl.kernels.proof.placed import KINDS, corner_blocks, size_rows
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid, block_count
from rrtik_ompl.model.robot import Robot

KERNELS = "distances.kernels"

ROUNDING = 1e-14  # of coordinates
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


@dataclass(frozen=True, slots=True, eq=False)
class _Packed:
    """An object as the table has it, with numbers of its own.

    Attributes:
        joint: The number of the joint that carries it.
        tree: Its nodes, without the solids.
        kinds, counts: Of each solid its kind and how many blocks of corners it has, shape (k,).
        sizes: Shape (k, SIZE_COUNT).
        spans: Shape (k, SPAN_SIZE).
        blocks: Shape (blocks, 3, WIDTH).
    """

    joint: int
    tree: Tree
    kinds: NDArray[np.int64]
    counts: NDArray[np.int64]
    sizes: Matrix
    spans: Matrix
    blocks: NDArray[np.float64]


def _packed_tree(tree: Tree, joint: int) -> _Packed:
    """Pack a tree that a joint carries."""
    solids = tree.solids
    return _Packed(
        joint,
        Tree((), tree.nodes),
        np.array([KINDS[solid.kind] for solid in solids], dtype=np.int64),
        np.array([block_count(solid.corners) for solid in solids], dtype=np.int64),
        size_rows([(solid,) for solid in solids], np.tile(np.eye(3), (len(solids), 1, 1))),
        _spans(solids),
        corner_blocks([solid.corners for solid in solids]),
    )


def _packed_bodies(bodies: Sequence[Body]) -> _Packed | None:
    """Pack the bodies of an object; None if the kernels do not know all of them."""
    tree = tree_of(bodies)
    return None if tree is None else _packed_tree(tree, bodies[0].joint)


@kept_with
def _packed_link(robot: Robot, bodies: tuple[Body, ...]) -> _Packed | None:
    """Pack a link once for all worlds of its robot: meshes take long."""
    del robot  # it keeps the answer
    return _packed_bodies(bodies)


@collector_waits()
def distance_rows(robot: Robot, objects: Sequence[Sequence[Body]]) -> DistanceRows:
    """Pack objects, each of bodies that one joint carries."""
    chain = robot.chain
    found = [
        _packed_link(robot, tuple(bodies)) if bodies[0].kind == "link" else _packed_bodies(bodies) for bodies in objects
    ]
    # Behind them is what stands at a point of a cloud, while that is compared.
    element = _packed_tree(Tree([ConvexSolid(np.zeros((1, 3)))], np.zeros((0, layout.NODE_SIZE), dtype=np.int64)), 0)
    all_packed = [*(each for each in found if each is not None), element]
    roots: list[int] = []
    nodes = [element.tree.nodes]
    first_node = 0
    first_solid = 0
    for each in found:
        roots.append(-1 if each is None else first_node)
        if each is not None:
            nodes.append(each.tree.behind(first_solid, first_node))
            first_node += len(each.tree.nodes)
            first_solid += len(each.kinds)

    ends = np.cumsum(np.concatenate([each.counts for each in all_packed]))
    kinds = np.concatenate([each.kinds for each in all_packed])
    joints = np.repeat([each.joint for each in all_packed], [len(each.kinds) for each in all_packed])
    records = np.column_stack([joints, [0, *ends[:-1]], ends, kinds])

    made = packed(
        DistanceTable,
        joint_count=len(chain.parent),
        parents=(chain.parent + 1).astype(np.int32),
        sliding=chain.prismatic.astype(np.int32),
        joints=joint_rows(chain),
        solids=records.astype(np.int32),
        sizes=np.concatenate([each.sizes for each in all_packed]),
        corners=np.concatenate([each.blocks for each in all_packed]),
        frames=np.zeros((len(chain.parent) + 1) * FRAME_SIZE),
        angles=angle_lanes(len(chain.parent)),
        nodes=np.concatenate(nodes).astype(np.int32),
        spans=np.concatenate([each.spans for each in all_packed]),
        element=len(records) - 1,
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


def _spans(solids: Sequence[ConvexSolid]) -> Matrix:
    """Return which solids have a core that is a box, with its middle and half edges, shape (n, SPAN_SIZE)."""
    spans = np.zeros((len(solids), layout.SPAN_SIZE))
    counts = np.array([len(solid.corners) for solid in solids])
    for count, signs in ((1, np.zeros((1, 0))), (2, BOX_CORNERS[:2, 2:]), (8, BOX_CORNERS)):
        numbers = np.flatnonzero(counts == count)
        if not len(numbers):
            continue
        corners = np.array([solids[k].corners for k in numbers.tolist()])
        middles = corners.mean(axis=1)
        halves = np.einsum("ck,ncx->nkx", signs, corners) / count
        off = np.abs(middles[:, None] + np.einsum("ck,nkx->ncx", signs, halves) - corners).max(axis=(1, 2))
        own = spans[numbers]
        own[:, layout.IS_SPAN] = off <= ROUNDING * np.abs(corners).max(axis=(1, 2), initial=1.0)
        own[:, layout.SPAN_MIDDLE : layout.SPAN_EDGES] = middles
        own[:, layout.SPAN_EDGES : layout.SPAN_EDGES + halves[0].size] = halves.reshape(len(numbers), -1)
        spans[numbers] = own
    return spans
