"""Problems of which one measure grows while the rest stays alike: joints of a chain, obstacles about an arm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

CHAIN_LENGTH = 3.0  # [m] of all links together
BEND = np.pi / 2.0  # [rad] by which all joints of the chain together bend to either side at start and goal
WAY = np.array([[2.1, 0.0]])  # [m] where the disc stands that keeps the straight motion from being free
DISC, SMALL_DISC = 0.35, 0.12  # [m] radii
SHELL = (0.25, 1.1)  # where the obstacles about an arm are, in reaches
GATE, LARGEST = 0.1, 0.12  # radii in reaches: of the ball on the straight way, of a crowd of one
CLEAR_SIZE_RATIO = 1.4  # times their size obstacles leave to the known way
POSTURES, DRAWS, STOPS = 512, 200, 40
APART = 0.6  # of the tip between start and goal, in reaches


def planar_chain(joints: int, seed: int = 0) -> Problem:
    """A chain in the plane, 3 m long whatever its number of links, that bends from one side of a disc to the other.

    Args:
        joints: 2 or more.
        seed: Of the places of three smaller discs.

    Raises:
        InputError: If there are fewer than two joints, or no such scene leaves start and goal free.
    """
    if joints < 2:
        raise InputError(f"joints of a planar chain must be 2 or more, got {joints}")

    robot = load_robot("planar", lengths=[CHAIN_LENGTH / joints] * joints, radius=0.01)
    start = _bent(joints, BEND)
    rng = np.random.default_rng([joints, seed])

    for _ in range(DRAWS):
        angles = rng.uniform(-0.6, 0.6, 3) + np.array([np.pi, TAU / 3.0, -TAU / 3.0])
        places = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(1.0, 2.5, (3, 1))
        discs = [(place, SMALL_DISC) for place in places] + [(WAY[0], DISC)]
        world = World(robot, Scene(tuple(_ball(k, (*place, 0.0), size) for k, (place, size) in enumerate(discs))))

        if world.valid_batch(np.stack([start, -start])).all() and not world.motion_valid(start, -start):
            return Problem(world, start, -start, name=f"planar/{joints}")

    raise InputError(f"planar chain of {joints} joints: no scene of {DRAWS} leaves its start and goal free")


def _bent(joints: int, angle: float) -> Vector:
    """A chain whose base turns by half the angle, and whose other joints turn by the rest of it together."""
    return np.array([0.5 * angle] + [0.5 * angle / (joints - 1)] * (joints - 1))


def _ball(number: int, centre: object, radius: float) -> Obstacle:
    return Obstacle(f"ball{number}", Sphere(radius), pin.SE3(np.eye(3), np.asarray(centre, dtype=float)))


def crowded_arm(robot: Robot, count: int, seed: int = 0) -> Problem:
    """An arm between ``count`` boxes and balls; a way of two straight motions is known to be free.

    The first is a ball on the straight way. The others shrink as they grow in number, so that they fill the same share
    of the room; those beside the known way are left out. Start and goal depend on the seed alone.

    Raises:
        InputError: If ``count`` is below 1, or no such way turned up for the robot.
    """
    if count < 1:
        raise InputError(f"obstacles about an arm must be 1 or more, got {count}")

    rng = np.random.default_rng(seed)
    alone = World(robot)
    reach = float(np.linalg.norm(robot.fk_batch(_postures(alone, rng))[:, :3, 3], axis=1).max())

    start, via, goal, gate = _detour(alone, reach, rng)
    shares = np.linspace(0.0, 1.0, STOPS)[:, None]
    stops = np.vstack([(1.0 - shares) * a + shares * b for a, b in ((start, via), (via, goal))])

    scene = Scene((gate, *_beside(robot, stops, count - 1, reach, rng)))
    return Problem(World(robot, scene), start, goal, name=f"{robot.name}/obstacles/{count}")


def _postures(alone: World, rng: np.random.Generator) -> Matrix:
    lower, upper = alone.robot.finite_range()
    turning = ~alone.robot.prismatic
    lower = np.where(turning, np.maximum(lower, -np.pi), lower)
    upper = np.where(turning, np.minimum(upper, np.pi), upper)

    rows = rng.uniform(lower, upper, (POSTURES, alone.robot.dof))
    free: Matrix = rows[alone.valid_batch(rows)]
    return free


def _detour(alone: World, reach: float, rng: np.random.Generator) -> tuple[Vector, Vector, Vector, Obstacle]:
    """Start, another posture, goal, and a ball on the straight way that the way by the other posture does not touch."""
    robot = alone.robot
    for _ in range(DRAWS):
        rows = _postures(alone, rng)[:60]
        starts, vias, goals = (rows[k::3][: len(rows) // 3] for k in range(3))

        ends = np.vstack([starts, vias]), np.vstack([vias, goals])
        free = alone.motion_valid_batch(*ends).reshape(2, -1).all(axis=0) & alone.motion_valid_batch(starts, goals)
        tips = [robot.fk_batch(each)[:, :3, 3] for each in (starts, goals, 0.5 * (starts + goals))]
        free &= np.linalg.norm(tips[0] - tips[1], axis=1) > APART * reach

        for k in np.flatnonzero(free):
            gate = _ball(0, tips[2][k], GATE * reach)
            world = World(robot, Scene((gate,)))
            blocked = not world.motion_valid(starts[k], goals[k])
            if blocked and world.motion_valid(starts[k], vias[k]) and world.motion_valid(vias[k], goals[k]):
                return starts[k], vias[k], goals[k], gate

    raise InputError(f"robot '{robot.name}': no way round a ball turned up; take another seed")


def _beside(robot: Robot, stops: Matrix, count: int, reach: float, rng: np.random.Generator) -> list[Obstacle]:
    """Obstacles that leave room to the arm at all stops."""
    kept: list[Obstacle] = []
    size = LARGEST * reach / (count + 1) ** (1.0 / 3.0)

    while len(kept) < count:
        places = _places(count, reach, rng)
        wide = World(robot, Scene(tuple(_solid(k, place, CLEAR_SIZE_RATIO * size) for k, place in enumerate(places))))
        touched = {name for q in stops for contact in wide.contacts(q) for name in (contact.first, contact.second)}
        free = [place for k, place in enumerate(places) if _solid(k, place, size).name not in touched]
        kept += [_solid(len(kept) + k, place, size) for k, place in enumerate(free)]

    return kept[:count]


def _places(count: int, reach: float, rng: np.random.Generator) -> list[Any]:
    """Random poses, evenly in the shell."""
    ways = rng.normal(size=(count, 3))
    far = reach * rng.uniform(SHELL[0] ** 3, SHELL[1] ** 3, (count, 1)) ** (1.0 / 3.0)
    centres = far * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    return [pin.SE3(pin.exp3(turn), centre) for turn, centre in zip(rng.normal(size=(count, 3)), centres, strict=True)]


def _solid(number: int, place: pin.SE3, size: float) -> Obstacle:
    """Balls and boxes in turns."""
    if number % 2:
        return Obstacle(f"box{number}", Box([1.6 * size] * 3), place)
    return Obstacle(f"sphere{number}", Sphere(size), place)
