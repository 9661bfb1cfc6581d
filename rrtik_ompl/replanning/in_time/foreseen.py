"""The scene in each slot of time by the stated motions; motions of the arm are proven free for the whole slot.

For a slot, each obstacle is put where it is in the middle of the slot, and inflated by the largest travel of any of its
points from there to an end of the slot. So a straight motion of the arm that is proven free of the inflated obstacle at
rest is free of the moving one at every time of the slot. The same holds for several slots at once.
"""

from __future__ import annotations

from dataclasses import replace
from hashlib import blake2b
from itertools import pairwise

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.base.poses import travel_bound
from rrtik_ompl.geometry.collision.bodies import Body, kept_apart
from rrtik_ompl.geometry.collision.certificate import distance
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses, pose_at
from rrtik_ompl.replanning.travels import states_rest, turns_without_end
from rrtik_ompl.world.moving_world import MovingProver
from rrtik_ompl.world.world import World

ROUNDING = 1e-9  # [m]: rounding of places that are computed from times
MOST_PROVERS = 1024  # that are kept at once, as there may be ten thousand slots
LEVELS = 4  # of blocks: of 1, 2, 4 and 8 slots
FINEST = 5e-5  # [m]: an obstacle that may touch the base within a way of this length counts as touching it


class ForeseenWorlds:
    """Checks which straight motions are free in which slots, among obstacles as they are in each block of slots.

    A block is a number of slots that is a power of two, and begins at a multiple of that number. Obstacles are placed
    for a block when it is needed. Where the arm has room a motion is proven for a whole block, else slot by slot.

    Args:
        world: The robot and the scene, whose obstacles state their motions.
        slot: Length of a slot [s].
        clearance: Distance that the arm keeps from every obstacle in addition to that obstacle's margin [m].

    Raises:
        InputError: If an unbounded obstacle turns.
    """

    def __init__(self, world: World, slot: float, clearance: float) -> None:
        self._world = world.with_accuracy("exact")
        self._slot = slot
        self._clearance = clearance
        self._travels = {o.name: Travel(o, farthest(o.shape, pin.SE3.Identity())) for o in world.scene.obstacles}

        room = world.settings.clearance
        self._bodies = [replace(b, margin=b.margin + room) if b.kind == "obstacle" else b for b in world.bodies]
        pairs = tuple(pair for pair in world.pairs if any(world.bodies[k].joint for k in pair))
        self._first = MovingProver(world.robot, tuple(self._bodies), pairs)
        self._provers: dict[bytes, MovingProver] = {}
        self._keys: dict[tuple[int, int], bytes] = {}  # key in ``_provers`` for each level and number of a block
        self._rng = np.random.default_rng(0)

    def free(self, slot: int, a: Vector, b: Vector) -> bool:
        """Check whether the straight motion from a to b, shape (n,), inside the limits, is proven free in a slot."""
        return self._free(0, slot, a, b)

    def steps_free(self, slot: int, rows: Matrix, onward: int, stop: Stop) -> int:
        """Return how many of the motions from row to row are free, one slot for each, up to the first blocked one.

        Args:
            slot: Slot of the first motion.
            rows: Configurations on a straight line, shape (k, n), none of which is farther back than the one before it:
                in the order of time if ``onward`` is 1, backwards if it is -1.
            onward: 1 if each motion is one slot later than the one before it, -1 if it is one slot earlier.
            stop: Ends the check when it returns True; motions that were not checked count as blocked.
        """
        count = len(rows) - 1
        done = 0
        level = LEVELS - 1
        while done < count and not stop():
            # The largest block that begins here and ends before the last motion does.
            here = slot + done if onward > 0 else slot - done + 1
            while here % (1 << level) or done + (1 << level) > count:
                level -= 1

            first = here if onward > 0 else here - (1 << level)
            ends = rows[done], rows[done + (1 << level)]
            if self._free(level, first >> level, *ends[::onward]):
                done += 1 << level
                level = LEVELS - 1
            elif level == 0:
                break
            else:
                level -= 1
        return done

    def _free(self, level: int, block: int, a: Vector, b: Vector) -> bool:
        """Check whether a straight motion is proven free in a block of ``2**level`` slots."""
        return bool(self._prover_of(level, block).proven(a[None], b[None])[0])

    def base_reached(self, until: float) -> tuple[float, str]:
        """Find when a moving obstacle first touches a part of the robot that no joint moves.

        Nothing is free from then on. The worlds of the slots do not show this contact reliably, since an obstacle may
        touch the base between the middles of two slots.

        Args:
            until: Only contacts before this time count [s].

        Returns:
            The time [s] and a line that says which obstacle touches which body; inf and "" if there is no contact.
        """
        obstacles = {o.name: o for o in self._world.scene.obstacles if o.motion is not None}
        bodies = self._world.bodies
        first_touch = (float("inf"), "")

        for pair in self._world.pairs:
            base_part, obstacle_body = sorted((bodies[k] for k in pair), key=lambda body: body.kind == "obstacle")
            if base_part.joint == obstacle_body.joint == 0 and obstacle_body.name in obstacles:
                limit = min(until, first_touch[0])
                rest = base_part.placement.homogeneous
                obstacle = obstacles[obstacle_body.name]
                time = self._first_touch((base_part, rest, 0.0), obstacle_body, obstacle, 0.0, limit)
                if time is not None:
                    pair_reached = f"'{obstacle_body.name}' reaches '{base_part.name}' at {time:.3g} s"
                    first_touch = time, f"{pair_reached}, and the base cannot give way"

        return first_touch

    def rest_ends(self, q: Vector, begin: float, until: float) -> float:
        """Find when an obstacle first comes nearer to an arm at rest than it has to keep.

        Args:
            q: The configuration, shape (n,), free at ``begin``.
            begin: From when the arm rests [s].
            until: Up to when obstacles are looked at that never come to rest [s].

        Returns:
            The time [s]: until then the arm is proven free; inf if it is for ever.
        """
        obstacles = {o.name: o for o in self._world.scene.obstacles if o.motion is not None and not states_rest(o)}
        bodies = self._world.bodies
        frames = self._world.robot.chain.joint_frames(q[None])[0]
        clearance = self._clearance + self._world.settings.clearance
        ends = float("inf")

        for pair in self._world.pairs:
            part, obstacle_body = sorted((bodies[k] for k in pair), key=lambda body: body.kind == "obstacle")
            obstacle = obstacles.get(obstacle_body.name)
            if part.kind == "obstacle" or obstacle is None:
                continue

            rest = frames[part.joint] @ part.placement.homogeneous
            kept = kept_apart(part, obstacle_body) + clearance if part.joint else 0.0

            # What comes to rest at some time comes no nearer after that.
            motion = obstacle.motion
            stop = max(float(motion.times[-1]), begin) if isinstance(motion, TimedPoses) else None
            last = until if stop is None else stop
            time = self._first_touch((part, rest, kept), obstacle_body, obstacle, begin, min(last, ends))
            if time is not None:
                ends = time
            elif stop is None:
                ends = min(ends, until)

        return ends

    def _first_touch(
        self, body: tuple[Body, Matrix, float], obstacle_body: Body, obstacle: Obstacle, begin: float, end: float
    ) -> float | None:
        """Find by bisection when an obstacle first touches a body at rest between two times [s].

        An interval is free if the distance at its middle exceeds the obstacle's travel to its ends.

        Args:
            body: The body, its pose, shape (4, 4), and the distance at which it counts as touched [m].
            obstacle_body: A piece of the obstacle.
            obstacle: The obstacle with its stated motion.
            begin: See above.
            end: See above.

        Returns:
            The time [s], or None if the two are proven apart in the whole interval.
        """
        middle = 0.5 * (begin + end)
        reach = self._travels[obstacle.name].from_middle(begin, end)
        pose = pose_at(obstacle, middle) * obstacle_body.within
        part, rest, kept = body
        if distance(part.geometry, rest, obstacle_body.geometry, pose.homogeneous, kept + reach) is not None:
            return None

        if reach <= FINEST:
            return begin
        first_touch = self._first_touch(body, obstacle_body, obstacle, begin, middle)
        if first_touch is not None:
            return first_touch
        return self._first_touch(body, obstacle_body, obstacle, middle, end)

    def scene_at(self, time: float) -> Scene:
        """Return the scene with obstacles at their poses at a time [s]."""
        scene = self._world.scene
        return replace(scene, obstacles=tuple(replace(o, pose=pose_at(o, time)) for o in scene.obstacles))

    def _prover_of(self, level: int, block: int) -> MovingProver:
        """Return the prover of a block; blocks with the same places and distances share one."""
        key = self._keys.get((level, block))
        if key is not None and key in self._provers:
            return self._provers[key]

        begin = self._slot * (block << level)
        end = self._slot * ((block + 1) << level)
        poses = {o.name: pose_at(o, 0.5 * (begin + end)) for o in self._world.scene.obstacles}
        room = {name: self._clearance + travel.from_middle(begin, end) for name, travel in self._travels.items()}
        places = np.array([[*poses[name].homogeneous.ravel(), room[name]] for name in poses])

        key = self._keys[level, block] = blake2b(places.tobytes(), digest_size=16).digest()
        if key not in self._provers:
            bodies = [
                replace(body, placement=poses[body.name] * body.within) if body.kind == "obstacle" else body
                for body in self._bodies
            ]
            prover = self._prover_to_place()
            prover.place(bodies, [room.get(body.name, 0.0) for body in bodies], always_colliding=False)
            self._provers[key] = prover
        return self._provers[key]

    def _prover_to_place(self) -> MovingProver:
        """Return a new prover, or a random one of those that are kept if there are too many.

        The oldest one would be a bad choice: searches go through the slots in order, so it would be needed next.
        """
        if len(self._provers) < MOST_PROVERS:
            return self._first.elsewhere()
        return self._provers.pop(list(self._provers)[int(self._rng.integers(len(self._provers)))])


class Travel:
    """Upper bounds on how far the points of an obstacle go by its stated motion.

    Args:
        obstacle: The obstacle.
        radius: Distance of its farthest point from its origin [m]; inf if it is unbounded.
    """

    def __init__(self, obstacle: Obstacle, radius: float) -> None:
        self._name = obstacle.name
        self._speed = 0.0
        self._times = np.zeros(1)
        self._ways = np.zeros(0)  # from each pose that is stated to the next one [m]
        match obstacle.motion:
            case ConstantVelocity(velocity=velocity):
                self._speed = float(np.linalg.norm(velocity))
            case TimedPoses(times=times, poses=poses):
                self._times = times
                self._ways = np.array([travel_bound(a, b, radius) for a, b in pairwise(poses)])

    def from_middle(self, begin: float, end: float) -> float:
        """Return an upper bound on the way of any point from the middle of an interval to either end [m].

        Args:
            begin: Begin of the interval [s].
            end: End of the interval [s].

        Raises:
            InputError: If the obstacle turns and is unbounded.
        """
        middle = 0.5 * (begin + end)
        longest = max(self._way(begin, middle), self._way(middle, end))
        return longest + (ROUNDING if longest > 0.0 else 0.0)

    def _way(self, begin: float, end: float) -> float:
        """Return how far a point goes between two times at most [m]; between two poses its speed is even."""
        first = self._times[:-1]
        last = self._times[1:]
        shares = (np.minimum(last, end) - np.maximum(first, begin)) / (last - first)
        meant = shares > 0.0
        way = self._speed * (end - begin) + float(shares[meant] @ self._ways[meant])
        if not np.isfinite(way):
            raise turns_without_end(self._name)
        return way
