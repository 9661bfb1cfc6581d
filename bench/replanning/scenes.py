"""The scenes of [1, ch. 5.2] (its figures give no numbers; these are proposals of this project)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

import rrtik_ompl as rrtik
from rrtik_bench.moving_scenes import turning_points
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Prism

SIZE, STEP, EPS, RATE = 20.0, 0.5, 1.0, 10.0
WALLS = [[(6, -5), (8, -5), (8, 12), (6, 12)], [(12, 8), (14, 8), (14, 25), (12, 25)]]
POCKET = [(4, 2), (12, 2), (12, 3), (5, 3), (5, 8), (4, 8)]
UPPER = [(9, 10), (17, 10), (17, 17), (16, 17), (16, 11), (9, 11)]
CENTRES = [(5, 5), (5, 14), (10, 9), (10, 16), (14, 5), (15, 12)]
CIRCUMRADIUS, TURN_CHANCE = 1.8, 0.03
OPTIONS: dict[str, Any] = {"step": STEP, "rate": RATE, "max_edge": EPS, "repair_budget": 0.5}


def limits() -> rrtik.RateLimits:
    """No limit of its own: the step is what bounds the robot."""
    return rrtik.RateLimits([1e3, 1e3], [1e3, 1e3])


def point() -> rrtik.Robot:
    return rrtik.load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, SIZE], [0, SIZE]]})


def place(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def problem(name: str, obstacles: list[Obstacle], start: ArrayLike, goal: ArrayLike) -> rrtik.Problem:
    world = rrtik.World(point(), Scene(tuple(obstacles)), motion_resolution=0.05)
    return rrtik.Problem(world, start, goal, name=name)


def walls() -> rrtik.Problem:
    """The static comparison as it was measured before."""
    obstacles = [Obstacle(f"wall{k + 1}", Prism(shape)) for k, shape in enumerate(WALLS)]
    return problem("two_walls", obstacles, (2, 2), (18, 17))


def pockets(*, moving: bool) -> rrtik.Problem:
    """Scene 1, or frozen scene 2: the upper L slides left by 0.1 a tick until its left end is at x = 3."""
    motion = TimedPoses([0.0, 60.0 / RATE], [place(0, 0), place(-6, 0)]) if moving else None
    obstacles = [Obstacle("pocket", Prism(POCKET)), Obstacle("upper", Prism(UPPER), motion=motion)]
    return problem("pockets" if moving else "pockets_frozen", obstacles, (2, 2), (18, 14))


def triangles(ratio: float, seed: int, ticks: int = 400) -> rrtik.Problem:
    """Scene 3: six triangles that wander at ``ratio`` times the robot's speed and bounce off the border."""
    rng = np.random.default_rng([seed, 3])
    obstacles = []
    for k, centre in enumerate(CENTRES):
        turn = rng.uniform(0.0, 2.0 * np.pi)
        corners = [turn + 2.0 * np.pi * j / 3.0 for j in range(3)]
        shape = Prism([(CIRCUMRADIUS * np.cos(a), CIRCUMRADIUS * np.sin(a)) for a in corners])
        places = _wander(rng, np.array(centre, dtype=float), ratio * STEP, ticks)
        motion = None
        if ratio > 0.0:
            turns = turning_points(places)
            motion = TimedPoses(turns / RATE, [place(*p) for p in places[turns]])
        obstacles.append(Obstacle(f"triangle{k + 1}", shape, place(*centre), motion))
    return problem("six_triangles", obstacles, (1, 1), (19, 19))


def _wander(rng: np.random.Generator, at: np.ndarray, length: float, ticks: int) -> np.ndarray:
    heading, places = rng.uniform(0.0, 2.0 * np.pi), [at]
    way = length * np.array([np.cos(heading), np.sin(heading)])
    for _ in range(ticks):
        if rng.random() < TURN_CHANCE:
            heading = rng.uniform(0.0, 2.0 * np.pi)
            way = length * np.array([np.cos(heading), np.sin(heading)])
        ahead = at + way
        way = np.where((ahead < CIRCUMRADIUS) | (ahead > SIZE - CIRCUMRADIUS), -way, way)
        at = at + way
        places.append(at)
    return np.array(places)


def covered(seed: int) -> rrtik.Problem:
    """The goal is covered from tick 8 to tick 80 by a square that comes and goes."""
    y = np.random.default_rng([seed, 4]).uniform(14.0, 18.0)
    goal = (16.0, float(y))
    square = Prism([(-1.5, -1.5), (1.5, -1.5), (1.5, 1.5), (-1.5, 1.5)])
    away, over = place(16.0, y - 8.0), place(*goal)
    motion = TimedPoses([0.0, 0.5, 0.8, 8.0, 8.3], [away, away, over, over, away])
    return problem("covered_goal", [Obstacle("lid", square, away, motion)], (2, 2), goal)


def moving_goal(seed: int) -> tuple[rrtik.Problem, Callable[[float], np.ndarray]]:
    """A static scene whose goal goes on a circle at 0.6 of the robot's speed; the problem and the goal's feed."""
    phase, speed = np.random.default_rng([seed, 5]).uniform(0.0, 2.0 * np.pi), 0.6 * STEP * RATE
    centre, radius = np.array([15.0, 14.0]), 2.5

    def goal(time: float) -> np.ndarray:
        angle = phase + speed * min(time, 40.0) / radius
        return centre + radius * np.array([np.cos(angle), np.sin(angle)])

    block = Obstacle("block", Prism([(6, 4), (9, 4), (9, 12), (6, 12)]))
    return problem("moving_goal", [block], (2, 2), tuple(goal(0.0))), goal


def planar_arm() -> rrtik.Problem:
    """Scene 4: a planar arm; the second box covers the goal posture for a while, the first one leaves its place."""
    robot = rrtik.load_robot("planar", parameters={"lengths": [1.0, 1.0, 1.0], "radius": 0.02})
    box = [(-0.25, -0.4), (0.25, -0.4), (0.25, 0.4), (-0.25, 0.4)]
    first = TimedPoses([0.0, 2.0, 5.0], [place(1.6, 1.6), place(1.6, 1.6), place(1.6, 3.4)])
    second = TimedPoses([0.0, 0.6, 4.5, 6.5], [place(-3.2, 1.9), place(-1.1, 1.9), place(-1.1, 1.9), place(-3.4, 1.9)])
    obstacles = [Obstacle("first", Prism(box), place(1.6, 1.6), first)]
    obstacles.append(Obstacle("second", Prism(box), place(-3.2, 1.9), second))
    world = rrtik.World(robot, Scene(tuple(obstacles)), motion_resolution=0.02)
    return rrtik.Problem(world, [0.2, 0.3, 0.2], np.deg2rad([105.0, 15.0, 10.0]), name="planar_arm")
