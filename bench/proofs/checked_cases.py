"""True certificates for checkers: arms, scenes and motions of all kinds, with path constraints that these keep."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from bench.proofs.cases import DENTED, FACES, random_path
from bench.proofs.forgeries import Case, frame_poses
from bench.proofs.forgery_judge import Judge, outside
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.urdf import robot_from_urdf
from rrtik_ompl.model.certificate import Route
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    Octree,
    PointCloud,
    Prism,
    Sphere,
)
from rrtik_ompl.motion.trajectory.splines import Splines
from rrtik_ompl.world.world import World
from rrtik_robots.example_arms import data_folder

CLEARANCE = 0.001  # [m]
PLANAR = 4  # links of the planar arm
FEWEST_PLANES = 3  # of a certificate, as those of paths far from everything offer little to forge
PLANE = 9  # numbers of an entry with a plane
HOLDING = 4  # links at the end of an arm that what it holds may touch, and that path constraints are of
ROOM = 1.2  # factor on what a path constraint has to allow
LARGEST_ANGLE = 1.3  # [rad] of a path constraint
DEPTH = 16  # levels of a file of OctoMap
MIDDLE = 1 << (DEPTH - 1)  # number of the cell at its origin
LEAF, INNER = 2, 3  # kinds of children there


def planar_urdf(links: int = PLANAR) -> str:
    """Return the URDF of an arm that turns about z alone, of boxes and capsules."""
    parts = ['<robot name="planar"><link name="base"/>']
    for k in range(links):
        shape = '<box size="0.5 0.06 0.06"/>' if k % 2 else '<capsule radius="0.03" length="0.5"/>'
        turned = "0 0 0" if k % 2 else "0 1.5707963267948966 0"
        parts.append(
            f'<link name="link{k}"><collision><origin xyz="0.3 0 0" rpy="{turned}"/>'
            f"<geometry>{shape}</geometry></collision></link>"
            f'<joint name="joint{k}" type="revolute"><parent link="{f"link{k - 1}" if k else "base"}"/>'
            f'<child link="link{k}"/><origin xyz="{0.65 if k else 0} 0 0"/><axis xyz="0 0 1"/>'
            '<limit lower="-2.8" upper="2.8" velocity="1" effort="1"/></joint>'
        )
    return "\n".join([*parts, "</robot>\n"])


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A robot, and the files that describe it."""

    robot: Robot
    files: tuple[str, ...]


def arm_of(name: str, folder: Path) -> Arm:
    """Return an arm by its name in `ARMS` or `KINDS`."""
    name = name.split()[0]
    example = data_folder()
    known: dict[str, list[Any]] = {
        "titan4": [str(files("rrtik_robots.titan4").joinpath(f"titan4.{kind}")) for kind in ("urdf", "srdf")],
        "ur5": [
            example / "ur_description/urdf/ur5_robot.urdf",
            example / "ur_description/srdf/ur5_joint_limited_robot.srdf",
        ],
        "panda": [example / "panda_description/urdf/panda.urdf", example / "panda_description/srdf/panda.srdf"],
        "so101": [example / "so_arm_description/urdf/so101.urdf"],
    }
    if name in known:
        return Arm(_loaded(name), tuple(map(str, known[name])))
    urdf = folder / "planar.urdf"
    urdf.write_text(planar_urdf())
    return Arm(robot_from_urdf(urdf), (str(urdf),))


@cache
def _loaded(name: str) -> Robot:
    """Return a robot by its name, the same each time, as much is remembered of it."""
    from rrtik_ompl import load_robot

    return load_robot(name)


def random_scene(arm: str, robot: Robot, folder: Path, rng: np.random.Generator) -> Scene:
    """Return obstacles of every kind around an arm; those that come from files are written to a folder."""
    arm, *kinds = arm.split()
    reach = {"planar": 2.4, "titan4": 1.6, "so101": 0.4}.get(arm, 0.9)
    size = reach / 0.9
    mesh = _dented(folder, size)
    points = 0.1 * size * rng.normal(size=(40, 3))
    cloud = PointCloud(points, radius=0.02 * size).save(folder / f"cloud{rng.integers(1 << 30)}.ply")
    corner = size * np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.3], [0.0, 0.3]])
    solids = [
        Box(size * np.array([0.2, 0.1, 0.3])), Sphere(0.1 * size), Cylinder(0.05 * size, 0.4 * size),
        Capsule(0.04 * size, 0.3 * size), Box(size * np.array([0.3, 0.3, 0.02])), Prism(corner, 0.2 * size),
        mesh, cloud,
    ]  # fmt: skip
    chosen = rng.permutation(len(solids))[:6].tolist()
    if "piles" in kinds:
        solids += [_cells(folder, size, rng), _ground(folder, size, rng)]
        chosen = [*chosen[:3], len(solids) - 2, len(solids) - 1]
    places = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-reach, reach, 3)) for _ in chosen]
    obstacles = [
        Obstacle(f"solid {k}", solids[k], place, margin=float(rng.choice([0.0, 0.002])))
        for k, place in zip(chosen, places, strict=True)
    ]
    if "moving" in kinds:
        obstacles = [replace(each, motion=_random_motion(each.pose, rng)) for each in obstacles[:3]] + obstacles[3:]
    floor = Obstacle("floor", HalfSpace([0.1, 0.0, 1.0], -1.2 * reach), pin.SE3.Identity())
    held = _held(robot, size, mesh, rng) if "holding" in kinds else []
    return Scene((*obstacles, floor), attached=held)


def _cells(folder: Path, size: float, rng: np.random.Generator) -> Octree:
    """Return the cells of an octree, some of them next to each other, from a file of OctoMap."""
    drawn = np.rint(3.0 * rng.normal(size=(60, 3))).astype(np.int64) + MIDDLE
    head = f"# Octomap OcTree binary file\nid OcTree\nsize 1\nres {0.04 * size!r}\ndata\n"
    file = folder / f"cells{rng.integers(1 << 30)}.bt"
    file.write_bytes(head.encode() + _branches(np.unique(drawn, axis=0), 0))
    return Octree.load(file)


def _branches(cells: NDArray[np.int64], level: int) -> bytes:
    """Return the node of a level around cells, shape (n, 3), and what is below it, as a file of OctoMap has them."""
    children = (cells >> (DEPTH - 1 - level) & 1) @ [1, 2, 4]
    there = np.unique(children).tolist()
    is_leaf = level == DEPTH - 1
    bits = sum((LEAF if is_leaf else INNER) << (2 * child) for child in there)
    below = [] if is_leaf else [_branches(cells[children == child], level + 1) for child in there]
    return int(bits).to_bytes(2, "little") + b"".join(below)


def _ground(folder: Path, size: float, rng: np.random.Generator) -> HeightField:
    """Return a grid of heights, from a file."""
    file = folder / f"ground{rng.integers(1 << 30)}.npy"
    np.save(file, np.round(0.1 * size * rng.random((6, 8)), 2))
    return HeightField.load(file, 0.06 * size, -0.05 * size)


def _held(robot: Robot, size: float, mesh: Mesh, rng: np.random.Generator) -> list[AttachedObject]:
    """Return things that an arm holds at its tip."""
    around = robot.link_names[-HOLDING:]
    solids = [Box(0.1 * size * rng.uniform(0.3, 1.0, 3)), Capsule(0.02 * size, 0.1 * size), Sphere(0.03 * size), mesh]
    chosen = rng.permutation(len(solids))[: int(rng.integers(1, 3))].tolist()
    return [
        AttachedObject(
            f"tool {k}",
            robot.tip,
            solids[k],
            pin.SE3(pin.exp3(rng.normal(size=3)), 0.05 * size * rng.normal(size=3)),
            allow=(*around, *(f"tool {other}" for other in chosen if other != k)),
            padding=float(rng.choice([0.0, 0.002])),
            margin=float(rng.choice([0.0, 0.001])),
        )
        for k in chosen
    ]


def kept_regions(world: World, route: Route, rng: np.random.Generator) -> list[TaskRegion]:
    """Return one to three path constraints of any kind that a motion keeps, with some room."""
    found = []
    for _ in range(int(rng.integers(1, 4))):
        links = [*world.robot.link_names[-HOLDING:], *(each.name for each in world.scene.attached), None]
        frame = links[int(rng.integers(len(links)))]
        poses = frame_poses(world, frame, route)
        middle = poses[len(poses) // 2]
        bounds = np.outer([1000.0] * 3 + [np.pi] * 3, [-1.0, 1.0])
        kind = int(rng.integers(6))
        if kind == 0:  # on a plane
            bounds[2] = 0.0
        elif kind == 1:  # on a line
            bounds[:2] = 0.0
        elif kind == 2:  # in a box
            bounds[:3] = rng.uniform(0.0, 0.1, (3, 1)) * [-1.0, 1.0]
        elif kind == 3:  # an orientation
            bounds[3:] = 0.0
        elif kind == 4:  # a direction of an axis
            bounds[3:][np.arange(3) != int(rng.integers(3))] = 0.0
        else:  # ranges of angles, and a box
            bounds[:3] = rng.uniform(0.0, 0.1, (3, 1)) * [-1.0, 1.0]
            bounds[3:] = rng.uniform(0.2, 1.0, (3, 1)) * [-1.0, 1.0]
        within = pin.SE3(pin.exp3(rng.normal(size=3)), 0.02 * rng.normal(size=3))
        region = TaskRegion(middle * within.inverse(), bounds, within, frame=frame)
        metres, angle = outside(region, poses)
        tolerances = ROOM * metres + 2e-3, ROOM * angle + 2e-2
        if kind > 2 and tolerances[1] > LARGEST_ANGLE:
            continue
        found.append(replace(region, position_tolerance=tolerances[0], orientation_tolerance=tolerances[1]))
    return found


def _random_motion(pose: pin.SE3, rng: np.random.Generator) -> ConstantVelocity | TimedPoses:
    """Return a motion of an obstacle that is at a pose at first."""
    if rng.integers(2):
        return ConstantVelocity(0.05 * rng.normal(size=3))
    steps = [pin.SE3(pin.exp3(0.2 * rng.normal(size=3)), 0.1 * rng.normal(size=3)) for _ in range(3)]
    return TimedPoses([0.0, 1.5, 4.0, 5.2], [pose, *(pose * step for step in steps)])


def _dented(folder: Path, size: float) -> Mesh:
    """Return a mesh that is not convex, from a file of text."""
    corners = size * np.array(DENTED)
    lines = ["solid dented"]
    for face in FACES:
        rows = "\n".join("vertex " + " ".join(map(repr, corners[k].tolist())) for k in face)
        lines.append(f"facet normal 0 0 0\nouter loop\n{rows}\nendloop\nendfacet")
    file = folder / f"dented{size:.3f}.stl"
    file.write_text("\n".join([*lines, "endsolid dented\n"]))
    return Mesh.load(file)


def cases_of(arm: str, robot: Robot, folder: Path, seed: int) -> Iterator[Case]:
    """Yield true certificates of an arm in ever new scenes, each with some planes."""
    rng = np.random.default_rng(seed)
    while True:
        world = World(robot, random_scene(arm, robot, folder, rng))
        for _ in range(3):
            path = random_path(world, rng, CLEARANCE)
            if path is None:
                continue
            route = _route(arm, path.waypoints, world.scene, rng)
            asked = _with_regions(world, route, rng) if "held" in arm.split() else world
            certificate = None if asked is None else asked.certificate(route, CLEARANCE)
            if asked is None or certificate is None:
                continue
            document = json.loads(json.dumps(certificate.document()))
            if sum(len(row) == PLANE for rows in document["motions"] for row in rows) >= FEWEST_PLANES:
                yield Case(asked, route, document, Judge(asked, route))


def _with_regions(world: World, route: Route, rng: np.random.Generator) -> World | None:
    """Return a world with path constraints that a motion keeps; None if there are none of use."""
    regions = kept_regions(world, route, rng)
    try:
        return World.of(replace(world.settings, constraints=tuple(regions))) if regions else None
    except InputError:  # angles that are too steep, or a tolerance that is too small for the arm
        return None


def _route(arm: str, rows: Matrix, scene: Scene, rng: np.random.Generator) -> Route:
    """Return a motion through waypoints, shape (k, dof): as the kind of an arm has it."""
    kinds = arm.split()[1:]
    if "timed" not in kinds and "moving" not in kinds:
        return Route(rows)
    if "moving" in kinds:
        turns = [each.motion.times for each in scene.obstacles if isinstance(each.motion, TimedPoses)]
        clock = np.linspace(0.0, 5.0, len(rows))
        times = np.unique(np.concatenate([clock, *turns]))
        times = times[times <= clock[-1]]
        rows = np.column_stack([np.interp(times, clock, column) for column in rows.T])
        return Route(rows, times, (np.diff(rows, axis=0) / np.diff(times)[:, None])[:, None], moving=True)
    times = np.cumsum([0.0, *rng.uniform(0.5, 2.0, len(rows) - 1)])
    rest = np.zeros_like(rows)
    speeds = rest.copy()
    speeds[1:-1] = 0.2 * (rows[2:] - rows[:-2]) / (times[2:] - times[:-2])[:, None]
    return Splines.through(times, rows, speeds, rest if rng.integers(2) else None).route
