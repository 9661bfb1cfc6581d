"""The scene in each slot of time, as stated motions put it: what is free there is proven for the whole slot.

In a slot an obstacle stands where it is in the middle of it, and the arm keeps as far from it as any of its points
travels from there to an end of the slot. So a straight motion of the arm that is proven against the obstacle at rest is
free at every time of the slot.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.extent import farthest
from rrtik_ompl.errors import InputError
from rrtik_ompl.replanning.feed import ROTATION_NOISE
from rrtik_ompl.scene import ConstantVelocity, Obstacle, Scene
from rrtik_ompl.world import World
from rrtik_ompl.world.moving_world import MovingWorld

ROUNDING = 1e-9  # [m]: of places that are computed from times


class ForeseenWorlds:
    """Which straight motions are free in which slot; each slot's world is made when it is first asked for.

    Args:
        world: The robot and the scene, whose obstacles state their motions.
        slot: Length of a slot [s].
        room: What the arm keeps from every obstacle beside its margin [m].

    Raises:
        InputError: If an obstacle without an end turns.
    """

    def __init__(self, world: World, slot: float, room: float) -> None:
        self._world, self._slot, self._room = world.with_accuracy("exact"), slot, room
        self._radii = {o.name: farthest(o.shape, pin.SE3.Identity()) for o in world.scene.obstacles}
        self._worlds: dict[bytes, MovingWorld] = {}
        self._known: dict[int, MovingWorld] = {}

    def free(self, slot: int, a: Vector, b: Vector) -> bool:
        """Whether the straight motion from a to b, shape (n,), both inside the limits, is proven free in a slot."""
        return bool(self._in(slot).motions_proven(a[None], b[None])[0])

    def steps_free(self, slot: int, rows: Matrix, onward: int) -> int:
        """How many of the motions from row to row, shape (k, n), are free, the first in a slot, the next in that after.

        Args:
            slot: Of the first motion.
            rows: In the order of time where ``onward`` is 1, backwards where it is -1.
            onward: See there.
        """
        for number, (a, b) in enumerate(pairwise(rows)):
            first, second = (a, b) if onward > 0 else (b, a)
            if not self.free(slot + onward * number, first, second):
                return number
        return len(rows) - 1

    def blocked(self, slot: int) -> str:
        """Which obstacle overlaps the base in a slot, as a line; "" if none does."""
        return self._in(slot).blocked

    def scene_at(self, time: float) -> Scene:
        """Where obstacles are at a time [s]."""
        scene = self._world.scene
        moved = (o if o.motion is None else replace(o, pose=o.motion.pose_at(o.pose, time)) for o in scene.obstacles)
        return replace(scene, obstacles=tuple(moved))

    def _in(self, slot: int) -> MovingWorld:
        known = self._known.get(slot)
        if known is None:
            begin, end = slot * self._slot, (slot + 1) * self._slot
            scene = self.scene_at(0.5 * (begin + end))
            kept = {
                o.name: self._room + travel(o, begin, end, self._radii[o.name]) for o in self._world.scene.obstacles
            }
            key = np.array([[*o.pose.homogeneous.ravel(), kept[o.name]] for o in scene.obstacles]).tobytes()
            if key not in self._worlds:  # where all is at rest one world serves every slot
                self._worlds[key] = MovingWorld(self._world)
                self._worlds[key].move(scene, inflation=kept)
            known = self._known[slot] = self._worlds[key]
        return known


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
    middle, ways = 0.5 * (begin + end), []
    for first, last in ((begin, middle), (middle, end)):
        stations = motion.times[(motion.times > first) & (motion.times < last)]
        poses = [motion.pose_at(obstacle.pose, float(time)) for time in (first, *stations, last)]
        ways.append(sum(_way(a, b, radius, obstacle.name) for a, b in pairwise(poses)))
    return max(ways) + (ROUNDING if max(ways) > 0.0 else 0.0)


def _way(a: pin.SE3, b: pin.SE3, radius: float, name: str) -> float:
    angle = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
    turned = radius * angle if angle > ROTATION_NOISE else 0.0
    if not np.isfinite(turned):
        raise InputError(f"obstacle '{name}' has no end and turns: no bound on its way; use a box in its place")
    return float(np.linalg.norm(b.translation - a.translation)) + turned
