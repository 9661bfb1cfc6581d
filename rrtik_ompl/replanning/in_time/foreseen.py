"""The scene in each slot of time, as stated motions put it: what is free there is proven for the whole slot.

In a slot an obstacle stands where it is in the middle of it, and the arm keeps as far from it as any of its points
travels from there to an end of the slot. So a straight motion of the arm that is proven against the obstacle at rest is
free at every time of the slot.
"""

from __future__ import annotations

from dataclasses import replace
from hashlib import blake2b
from itertools import pairwise

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.certificate import distance
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, pose_at
from rrtik_ompl.replanning.travels import travel_bound, turns_without_end
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World

ROUNDING = 1e-9  # [m]: of places that are computed from times
MOST_WORLDS = 1024  # that are kept at once: 0.5 to 1.5 MB each, and there may be ten thousand slots
FINEST = 1e-4  # [m]: of an obstacle's way; if it may touch the base within so little, it counts as touching it


class ForeseenWorlds:
    """Which straight motions are free in which slot; each slot's world is made when it is asked for.

    Args:
        world: The robot and the scene, whose obstacles state their motions.
        slot: Length of a slot [s].
        clearance: What the arm keeps from every obstacle beside its margin [m].

    Raises:
        InputError: If an obstacle without an end turns.
    """

    def __init__(self, world: World, slot: float, clearance: float) -> None:
        self._world = world.with_accuracy("exact")
        self._slot = slot
        self._clearance = clearance
        self._radii = {o.name: farthest(o.shape, pin.SE3.Identity()) for o in world.scene.obstacles}
        self._worlds: dict[bytes, MovingWorld] = {}
        self._keys: dict[int, bytes] = {}  # of the slots' worlds
        self._rng = np.random.default_rng(0)

    def free(self, slot: int, a: Vector, b: Vector) -> bool:
        """Whether the straight motion from a to b, shape (n,), both inside the limits, is proven free in a slot."""
        return bool(self._world_in_slot(slot).motions_proven(a[None], b[None])[0])

    def steps_free(self, slot: int, rows: Matrix, onward: int, stop: Stop) -> int:
        """How many of the motions from row to row, shape (k, n), are free, the first in a slot, the next in that after.

        Args:
            slot: Of the first motion.
            rows: In the order of time where ``onward`` is 1, backwards where it is -1.
            onward: See there.
            stop: Ends it; what was not looked at is not free.
        """
        for number, (a, b) in enumerate(pairwise(rows)):
            first, second = (a, b) if onward > 0 else (b, a)
            if stop() or not self.free(slot + onward * number, first, second):
                return number
        return len(rows) - 1

    def base_reached(self, until: float) -> tuple[float, str]:
        """When an obstacle first reaches what no joint moves before a time [s], and a line about it; inf, "" if never.

        Nothing is free from then on. The places in the middle of slots would not show it: an obstacle may touch the
        base between them.
        """
        obstacles = {o.name: o for o in self._world.scene.obstacles if o.motion is not None}
        bodies = self._world.bodies
        first_touch = (float("inf"), "")

        for pair in self._world.pairs:
            base_part, obstacle_body = sorted((bodies[k] for k in pair), key=lambda body: body.kind == "obstacle")
            if base_part.joint == obstacle_body.joint == 0 and obstacle_body.name in obstacles:
                limit = min(until, first_touch[0])
                time = self._first_touch(base_part, obstacle_body, obstacles[obstacle_body.name], 0.0, limit)
                if time is not None:
                    pair_reached = f"'{obstacle_body.name}' reaches '{base_part.name}' at {time:.3g} s"
                    first_touch = time, f"{pair_reached}, and the base cannot give way"

        return first_touch

    def _first_touch(
        self, base_part: Body, obstacle_body: Body, obstacle: Obstacle, begin: float, end: float
    ) -> float | None:
        """When an obstacle first touches a body at rest, None if it is proven apart from it from begin to end [s]."""
        middle = 0.5 * (begin + end)
        reach = travel(obstacle, begin, end, self._radii[obstacle.name])
        pose = pose_at(obstacle, middle) * obstacle_body.within
        rest = base_part.placement.homogeneous
        if distance(base_part.geometry, rest, obstacle_body.geometry, pose.homogeneous, reach) is not None:
            return None

        if reach <= FINEST:
            return begin
        first_touch = self._first_touch(base_part, obstacle_body, obstacle, begin, middle)
        if first_touch is not None:
            return first_touch
        return self._first_touch(base_part, obstacle_body, obstacle, middle, end)

    def scene_at(self, time: float) -> Scene:
        """Where obstacles are at a time [s]."""
        scene = self._world.scene
        return replace(scene, obstacles=tuple(replace(o, pose=pose_at(o, time)) for o in scene.obstacles))

    def _world_in_slot(self, slot: int) -> MovingWorld:
        """The world in a slot; where all is at rest one world serves every slot."""
        key = self._keys.get(slot)
        if key is not None and key in self._worlds:
            return self._worlds[key]

        begin = slot * self._slot
        end = (slot + 1) * self._slot
        scene = self.scene_at(0.5 * (begin + end))
        required_distances = {
            o.name: self._clearance + travel(o, begin, end, self._radii[o.name]) for o in self._world.scene.obstacles
        }
        places = np.array([[*o.pose.homogeneous.ravel(), required_distances[o.name]] for o in scene.obstacles])

        key = self._keys[slot] = blake2b(places.tobytes(), digest_size=16).digest()
        if key not in self._worlds:
            world = self._world_to_place()
            world.move(scene, inflation=required_distances)
            self._worlds[key] = world
        return self._worlds[key]

    def _world_to_place(self) -> MovingWorld:
        """A new world, or any of those that are kept.

        Not the oldest one: searches go through the slots in order, and would always come for what was just taken.
        """
        if len(self._worlds) < MOST_WORLDS:
            return MovingWorld(self._world)
        return self._worlds.pop(list(self._worlds)[int(self._rng.integers(len(self._worlds)))])


def travel(obstacle: Obstacle, begin: float, end: float, radius: float) -> float:
    """How far a point of an obstacle travels at most between the middle of a slot and one of its ends [m].

    Args:
        obstacle: With its motion.
        begin: Of the slot [s].
        end: Of the slot [s].
        radius: Of the obstacle about its origin [m].

    Raises:
        InputError: If it turns and has no end.
    """
    motion = obstacle.motion
    if motion is None:
        return 0.0
    if isinstance(motion, ConstantVelocity):
        return 0.5 * (end - begin) * float(np.linalg.norm(motion.velocity)) + ROUNDING

    middle = 0.5 * (begin + end)
    travels = []
    for first, last in ((begin, middle), (middle, end)):
        stations = motion.times[(motion.times > first) & (motion.times < last)]
        poses = [motion.pose_at(obstacle.pose, float(time)) for time in (first, *stations, last)]
        travels.append(sum(travel_bound(a, b, radius) for a, b in pairwise(poses)))
    if not np.isfinite(max(travels)):
        raise turns_without_end(obstacle.name)
    return max(travels) + (ROUNDING if max(travels) > 0.0 else 0.0)
