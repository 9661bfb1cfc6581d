"""How straight motions are checked, once for each world: the rule of steps, and its table for the kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, finite_array, positive
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.search.motions.motion_layout import STEP_TOLERANCE, MotionTable
from rrtik_ompl.kernels.tables.memory import packed

MotionsFree: TypeAlias = Callable[[Matrix, Matrix], Mask]  # as MotionQueries.motion_valid_batch

NO_LIMIT = 2**62  # a count that no search reaches; fits into the kernels' integers


def step_counts(starts: Matrix, ends: Matrix, weights: Vector, resolution: float) -> NDArray[np.int64]:
    """Steps in which straight motions are checked: the bound on the arm's displacement over the resolution, rounded up.

    The kernels' own is :func:`rrtik_ompl.kernels.search.motions.motion_kernels.step_count`.

    Args:
        starts: Configurations, shape (..., dof).
        ends: As many configurations.
        weights: No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,).
        resolution: Largest step of any point of the arm [m].

    Returns:
        At least 1 each, shape (...,).
    """
    travel = np.abs(ends - starts) @ weights
    counts: NDArray[np.int64] = np.maximum(1, np.ceil(travel / resolution - STEP_TOLERANCE)).astype(np.int64)
    return counts


class FastMotions:
    """What kernels need to check straight motions in a world; all searches in the world read this one table.

    Obstacles may be moved meanwhile: the table holds where the tables of the checks are, not what they say.

    Attributes:
        fast: The checks.
        dof: Length of a configuration.
        resolution: See ``weights`` [m].
        resolve: Whether the world decides motions that the kernels leave undecided; False if it is conservative.
        spare: What searches keep here from one call to the next, by its kind; whoever uses it takes it out meanwhile.
        identity: Whether joint values are the configuration itself.
        table: What kernels read.
        address: Of it in memory; valid as long as this object lives.

    Args:
        fast: Must have kernels (an ``address`` other than 0).
        gain, offset: Joint values are ``gain @ q + offset``, shapes (joints, dof) and (joints,).
        weights: A motion takes ``weights @ |b - a| / resolution`` steps, rounded up, shape (dof,).
        resolution: See ``weights``, above 0 [m].
        steps_per_unit: At least this many steps for each unit of Euclidean length; with zero weights the only rule.
        resolve: See above.
        proof: Makes the table of proofs ready, in a world where only proven motions count as free.

    Raises:
        InputError: If there are no kernels, shapes do not fit, or a number is out of range.
    """

    def __init__(
        self,
        fast: FastWorld,
        gain: ArrayLike,
        offset: ArrayLike,
        *,
        weights: ArrayLike,
        resolution: float,
        steps_per_unit: float = 0.0,
        resolve: bool = True,
        proof: Callable[[], ProofTable] | None = None,
    ) -> None:
        if fast.address == 0:
            raise InputError("search in kernels: there are none; install numba")
        matrix = finite_array(gain, (None, None), "gain")
        joints, self.dof = matrix.shape
        shift = finite_array(offset, (joints,), "offset")
        if joints != len(fast.limits):
            raise InputError(f"gain and offset: expected {len(fast.limits)} rows, one for each joint, got {joints}")
        self.fast = fast
        self.resolve = resolve
        self._gain = matrix
        self._offset = shift
        self._proof = proof
        self.spare: dict[str, Any] = {}
        self.resolution = positive(resolution, "resolution")
        self._steps_per_unit = steps_per_unit
        self._weights = finite_array(weights, (self.dof,), "weights")
        self.identity = matrix.shape == (joints, joints) and bool((matrix == np.eye(joints)).all() and not shift.any())
        self.table = packed(
            MotionTable,
            world=fast.table,
            dof=self.dof,
            joints=joints,
            gain=matrix,
            offset=shift,
            weights=self._weights,
            resolution=self.resolution,
            steps_per_unit=steps_per_unit,
            ends=np.zeros((2, joints)),
            resolve=int(resolve),
        )
        self.address = self.table.address

    @property
    def proves(self) -> bool:
        """Whether only proven motions count as free."""
        return self._proof is not None

    @property
    def joints(self) -> int:
        """How many joint values a configuration has."""
        return len(self._offset)

    def scaled(self, scale: Vector) -> FastMotions:
        """The same motions between configurations that are multiplied by ``scale``, shape (dof,), above 0."""
        return FastMotions(
            self.fast,
            self._gain / scale,
            self._offset,
            weights=self._weights / scale,
            resolution=self.resolution,
            steps_per_unit=self._steps_per_unit,
            resolve=self.resolve,
            proof=self._proof,
        )

    def joint_values(self, Q: Matrix) -> Matrix:
        """Joint values of configurations, shapes (m, dof) and (m, joints)."""
        return Q @ self._gain.T + self._offset

    def make_ready(self) -> None:
        """To be called before kernels that ask for proofs: others may have proven with another clearance meanwhile."""
        if self._proof is not None:
            self.table.put(proof=self._proof())

    def intact(self) -> bool:
        """Whether no kernel has written beyond this table or those of the checks."""
        return self.table.intact() and self.fast.intact()

    def require_covered(self, lower: Vector, upper: Vector) -> None:
        """Refuse a box of configurations that the checks' margin against rounding does not cover; shapes (dof,).

        The kernels do not check it again.

        Raises:
            InputError: It names the joint.
        """
        largest = np.abs(self._gain) @ np.maximum(np.abs(lower), np.abs(upper)) + np.abs(self._offset)
        limits = self.fast.limits
        beyond = np.flatnonzero(largest > limits)
        if len(beyond):
            raise InputError(f"bounds: joint {beyond[0]} can go farther than the checks cover ({limits[beyond[0]]:g})")


class MotionSource(Protocol):
    """A world whose motion table is wanted."""

    @property
    def weights(self) -> Vector:
        """No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,)."""

    @property
    def robot(self) -> Any:
        """The arm."""

    @property
    def motion_resolution(self) -> float:
        """Largest step of any point of the arm between two checked configurations [m]."""

    @property
    def resolves(self) -> bool:
        """Whether motions that outer balls leave in doubt are resolved."""

    @property
    def fast(self) -> FastWorld | None:
        """The tables of the checks, None where nothing can be checked in kernels."""


def motions_of(world: MotionSource, tables: dict[tuple[bool, float], FastMotions]) -> FastMotions | None:
    """The motion table of a world: the one that is kept while it still fits, None where kernels cannot be used.

    Args:
        world: The world.
        tables: Those that are kept, by whether doubtful motions are resolved, and the resolution [m].
    """
    fast = world.fast
    if fast is None:
        return None
    resolve = world.resolves
    resolution = world.motion_resolution
    kept = tables.get((resolve, resolution))
    if kept is None or kept.fast is not fast:
        chain = world.robot.chain
        kept = FastMotions(
            fast, chain.gain, chain.offset, weights=world.weights, resolution=resolution, resolve=resolve
        )
        tables[resolve, resolution] = kept
    return kept
