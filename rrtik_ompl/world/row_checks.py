"""The inner side of a world: what it says of rows of configurations that are trusted.

:class:`rrtik_ompl.World` is the door: its methods check what they are given, and ask here. What computes in the library
has rows that are float64, finite and of shape (m, dof) already, and asks here at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from rrtik_ompl.base.arrays import Mask, Matrix, in_blocks
from rrtik_ompl.base.sharing import Shared
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.kernels.search.motions.motion_table import step_counts
from rrtik_ompl.model.robot import inside_limits
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.world.arrangement import Arrangement
from rrtik_ompl.world.exact_checks import ExactChecker, one_way
from rrtik_ompl.world.proof import Prover


def _second_checker(solids: Arrangement, clearance: float) -> Certificate:
    return Certificate(solids.robot, solids.with_room(clearance).whole, solids.pairs)


CERTIFICATES = Shared(_second_checker)  # arrangement, clearance


@dataclass(frozen=True, eq=False)
class RowChecks:
    """What a world says of rows of configurations; for one thread at a time.

    Attributes:
        settings: Of the world.
        solids: Its bodies, and which of them must not touch.
        checker: Says what is free of collision.
        prover: Says what is proven.
        constraints: What is held; None if nothing is.
    """

    settings: WorldSettings
    solids: Arrangement
    checker: ExactChecker
    prover: Prover
    constraints: HeldRegions | None

    def for_thread(self) -> RowChecks:
        """The same for another thread."""
        return replace(self, checker=self.checker.for_thread(), prover=self.prover.for_thread())

    @cached_property
    def certificate(self) -> Certificate:
        """The checker behind :meth:`certified`."""
        return CERTIFICATES.of(self.solids, self.settings.clearance)

    def free(self, rows: Matrix) -> Mask:
        """Which rows, shape (m, dof), are inside the limits and free. Shape (m,)."""
        return in_blocks(self._free, rows)

    def motions_free(self, starts: Matrix, ends: Matrix) -> Mask:
        """Which straight motions starts[k] -> ends[k], shapes (m, dof), are valid. Shape (m,)."""
        return in_blocks(self._motions_free, starts, ends)

    def certified(self, rows: Matrix) -> Mask:
        """Which rows, shape (m, dof), a second opinion calls free: proofs first, then coal. Shape (m,)."""
        mask = inside_limits(self.settings.robot, rows)
        unproven = mask & ~self.prover.still_proven(rows, clearance=self.settings.clearance)
        mask[unproven] = self.certificate.free(rows[unproven])
        return mask if self.constraints is None else mask & self.constraints.held(rows)

    @property
    def _exact(self) -> bool:
        return self.settings.accuracy == "exact"

    def _free(self, rows: Matrix) -> Mask:
        mask = inside_limits(self.settings.robot, rows) & (not self.solids.always_colliding)
        if mask.all():
            mask = self.checker.free(rows, exact=self._exact)
        else:
            mask[mask] = self.checker.free(rows[mask], exact=self._exact)
        if self.constraints is not None:
            mask[mask] = self.constraints.held(rows[mask])
        return mask

    def _motions_free(self, starts: Matrix, ends: Matrix) -> Mask:
        robot = self.settings.robot
        mask = inside_limits(robot, starts) & inside_limits(robot, ends) & (not self.solids.always_colliding)

        A, B = one_way(starts[mask], ends[mask])
        counts = step_counts(A, B, self.solids.weights, self.settings.motion_resolution)

        clearance = self.settings.proving
        mask[mask] = free = self.checker.motions_free(
            A, B, counts, exact=self._exact, to_be_proven=clearance is not None
        )

        if clearance is not None:
            mask[mask] = self.prover.proven(A[free], B[free], clearance=clearance)
        elif self.constraints is not None:  # a prover says that too
            mask[mask] = self.constraints.motions_held(starts[mask], ends[mask])
        return mask
