"""Contacts of a run, checked densely in time by coal alone, independent of what the run was planned with."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.cloud_solid import cloud_gap, has_cloud, nearest_of_cloud
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses, pose_at
from rrtik_ompl.model.shapes import same_shape
from rrtik_ompl.replanning.feed import Feed
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.world.arrangement import arranged

SAMPLES_PER_TICK = 10
MAX_DISTANCE = 0.05  # [m]; larger distances are not measured


@dataclass(frozen=True, slots=True, eq=False)
class ContactReport:
    """What a dense check of a run found.

    Attributes:
        contacts: Time [s], event of the tick, link and obstacle of each tick with contact, the first of the tick.
        nearest: Smallest distance between the arm and an obstacle [m], at most ``MAX_DISTANCE``; 0 for a contact.
        samples: Number of times that were checked.
    """

    contacts: tuple[tuple[float, str, str, str], ...]
    nearest: float
    samples: int


def check_contacts(
    robot: Robot, run: ReplanRun, source: Scene | Feed, *, samples_per_tick: int = SAMPLES_PER_TICK
) -> ContactReport:
    """Check a run ``samples_per_tick`` times a tick: the arm moves straight, obstacles are where the source says.

    Contacts of the arm, with what it holds, and obstacles; self-collision does not depend on time and is left out.

    Args:
        robot: Of the run.
        run: The record.
        source: The scene whose obstacles state their motion, or a function from any time [s] to a scene, between the
            ticks too.
        samples_per_tick: Number of checks in a tick.

    Raises:
        InputError: If a cloud does not keep its points.
    """
    ticks = run.ticks
    seconds = 1.0 / run.rate
    shares = np.arange(samples_per_tick) / samples_per_tick
    rows = [a.q + (b.q - a.q) * s for a, b in pairwise(ticks) for s in shares] + [ticks[-1].q]
    times = [t.time + s * seconds for t in ticks[:-1] for s in shares] + [ticks[-1].time]

    first = source if isinstance(source, Scene) else source(0.0)
    gaps, names = _gaps(robot, np.array(rows), first, _poses(source, times))

    contacts = []
    ticks_in_contact = set()
    for sample in np.flatnonzero((gaps <= 0.0).any(axis=1)):
        if (tick := sample // samples_per_tick) not in ticks_in_contact:
            ticks_in_contact.add(tick)
            contacts.append((times[sample], ticks[tick].event, *names[int(gaps[sample].argmin())]))

    return ContactReport(tuple(contacts), max(float(gaps.min(initial=MAX_DISTANCE)), 0.0), len(times))


def _poses(source: Scene | Feed, times: list[float]) -> dict[str, NDArray[np.float64]]:
    """Where each obstacle is at the times, shape (m, 4, 4)."""
    if isinstance(source, Scene):
        return {o.name: _course(o, np.array(times)) for o in source.obstacles}

    scenes = [source(time) for time in times]
    names = [o.name for o in scenes[0].obstacles]
    for name in names:
        shape = scenes[0].obstacle(name).shape
        if any(not same_shape(scene.obstacle(name).shape, shape) for scene in scenes):
            raise InputError(f"check of contacts: '{name}' has other points later; check such a run tick by tick")
    return {name: np.array([scene.obstacle(name).pose.homogeneous for scene in scenes]) for name in names}


def _course(obstacle: Obstacle, times: Vector) -> NDArray[np.float64]:
    """Where an obstacle is at times, shape (m,), by its motion, shape (m, 4, 4)."""
    motion = obstacle.motion
    if not isinstance(motion, TimedPoses) or len(motion.times) < 2:
        return np.array([pose_at(obstacle, time).homogeneous for time in times.tolist()])
    stations = np.array([pose.homogeneous for pose in motion.poses])
    if (stations[:, :3, :3] != stations[0, :3, :3]).any():
        return np.array([pose_at(obstacle, time).homogeneous for time in times.tolist()])

    # One that does not turn is moved at once.
    after = np.clip(np.searchsorted(motion.times, times, side="right"), 1, len(stations) - 1)
    shares = (times - motion.times[after - 1]) / (motion.times[after] - motion.times[after - 1])
    shares = np.clip(shares, 0.0, 1.0)[:, None]
    poses = np.repeat(stations[:1], len(times), axis=0)
    poses[:, :3, 3] = (1.0 - shares) * stations[after - 1, :3, 3] + shares * stations[after, :3, 3]
    return poses


def _gaps(
    robot: Robot, rows: Matrix, scene: Scene, obstacle_poses: dict[str, NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[tuple[str, str]]]:
    """Distances [m] of all pairs of an arm's body and an obstacle, shape (samples, pairs), and the pairs' names."""
    solids = arranged(robot, scene, 0.0)
    bodies = solids.bodies.as_tuple
    frames = robot.joint_frames(rows)
    body_poses = [
        obstacle_poses[body.name] @ body.within.homogeneous
        if body.kind == "obstacle"
        else frames[:, body.joint] @ body.placement.homogeneous
        for body in bodies
    ]

    both = (sorted(pair, key=lambda number: bodies[number].kind == "obstacle") for pair in solids.moving)
    pairs = sorted((arm, other) for arm, other in both if bodies[other].kind == "obstacle")

    gaps = np.full((len(rows), len(pairs)), np.inf)
    for k, (arm, other) in enumerate(pairs):
        near = _sphere_distances(bodies[arm], body_poses[arm], bodies[other], body_poses[other]) < MAX_DISTANCE
        for sample in np.flatnonzero(near):
            gaps[sample, k] = _distance(
                bodies[arm].geometry, body_poses[arm][sample], bodies[other].geometry, body_poses[other][sample]
            )

    return gaps, [(bodies[arm].name, bodies[other].name) for arm, other in pairs]


def _sphere_distances(
    first: Body, first_poses: NDArray[np.float64], second: Body, second_poses: NDArray[np.float64]
) -> Vector:
    """Distance [m] of the spheres around two bodies at many poses, shape (m, 4, 4)."""
    solids = [body.geometry for body in (first, second)]
    if isinstance(solids[1], coal.Halfspace):
        return np.full(len(first_poses), -np.inf)

    centres = [
        poses[:, :3, :3] @ np.array(solid.aabb_center) + poses[:, :3, 3]
        for poses, solid in zip((first_poses, second_poses), solids, strict=True)
    ]
    distances: Vector = np.linalg.norm(centres[0] - centres[1], axis=1) - sum(float(s.aabb_radius) for s in solids)
    return distances


def _distance(
    first: coal.CollisionGeometry, first_pose: Matrix, second: coal.CollisionGeometry, second_pose: Matrix
) -> float:
    """Coal's distance of two geometries [m], 0 if they touch."""
    poses = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    solids = (first, poses[0], second, poses[1])
    if has_cloud(solids):
        return max(0.0, nearest_of_cloud(solids).distance) if cloud_gap(solids, 0.0) is not None else 0.0
    if coal.collide(*solids, coal.CollisionRequest(), coal.CollisionResult()):
        return 0.0
    return float(coal.distance(*solids, coal.DistanceRequest(), coal.DistanceResult()))
