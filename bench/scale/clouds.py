"""Clouds of points: what they cost to make, in checks and in whole plans; every path is compared with the points."""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import coal
import numpy as np

from bench.scale.boxes import BUSY, PLANNER
from bench.shared.clocks import spent
from rrtik_ompl import Obstacle, PointCloud, Problem, ProblemError, Robot, Scene, World, load_robot, plan
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

RADIUS = 0.005  # [m] of a point
STEP = 0.02  # [rad] between the configurations of a path that are compared with the points
ROWS, MADE = 2000, 3


@dataclass(frozen=True)
class Seen:
    """A problem whose obstacles are points: times [ms, us, ms], and what became of it.

    ``plan``: the default call; ``named``: the planner; ``state``: "planned", "swallowed" (the start or the goal is
    among the points) or "not found"; ``nearest``: how far the arm is from the points' balls, at least [m].
    """

    state: str
    build: float = 0.0
    world: float = 0.0
    check: float = 0.0
    plan: float = 0.0
    named: float = 0.0
    proven: bool = False
    nearest: float = float("inf")


@cache
def _panda(folder: str) -> Robot:
    return load_robot(Path(folder) / "panda.urdf", srdf=Path(folder) / "panda.srdf", group="panda_arm")


def files_of(folder: Path, count: int) -> list[str]:
    """The first problems of each family in turn, so many in all."""
    families = [sorted(each.glob("scene*.yaml")) for each in sorted((folder / "problems").iterdir())]
    return [str(files[k]) for k in range(max(map(len, families))) for files in families if k < len(files)][:count]


def sampled(scene: Scene, count: int) -> Matrix:
    """Points on the surfaces of a scene's obstacles, evenly by area, shape (count, 3)."""
    rng, corners = np.random.default_rng(7), []
    for obstacle in scene.obstacles:
        vertices, faces = obstacle.shape.surface()
        corners.append((vertices @ obstacle.pose.rotation.T + obstacle.pose.translation)[faces])
    triangles = np.concatenate(corners)
    a, b, c = (triangles[:, k] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = rng.choice(len(areas), count, p=areas / areas.sum())
    u, v = np.sqrt(rng.uniform(size=count)), rng.uniform(size=count)
    shares = np.stack([1.0 - u, u * (1.0 - v), u * v], axis=1)
    points: Matrix = np.einsum("nk,nki->ni", shares, triangles[chosen])
    return points


def seen_as_points(file: str, folder: str, count: int, judged: bool) -> Seen:
    """A problem of MotionBenchMaker with its obstacles as points, planned once."""
    robot = _panda(folder)
    problem = load_motion_bench_maker(file, robot=robot)
    points = sampled(problem.world.scene, count)
    builds = [spent(lambda: PointCloud(points, RADIUS).tree)[0] for _ in range(MADE)]
    cloud = PointCloud(points, RADIUS)
    made, world = spent(partial(World, robot, Scene((Obstacle("cloud", cloud),))))
    rows = np.random.default_rng(2).uniform(*robot.finite_range(), (ROWS, robot.dof))
    world.valid_batch(rows)
    check = min(spent(partial(world.valid_batch, rows))[0] for _ in range(MADE)) / ROWS
    cost = partial(Seen, build=1e3 * min(builds), world=1e3 * made, check=1e6 * check)
    try:
        asked = Problem(world, problem.start, problem.goal)
    except ProblemError:
        return cost("swallowed")
    calls = (partial(plan, asked, seconds=BUSY), partial(plan, asked, PLANNER, seconds=BUSY, shorten=False))
    for call in calls:
        call(seed=2)
    (taken, found), (named, _) = (spent(partial(call, seed=1)) for call in calls)
    cost = partial(cost, plan=1e3 * taken, named=1e3 * named)
    if found.path is None:
        return cost("not found")
    gap = nearest(robot, found.path.waypoints, cloud) if judged else float("nan")
    return cost("planned", proven=bool(found.proven), nearest=gap)


def nearest(robot: Robot, waypoints: Matrix, cloud: PointCloud) -> float:
    """The least distance of the moving links to the points' balls along a path [m], by coal, a point at a time.

    Points farther from a link's bounding box than the least so far are left out. ``inf`` if all are 2 cm away or more.
    """
    parts = [waypoints[-1:]]
    for a, b in pairwise(waypoints):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / STEP)))
        parts.append(a + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (b - a))
    rows = np.concatenate(parts)
    points, least, found = cloud.points.astype(np.float64), cloud.radius + 0.02, float("inf")
    here, ball = coal.Transform3s(), coal.Sphere(cloud.radius)
    for frames in robot.joint_frames(rows):
        for body in link_bodies(robot):
            if body.joint == 0:
                continue
            place = frames[body.joint] @ body.placement.homogeneous
            box = body.geometry.aabb_local
            local = (points - place[:3, 3]) @ place[:3, :3]
            away = np.maximum(np.maximum(np.array(box.min_) - local, local - np.array(box.max_)), 0.0)
            near = np.linalg.norm(away, axis=1)
            for k in np.flatnonzero(near < least)[np.argsort(near[near < least])].tolist():
                if near[k] >= least:
                    break
                result = coal.DistanceResult()
                where = coal.Transform3s(np.eye(3), local[k])
                gap = coal.distance(body.geometry, here, ball, where, coal.DistanceRequest(), result)
                if gap + cloud.radius < least:
                    least, found = gap + cloud.radius, gap
    return found


def memory_of(count: int) -> float:
    """Memory of a cloud, its tree and its world's tables beside the points given [MB]."""
    points, robot = np.random.default_rng(0).uniform(0.4, 1.4, (count, 3)).astype(np.float32), load_robot("panda")
    World(robot)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    cloud = PointCloud(points, RADIUS)
    world = World(robot, Scene((Obstacle("cloud", cloud),)))
    world.valid(robot.posture("default"))
    held = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return float(held / 1e6 + points.nbytes / 1e6)
