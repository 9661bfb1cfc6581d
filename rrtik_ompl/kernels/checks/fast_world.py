"""Batched collision checks on plain tables, many configurations at a time, with three answers.

``FREE``: spheres that contain the moving bodies, or convex solids that do, are clear of all they are checked against.
``COLLIDING``: spheres inside them hit, or solids do. ``UNDECIDED``: neither; only an exact check decides. Rounding is
covered by a margin, so the first two answers are certain.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, distinct
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body, by_motion, pair_array
from rrtik_ompl.kernels.checks import inputs
from rrtik_ompl.kernels.checks.clearance import Clearance, rounded
from rrtik_ompl.kernels.layout import IGNORED, UNDECIDED, ProbeTable, WorldTable
from rrtik_ompl.kernels.record import Record
from rrtik_ompl.kernels.reference.checks import ReferenceChecks, measure
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import packed, with_own_arrays
from rrtik_ompl.kernels.tables.neighbour_tables import Cells, neighbour_table
from rrtik_ompl.kernels.tables.packing import (
    ArmTables,
    Flags,
    PlacedPrimitives,
    alike,
    arm_tables,
    checked_table,
    looked_up,
    partners,
    standing_solids,
    standing_tables,
)
from rrtik_ompl.kernels.tables.primitive_tables import joined, primitive_table
from rrtik_ompl.kernels.tables.robot_tables import Spheres
from rrtik_ompl.kernels.tables.scratch import probe_table, scratch_table
from rrtik_ompl.kernels.tables.solid_tables import NO_SOLIDS, Solids
from rrtik_ompl.model.robot import Chain

MARKED_ROWS = 8  # at a time; every width has that many lanes


class FastWorld:
    """Bodies carried by a tree of joints, and the pairs of them that must not touch, packed for the kernels.

    Joint values are those of the chain's own joints: mimic joints resolved, one value for a continuous joint. A value
    beyond what the margin covers (``LARGEST_ANGLE``, ``strokes``) makes a configuration undecided.

    It is meant for one thread at a time: see :meth:`for_thread`.

    Attributes:
        address: Of the tables in memory, for other kernels; 0 without kernels. Valid as long as this object lives.
        table: What is there; none without kernels.
        moving, standing: Numbers of the bodies that move, in sets that count as one, and of those that stand still.
        pinned: Whether a search keeps the address beyond a call, so that nobody may change the tables.

    Args:
        chain: The tree of joints.
        bodies: Things with ``joint`` (0 stands still), ``placement`` in the joint's frame, coal ``geometry``, and the
            ``margin`` [m] that is to be kept from what stands still, or between those that move: one for all of these.
        pairs: Numbers of the bodies that must not touch; pairs that both stand still are left out.
        outer: For each body spheres (x, y, z, r) in its own frame whose union contains it, shape (n, 4); none stand
            for the bounding ball.
        inner: For each body spheres inside it, shape (n, 4), possibly none.
        solids: For each body convex solids around and inside it; None leaves undecided what spheres do not decide.
        strokes: Largest value of sliding joints [m], a number or shape (joints,).
        cells: Of neighbours, by their numbers, the smaller one first, where they are apart; not used without kernels.
        like: Tables of the same arm in other worlds (:attr:`arm`): what has not changed is not packed again.
        compiled: Whether to use the kernels; False for plain numpy.

    Raises:
        InputError: If ``strokes`` are not numbers of metres.
    """

    def __init__(
        self,
        chain: Chain,
        bodies: Sequence[Body],
        pairs: Sequence[tuple[int, int]],
        *,
        outer: Sequence[Spheres],
        inner: Sequence[Spheres],
        solids: Sequence[Solids] | None = None,
        strokes: ArrayLike = inputs.STROKE,
        cells: Mapping[tuple[int, int], Cells] = MappingProxyType({}),
        like: Iterable[ArmTables] = (),
        compiled: bool = True,
    ) -> None:
        self._joints = len(chain.parent)
        self._limits = inputs.joint_limits(chain, strokes)
        self._smallest_limit = float(self._limits.min(initial=inputs.LARGEST_ANGLE))
        kept = by_motion(bodies, tuple(pairs))[0]
        clear = partners(bodies, kept)
        moving = alike(bodies, clear)
        standing = [k for k in distinct(pair_array(kept)).tolist() if bodies[k].joint == 0]
        self._pairs = kept
        solids = [NO_SOLIDS] * len(bodies) if solids is None else solids
        self._kernels = library("checks.check_kernels") if compiled else None
        near = {} if self._kernels is None else looked_up(bodies, moving, kept, cells)
        self._arm: ArmTables = arm_tables(
            chain, bodies, moving, kept, outer, inner, solids, self._limits, looked_up=near, like=like
        )
        self._checked = checked_table(moving, standing, clear, near)
        self._primitives = standing_tables(bodies, standing, self._checked, outer, inner)
        self.moving = moving
        self.standing = standing
        self._outer = outer
        self._placed = PlacedPrimitives()
        self._flagged = Flags(clear, self._arm, moving, standing)
        self._reference = ReferenceChecks(self._arm.arm, self._arm.balls, self._primitives)
        self._probe: ProbeTable | None = None
        self._moved = False
        self.pinned = False
        self.address = 0
        if self._kernels is not None:
            self._solids = standing_solids(bodies, standing, solids)
            self._neighbours = neighbour_table([(own, self._flagged.number(pair)) for pair, own in near.items()])
            self._take_memory()

    def _take_memory(self) -> None:
        """Memory to compute in, and the table of all that kernels read."""
        self._scratch = scratch_table(self._arm.arm, self._arm.balls, self._arm.bounds, self._primitives)
        arm = self._arm
        outer_balls, inner_balls = arm.balls
        outer_primitives, inner_primitives = self._primitives
        self.table = packed(
            WorldTable,
            arm=arm.arm,
            outer_balls=outer_balls,
            inner_balls=inner_balls,
            outer_primitives=outer_primitives,
            inner_primitives=inner_primitives,
            scratch=self._scratch,
            moving_solids=arm.solids,
            standing_solids=self._solids,
            wider_solids=arm.wider_solids,
            motion_bounds=arm.bounds,
            neighbours=self._neighbours,
        )
        self.address = self.table.address
        self._marks = self._scratch.marks

    def for_thread(self) -> FastWorld:
        """The same tables with memory of their own to compute in."""
        other = copy.copy(self)
        other._probe = None
        if other._kernels is not None:
            outer, inner = other._primitives
            if outer.clouds or inner.clouds:  # of a cloud, a point is put among the solids
                solids = other._solids
                other._solids = with_own_arrays(solids, sizes=solids.sizes, corners=solids.corners)
            other._take_memory()

        return other

    def update_obstacles(self, bodies: Sequence[Body], inflation: Sequence[float]) -> None:
        """Put what stands still elsewhere, in place: the arm, the pairs and addresses stay as they are.

        From then on no contact with them is proven, only freedom from it.

        Args:
            bodies: As at the beginning, those that stand still with other placements. One that is the same object
                as before is not packed again.
            inflation: For each body how far from it, beyond its margin, the arm must stay to be FREE [m]; read for
                those that stand still.
        """
        around = self._placed.primitives(bodies, self.standing, self._outer, inflation)
        first = not self._moved
        self._moved = True
        inside = primitive_table(joined([]), self._checked != IGNORED) if first else self._primitives[1]
        self._primitives = primitive_table(around, self._checked), inside
        self._reference = ReferenceChecks(self._arm.arm, self._arm.balls, self._primitives)
        self._probe = None

        if self._kernels is not None:
            outer, inner = self._primitives
            self.table.put(outer_primitives=outer, inner_primitives=inner)
            if first:  # the solids stand where nothing is any more; that none is known holds wherever bodies go
                self._solids = standing_solids(bodies, self.standing, [NO_SOLIDS] * len(bodies))
                self.table.put(standing_solids=self._solids)

    def intact(self) -> bool:
        """Whether no kernel has written beyond its own memory; tests check it after each call."""
        arm = self._arm
        outer, inner = self._primitives
        tables: list[Record] = [arm.arm, *arm.balls, outer, inner, *outer.clouds, *inner.clouds]
        tables += [arm.solids, arm.wider_solids, arm.bounds]
        if self._kernels is not None:
            tables += [self._scratch, self._solids, self._neighbours, self.table]
        return all(each.intact() for each in tables) and (self._probe is None or self._probe.intact())

    @property
    def arm(self) -> ArmTables:
        """What depends on the moving bodies alone, for other worlds of the same arm."""
        return self._arm

    @property
    def margin(self) -> float:
        """What is added to outer and taken from inner radii against rounding [m]."""
        return self._arm.margin

    @property
    def limits(self) -> Vector:
        """Largest absolute value of each joint that kernels can be given directly [rad or m], shape (joints,)."""
        return self._limits

    def classify(self, V: ArrayLike, *, resolve: bool = True) -> NDArray[np.int8]:
        """Check rows of joint values V, shape (m, joints): FREE, UNDECIDED or COLLIDING each. Shape (m,).

        Args:
            V: Joint values [rad or m].
            resolve: False to be content with FREE and UNDECIDED.

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        rows, beyond = self._values(V, "joint values")
        if self._kernels is None:
            answers = self._reference.classify(rows, resolve=resolve)
        else:
            found = np.empty(len(rows), dtype=np.int32)
            places = (rows.ctypes.data, len(rows), found.ctypes.data)
            inputs.require_sound(self._kernels.classify(self.address, *places, resolve))
            answers = found.astype(np.int8)

        return answers if beyond is None else np.where(beyond, np.int8(UNDECIDED), answers)

    def classify_edges(
        self, A: ArrayLike, B: ArrayLike, counts: ArrayLike, *, resolve: bool = True
    ) -> NDArray[np.int8]:
        """Check straight motions A[k] -> B[k] by their configurations (1 - s) A + s B, s = 0, 1 / count, ..., 1.

        A motion is COLLIDING as soon as one of them is, FREE if all are, UNDECIDED otherwise.

        Args:
            A: Starts, shape (m, joints).
            B: Ends, shape (m, joints).
            counts: Numbers of steps, whole and at least 1, shape (m,).
            resolve: False to be content with FREE and UNDECIDED.

        Raises:
            InputError: If shapes do not fit, a value is not finite or a number of steps is not a positive integer.
        """
        starts, first = self._values(A, "starts")
        ends, second = self._values(B, "ends")
        steps = inputs.checked_step_counts(counts, len(starts))
        if len(starts) != len(ends):
            raise InputError(f"motions need as many starts as ends, got {len(starts)} and {len(ends)}")
        if self._kernels is None:
            answers = self._reference.classify_edges(starts, ends, steps, resolve=resolve)
        else:
            found = np.empty(len(starts), dtype=np.int32)
            places = (starts.ctypes.data, ends.ctypes.data, steps.ctypes.data)
            sink = found.ctypes.data
            inputs.require_sound(self._kernels.classify_edges(self.address, *places, len(starts), sink, resolve))
            answers = found.astype(np.int8)

        for beyond in (first, second):
            answers = answers if beyond is None else np.where(beyond, np.int8(UNDECIDED), answers)
        return answers

    def covered(self, V: ArrayLike) -> bool:
        """Whether the margin covers all joint values V, shape (m, joints): only then may kernels be given them.

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        return self._values(V, "joint values")[1] is None

    def clearance(self, V: ArrayLike, *, upper: bool = False) -> Clearance:
        """Bounds of the distance to contact for rows of joint values V, shape (m, joints).

        Args:
            V: Joint values [rad or m].
            upper: Whether to find an upper bound too, which takes as long again.

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        rows, beyond = self._values(V, "joint values")
        lowest, nearest = self._measured(rows, 0)
        highest = self._measured(rows, 1)[0] if upper else np.full(len(rows), np.inf)

        if beyond is not None:
            lowest = np.where(beyond, -np.inf, lowest)
            highest = np.where(beyond, np.inf, highest)
            nearest = np.where(beyond, -1, nearest)

        pairs = [self._flagged[flag][0] if flag >= 0 else (-1, -1) for flag in nearest.tolist()]
        return Clearance(rounded(lowest, -1.0), rounded(highest, 1.0), np.array(pairs, dtype=np.int64).reshape(-1, 2))

    def least_clearance(self, V: ArrayLike) -> Vector:
        """Lower bounds of the distance to contact for rows of joint values V, shape (m, joints), shape (m,).

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        rows, beyond = self._values(V, "joint values")
        lowest = self._measured(rows, 0)[0]
        return rounded(lowest if beyond is None else np.where(beyond, -np.inf, lowest), -1.0)

    def _measured(self, rows: Matrix, level: int) -> tuple[Vector, NDArray[np.int32]]:
        """Distances between outer (0) or inner (1) solids and the flags of the nearest pairs, -1 for none."""
        balls = self._arm.balls[level]
        scene = self._primitives[level]
        kernels = None if self._kernels is None else library("checks.distance_kernels")
        if kernels is None:
            return measure(self._arm.arm, balls, scene, rows)
        if self._probe is None:
            self._probe = probe_table(self._primitives)
        found = np.empty(len(rows))
        pairs = np.empty(len(rows), dtype=np.int32)
        tables = (self.address, balls.address, scene.address, rows.ctypes.data, len(rows), self._probe.address)
        inputs.require_sound(kernels.measure(*tables, found.ctypes.data, pairs.ctypes.data))

        return np.where(pairs < 0, np.inf, found), pairs

    def undecided_pairs(self, V: ArrayLike) -> list[list[tuple[int, int]]]:
        """For each row of joint values V, shape (m, joints), the pairs that nothing here proves free.

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        rows, beyond = self._values(V, "joint values")
        found: list[list[tuple[int, int]]] = []
        for start in range(0, len(rows), MARKED_ROWS):
            marks = self._marked(rows[start : start + MARKED_ROWS])
            pairs: list[list[tuple[int, int]]] = [[] for _ in marks]
            for row, flag in np.argwhere(marks).tolist():
                pairs[row] += self._flagged[flag]
            found += pairs

        for far in np.flatnonzero(beyond) if beyond is not None else ():
            found[far] = list(self._pairs)
        return found

    def _marked(self, rows: Matrix) -> Mask:
        """Flags of the pairs that are not proven free, shape (m, flags), for a few rows."""
        if self._kernels is None:
            return self._reference.marks(rows)
        count = inputs.require_sound(self._kernels.mark_pairs(self.address, rows.ctypes.data, len(rows)))
        lanes = np.arange(len(rows), dtype=np.int32)[:, None]
        return np.asarray((self._marks[:count] >> lanes) & 1, dtype=bool)

    def _values(self, V: ArrayLike, what: str) -> tuple[Matrix, Mask | None]:
        """Rows of values as the kernels want them, and which of them lie beyond the limits, if any."""
        return inputs.kernel_values(V, self._limits, self._smallest_limit, what)
