"""The interface by which planners, shortening and replanning check motions, its forms in kernels, and batches.

The interface is :class:`MotionQueries`. Its optional members are only read by functions of this module, so a stand-in
for a world may leave them out: ``fast``, the tables for searches in kernels (:func:`has_kernels`), and ``accuracy``
(:func:`is_conservative`).
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
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
FIRST_BATCH = 8  # motions, as each may take some hundredths of a second in numpy
CALL_TARGET_SECONDS = 0.01  # [s] processor time of a batch above which the next one is made smaller


class MotionQueries(Protocol):
    """Interface of objects that check configurations and straight motions: a `World`, a stand-in, a planner's checker.

    Members ``fast`` and ``accuracy`` are optional and as those of `World`; see :func:`has_kernels` and
    :func:`is_conservative`. A stand-in that derives from this class need only implement :meth:`motion_valid_batch`.
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
    """A world whose checks also run in kernels; :func:`has_kernels` tells whether a world is one."""

    @property
    def robot(self) -> Robot:
        """The arm."""

    @property
    def fast(self) -> FastWorld:
        """The tables that kernels read."""

    @property
    def motions(self) -> FastMotions:
        """The motion checks for kernels: tables, joint values, step rule."""

    @property
    def weights(self) -> Vector:
        """No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,)."""

    @property
    def motion_resolution(self) -> float:
        """Largest step of any point of the arm between two checked configurations [m]."""

    @property
    def accuracy(self) -> Accuracy:
        """The treatment of configurations that the kernels cannot decide, see `World`."""


class HoldingQueries(MotionQueries, Protocol):
    """A world with path constraints; :func:`keeps_constraints` tells whether a world is one."""

    @property
    def robot(self) -> Robot:
        """The arm."""

    @property
    def constraints(self) -> HeldRegions:
        """The path constraints."""

    @property
    def free_motions(self) -> FastMotions | None:
        """The kernels' collision checks of motions without the constraints; None where there are none."""


def kernel_tables(world: object) -> FastWorld | None:
    """Return the kernels' tables of a world, or None where it has none."""
    return getattr(world, "fast", None)


def has_kernels(world: object, *libraries: str, within: Matrix | None = None) -> TypeGuard[KernelWorld]:
    """Check whether searches can run in kernels in a world.

    Args:
        world: A world, a stand-in, or None.
        libraries: Names of the kernel libraries that are needed (:func:`rrtik_ompl.kernels.simd.library.library`).
        within: Corners of a box of configurations, shape (m, n), in which no joint value may exceed the range of the
            kernels; None for no such check.
    """
    fast = kernel_tables(world)
    if fast is None:
        return False
    if within is not None and not _certain(fast, world.robot.chain, within):  # type: ignore[attr-defined]
        return False
    return all(library(name) is not None for name in libraries)


def _certain(fast: FastWorld, chain: Chain, corners: Matrix) -> bool:
    """Check whether all joint values in a box of configurations, corners of shape (m, n), are in the kernels' range."""
    largest = np.abs(corners).max(axis=0)
    return bool((np.abs(chain.gain) @ largest + np.abs(chain.offset) <= fast.limits).all())


def is_conservative(world: object) -> bool:
    """Check whether a world counts undecided configurations as blocked; worlds without ``accuracy`` count as exact."""
    return bool(getattr(world, "accuracy", "exact") == "conservative")


def decider(world: object, ask: MotionsFree) -> MotionsFree | None:
    """Return the function that decides motions which kernels leave undecided.

    Args:
        world: Any world.
        ask: Decides them in an exact world.

    Returns:
        ``ask`` for an exact world. For a conservative one whose kernels compare solids too, a function that refuses all
        motions; for other conservative worlds None, as the answer by the sphere covers stands.
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
    """Return which joints of a world's arm are revolute, shape (n,); None if there is no arm."""
    robot = getattr(world, "robot", None)
    return ~robot.prismatic if isinstance(robot, Robot) else None


class OutOfTime(Exception):
    """Raised when the time limit is reached in the middle of a batch."""


class BatchedMotionQueries:
    """Checks motions in batches of about ``CALL_TARGET_SECONDS``, so that a search ends soon after its time limit.

    The batch size is adapted to the processor time of the last batch, not to wall time: on a busy machine smaller
    batches would take longer without ending the search sooner.

    Attributes:
        asked: Number of motions checked so far.
        stop: Returns True when the search has to end.
    """

    def __init__(self, motions_free: MotionsFree, stop: Stop = no_stop) -> None:
        self._motions_free = motions_free
        self._batch = FIRST_BATCH
        self.asked = 0
        self.stop = stop

    def __call__(self, tails: Matrix, heads: Matrix) -> Mask:
        """Return which motions from tails to heads, shapes (m, n), are free, shape (m,).

        Raises:
            OutOfTime: If the search has to end.
        """
        if self.stop():
            raise OutOfTime
        answers, count = self._answers(tails, heads, self.stop)
        if count < len(tails):
            raise OutOfTime
        return answers

    def to_the_end(self, tails: Matrix, heads: Matrix) -> Mask:
        """Return which motions, shapes (m, n), are free, shape (m,), even if the search has to end."""
        return self._answers(tails, heads, no_stop)[0]

    def in_time(self, tails: Matrix, heads: Matrix) -> Mask:
        """Return which motions, shapes (m, n), are free, shape (m,); none that is left once the search has to end."""
        if self.stop():
            return np.zeros(len(tails), dtype=bool)
        return self._answers(tails, heads, self.stop)[0]

    def _answers(self, tails: Matrix, heads: Matrix, stop: Stop) -> tuple[Mask, int]:
        """Check motions batch by batch, until ``stop`` says so between two batches.

        Returns:
            Which motions are free, shape (m,), and how many of them have been checked.
        """
        free = np.zeros(len(tails), dtype=bool)
        first = 0
        while first < len(tails) and (first == 0 or not stop()):
            begin = time.thread_time()
            last = first + self._batch
            free[first:last] = self._motions_free(tails[first:last], heads[first:last])
            first = min(last, len(tails))

            # Adapt the size of the next batch to the time that this one took.
            if time.thread_time() - begin > CALL_TARGET_SECONDS:
                self._batch = max(self._batch // 2, 1)
            else:
                self._batch = min(2 * self._batch, LARGEST_BATCH)

        self.asked += first
        return free, first
