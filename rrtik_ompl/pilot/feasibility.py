"""Cache lamps, grasp faults and joint ranges until the state that they depend on changes."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.ik.analytic.closed_form import has_closed_form
from rrtik_ompl.pilot.routes.lamps import Lamp, diagnose, lamps
from rrtik_ompl.pilot.routes.manoeuvre import JointRange, joint_range
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.world.world import World

PATIENT_SECONDS = 0.05  # time limit of inverse kinematics for one pose, once the pilot asks for a route


class FeasibilityCache:
    """Compute what the arm can do from its configuration, and keep the last result of each kind.

    Each cached value is stored with a key of all that it depends on; a different key makes it be computed again.
    """

    def __init__(self) -> None:
        self._lamps: tuple[Hashable, tuple[Lamp, ...]] = ((), ())
        self._fault: tuple[Hashable, str] = ((), "")
        self._range: tuple[Hashable, JointRange | None] = ((), None)

    def lamps(self, surroundings: Surroundings, target: str | None, q: Vector) -> tuple[Lamp, ...]:
        """Return the lamps of all grasps of an object at its last seen pose; an empty tuple if it was never seen."""
        target_seen = None if target is None else surroundings.named(target)
        if target_seen is None:
            return ()

        key = (target, surroundings, surroundings.world_at(q, target).valid(q))
        if key != self._lamps[0]:
            world_touching = surroundings.holding(target_seen.object.name)
            self._lamps = (
                key,
                lamps(surroundings.world, target_seen.object, target_seen.T_base_object, q, holding=world_touching),
            )
        return self._lamps[1]

    def patient_lamp(
        self, surroundings: Surroundings, target: str | None, choice: tuple[str, int] | None, q: Vector
    ) -> Lamp | None:
        """Return the lamp of a grasp, after a longer search if the first one found no configuration.

        Only robots without closed-form inverse kinematics are searched longer (`PATIENT_SECONDS` a pose). The lamps
        found then replace the cached ones, so that the page agrees with the route.

        Args:
            surroundings: The world with the objects seen.
            target: Name of the object; None if none is chosen.
            choice: Type and level of the grasp; None if none is chosen.
            q: Present configuration, shape (dof,).

        Returns:
            None if there is no such grasp.
        """
        lamp = self._lamp(surroundings, target, choice, q)
        target_seen = None if target is None else surroundings.named(target)
        if lamp is None or target_seen is None or len(lamp.grasps) or has_closed_form(surroundings.world.robot):
            return lamp

        world_touching = surroundings.holding(target_seen.object.name)
        key = self._lamps[0]
        longer_search = lamps(
            surroundings.world,
            target_seen.object,
            target_seen.T_base_object,
            q,
            holding=world_touching,
            seconds=PATIENT_SECONDS,
        )

        self._lamps = (key, longer_search)
        self._fault = ((), "")
        return self._lamp(surroundings, target, choice, q)

    def _lamp(
        self, surroundings: Surroundings, target: str | None, choice: tuple[str, int] | None, q: Vector
    ) -> Lamp | None:
        return next((lamp for lamp in self.lamps(surroundings, target, q) if (lamp.type, lamp.level) == choice), None)

    def fault(self, surroundings: Surroundings, target: str, lamp: Lamp, q: Vector) -> str:
        """Return why a grasp cannot be made: how far it is out of reach, or which pair would touch; "" if it can."""
        seen = surroundings.named(target)
        if seen is None or lamp.stage is None:
            return ""

        key = (self._lamps[0], lamp.type, lamp.level)
        if key != self._fault[0]:
            worlds = surroundings.world, surroundings.holding(target)
            self._fault = (key, diagnose(lamp, seen.object, seen.T_base_object, q, *worlds))
        return self._fault[1]

    def joint_range(self, surroundings: Surroundings, world: World, q: Vector, joint: int) -> JointRange:
        """Return the free range of one joint while all others stand still.

        The range is reused as long as the other joints, the surroundings and the world stay the same and the joint has
        not left it.
        """
        key = (joint, np.delete(q, joint).tobytes(), surroundings, id(world))
        cached = self._range[1]
        if cached is None or key != self._range[0] or not cached.low <= q[joint] <= cached.high:
            cached = joint_range(world, q, joint)
            self._range = (key, cached)
        return cached
