"""Families of problems in which one quantity grows: the joints of a chain, or the obstacles around an arm."""

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
# [rad]; total bend of the chain, to one side at the start and to the other at the goal.
BEND = np.pi / 2.0
WAY = np.array([[2.1, 0.0]])  # [m]; centre of the disc that blocks the straight motion
DISC, SMALL_DISC = 0.35, 0.12  # [m] radii
SHELL = (0.25, 1.1)  # inner and outer radius of the shell of obstacles around an arm, in units of its reach
# Radii in units of the reach: of the ball on the straight motion, and of the obstacles if there is only one.
GATE, LARGEST = 0.1, 0.12
CLEAR_SIZE_RATIO = 1.4  # obstacles scaled by this factor must not touch the known path
POSTURES, DRAWS, STOPS = 512, 200, 40
APART = 0.6  # least distance of the tip between start and goal, in units of the reach


def planar_chain(joints: int, seed: int = 0) -> Problem:
    """Return the problem of a planar chain, 3 m long, that bends from one side of a disc to the other.

    Args:
        joints: 2 or more.
        seed: Seed of the places of three smaller discs.

    Raises:
        InputError: If there are fewer than two joints, or no such scene leaves start and goal free.
    """
    if joints < 2:
        raise InputError(f"joints of a planar chain must be 2 or more, got {joints}")

    robot = load_robot("planar", parameters={"lengths": [CHAIN_LENGTH / joints] * joints, "radius": 0.01})
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
    """Return a configuration of the chain: the base turns by half the angle, the other joints share the other half."""
    return np.array([0.5 * angle] + [0.5 * angle / (joints - 1)] * (joints - 1))


def _ball(number: int, centre: object, radius: float) -> Obstacle:
    return Obstacle(f"ball{number}", Sphere(radius), pin.SE3(np.eye(3), np.asarray(centre, dtype=float)))


def crowded_arm(robot: Robot, count: int, seed: int = 0) -> Problem:
    """Return a problem of an arm among ``count`` boxes and balls, for which a path of two straight motions is known.

    The first obstacle is a ball that blocks the straight motion. The others shrink as their number grows, so that they
    fill the same share of space; those near the known path are left out. Start and goal depend only on the seed.

    Raises:
        InputError: If ``count`` is below 1, or no such path was found for the robot.
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
    """Return start, via and goal configurations, and a ball that blocks the direct motion but not that through via."""
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
    """Return obstacles that keep clear of the arm at all given configurations."""
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
    """Return random poses, uniformly distributed in the shell."""
    ways = rng.normal(size=(count, 3))
    far = reach * rng.uniform(SHELL[0] ** 3, SHELL[1] ** 3, (count, 1)) ** (1.0 / 3.0)
    centres = far * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    return [pin.SE3(pin.exp3(turn), centre) for turn, centre in zip(rng.normal(size=(count, 3)), centres, strict=True)]


def _solid(number: int, place: pin.SE3, size: float) -> Obstacle:
    """Return a box for odd numbers, and a ball for even ones."""
    if number % 2:
        return Obstacle(f"box{number}", Box([1.6 * size] * 3), place)
    return Obstacle(f"sphere{number}", Sphere(size), place)
