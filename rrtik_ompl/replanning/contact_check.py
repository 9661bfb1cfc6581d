"""Was there contact? A run judged in continuous time, by coal alone, independent of what the run was planned with."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.bodies import Body, link_bodies, scene_bodies
from rrtik_ompl.replanning.feed import Feed
from rrtik_ompl.replanning.run import Run
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Obstacle, Scene

FINE = 10  # looks in a tick
NEAR = 0.05  # [m]; distances above are not measured


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What a dense look at a run found.

    Attributes:
        contacts: Time [s], event of the tick, link and obstacle of each tick with contact, the first of the tick.
        nearest: Smallest distance between the arm and an obstacle [m], or ``NEAR`` if it is larger; 0 for a contact.
        looks: Moments that were looked at.
    """

    contacts: tuple[tuple[float, str, str, str], ...]
    nearest: float
    looks: int


def judge(robot: Robot, run: Run, source: Scene | Feed, *, fine: int = FINE) -> Verdict:
    """Look at a run ``fine`` times a tick: the arm on its straight way, every obstacle where it really is then.

    Contact of the arm with obstacles alone: the arm with itself is no matter of time. What the arm holds counts.

    Args:
        robot: Of the run.
        run: What happened.
        source: The scene whose obstacles state their motion, or a function from any time [s] to a scene, between the
            ticks too.
        fine: Looks in a tick.
    """
    ticks, seconds = run.ticks, 1.0 / run.rate
    shares = np.arange(fine) / fine
    rows = [a.q + (b.q - a.q) * s for a, b in pairwise(ticks) for s in shares] + [ticks[-1].q]
    times = [t.time + s * seconds for t in ticks[:-1] for s in shares] + [ticks[-1].time]
    first = source if isinstance(source, Scene) else source(0.0)
    gaps, names = _gaps(robot, np.array(rows), first, _poses(source, times))
    contacts, done = [], set()
    for look in np.flatnonzero((gaps <= 0.0).any(axis=1)):
        if (tick := look // fine) not in done:
            done.add(tick)
            contacts.append((times[look], ticks[tick].event, *names[int(gaps[look].argmin())]))
    return Verdict(tuple(contacts), max(float(gaps.min(initial=NEAR)), 0.0), len(times))


def _poses(source: Scene | Feed, times: list[float]) -> dict[str, NDArray[np.float64]]:
    """Where each obstacle is at the times, shape (m, 4, 4)."""
    if isinstance(source, Scene):
        return {o.name: np.array([_place(o, time).homogeneous for time in times]) for o in source.obstacles}
    scenes = [source(time) for time in times]
    names = [o.name for o in scenes[0].obstacles]
    return {name: np.array([scene.obstacle(name).pose.homogeneous for scene in scenes]) for name in names}


def _place(obstacle: Obstacle, time: float) -> Any:
    return obstacle.pose if obstacle.motion is None else obstacle.motion.pose_at(obstacle.pose, time)


def _gaps(
    robot: Robot, rows: Matrix, scene: Scene, own: dict[str, NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[tuple[str, str]]]:
    """Distances [m] of all pairs of an arm's body and an obstacle, shape (looks, pairs), and the names of the pairs."""
    placed = scene_bodies(robot, scene)
    arm = [*link_bodies(robot), *(b for b in placed if b.kind == "attached")]
    allowed = {frozenset(pair) for pair in scene.allowed_collisions}
    moving = [b for b in placed if b.kind == "obstacle"]
    pairs = [(a, o) for a in arm for o in moving if frozenset((a.name, o.name)) not in allowed and a.joint > 0]
    frames = robot.joint_frames(rows)
    arm_poses = {id(a): frames[:, a.joint] @ a.placement.homogeneous for a in arm}
    gaps = np.full((len(rows), len(pairs)), np.inf)
    for k, (a, o) in enumerate(pairs):
        near = np.flatnonzero(_between_balls(a, arm_poses[id(a)], o, own[o.name]) < NEAR)
        for look in near:
            gaps[look, k] = _distance(a.geometry, arm_poses[id(a)][look], o.geometry, own[o.name][look])
    return gaps, [(a.name, o.name) for a, o in pairs]


def _between_balls(
    first: Body, first_poses: NDArray[np.float64], second: Body, second_poses: NDArray[np.float64]
) -> Vector:
    """Distance [m] of the balls around two bodies at many poses, shape (m, 4, 4)."""
    solids = [body.geometry for body in (first, second)]
    if isinstance(solids[1], coal.Halfspace):
        return np.full(len(first_poses), -np.inf)
    centres = [
        poses[:, :3, :3] @ np.array(solid.aabb_center) + poses[:, :3, 3]
        for poses, solid in zip((first_poses, second_poses), solids, strict=True)
    ]
    apart: Vector = np.linalg.norm(centres[0] - centres[1], axis=1) - sum(float(s.aabb_radius) for s in solids)
    return apart


def _distance(first: Any, first_pose: Matrix, second: Any, second_pose: Matrix) -> float:
    """Coal's distance of two geometries [m], 0 if they touch."""
    ends = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    if coal.collide(first, ends[0], second, ends[1], coal.CollisionRequest(), coal.CollisionResult()):
        return 0.0
    return float(coal.distance(first, ends[0], second, ends[1], coal.DistanceRequest(), coal.DistanceResult()))
