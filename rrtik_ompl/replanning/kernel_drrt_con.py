"""DRRT-Con whose check and whose repair of the path are one call of a kernel each, for worlds that have kernels."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop, no_stop
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.repair import PathRepair
from rrtik_ompl.replanning.connecting import CUTS, ITERATIONS, PATIENCE, KernelConnect, KernelCuts
from rrtik_ompl.replanning.drrt_con import DrrtCon
from rrtik_ompl.world.motion_queries import MotionQueries, has_kernels
from rrtik_ompl.world.moving_world import MovingWorld

REPAIR_CUTS, REPAIR_PATIENCE = 16, 6  # as CUTS and PATIENCE, where only a detour is new; walking shortens it further


class KernelDrrtCon(DrrtCon):
    """As :class:`DrrtCon`, in one world: its path is kept free of what moves there.

    What the kernels add to the published algorithm: :mod:`rrtik_ompl.kernels.search.repair_kernels`.

    Args:
        world: Checks motions; the ``motions`` of all methods.
        lower, upper: The box to sample in, shape (n,).
        max_edge: See :class:`DrrtCon`.
        seed: Of the samples and the shortcuts.
        forgetting: Whether each repair plans from scratch, as :class:`FromScratch` does.

    Raises:
        InputError: If the world has no kernels.
    """

    def __init__(
        self, world: MovingWorld, lower: Vector, upper: Vector, max_edge: float, seed: int, *, forgetting: bool = False
    ) -> None:
        self._world = world  # before the check, behind which its type is a lesser one
        if not has_kernels(world):
            raise InputError("replanning in kernels: the world has none; install numba")

        self._forgetting = forgetting
        self._rng = np.random.default_rng([seed, 1])
        super().__init__(KernelConnect(world, lower, upper, max_edge, seed), max_edge, post=KernelCuts(world, seed))
        tries, patience = (CUTS, PATIENCE) if forgetting else (REPAIR_CUTS, REPAIR_PATIENCE)
        self._kernels = PathRepair(
            world.motions, lower, upper, max_edge=max_edge, iterations=ITERATIONS, tries=tries, patience=patience
        )  # fmt: skip

    def check_path(self, motions: MotionQueries) -> bool:
        """See :meth:`DrrtCon.check_path`."""
        if self.path is None:
            return False
        self.free = self._kernels.check(self.path)
        self._world.checked += self._kernels.checked
        return self.free

    def repair(self, motions: MotionQueries, stop: Stop = no_stop) -> bool:
        """See :meth:`DrrtCon.repair`."""
        self.repairs += 1
        seed = int(self._rng.integers(2**62))
        new_path: Matrix | None = None
        if self.path is not None:
            new_path = self._kernels.repair(seed, stop, forgetting=self._forgetting)
        self.free = new_path is not None
        if new_path is not None:
            self.path = new_path
        return self.free
