"""Batched collision checks on plain tables, many configurations at a time, with three answers.

``FREE``: spheres that contain the moving bodies are clear of all they are checked against. ``COLLIDING``: spheres
inside them hit. ``UNDECIDED``: neither; only an exact check can tell. Rounding is covered by a margin, so the first two
answers are certain.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Mask, Matrix, Vector, finite_array
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast import plain_distances
from rrtik_ompl.fast.plain import PlainChecks
from rrtik_ompl.fast.robot_tables import (
    PAIRS,
    MovingBody,
    Spheres,
    Table,
    arm_table,
    ball_table,
    moving_body,
    rounding_margin,
    table,
    usable_cover,
)
from rrtik_ompl.fast.scene_tables import inner_rows, needs_covers, outer_rows, rows_table
from rrtik_ompl.robot import Chain

FREE, UNDECIDED, COLLIDING = 0, 1, 2
LARGEST_ANGLE = 1e8  # [rad]; float64 cannot hold larger ones to the precision of the margin
STROKE = 4.0  # [m] a sliding joint may go this far from its zero unless told otherwise
MOST_STEPS = 2**30
DISTANCE_ROUNDING = 3e-6  # relative error of a distance in float32, with room to spare; the margin covers the rest

__all__ = ["COLLIDING", "FREE", "UNDECIDED", "Clearance", "FastWorld", "needs_covers"]


@dataclass(frozen=True, slots=True, eq=False)
class _ArmTables:
    """All that depends on the moving bodies alone."""

    bodies: tuple[Any, ...]
    covers: tuple[Spheres, ...]
    pairs: tuple[tuple[int, int], ...]
    strokes: Vector
    margin: float
    arm: Table
    balls: tuple[Table, Table]

    def serves(
        self, bodies: Sequence[Any], covers: Sequence[Spheres], pairs: Sequence[tuple[int, int]], strokes: Vector
    ) -> bool:
        """Whether the tables of these bodies would be the same."""
        return (
            len(bodies) == len(self.bodies)
            and tuple(pairs) == self.pairs
            and np.array_equal(strokes, self.strokes)
            and all(np.array_equal(a, b) for a, b in zip(covers, self.covers, strict=True))
            and all(_same(a, b) for a, b in zip(bodies, self.bodies, strict=True))
        )


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Bounds of the signed distance between the arm and all that it must not touch, for m configurations.

    Attributes:
        lower: No more than the distance [m], shape (m,); not above 0 means that nothing is proven. +inf if nothing can
            collide, -inf for joint values beyond what the margin covers.
        upper: No less than the distance [m], shape (m,); below 0 means a collision, +inf that nothing is known.
        pairs: Numbers of the two bodies that the lower bound is of, -1 where there are none, shape (m, 2).
    """

    lower: Vector
    upper: Vector
    pairs: NDArray[np.int64]


class FastWorld:
    """Bodies carried by a tree of joints, and the pairs of them that must not touch, packed for the kernels.

    Joint values are those of the chain's own joints: mimic joints resolved, one value for a continuous joint. A value
    beyond what the margin covers (``LARGEST_ANGLE``, ``strokes``) makes a configuration undecided.

    A world is meant for one thread at a time.

    Attributes:
        address: Of the tables in memory, for other kernels; 0 without kernels. Valid as long as this object lives.

    Args:
        chain: The tree of joints.
        bodies: Things with ``joint`` (0 stands still), ``placement`` in the joint's frame and coal ``geometry``.
        pairs: Numbers of the bodies that must not touch; pairs that both stand still are left out.
        outer: For each body spheres (x, y, z, r) in its own frame whose union contains it, shape (n, 4); none stand
            for the bounding ball.
        inner: For each body spheres inside it, shape (n, 4), possibly none.
        strokes: Largest value of sliding joints [m], a number or shape (joints,).
        like: A world of the same arm in another scene: what has not changed is not packed again.
        compiled: Whether to use the kernels; False for plain numpy.

    Raises:
        InputError: If ``strokes`` are not numbers of metres.
    """

    def __init__(
        self,
        chain: Chain,
        bodies: Sequence[Any],
        pairs: Sequence[tuple[int, int]],
        *,
        outer: Sequence[Spheres],
        inner: Sequence[Spheres],
        strokes: ArrayLike = STROKE,
        like: FastWorld | None = None,
        compiled: bool = True,
    ) -> None:
        self._joints = len(chain.parent)
        self._limits = _limits(chain, strokes)
        self._smallest_limit = float(self._limits.min(initial=LARGEST_ANGLE))
        kept = [(i, j) for i, j in pairs if bodies[i].joint > 0 or bodies[j].joint > 0]
        concerned = sorted({k for pair in kept for k in pair})
        moving = [k for k in concerned if bodies[k].joint > 0]
        standing = [k for k in concerned if bodies[k].joint == 0]
        self._pairs = kept
        self._arm = self._arm_tables(chain, bodies, moving, kept, outer, inner, like)
        self._rows = _scene_tables(bodies, moving, standing, kept, outer, inner)
        self._flagged = self._flag_places(moving, standing)
        self._plain = PlainChecks(self._arm.arm, self._arm.balls, self._rows)
        self._kernels = _kernels() if compiled else None
        self._probe: Table | None = None
        self.address = 0
        if self._kernels is not None:
            self._work = self._kernels.workspace(self._arm.arm, self._arm.balls, self._rows)
            tables = (self._arm.arm, *self._arm.balls, *self._rows, self._work)
            self._world = table({k: t.address for k, t in enumerate(tables)})
            self.address = self._world.address
            self._marks = self._work[self._kernels.MARKS]

    @property
    def margin(self) -> float:
        """What is added to outer and taken from inner radii against rounding [m]."""
        return self._arm.margin

    def classify(self, V: ArrayLike, *, prove: bool = True) -> NDArray[np.int8]:
        """Judge rows of joint values V, shape (m, joints): FREE, UNDECIDED or COLLIDING each. Shape (m,).

        Args:
            V: Joint values [rad or m].
            prove: False to be content with FREE and UNDECIDED.

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        rows, beyond = self._values(V, "joint values")
        if self._kernels is None:
            answers = self._plain.classify(rows, prove=prove)
        else:
            judged = np.empty(len(rows), dtype=np.int32)
            self._kernels.classify(self.address, rows.ctypes.data, len(rows), judged.ctypes.data, prove)
            answers = judged.astype(np.int8)
        return answers if beyond is None else np.where(beyond, np.int8(UNDECIDED), answers)

    def classify_edges(self, A: ArrayLike, B: ArrayLike, counts: ArrayLike, *, prove: bool = True) -> NDArray[np.int8]:
        """Judge straight motions A[k] -> B[k] by their configurations (1 - s) A + s B, s = 0, 1 / count, ..., 1.

        A motion is COLLIDING as soon as one of them is, FREE if all are, UNDECIDED otherwise.

        Args:
            A: Starts, shape (m, joints).
            B: Ends, shape (m, joints).
            counts: Numbers of steps, whole and at least 1, shape (m,).
            prove: False to be content with FREE and UNDECIDED.

        Raises:
            InputError: If shapes do not fit, a value is not finite or a number of steps is not a positive integer.
        """
        (starts, first), (ends, second) = self._values(A, "starts"), self._values(B, "ends")
        steps = _steps(counts, len(starts))
        if len(starts) != len(ends):
            raise InputError(f"motions need as many starts as ends, got {len(starts)} and {len(ends)}")
        if self._kernels is None:
            answers = self._plain.classify_edges(starts, ends, steps, prove=prove)
        else:
            judged = np.empty(len(starts), dtype=np.int32)
            places = (starts.ctypes.data, ends.ctypes.data, steps.ctypes.data)
            self._kernels.classify_edges(self.address, *places, len(starts), judged.ctypes.data, prove)
            answers = judged.astype(np.int8)
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
            upper: Whether to look for an upper bound too, which takes as long again.

        Raises:
            InputError: If V has the wrong shape or a value that is not finite.
        """
        rows, beyond = self._values(V, "joint values")
        lowest, nearest = self._measured(rows, 0)
        highest = self._measured(rows, 1)[0] if upper else np.full(len(rows), np.inf)
        if beyond is not None:
            lowest, highest = np.where(beyond, -np.inf, lowest), np.where(beyond, np.inf, highest)
            nearest = np.where(beyond, -1, nearest)
        pairs = np.array([*self._pairs, (-1, -1)], dtype=np.int64)
        places = np.array([self._flagged[flag] if flag >= 0 else -1 for flag in nearest.tolist()], dtype=np.int64)
        return Clearance(_rounded(lowest, -1.0), _rounded(highest, 1.0), pairs[places])

    def _measured(self, rows: Matrix, level: int) -> tuple[Vector, NDArray[np.int32]]:
        """Distances between outer (0) or inner (1) solids and the flags of the nearest pairs, -1 for none."""
        balls, scene = self._arm.balls[level], self._rows[level]
        if self._kernels is None:
            return plain_distances.measure(self._arm.arm, balls, scene, rows)
        from rrtik_ompl.fast import distance_kernels

        if self._probe is None:
            self._probe = distance_kernels.probe_table(self._rows)
        found, pairs = np.empty(len(rows)), np.empty(len(rows), dtype=np.int32)
        tables = (self.address, balls.address, scene.address, rows.ctypes.data, len(rows), self._probe.address)
        distance_kernels.measure(*tables, found.ctypes.data, pairs.ctypes.data)
        return np.where(pairs < 0, np.inf, found), pairs

    def undecided_pairs(self, v: ArrayLike) -> list[tuple[int, int]]:
        """Pairs of body numbers that the outer spheres cannot prove free at joint values v, shape (joints,).

        Raises:
            InputError: If v has the wrong length or a value that is not finite.
        """
        rows, beyond = self._values(np.asarray(v)[None], "joint values")
        if beyond is not None:
            return list(self._pairs)
        if self._kernels is None:
            marks = self._plain.marks(rows)
        else:
            count = self._kernels.mark_pairs(self.address, rows.ctypes.data)
            marks = self._marks[:count]
        return [self._pairs[k] for k in sorted(self._flagged[flag] for flag in np.flatnonzero(marks).tolist())]

    def _values(self, V: ArrayLike, what: str) -> tuple[Matrix, Mask | None]:
        """Rows of values as the kernels want them, and which of them lie beyond the limits, if any."""
        rows = V if isinstance(V, np.ndarray) and V.dtype == np.float64 else None
        if rows is None or rows.ndim != 2 or rows.shape[1] != self._joints:
            rows = finite_array(V, (None, self._joints), what)
        rows = np.ascontiguousarray(rows)
        if not rows.size or (rows.max() <= self._smallest_limit and rows.min() >= -self._smallest_limit):
            return rows, None
        rows = finite_array(rows, (None, self._joints), what)
        beyond: Mask = np.any(np.abs(rows) > self._limits, axis=1)
        return (np.where(beyond[:, None], 0.0, rows), beyond) if beyond.any() else (rows, None)

    def _arm_tables(
        self,
        chain: Chain,
        bodies: Sequence[Any],
        moving: Sequence[int],
        pairs: Sequence[tuple[int, int]],
        outer: Sequence[Spheres],
        inner: Sequence[Spheres],
        like: FastWorld | None,
    ) -> _ArmTables:
        place = {body: k for k, body in enumerate(moving)}
        own = tuple((place[i], place[j]) for i, j in pairs if i in place and j in place)
        carried = tuple(bodies[k] for k in moving)
        covers = tuple(np.asarray(spheres[k], dtype=np.float64) for k in moving for spheres in (outer, inner))
        if like is not None and like._joints == self._joints and like._arm.serves(carried, covers, own, self._limits):
            return like._arm
        reaches = [(b.joint, _reach(b, covers[2 * k])) for k, b in enumerate(carried)]
        margin = rounding_margin(chain, reaches, self._limits)
        packed: list[MovingBody] = [
            moving_body(chain, body, covers[2 * k], covers[2 * k + 1], margin) for k, body in enumerate(carried)
        ]
        balls = (ball_table(packed, own, inner=False), ball_table(packed, own, inner=True))
        return _ArmTables(carried, covers, own, self._limits, margin, arm_table(chain), balls)

    def _flag_places(self, moving: Sequence[int], standing: Sequence[int]) -> dict[int, int]:
        """For each flag that the kernels can set the place of its pair in the list of pairs."""
        number = {frozenset(pair): k for k, pair in enumerate(self._pairs)}
        crossing = {
            m * len(standing) + s: number[frozenset((i, j))]
            for m, i in enumerate(moving)
            for s, j in enumerate(standing)
            if frozenset((i, j)) in number
        }
        own = self._arm.balls[0][PAIRS].reshape(-1, 2)
        start = len(moving) * len(standing)
        return crossing | {start + k: number[frozenset((moving[i], moving[j]))] for k, (i, j) in enumerate(own)}


def _scene_tables(
    bodies: Sequence[Any],
    moving: Sequence[int],
    standing: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    outer: Sequence[Spheres],
    inner: Sequence[Spheres],
) -> tuple[Table, Table]:
    """Rows that contain what stands still, and rows inside it."""
    listed = {frozenset(pair) for pair in pairs}
    checked = np.array([[frozenset((i, j)) in listed for j in standing] for i in moving], dtype=bool)
    checked = checked.reshape(len(moving), len(standing))
    around = [(s, row) for s, k in enumerate(standing) for row in outer_rows(bodies[k], outer[k])]
    inside = [(s, row) for s, k in enumerate(standing) for row in inner_rows(bodies[k], inner[k])]
    return rows_table(around, checked), rows_table(inside, checked)


def _limits(chain: Chain, strokes: ArrayLike) -> Vector:
    """Largest absolute value of each joint that the margin covers, shape (joints,)."""
    given = np.asarray(strokes, dtype=np.float64)
    if given.shape not in ((), chain.prismatic.shape) or not (np.isfinite(given) & (given >= 0.0)).all():
        raise InputError(f"strokes: expected one number of metres or {len(chain.parent)}, none negative")
    return np.where(chain.prismatic, given, LARGEST_ANGLE)


def _reach(body: Any, outer: Spheres) -> float:
    """Distance of the farthest point of a body's outer spheres from its joint's frame [m]."""
    spheres = usable_cover(body.geometry, outer)
    centres = spheres[:, :3] @ np.array(body.placement.rotation).T + np.array(body.placement.translation)
    return float((np.linalg.norm(centres, axis=1) + spheres[:, 3]).max())


def _rounded(distances: Vector, sign: float) -> Vector:
    """Distances moved up (sign 1) or down (-1) by what float32 may have lost."""
    return distances * (1.0 + sign * DISTANCE_ROUNDING * np.sign(distances))


def _same(first: Any, second: Any) -> bool:
    """Whether two bodies are the same solid carried in the same way."""
    return (
        first.joint == second.joint
        and first.geometry is second.geometry
        and np.array_equal(first.placement.homogeneous, second.placement.homogeneous)
    )


def _steps(counts: ArrayLike, count: int) -> NDArray[np.int32]:
    """Numbers of steps, checked."""
    values = finite_array(counts, (count,), "steps of motions")
    if len(values) and (values.min() < 1.0 or values.max() > MOST_STEPS or not np.array_equal(values, values.round())):
        raise InputError(f"steps of motions: expected whole numbers from 1 to {MOST_STEPS}")
    return values.astype(np.int32)


_warned = False


def _kernels() -> ModuleType | None:
    """The compiled kernels, or None (and one warning) where numba is missing."""
    global _warned
    try:
        from rrtik_ompl.fast import kernels
    except ImportError as error:
        if not _warned:
            message = f"collision checks run in plain numpy, many times slower: {error}; install numba"
            warnings.warn(message, RuntimeWarning, stacklevel=3)
            _warned = True
        return None
    return kernels
