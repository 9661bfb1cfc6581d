"""Random straight lines: how far they are followed, how exactly, how quickly, beside a brute-force follower."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.shared.clocks import least
from bench.tip_motion.judge import Judge
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.world.world import World

BALLS, RADIUS = 4, 0.1  # obstacles of every world, [m]
SPREAD = 0.35  # [rad] of the joints between the begin and a configuration at the goal
RANDOM_WAYS = 24  # of a redundant arm's brute-force follower
PULL = 6.0
ROUNDS = 3


@dataclass(frozen=True)
class Line:
    """What was measured of one line."""

    length: float  # [m]
    fraction: float
    brute: float  # nan if it was not asked
    seconds: float  # of processor time, the smallest of three rounds
    waypoints: int
    off: float  # [m] from the line, dense samples
    turned: float  # [rad]
    jump: float  # [rad] largest of a joint between waypoints
    cut: float  # [m]
    proven: bool
    reason: str


@cache
def world_of(arm: str) -> World:
    """An arm among a few balls, always the same."""
    robot, rng = rrtik.load_robot(arm), np.random.default_rng(11)
    reach = np.linalg.norm(robot.fk_batch(rng.uniform(*robot.finite_range(), (500, robot.dof)))[:, :3, 3], axis=1).max()
    balls: list[rrtik.Obstacle] = []
    while len(balls) < BALLS:
        place = rng.uniform(-0.7, 0.7, 3) * reach
        if np.linalg.norm(place[:2]) > 0.35 * reach:
            balls.append(rrtik.Obstacle(f"ball{len(balls)}", rrtik.Sphere(RADIUS), place))
    return rrtik.World(robot, rrtik.Scene(tuple(balls)))


def line_of(arm: str, number: int, brute: bool) -> Line:
    """One line of an arm, from a free configuration to the pose of another one that is near."""
    world, rng = world_of(arm), np.random.default_rng([5, number])
    robot = world.robot
    while True:
        q = rng.uniform(*robot.finite_range())
        other = robot.clamp(q + rng.normal(0.0, SPREAD, robot.dof))
        if world.valid_batch(np.stack([q, other])).all() and world.certify(np.stack([q, other])).all():
            break
    begin, end = robot.fk(q), robot.fk(other)
    seconds, made = least(lambda: rrtik.tip.straight(world, q, end), ROUNDS)
    judge = Judge(world)
    off = turned = jump = cut = 0.0
    if made.path is not None:
        rows = made.path.waypoints
        off, turned = judge.strays(rows, begin, end)
        jump, cut = float(np.abs(np.diff(rows, axis=0)).max()), judge.cuts(rows)
    return Line(
        length=float(np.linalg.norm(end.translation - begin.translation)),
        fraction=made.fraction,
        brute=_brute(judge, q, begin, end, rng) if brute and made.fraction < 1.0 else float("nan"),
        seconds=seconds,
        waypoints=0 if made.path is None else len(made.path.waypoints),
        off=off,
        turned=turned,
        jump=jump,
        cut=cut,
        proven=made.path is None or made.path.proven,
        reason=made.reason,
    )


def _brute(judge: Judge, q: Vector, begin: pin.SE3, end: pin.SE3, rng: np.random.Generator) -> float:
    """Of a redundant arm the best of many random ways to use its freedom."""
    best = judge.farthest(q, begin, end)
    if judge.robot.dof <= 6:
        return best
    for _ in range(RANDOM_WAYS):
        if best == 1.0:
            break
        toward = rng.uniform(*judge.robot.finite_range())
        best = max(best, judge.farthest(q, begin, end, partial(_pulled, toward=toward)))
    return best


def _pulled(now: Vector, toward: Vector) -> Vector:
    """A motion of the joints towards a configuration."""
    return PULL * (toward - now)
