"""Worlds of several robots among random obstacles, and random paths in them that are proven free."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.model.certificate import Certificate
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from rrtik_ompl.world.world import World

WAYPOINTS = 7
STEP = 0.8  # [rad] or [m] from one waypoint to the next, about
DENTED = [[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)] + [[0.0, 0.0, -0.03]]
FACES = (  # of a block whose top is pushed in
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4)),
    *((1, 5, 8), (5, 7, 8), (7, 3, 8), (3, 1, 8)),
)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A path, the world that it is free in, and what proves that."""

    world: World
    path: JointPath
    certificate: Certificate


def random_scene(robot: Robot, rng: np.random.Generator, margin: float = 0.002) -> Scene:
    """Solids of each kind around an arm, a mesh that is not convex and a half-space below it among them."""
    reach = 3.0 if "planar" in robot.name else 0.9
    solids = [Box([0.2, 0.1, 0.3]), Sphere(0.1), Cylinder(0.05, 0.4), Box([0.3, 0.3, 0.02]), Mesh(DENTED, FACES)]
    places = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-reach, reach, 3)) for _ in solids]
    found = [
        Obstacle(f"solid {k}", solid, place, margin=margin)
        for k, (solid, place) in enumerate(zip(solids, places, strict=True))
    ]
    return Scene((*found, Obstacle("floor", HalfSpace([0.1, 0.0, 1.0], -1.1), pin.SE3.Identity())))


def random_path(world: World, rng: np.random.Generator, clearance: float) -> JointPath | None:
    """A path through random configurations, each motion proven to keep a clearance [m]; None if none is found soon."""
    robot = world.robot
    lower, upper = robot.finite_range()
    drawn = rng.uniform(lower, upper, (200, robot.dof))
    free = drawn[world.motions_proven(drawn, drawn, clearance=clearance)]
    route = list(free[:1])
    for _ in range(10):
        if not route or len(route) == WAYPOINTS:
            break
        size = STEP * rng.uniform(0.05, 1.0, (50, 1)) / np.sqrt(robot.dof)
        ahead = np.clip(route[-1] + rng.normal(0.0, 1.0, (50, robot.dof)) * size, lower, upper)
        tails = np.repeat(route[-1][None], len(ahead), axis=0)
        route += list(ahead[world.motions_proven(tails, ahead, clearance=clearance)][:1])
    return JointPath.of(robot, np.array(route)) if len(route) == WAYPOINTS else None


def random_cases(robot: Robot, seed: int, clearance: float = 0.001) -> Iterator[Case]:
    """Paths in ever new scenes, without end."""
    rng = np.random.default_rng(seed)
    while True:
        world = World(robot, random_scene(robot, rng))
        for _ in range(5):
            path = random_path(world, rng, clearance)
            found = None if path is None else world.certificate(path, clearance)
            if path is not None and found is not None:
                yield Case(world, path, found)


def inner_point(world: World, q: Vector, rng: np.random.Generator) -> Vector:
    """A point inside a moving link at a configuration, shape (3,)."""
    moving = [body for body in world.bodies if body.joint > 0 and convex_solids(body.geometry).around]
    body = moving[int(rng.integers(len(moving)))]
    solid = convex_solids(body.geometry).around[0]
    frame: Matrix = world.robot.joint_frames(q[None])[0][body.joint] @ body.placement.homogeneous
    return np.asarray(frame[:3, :3] @ solid.corners.mean(axis=0) + frame[:3, 3])
