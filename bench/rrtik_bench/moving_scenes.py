"""Scenes that move, from a seed: obstacles that move at random in the reach of an arm, none faster than a bound."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, Capsule, Shape, Sphere
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

SHELL = (0.5, 1.05)  # of the reach: between these distances from the first joints obstacles move
TURN_PROBABILITY = 0.08  # probability that one of them turns at a waypoint
WAYPOINT_SECONDS = 0.25  # from waypoint to waypoint
REACH_SAMPLES = 400  # configurations that measure the reach
ENDPOINT_SAMPLES = 2000  # configurations from which start and goal are chosen


def moving_scene(robot: Robot, count: int, speed: float, seed: int, *, seconds: float = 60.0) -> Scene:
    """Spheres, boxes and capsules that move at constant speed, turn now and then, and keep clear of the arm's base.

    Args:
        robot: The arm.
        count: Number of obstacles.
        speed: Of each of them [m/s].
        seed: The same seed gives the same scene.
        seconds: How long they move [s].
    """
    rng = np.random.default_rng(seed)
    centre, reach = _reach(robot)
    steps = int(np.ceil(seconds / WAYPOINT_SECONDS))
    times = WAYPOINT_SECONDS * np.arange(steps + 1)

    obstacles = []
    for k in range(count):
        shape = _shape(rng, k, reach)
        low = SHELL[0] * reach + shape.bounding_radius
        high = SHELL[1] * reach
        points = _wander(rng, steps, speed * WAYPOINT_SECONDS, low, high) + centre

        rotation = _rotation(rng)
        turns = turning_points(points)
        poses = [pin.SE3(rotation, place) for place in points[turns]]
        obstacles.append(Obstacle(f"obstacle{k + 1}", shape, poses[0], TimedPoses(times[turns], poses)))

    return Scene(tuple(obstacles))


def moving_problem(
    robot: Robot, count: int, speed: float, seed: int, *, room: float = 0.1, seconds: float = 60.0
) -> Problem:
    """A :func:`moving_scene` with a start and a goal that are ``room`` [m] clear of it at time 0.

    Raises:
        InputError: If no such configurations were found.
    """
    scene = moving_scene(robot, count, speed, seed, seconds=seconds)
    world = World(robot, scene)
    inflated_world = MovingWorld(world)
    inflated_world.move(scene, inflation={o.name: room for o in scene.obstacles})

    rng = np.random.default_rng([seed, 1])
    lower, upper = (np.clip(limits, -0.5 * np.pi, 0.5 * np.pi) for limits in robot.finite_range())
    rows = rng.uniform(lower, upper, (ENDPOINT_SAMPLES, robot.dof))
    free = rows[inflated_world.valid_batch(rows)]
    if len(free) < 2:
        raise InputError(f"no free start and goal among {count} obstacles; take fewer, or another seed than {seed}")

    goal_number = int(np.argmax(np.linalg.norm(free[1:16] - free[0], axis=1))) + 1
    return Problem(world, free[0], free[goal_number], name=f"{robot.name}_{count}_{seed}")


def turning_points(places: Matrix) -> NDArray[np.int64]:
    """Numbers of the first, the last, and those points of equally spaced ones, shape (k, d), where they turn."""
    steps = np.diff(places, axis=0)
    turned = np.linalg.norm(np.diff(steps, axis=0), axis=1) > 1e-9 * np.linalg.norm(steps, axis=1).max(initial=0.0)
    return np.concatenate([[0], np.flatnonzero(turned) + 1, [len(places) - 1]])


def _reach(robot: Robot) -> tuple[Vector, float]:
    """Position of the arm's base and how far its tip gets from there [m]."""
    rows = np.random.default_rng(0).uniform(*robot.finite_range(), (REACH_SAMPLES, robot.dof))
    frames = robot.joint_frames(rows)
    tips = robot.fk_batch(rows)[:, :3, 3]
    foot: Vector = frames[:, min(2, frames.shape[1] - 1), :3, 3].mean(axis=0)
    return foot, float(np.linalg.norm(tips - foot, axis=1).max())


def _shape(rng: np.random.Generator, number: int, reach: float) -> Shape:
    """One of three kinds in turn."""
    a, b, c = rng.uniform(0.03, 0.08, 3) * reach
    if number % 3 == 0:
        return Sphere(a)
    if number % 3 == 1:
        return Box([2 * a, 2 * b, 2 * c])
    return Capsule(0.5 * a, 2 * b)


def _wander(rng: np.random.Generator, steps: int, length: float, low: float, high: float) -> Matrix:
    """Points ``length`` apart between two spheres about the origin, shape (steps + 1, 3)."""
    point = _direction(rng) * rng.uniform(low, high)
    heading = _direction(rng)
    points = [point]

    for _ in range(steps):
        if rng.random() < TURN_PROBABILITY:
            heading = _direction(rng)
        while not low <= np.linalg.norm(point + length * heading) <= high:
            heading = _direction(rng)
        point = point + length * heading
        points.append(point)
    return np.array(points)


def _direction(rng: np.random.Generator) -> Vector:
    normal = rng.normal(size=3)
    unit: Vector = normal / np.linalg.norm(normal)
    return unit


def _rotation(rng: np.random.Generator) -> Matrix:
    rotation: Matrix = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
    return rotation
