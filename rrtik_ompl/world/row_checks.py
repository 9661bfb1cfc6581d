"""The implementation of a world: its answers for arrays of configurations that need no validation.

The methods of :class:`rrtik_ompl.World` validate their arguments and call these functions. Code inside the library
calls them directly with rows that are float64, finite and of shape (m, dof) already.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, in_blocks
from rrtik_ompl.base.copies import changed
from rrtik_ompl.base.errors import MeshWarning
from rrtik_ompl.base.sharing import Shared
from rrtik_ompl.constraints.held_regions import HeldRegions, held_regions
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.geometry.collision.distances import inside, measured
from rrtik_ompl.kernels.search.motions.motion_table import step_counts
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.model.robot import Robot, inside_limits
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, exchanged
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.world.arrangement import Arrangement, arranged, with_contacts
from rrtik_ompl.world.exact_checks import ExactChecker, one_way
from rrtik_ompl.world.proof import Prover

if TYPE_CHECKING:
    from rrtik_ompl.world.distances import Ruler


def _arranged(robot: Robot, scene: Scene, self_margin: float) -> Arrangement:
    """Arrange the solids of a scene; those of a scene with contacts are those of the one without."""
    if not scene.contacts:
        return arranged(robot, scene, self_margin)
    return with_contacts(ARRANGEMENTS.of(robot, changed(scene, contacts=()), self_margin), scene)


def _prover_of(solids: Arrangement, constraints: HeldRegions | None) -> Prover:
    """Make the prover of an arrangement.

    With path constraints it shares the tables of the one without them.
    """
    if constraints is not None:
        return PROVERS.of(solids, None).holding(constraints)
    always_colliding = solids.always_colliding
    return Prover(
        solids.robot,
        solids.bodies,
        solids.moving,
        self_margin=solids.self_margin,
        always_colliding=always_colliding,
        bare=None if solids.bare is None else PROVERS.of(solids.bare, None),
    )


def _held_regions(robot: Robot, attached: tuple[AttachedObject, ...], regions: tuple[TaskRegion, ...]) -> HeldRegions:
    return held_regions(robot, Scene(attached=attached), regions, None)


def _second_checker(solids: Arrangement, clearance: float) -> Certificate:
    return Certificate(solids.robot, solids.with_clearance(clearance).as_tuple, solids.pairs)


def _ruler_of(solids: Arrangement) -> Ruler:
    from rrtik_ompl.world.distances import Ruler  # a plan does not need it

    return Ruler(solids.robot, solids.bodies, solids.pairs)


# The parts of worlds, each with the values that it depends on. Worlds with equal values share a part.
ARRANGEMENTS = Shared(_arranged)  # robot, scene, self_margin
CHECKERS = Shared(ExactChecker.of)  # arrangement, clearance
PROVERS = Shared(_prover_of)  # arrangement, held regions
HELD = Shared(_held_regions)  # robot, attached objects, regions
CERTIFICATES = Shared(_second_checker)  # arrangement, clearance
RULERS = Shared(_ruler_of)  # arrangement


@dataclass(frozen=True, eq=False)
class RowChecks:
    """The checks of a world for rows of configurations. An object serves one thread at a time.

    Attributes:
        settings: The settings of the world.
        solids: Its bodies, and which of them must not touch.
        prover: Proves motions free.
        constraints: The path constraints; None if there are none.
    """

    settings: WorldSettings
    solids: Arrangement
    prover: Prover
    constraints: HeldRegions | None

    def for_thread(self) -> RowChecks:
        """Return the same checks for another thread."""
        return replace(self, prover=self.prover.for_thread())

    @cached_property
    def checker(self) -> ExactChecker:
        """The checks for collisions; made when something is checked, as many worlds are only asked for their bodies."""
        return CHECKERS.of(self.solids, self._clearance)

    @property
    def _clearance(self) -> float:
        return self.settings.clearance + self.settings.inflation

    @property
    def unheld(self) -> RowChecks:
        """The same checks without path constraints."""
        return self if self.constraints is None else checks_of(changed(self.settings, constraints=()))

    def with_obstacle(self, obstacle: Obstacle) -> RowChecks:
        """Return the checks with another obstacle in the place of the one of the same name.

        The parts for the new scene are derived from the current ones where that is possible, and stored among the
        shared parts, where :func:`checks_of` finds them.

        Raises:
            UnknownNameError: If there is no obstacle of that name.
        """
        settings = self.settings
        derived = self.solids.exchanged(obstacle)
        if derived is None:
            scene = exchanged(settings.scene, self.solids.index_of(obstacle.name), obstacle)
            return checks_of(changed(settings, scene=scene))

        solids, numbers = derived
        checks = self._derived(solids, numbers)
        checker = self.checker.exchanged(solids, numbers) if "checker" in vars(self) else None
        if checker is not None:
            vars(checks)["checker"] = CHECKERS.keep(checker, solids, checker.clearance)
        return checks

    def held_elsewhere(self, item: AttachedObject) -> RowChecks:
        """Return the checks with an attached object elsewhere on its link; its proofs take over the tables of these.

        Args:
            item: As it is held now: of the scene's object of its name all but the pose. The scene has no contacts.
        """
        return self._derived(*self.solids.held_elsewhere(item))

    def _derived(self, made: Arrangement, numbers: tuple[int, ...]) -> RowChecks:
        """Return the checks for an arrangement that differs from this one's in bodies of these indices."""
        # The shared parts are held weakly, so these variables keep them alive until checks_of has found them.
        settings = self.settings
        solids = ARRANGEMENTS.keep(made, settings.robot, made.scene, settings.self_margin)
        unheld_prover = PROVERS.of(self.solids, None)
        prover = unheld_prover.exchanged(solids.bodies, numbers, always_colliding=solids.always_colliding)
        PROVERS.keep(prover, solids, None)
        return checks_of(changed(settings, scene=solids.scene))

    @cached_property
    def certificate(self) -> Certificate:
        """The checker by coal behind :meth:`certified`."""
        return CERTIFICATES.of(self.solids, self.settings.clearance)

    @cached_property
    def ruler(self) -> Ruler:
        """Measures distances between the objects."""
        return RULERS.of(self.solids)

    def free(self, rows: Matrix) -> Mask:
        """Return which rows, shape (m, dof), are inside the limits, free and within the constraints, shape (m,)."""
        return in_blocks(self._free, rows)

    def motions_free(self, starts: Matrix, ends: Matrix) -> Mask:
        """Return which straight motions starts[k] -> ends[k], shapes (m, dof), are valid, shape (m,)."""
        return in_blocks(self._motions_free, starts, ends)

    def certified(self, rows: Matrix) -> Mask:
        """Return which rows, shape (m, dof), the second check calls free, shape (m,): proofs first, then coal."""
        mask = inside_limits(self.settings.robot, rows)
        unproven = mask & ~self.prover.still_proven(rows, clearance=self.settings.clearance)
        if unproven.any():
            mask[unproven] = self.certificate.free(rows[unproven])
        return mask if self.constraints is None else mask & self.constraints.held(rows)

    def contacts(self, q: Vector) -> tuple[Contact, ...]:
        """Return the contacts at a valid configuration array, shape (dof,); see :meth:`rrtik_ompl.World.contacts`."""
        solids = self.solids
        rows = q[None]
        proven_pairs = self.checker.contacts_of_meshes_kept(rows)
        pairs = tuple(pair for pair in solids.pairs if pair not in proven_pairs) if proven_pairs else solids.pairs
        frames = self.settings.robot.chain.joint_frames(rows)[0]
        contacts = list(measured(solids.bodies.as_tuple, pairs, frames, near_only=True))

        # The distances may miss a body that is wholly inside another, which the second checker finds.
        if not contacts:
            same_pairs = not proven_pairs and self.settings.clearance == 0.0
            certificate = self.certificate if same_pairs else Certificate(solids.robot, solids.bodies.as_tuple, pairs)
            contacts = [inside(*names) for names in certificate.first_pairs(rows) if names is not None]
        return tuple(sorted(contacts, key=lambda c: c.clearance))

    def closest(self, q: Vector) -> Contact | None:
        """Return the pair of bodies with the least clearance at q, shape (dof,), if nothing touches, or None."""
        frames = self.settings.robot.chain.joint_frames(q[None])[0]
        contacts = measured(self.solids.bodies.as_tuple, self.solids.pairs, frames, near_only=False)
        return min(contacts, key=lambda c: c.clearance, default=None)

    def too_near(self, q: Vector) -> tuple[Contact, ...]:
        """Return the pairs within the clearance at q, shape (dof,); see :meth:`rrtik_ompl.World.too_near`."""
        clearance = self.settings.clearance
        if clearance == 0.0:
            return ()
        frames = self.settings.robot.chain.joint_frames(q[None])[0]
        bodies = self.solids.with_clearance(clearance).as_tuple
        contacts = measured(bodies, self.solids.pairs, frames, near_only=True)
        keeping_margin = (c for c in contacts if c.clearance + clearance > 0.0)
        return tuple(sorted(keeping_margin, key=lambda c: c.clearance))

    def explain(self, q: Vector) -> str:
        """Return the reason why q, shape (dof,), is not valid; see :meth:`rrtik_ompl.World.explain`."""
        if self.free(q[None])[0]:
            return ""
        if limit_fault := self.settings.robot.limit_fault(q):
            return limit_fault
        if touching := self.contacts(q):
            return f"{touching[0]}{_and_more(touching)}"
        if too_near := self.too_near(q):
            shortfall = f"nearer than the clearance of {1e3 * self.settings.clearance:.4g} mm asked for"
            distance = f"'{too_near[0].first}' and '{too_near[0].second}' are {1e3 * too_near[0].distance:.4g} mm apart"
            return f"{distance}, {shortfall}{_and_more(too_near)}"
        if self.constraints is not None and (breach := self.constraints.explain(q)):
            return breach

        nearest = self.closest(q)
        return "it is not proven free" if nearest is None else f"{nearest}, too near to be told free"

    @property
    def _exact(self) -> bool:
        return self.settings.accuracy == "exact"

    def _free(self, rows: Matrix) -> Mask:
        """As free, for one block of rows."""
        mask = inside_limits(self.settings.robot, rows) & (not self.solids.always_colliding)
        if mask.all():
            mask = self.checker.free(rows, exact=self._exact)
        else:
            mask[mask] = self.checker.free(rows[mask], exact=self._exact)
        if self.constraints is not None:
            mask[mask] = self.constraints.held(rows[mask])
        return mask

    def _motions_free(self, starts: Matrix, ends: Matrix) -> Mask:
        """As motions_free, for one block of motions."""
        robot = self.settings.robot
        mask = inside_limits(robot, starts) & inside_limits(robot, ends) & (not self.solids.always_colliding)

        # Both directions of a motion are checked at the same configurations.
        A, B = one_way(starts[mask], ends[mask])
        if self.checker.fast.address == 0:
            mask[mask] = self._motions_free_in_numpy(A, B)
            return mask

        clearance = self.settings.proving
        mask[mask] = free = self._free_in_steps(A, B)
        if clearance is not None:
            mask[mask] = self.prover.proven(A[free], B[free], clearance=clearance)
        elif self.constraints is not None:  # a prover checks the constraints as well
            mask[mask] = self.constraints.motions_held(starts[mask], ends[mask])
        return mask

    def _free_in_steps(self, A: Matrix, B: Matrix) -> Mask:
        """Check motions inside the limits, shapes (m, dof), in steps; not whether they keep path constraints."""
        counts = step_counts(A, B, self.solids.weights, self.settings.motion_resolution)
        to_be_proven = self.settings.proving is not None
        return self.checker.motions_free(A, B, counts, exact=self._exact, to_be_proven=to_be_proven)

    def _motions_free_in_numpy(self, A: Matrix, B: Matrix) -> Mask:
        """Check motions inside the limits, shapes (m, dof), without kernels.

        In numpy a whole motion is proven sooner than its steps are checked. So proofs come first, and decide alone in a
        conservative world and where motions have to be proven.
        """
        settings = self.settings
        kept = max(settings.clearance + settings.inflation, settings.proving or 0.0)
        free = self.prover.proven(A, B, clearance=kept)

        if settings.proving is None and self._exact:
            open_ = ~free
            free[open_] = self._free_in_steps(A[open_], B[open_])
            if self.constraints is not None:
                free[open_] &= self.constraints.motions_held(A[open_], B[open_])
        return free


def checks_of(settings: WorldSettings) -> RowChecks:
    """Create the checks of a world from its settings, and give the warnings about its geometry once."""
    robot = settings.robot
    scene = settings.scene
    solids = ARRANGEMENTS.of(robot, scene, settings.self_margin)
    while solids.doubts:  # each warning is given once
        warnings.warn(solids.doubts.pop(0), MeshWarning, stacklevel=3)

    constraints = HELD.of(robot, scene.attached, settings.constraints) if settings.constraints else None
    return RowChecks(settings, solids, PROVERS.of(solids, constraints), constraints)


def _and_more(contacts: tuple[Contact, ...]) -> str:
    more = len(contacts) - 1
    return f" (and {more} more pair{'s' * (more > 1)})" if more else ""
