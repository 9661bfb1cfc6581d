"""Random worlds that hold every kind of obstacle, for the judge of contacts."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pinocchio as pin

from rrtik_ompl import AttachedObject, Obstacle, PointCloud, Robot, Scene, World, load_robot
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Shape, Sphere
from rrtik_ompl.model.shapes.surfaces import revolved

ROBOTS = (
    *("titan4", "panda", "panda_primitives", "ur5_gripper", "ur10", "kinova"),
    *("xarm7", "z1", "so101", "puma560", "talos_left_arm", "baxter_left"),
)
LEAST_FREE = 0.05  # of the drawn configurations
LOOKS = 256
TRIES = 8
SIZES = (0.1, 0.25, 0.5)  # [m]
SHAPES = 4  # of each kind and size
RINGS, SEGMENTS = 7, 9  # of a ball of triangles


def _box(rng: np.random.Generator, size: float) -> Shape:
    return Box(size * rng.uniform(0.3, 1.0, 3))


def _ball(rng: np.random.Generator, size: float) -> Shape:
    return Sphere(0.5 * size * rng.uniform(0.3, 1.0))


def _capsule(rng: np.random.Generator, size: float) -> Shape:
    return Capsule(0.3 * size * rng.uniform(0.2, 1.0), size * rng.uniform(0.3, 1.0))


def _cylinder(rng: np.random.Generator, size: float) -> Shape:
    return Cylinder(0.5 * size * rng.uniform(0.3, 1.0), size * rng.uniform(0.1, 1.0))


def _prism(rng: np.random.Generator, size: float) -> Shape:
    """A star of some corners: not convex."""
    corners = int(rng.integers(5, 9))
    angles = np.sort(np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False) + rng.uniform(0.0, 0.3, corners))
    radii = 0.5 * size * rng.uniform(0.3, 1.0, corners)
    return Prism(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]), size * rng.uniform(0.1, 0.8))


def _ball_of_triangles(radii: Callable[[Matrix], Vector]) -> Mesh:
    """A closed mesh: the corners of a coarse ball, each moved to a distance from its middle."""
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, RINGS)
    ball = revolved(np.cos(latitude), np.sin(latitude), SEGMENTS)
    return Mesh(ball.vertices * radii(ball.vertices)[:, None], ball.faces)


def _convex_mesh(rng: np.random.Generator, size: float) -> Shape:
    axes = 0.5 * size * rng.uniform(0.4, 1.0, 3)
    return _ball_of_triangles(lambda points: 1.0 / np.linalg.norm(points / axes, axis=1))


def _dented_mesh(rng: np.random.Generator, size: float) -> Shape:
    waves = rng.uniform(2.0, 5.0, 3)
    return _ball_of_triangles(lambda points: 0.5 * size * (0.7 + 0.3 * np.cos(points @ np.diag(waves)).prod(axis=1)))


def _open_mesh(rng: np.random.Generator, size: float) -> Shape:
    """A wavy sheet."""
    side = np.linspace(-0.5, 0.5, 6) * size
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    points = np.column_stack([x, y, 0.1 * size * rng.uniform(-1.0, 1.0, len(x))])
    at = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    return Mesh(points, np.concatenate([np.column_stack([at, at + 1, at + 7]), np.column_stack([at, at + 7, at + 6])]))


def _cloud(rng: np.random.Generator, size: float) -> Shape:
    points = rng.normal(size=(400, 3))
    points *= 0.5 * size / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.8, 1.0, (400, 1))
    return PointCloud(points, 0.05 * size)


KINDS: dict[str, Callable[[np.random.Generator, float], Shape]] = {
    "box": _box, "ball": _ball, "capsule": _capsule, "cylinder": _cylinder, "prism": _prism,
    "convex mesh": _convex_mesh, "dented mesh": _dented_mesh, "sheet": _open_mesh, "cloud": _cloud,
}  # fmt: skip
HELD = [kind for kind in KINDS if kind not in ("cloud", "sheet")]


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


@cache
def _reach(name: str) -> float:
    """Farthest that the tip comes from the base [m]."""
    robot, rng = _robot(name), np.random.default_rng(0)
    tips = robot.fk_batch(rng.uniform(*robot.finite_range(), (500, robot.dof)))
    return float(np.linalg.norm(tips[:, :3, 3], axis=1).max())


@cache
def _shape(kind: str, number: int, size: float) -> Shape:
    """One of a few shapes of a kind, so that what is made of them once is made seldom."""
    return KINDS[kind](np.random.default_rng([list(KINDS).index(kind), number]), size)


def contact_world(rng: np.random.Generator, name: str) -> World:
    """A world of a robot with an obstacle of each kind, some with margins, and often something in the hand.

    What leaves the arm too little room is drawn again, farther away and without the thing in the hand.
    """
    robot, reach = _robot(name), _reach(name)
    shapes = {kind: _drawn(rng, kind) for kind in KINDS}
    own = float(rng.choice([0.0, 0.0, 0.002]))
    for attempt in range(TRIES):
        least = 0.2 + 0.1 * attempt
        obstacles = tuple(_obstacle(rng, kind, shape, reach, least) for kind, shape in shapes.items())
        floor = Obstacle("floor", HalfSpace(_way(rng), -reach * rng.uniform(least, 1.0 + 0.1 * attempt)))
        held = (_held(rng, robot, reach),) if rng.random() < 0.6 and attempt < TRIES // 2 else ()
        world = World(robot, Scene((*obstacles, floor), held), self_margin=own)
        rows = rng.uniform(*robot.finite_range(), (LOOKS, robot.dof))
        if world.valid_batch(rows).mean() > LEAST_FREE:
            break
    return world


def _drawn(rng: np.random.Generator, kind: str, sizes: tuple[float, ...] = SIZES) -> Shape:
    return _shape(kind, int(rng.integers(SHAPES)), float(rng.choice(sizes)))


def _way(rng: np.random.Generator) -> Vector:
    way: Vector = rng.normal(size=3)
    return way / np.linalg.norm(way)


def _place(rng: np.random.Generator, distance: float) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(size=3)), distance * _way(rng))


def _obstacle(rng: np.random.Generator, kind: str, shape: Shape, reach: float, least: float) -> Obstacle:
    margin = float(rng.choice([0.0, 0.0, 0.01])) * rng.random()
    return Obstacle(kind, shape, _place(rng, reach * rng.uniform(least, 1.0 + least)), margin=margin)


def _held(rng: np.random.Generator, robot: Robot, reach: float) -> AttachedObject:
    """A solid at the last link; it may touch the links before that."""
    solid = {robot.link_of(item) for item in robot.collision.geometryObjects}
    links = [name for name in robot.link_names if name in solid]
    kind = HELD[rng.integers(len(HELD))]
    return AttachedObject(
        "held", links[-1], _drawn(rng, kind, SIZES[:1]), _place(rng, 0.1 * reach), allow=tuple(links[-4:-1])
    )
