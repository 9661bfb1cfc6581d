"""Problems of which one measure grows while the rest stays alike: joints of a chain, obstacles about an arm."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.catalog import load_robot
from rrtik_ompl.errors import InputError
from rrtik_ompl.problem import Problem
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.shapes import Box, Sphere
from rrtik_ompl.world import World

CHAIN_LENGTH = 3.0  # [m] of all links together
BEND = np.pi / 2.0  # [rad] by which all joints of the chain together bend to either side at start and goal
WAY = np.array([[2.1, 0.0]])  # [m] where the disc stands that keeps the straight motion from being free
DISC, SMALL_DISC = 0.35, 0.12  # [m] radii
SHELL = (0.25, 1.1)  # where the obstacles about an arm are, in reaches
SHARE = 0.35  # of the shell that a crowd's balls would fill if they did not shrink by number
POSTURES, DRAWS = 512, 50
APART = 1.5  # [rad] least distance of start and goal, each joint counted


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
        angles = rng.uniform(-0.6, 0.6, 3) + np.array([np.pi, 2.0 * np.pi / 3.0, -2.0 * np.pi / 3.0])
        places = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(1.0, 2.5, (3, 1))
        discs = [(place, SMALL_DISC) for place in places] + [(WAY[0], DISC)]
        world = World(robot, Scene(tuple(_ball(k, (*place, 0.0), size) for k, (place, size) in enumerate(discs))))
        if world.valid_batch(np.stack([start, -start])).all() and not world.motion_valid(start, -start):
            return Problem(world, start, -start, name=f"planar/{joints}")
    raise InputError(f"planar chain of {joints} joints: no scene of {DRAWS} leaves its start and goal free")


def crowded_arm(robot: Robot, count: int, seed: int = 0) -> Problem:
    """An arm between ``count`` boxes and balls that shrink as they grow in number, so that they fill the same room.

    Start and goal are two free postures far from each other, the same for every ``count`` of a seed where both are
    free.

    Raises:
        InputError: If nothing turned up in which start and goal are free.
    """
    if count < 1:
        raise InputError(f"obstacles about an arm must be 1 or more, got {count}")
    rng = np.random.default_rng(seed)
    alone = World(robot)
    rows = _postures(alone, rng)
    reach = float(np.linalg.norm(robot.fk_batch(rows)[:, :3, 3], axis=1).max())
    for number in range(DRAWS):
        world = World(robot, Scene(_crowd(count, reach, np.random.default_rng([seed, count, number]))))
        free = rows[world.valid_batch(rows) & world.certify(rows)]
        for start, goal in zip(free[::2], free[1::2], strict=False):
            if np.abs(goal - start).max() > APART and not world.motion_valid(start, goal):
                return Problem(world, start, goal, name=f"{robot.name}/obstacles/{count}")
    raise InputError(f"robot '{robot.name}' between {count} obstacles: none of {DRAWS} scenes leaves it room")


def _bent(joints: int, angle: float) -> Vector:
    """A chain whose base turns by half the angle, and whose other joints turn by the rest of it together."""
    return np.array([0.5 * angle] + [0.5 * angle / (joints - 1)] * (joints - 1))


def _postures(alone: World, rng: np.random.Generator) -> Matrix:
    lower, upper = alone.robot.finite_range()
    turning = ~alone.robot.prismatic
    lower, upper = (
        np.where(turning, np.maximum(lower, -np.pi), lower),
        np.where(turning, np.minimum(upper, np.pi), upper),
    )
    rows = rng.uniform(lower, upper, (POSTURES, alone.robot.dof))
    free: Matrix = rows[alone.valid_batch(rows)]
    return free


def _crowd(count: int, reach: float, rng: np.random.Generator) -> tuple[Obstacle, ...]:
    inner, outer = SHELL
    size = 0.5 * reach * (SHARE * (outer**3 - inner**3) / (count + 5)) ** (1.0 / 3.0)
    found = []
    for k in range(count):
        way = rng.normal(size=3)
        centre = way / np.linalg.norm(way) * reach * rng.uniform(inner**3, outer**3) ** (1.0 / 3.0)
        if k % 2:
            found.append(Obstacle(f"box{k}", Box([1.6 * size] * 3), pin.SE3(pin.exp3(rng.normal(size=3)), centre)))
        else:
            found.append(_ball(k, centre, size))
    return tuple(found)


def _ball(number: int, centre: object, radius: float) -> Obstacle:
    return Obstacle(f"ball{number}", Sphere(radius), pin.SE3(np.eye(3), np.asarray(centre, dtype=float)))
