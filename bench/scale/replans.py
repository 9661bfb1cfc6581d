"""A UR5 that replans from clouds of points, ten a second; coal judges contacts, with the ball that they show."""

from __future__ import annotations

import time
from dataclasses import dataclass

import coal
import numpy as np

from rrtik_ompl import Obstacle, PointCloud, Problem, ProblemError, Robot, Scene, World, load_robot, replan
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import link_bodies

POINTS, RADIUS = 20_000, 0.005  # [m] of a point
BALL = 0.12  # [m]
RATE, STEP, SECONDS, BOUND = 10.0, 0.05, 8.0, 0.1  # [Hz], [rad] a tick, [s], [m/s]
SWAY = 0.4  # [m] of the ball, to either side
BETWEEN = 6  # places between two ticks that are judged


@dataclass(frozen=True)
class Walk:
    """A run: processor times of its ticks [ms], places with contact, whether it arrived, share of proven motions."""

    ticks: list[float]
    contacts: int
    arrived: bool
    proven: float


def ball_at(seed: int, t: float) -> Vector:
    """The middle of the ball at a time [s]; it is never faster than ``BOUND``."""
    rng = np.random.default_rng(seed)
    turn, along = rng.uniform(0.0, 2.0 * np.pi), rng.normal(size=3)
    middle = np.array([0.5 * np.cos(turn), 0.5 * np.sin(turn), 0.45])
    return np.asarray(middle + SWAY * np.sin(BOUND / SWAY * t) * along / np.linalg.norm(along))


def scene_at(seed: int, t: float) -> Scene:
    """A floor and the ball, as points seen anew each time."""
    rng = np.random.default_rng([seed, int(1e3 * t)])
    floor = np.column_stack([rng.uniform(-1.0, 1.0, (POINTS // 2, 2)), np.full(POINTS // 2, -0.15)])
    away = rng.normal(size=(POINTS // 2, 3))
    ball = ball_at(seed, t) + (BALL - RADIUS) * away / np.linalg.norm(away, axis=1)[:, None]
    return Scene((Obstacle("seen", PointCloud(np.concatenate([floor, ball]), RADIUS)),))


def walks(first: int, count: int) -> list[Walk]:
    """Runs of these seeds, between free configurations."""
    return [_walk(seed) for seed in range(first, first + count)]


def _walk(seed: int) -> Walk:
    robot = load_robot("ur5")
    world, rng = World(robot, scene_at(seed, 0.0)), np.random.default_rng(seed)
    while True:
        ends = rng.uniform(-np.pi, np.pi, (2, 6)) * [1.0, 0.5, 0.8, 1.0, 1.0, 1.0] - [0.0, 0.5 * np.pi, 0, 0, 0, 0]
        try:
            problem = Problem(world, *ends)
        except ProblemError:
            continue
        if world.clearance(ends[0]) > 5.0 * BOUND / RATE:  # points, their radius and two ticks of the ball lie between
            break
    camera: dict[float, float] = {}  # what making the clouds took, which a camera does elsewhere [s]

    def seen(t: float) -> Scene:
        begin = time.process_time()
        scene = scene_at(seed, t)
        camera[t] = time.process_time() - begin
        return scene

    run = replan(
        problem, seen, clock=time.process_time, rate=RATE, step=STEP, seconds=SECONDS, speed_bound=BOUND, seed=seed
    )
    times = [1e3 * (tick.seconds["all"] - camera[tick.time]) for tick in run.ticks if "all" in tick.seconds]
    proven = [tick.proven for tick in run.ticks if tick.proven is not None]
    contacts = sum(
        _contacts(robot, seed, a.time, np.linspace(a.q, b.q, BETWEEN, endpoint=False))
        for a, b in zip(run.ticks, run.ticks[1:], strict=False)
    )
    return Walk(times, contacts, run.outcome == "arrived", float(np.mean(proven)) if proven else 0.0)


def _contacts(robot: Robot, seed: int, begin: float, rows: Matrix) -> int:
    """At how many of some configurations within a tick the arm touches the ball where it is then."""
    ball, touched = coal.Sphere(BALL), 0
    for k, frames in enumerate(robot.joint_frames(rows)):
        there = coal.Transform3s(np.eye(3), ball_at(seed, begin + k / (RATE * len(rows))))
        hit = False
        for body in link_bodies(robot):
            place = frames[body.joint] @ body.placement.homogeneous
            pose = coal.Transform3s(place[:3, :3], place[:3, 3])
            asked, found = coal.CollisionRequest(), coal.CollisionResult()
            hit = hit or coal.collide(body.geometry, pose, ball, there, asked, found) > 0
        touched += hit
    return touched
