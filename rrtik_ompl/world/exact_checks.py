"""Exact collision checks of configurations and motions: by kernels first, by coal where kernels are in doubt.

The kernels (:mod:`rrtik_ompl.kernels`) give three answers. "Free" and "colliding", found by sphere covers and a narrow
phase of convex solids, are certain. An undecided configuration falls back to coal for those pairs that are in doubt, so
every answer agrees with coal's. Coal is called with fresh requests: reused collision data start from the last support
points and have been seen to miss overlaps.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.base.copies import Items
from rrtik_ompl.base.poses import working_memory
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, kept_apart, request
from rrtik_ompl.geometry.collision.distances import is_ours, own_gap
from rrtik_ompl.geometry.collision.solids import around, is_mesh, solids_of
from rrtik_ompl.kernels import FREE, UNDECIDED, FastWorld, needs_covers
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.taken_tables import TakenTables
from rrtik_ompl.model.robot import Robot, pinocchio_rows
from rrtik_ompl.world.arm_cache import arm_cache
from rrtik_ompl.world.arrangement import Arrangement
from rrtik_ompl.world.proof import Prover


@dataclass(eq=False)
class ExactChecker:
    """Exact collision checks of configurations within the robot's limits and of straight motions between them.

    An object serves one thread at a time.

    Attributes:
        solids: The bodies, and which of them must not touch.
        clearance: Distance kept from obstacles on top of their margins [m].
        bodies: The bodies of ``solids``, with the clearance added to the margins of obstacles.
        tables: The kernels' tables of the checked pairs.
        motions: Cache of :func:`rrtik_ompl.kernels.search.motions.motion_table.motions_of`.
    """

    solids: Arrangement
    clearance: float
    bodies: Items[Body]
    tables: TakenTables
    motions: dict[tuple[bool, float], FastMotions] = field(default_factory=dict)
    _data: Any = None

    @classmethod
    @collector_waits()
    def of(cls, solids: Arrangement, clearance: float) -> ExactChecker:
        """Create the checker of an arrangement that keeps a clearance [m] from obstacles on top of their margins."""
        bodies = solids.with_clearance(clearance)
        packed = arm_cache(solids.robot).pack(bodies.as_tuple, solids.checked, solids.covers())
        return cls(solids, clearance, bodies, TakenTables(packed), _data=working_memory(solids.robot.model))

    @property
    def fast(self) -> FastWorld:
        """The kernels' tables; built anew if another checker has taken them over."""
        return self.tables.get(self._packed)

    def for_thread(self) -> ExactChecker:
        """Return the same checker for another thread."""
        tables = self.tables.for_thread(self._packed)
        return replace(self, tables=tables, motions={}, _data=self.solids.robot.model.createData())

    def exchanged(self, solids: Arrangement, numbers: tuple[int, ...]) -> ExactChecker | None:
        """Return a checker for other bodies with the tables of this one; None if these must be made anew.

        This checker builds its tables anew if it is used again.

        Args:
            solids: The arrangement with the bodies that are there now, as many as before.
            numbers: Indices of the bodies that stand elsewhere or have another shape.
        """
        bodies = self.bodies
        tables = self.tables
        covers = solids.covers()
        for number in numbers:
            body = solids.bodies[number]
            if body.geometry is not bodies[number].geometry and any(needs_covers(body)):
                return None  # as many tables know its spheres

            kept = replace(body, margin=bodies[number].margin)  # which includes the clearance
            bodies = bodies.with_(number, kept)
            taken = tables.take(number, kept, covers[number])
            if taken is None:
                return None
            tables = taken

        motions = self.motions
        self.motions = {}
        return replace(self, solids=solids, bodies=bodies, tables=tables, motions=motions)

    def _packed(self) -> FastWorld:
        return arm_cache(self._robot).pack(self.bodies.as_tuple, self.solids.checked, self.solids.covers())

    @property
    def _robot(self) -> Robot:
        return self.solids.robot

    @cached_property
    def _contacts(self) -> Prover:
        """Prover for the pairs in contact: it proves that they overlap no deeper than they may."""
        return Prover(self._robot, self.bodies, self.solids.in_contact)

    def free(self, rows: Matrix, *, exact: bool = True) -> Mask:
        """Return which rows, shape (m, dof), are free of collision, shape (m,).

        Without ``exact`` nothing falls back to coal, and rows that the kernels leave undecided count as colliding.
        """
        answers = self.fast.classify(self._robot.chain.joint_values(rows))
        free: Mask = answers == FREE

        if exact and not free.all():
            undecided = rows[answers == UNDECIDED]
            doubtful = self.fast.undecided_pairs(self._robot.chain.joint_values(undecided))
            configurations = pinocchio_rows(self._robot, undecided)
            free[answers == UNDECIDED] = [
                self._gaps(configuration, pairs) is not None
                for configuration, pairs in zip(configurations, doubtful, strict=True)
            ]

        if self.solids.in_contact:
            free[free] = self._contacts.proven(rows[free], rows[free])
        return free

    def contacts_of_meshes_kept(self, row: Matrix) -> frozenset[tuple[int, int]]:
        """Return the pairs in contact that involve a mesh and are proven to overlap no deeper than they may.

        Coal measures the penetration depth of the filled hulls of such meshes, which is too large for hollow ones.

        Args:
            row: One configuration, shape (1, dof).
        """
        doubtful = [pair for pair in self.solids.in_contact if any(is_mesh(self.bodies[k].geometry) for k in pair)]
        return frozenset(pair for pair in doubtful if Prover(self._robot, self.bodies, (pair,)).proven(row, row).all())

    def motions_free(
        self,
        starts: Matrix,
        ends: Matrix,
        steps: NDArray[np.int64],
        *,
        exact: bool = True,
        to_be_proven: bool = False,
    ) -> Mask:
        """Return which straight motions are free at the configurations k / steps of the way, k = 0..steps, shape (m,).

        Args:
            starts: Start configurations, shape (m, dof).
            ends: End configurations, shape (m, dof).
            steps: Number of steps of each motion, shape (m,).
            exact: Whether undecided motions fall back to coal, as in :meth:`free`.
            to_be_proven: Whether the caller proves the free motions afterwards. Then motions that the kernels leave
                undecided count as free, because the proof settles them faster than coal would.
        """
        sides = self._robot.chain.joint_values(starts), self._robot.chain.joint_values(ends)
        answers = self.fast.classify_edges(*sides, steps)
        free: Mask = answers == FREE

        if exact and to_be_proven:
            free |= answers == UNDECIDED
        elif exact:
            for k in np.flatnonzero(answers == UNDECIDED):
                free[k] = self._motion_free_by_coal(starts[k], ends[k], int(steps[k]))

        if self.solids.in_contact:
            free[free] = self._contacts.proven(starts[free], ends[free])
        return free

    def _motion_free_by_coal(self, start: Vector, end: Vector, steps: int) -> bool:
        """Check by coal whether a motion that the kernels leave undecided is free at all k / steps, k = 0..steps.

        Configurations are visited from coarse to fine. The distance of a pair at one of them, divided by a bound on the
        approach of its bodies, gives a number of neighbouring steps at which the pair cannot touch and is skipped.

        Args:
            start: Start configuration, shape (dof,).
            end: End configuration, shape (dof,).
            steps: Number of steps.
        """
        # The configurations that the kernels leave undecided, from coarse to fine.
        order = spread_order(steps)
        rows = (1.0 - order / steps)[:, None] * start + (order / steps)[:, None] * end
        undecided = self.fast.classify(self._robot.chain.joint_values(rows)) != FREE
        rows = rows[undecided]
        order = order[undecided]

        doubtful = self.fast.undecided_pairs(self._robot.chain.joint_values(rows))
        travel = np.abs(end - start)
        places_apart: dict[tuple[int, int], Mask] = {}
        configurations = pinocchio_rows(self._robot, rows)

        for step, configuration, pairs in zip(order.astype(int).tolist(), configurations, doubtful, strict=True):
            open_pairs = [pair for pair in pairs if pair not in places_apart or not places_apart[pair][step]]
            gaps = self._gaps(configuration, open_pairs) if open_pairs else []
            if gaps is None:
                return False

            # Mark the neighbouring steps at which a pair is still apart.
            for pair, gap in zip(open_pairs, gaps, strict=True):
                approach = float(self.solids.approaches()[pair] @ travel)  # [m] along the whole motion
                certain_gap = max(gap - DISTANCE_TOLERANCE, 0.0)
                steps_apart = int(min(steps * certain_gap / approach, steps)) if approach > 0.0 else steps
                apart = places_apart.setdefault(pair, np.zeros(steps + 1, dtype=bool))
                apart[max(step - steps_apart, 0) : step + steps_apart + 1] = True

        return True

    def _gaps(self, configuration: Vector, pairs: list[tuple[int, int]]) -> list[float] | None:
        """Return lower bounds of pairs' distances minus margins [m] by coal; None if a pair does not keep its margin.

        Args:
            configuration: Pinocchio's configuration vector.
            pairs: Pairs of indices into ``bodies``.
        """
        pin.forwardKinematics(self._robot.model, self._data, configuration)
        transforms: dict[int, Any] = {}
        gaps = []
        for i, j in pairs:
            for k in (i, j):
                if k not in transforms:
                    transforms[k] = self._transform(k)

            ends = (self.bodies[i].geometry, transforms[i], self.bodies[j].geometry, transforms[j])
            gap = distance(*ends, kept_apart(self.bodies[i], self.bodies[j]))
            if gap is None:
                return None
            gaps.append(gap)

        return None if self.solids.containment.between(pairs, self._data.oMi) else gaps

    def _transform(self, number: int) -> coal.Transform3s:
        """Return the pose of a body in the world as coal's type."""
        body = self.bodies[number]
        pose = self._data.oMi[body.joint] * body.placement
        return coal.Transform3s(pose.rotation, pose.translation)


def distance(
    first: coal.CollisionGeometry,
    first_pose: coal.Transform3s,
    second: coal.CollisionGeometry,
    second_pose: coal.Transform3s,
    margin: float = 0.0,
) -> float | None:
    """Return a lower bound of the distance of two geometries minus a margin [m]; None if the margin is not kept.

    For solids coal returns the lower bound together with the answer whether they touch. A check of meshes takes much
    longer, so their hulls are checked first: where these are apart, so are the meshes.

    Args:
        first: A geometry of coal.
        first_pose: Its pose in the world.
        second: Another geometry.
        second_pose: Its pose in the world.
        margin: Distance that they must keep [m]; a negative one is a depth to which they may overlap.
    """
    ends, margin = solids_of((first, first_pose, second, second_pose), margin)
    if is_ours(ends):
        return own_gap(ends, margin)

    # Hulls first; a solid is its own hull.
    first, _, second, _ = ends
    result = coal.CollisionResult()
    hulls = around(first), around(second)
    if not coal.collide(hulls[0], first_pose, hulls[1], second_pose, request(margin), result):
        return float(result.distance_lower_bound)
    if hulls[0] is first and hulls[1] is second:
        return None

    result = coal.CollisionResult()
    if coal.collide(*ends, request(margin), result):
        return None
    return float(result.distance_lower_bound)


def one_way(starts: Matrix, ends: Matrix) -> tuple[Matrix, Matrix]:
    """Order the ends of motions, lexically smaller end first, so that both directions are checked identically.

    Args:
        starts: Start configurations, shape (m, dof).
        ends: End configurations, shape (m, dof).

    Returns:
        Start and end configurations of the ordered motions, shape (m, dof) each.
    """
    first_difference = (starts != ends).argmax(axis=1)[:, None]
    first_of_starts = np.take_along_axis(starts, first_difference, axis=1)
    is_turned = first_of_starts > np.take_along_axis(ends, first_difference, axis=1)
    return np.where(is_turned, ends, starts), np.where(is_turned, starts, ends)


def spread_order(count: int) -> NDArray[np.float64]:
    """Return the numbers 0..count in a coarse-to-fine order, so that collisions are found early, shape (count + 1,).

    Both ends come first, then the midpoints of ever smaller halves.
    """
    levels = [np.array([0, count])]
    step = 1 << max(count - 1, 1).bit_length()
    while step > 1:
        levels.append(np.arange(step // 2, count, step))
        step //= 2
    return np.concatenate(levels).astype(np.float64)
