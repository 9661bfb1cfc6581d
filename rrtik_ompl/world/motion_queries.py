"""What planners, shortening and replanning need to know of motions: the one interface, kernels, and batches.

The interface is :class:`MotionQueries`. Its two optional members are read here alone, so that a stand-in for a world
may leave them out: ``fast``, the tables for searches in kernels (:func:`has_kernels`), and ``accuracy``
(:func:`is_conservative`).
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol, TypeAlias, TypeGuard

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop, no_stop
from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.motions.motion_table import MotionsFree as MotionsFree
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.robot import Chain, Robot

MotionFree: TypeAlias = Callable[[Vector, Vector], bool]  # as MotionQueries.motion_valid

LARGEST_BATCH = 1024  # motions
FIRST_BATCH = 64
CALL_TARGET_SECONDS = 0.01  # [s] of the processor that a batch may take before the next one is made smaller


class MotionQueries(Protocol):
    """Says which configurations and straight motions are free: a `World`, a stand-in, or the checker of a planner.

    Optional: ``fast`` and ``accuracy``, as of `World`; see :func:`has_kernels` and :func:`is_conservative`. A stand-in
    that derives from this class need only implement :meth:`motion_valid_batch`.
    """

    def valid(self, q: Vector) -> bool:
        """Check whether q, shape (n,), is free."""
        return bool(self.valid_batch(q[None])[0])

    def valid_batch(self, Q: Matrix) -> Mask:
        """Return which configurations Q, shape (m, n), are free, shape (m,)."""
        return self.motion_valid_batch(Q, Q)

    def motion_valid(self, a: Vector, b: Vector) -> bool:
        """Check whether the straight motion from a to b, shapes (n,), is free."""
        return bool(self.motion_valid_batch(a[None], b[None])[0])

    @abstractmethod
    def motion_valid_batch(self, A: Matrix, B: Matrix) -> Mask:
        """Return which straight motions A[k] -> B[k], shapes (m, n), are free, shape (m,)."""


class KernelWorld(MotionQueries, Protocol):
    """A world whose checks also run in kernels; :func:`has_kernels` says whether a world is one."""

    @property
    def robot(self) -> Robot:
        """The arm."""

    @property
    def fast(self) -> FastWorld:
        """The tables that kernels read."""

    @property
    def motions(self) -> FastMotions:
        """How kernels check motions: tables, joint values, step rule."""

    @property
    def weights(self) -> Vector:
        """No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,)."""

    @property
    def motion_resolution(self) -> float:
        """Largest step of any point of the arm between two checked configurations [m]."""

    @property
    def accuracy(self) -> Accuracy:
        """What counts as free where the kernels cannot decide."""


class HoldingQueries(MotionQueries, Protocol):
    """A world with path constraints; :func:`keeps_constraints` says whether a world is one."""

    @property
    def robot(self) -> Robot:
        """The arm."""

    @property
    def constraints(self) -> HeldRegions:
        """What is held."""

    @property
    def free_motions(self) -> FastMotions | None:
        """How kernels check motions for collisions alone; None where they cannot."""


def kernel_tables(world: object) -> FastWorld | None:
    """Return the tables that kernels read of a world, or None where it has none."""
    return getattr(world, "fast", None)


def has_kernels(world: object, *libraries: str, within: Matrix | None = None) -> TypeGuard[KernelWorld]:
    """Check whether searches can run in kernels in a world.

    Args:
        world: A world, a stand-in, or None.
        libraries: Names of the kernel libraries that are needed (:func:`rrtik_ompl.kernels.simd.library.library`).
        within: Corners of a box of configurations, shape (m, n), in all of which the kernels must be certain.
    """
    fast = kernel_tables(world)
    if fast is None:
        return False
    if within is not None and not _certain(fast, world.robot.chain, within):  # type: ignore[attr-defined]
        return False
    return all(library(name) is not None for name in libraries)


def _certain(fast: FastWorld, chain: Chain, corners: Matrix) -> bool:
    """Whether no joint value of a box of configurations, given by corners of shape (m, n), is too large for kernels."""
    largest = np.abs(corners).max(axis=0)
    return bool((np.abs(chain.gain) @ largest + np.abs(chain.offset) <= fast.limits).all())


def is_conservative(world: object) -> bool:
    """Whether a world counts as blocked what its kernels cannot decide; one that does not say is taken to be exact."""
    return bool(getattr(world, "accuracy", "exact") == "conservative")


def decider(world: object, ask: MotionsFree) -> MotionsFree | None:
    """Who decides the motions that kernels leave undecided; None if they are left at what outer balls say.

    Args:
        world: Any.
        ask: Decides them in an exact world. A conservative `World` compares solids too, and refuses what they leave.
    """
    if not is_conservative(world):
        return ask
    return _none_free if getattr(world, "resolves", False) else None


def _none_free(starts: Matrix, ends: Matrix) -> Mask:
    del ends
    return np.zeros(len(starts), dtype=bool)


def keeps_constraints(world: object) -> TypeGuard[HoldingQueries]:
    """Check whether motions in a world also have to keep path constraints."""
    return getattr(world, "constraints", None) is not None


def turning_joints(world: object) -> Mask | None:
    """Return which joints of a world's arm turn, shape (n,); None for a stand-in without an arm, or no world."""
    robot = getattr(world, "robot", None)
    return ~robot.prismatic if isinstance(robot, Robot) else None


class OutOfTime(Exception):
    """It is time to stop, in the middle of a batch."""


class BatchedMotionQueries:
    """Checks motions in batches that take about ``CALL_TARGET_SECONDS``, so that a search ends soon after it should.

    Time of the processor counts: on a busy machine small batches would take longer, not end sooner.

    Attributes:
        asked: Motions so far.
        stop: True ends the search.
    """

    def __init__(self, motions_free: MotionsFree, stop: Stop = no_stop) -> None:
        self._motions_free = motions_free
        self._batch = FIRST_BATCH
        self.asked = 0
        self.stop = stop

    def __call__(self, tails: Matrix, heads: Matrix) -> Mask:
        """Return which motions are free, shapes (m, n) and (m,).

        Raises:
            OutOfTime: If it is time to stop.
        """
        return self._answers(tails, heads, self.stop)

    def to_the_end(self, tails: Matrix, heads: Matrix) -> Mask:
        """Return which motions are free, shapes (m, n) and (m,), even when it is time to stop."""
        return self._answers(tails, heads, no_stop)

    def _answers(self, tails: Matrix, heads: Matrix, stop: Stop) -> Mask:
        parts = [np.zeros(0, dtype=bool)]
        first = 0
        while first < len(tails):
            if stop():
                raise OutOfTime

            begin = time.thread_time()
            last = first + self._batch
            parts.append(self._motions_free(tails[first:last], heads[first:last]))
            first = last

            if time.thread_time() - begin > CALL_TARGET_SECONDS:
                self._batch = max(self._batch // 2, 1)
            else:
                self._batch = min(2 * self._batch, LARGEST_BATCH)

        self.asked += len(tails)
        return np.concatenate(parts)

    def in_time(self, tails: Matrix, heads: Matrix) -> Mask:
        """Return which motions are free, shapes (m, n) and (m,); none when it is time to stop."""
        with suppress(OutOfTime):
            return self(tails, heads)
        return np.zeros(len(tails), dtype=bool)
