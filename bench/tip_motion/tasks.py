"""Pick and place in random scenes, with three grasps and two places, beside each pair of these alone and more time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.shared.clocks import least
from bench.tip_motion.judge import TOUCHES, Judge  # a thing that stands on its table touches it
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.tasks.stages import Stage
from rrtik_ompl.world.world import World

DOWN = np.diag([1.0, -1.0, -1.0])
FORWARD = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # the TITAN's tip looks along x
BRUTE_SEEDS, BRUTE_SECONDS = 10, 2.0
ROUNDS = 2


@dataclass(frozen=True)
class Done:
    """What was measured of one scene."""

    found: bool
    brute: bool  # whether a pair of a grasp and a place alone has a plan; as found, if that is true
    seconds: float  # of processor time, the smaller of two rounds
    motions: int
    faults: int  # motions that touch something, by the judge, or begin elsewhere than the one before ends
    proven: int
    reason: str


@dataclass(frozen=True)
class Case:
    """A scene, a start, and the stages of each grasp and each place."""

    world: World
    start: str
    grasps: tuple[tuple[Stage, ...], ...]
    lift: rrtik.Straight
    places: tuple[tuple[Stage, ...], ...]


def panda_case(number: int) -> Case:
    """A Panda that takes a cup from above and carries it over a wall."""
    rng = np.random.default_rng([7, number])
    hand = rrtik.load_robot("panda").gripper
    robot = rrtik.load_robot("panda", locked=hand.posture("open"))
    at, up = np.array([rng.uniform(0.4, 0.6), rng.uniform(0.1, 0.35), 0.25]), np.array([0.0, 0.0, 0.12])
    things = [
        rrtik.Obstacle("table", rrtik.Box([0.7, 1.2, 0.04]), [0.55, 0.0, 0.18]),
        rrtik.Obstacle("cup", rrtik.Box([0.05, 0.05, 0.1]), at),
        rrtik.Obstacle("wall", rrtik.Box([0.4, 0.02, height := rng.uniform(0.1, 0.3)]), [0.5, 0.0, 0.2 + 0.5 * height]),
    ]
    spots = [np.array([rng.uniform(0.4, 0.6), rng.uniform(-0.35, -0.1), 0.25]) for _ in range(2)]
    things += list(_posts(rng, 3, [at, *spots], [0.3, -0.5, 0.2], [0.8, 0.5, 0.2], 0.25))

    def grip(place: Vector, yaw: float) -> pin.SE3:
        return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ DOWN, place + np.array([0.0, 0.0, 0.02]))

    grasps = tuple(
        (
            rrtik.MoveTo(grip(at + up, yaw)),
            rrtik.Straight(by=-up),
            rrtik.Attach("cup", "panda_hand"),
            rrtik.Gripper("close", width=0.05),
        )
        for yaw in (0.0, 0.5 * np.pi, -0.5 * np.pi)
    )
    places = []
    for to in spots:
        released = (rrtik.Detach("cup"), rrtik.Gripper("open"), rrtik.Straight(by=up))
        places.append((rrtik.MoveTo(grip(to + up, 0.0)), rrtik.Straight(by=-up), *released))
    return Case(rrtik.World(robot, rrtik.Scene(tuple(things))), "ready", grasps, rrtik.Straight(by=up), tuple(places))


def titan4_case(number: int) -> Case:
    """A TITAN 4 that takes a tool by its handle from one side of a shelf and puts it on the other."""
    rng = np.random.default_rng([8, number])
    robot = rrtik.load_robot("titan4")
    at = np.array([rng.uniform(1.25, 1.5), rng.uniform(0.2, 0.5), 0.0])
    things = [
        rrtik.Obstacle("shelf", rrtik.Box([0.8, 1.6, 0.04]), [1.4, 0.0, -0.22]),
        rrtik.Obstacle("tool", rrtik.Box([0.06, 0.06, 0.4]), at),
        rrtik.Obstacle("wall", rrtik.Box([0.4, 0.04, height := rng.uniform(0.1, 0.3)]), [1.4, 0.0, 0.5 * height - 0.2]),
    ]
    spots = [np.array([rng.uniform(1.25, 1.5), rng.uniform(-0.5, -0.2), 0.0]) for _ in range(2)]
    things += list(_posts(rng, 3, [at, *spots], [1.1, -0.8, -0.2], [1.8, 0.8, -0.2], 0.4))
    scene = rrtik.Scene(tuple(things), allowed_collisions=(("gripper", "tool"),))

    def grip(place: Vector, yaw: float) -> pin.SE3:
        return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ FORWARD, place + np.array([0.0, 0.0, 0.1]))

    def back(yaw: float) -> Vector:
        return -0.15 * np.array([np.cos(yaw), np.sin(yaw), 0.0])

    lift = np.array([0.0, 0.0, 0.1])
    grasps = tuple(
        (rrtik.MoveTo(grip(at + back(yaw), yaw)), rrtik.Straight(by=-back(yaw)), rrtik.Attach("tool", "gripper"))
        for yaw in (0.0, 0.4, -0.4)
    )
    places = []
    for to in spots:
        yaw = rng.uniform(-0.3, 0.3)
        released = (rrtik.Detach("tool"), rrtik.Straight(by=back(yaw)))
        places.append((rrtik.MoveTo(grip(to + lift, yaw)), rrtik.Straight(by=-lift), *released))
    return Case(rrtik.World(robot, scene), "ready", grasps, rrtik.Straight(by=lift), tuple(places))


CASES = {"panda": panda_case, "titan4": titan4_case}


def _posts(
    rng: np.random.Generator, count: int, away_from: list[Vector], low: list[float], high: list[float], tall: float
) -> Iterator[rrtik.Obstacle]:
    """Posts on the table, none within 15 cm of the object and of its places."""
    made = 0
    while made < count:
        place = rng.uniform(low, high)
        if min(np.linalg.norm(place[:2] - spot[:2]) for spot in away_from) > 0.15:
            height = rng.uniform(0.3, 1.0) * tall
            yield rrtik.Obstacle(
                f"post{made}", rrtik.Box([0.04, 0.04, height]), place + np.array([0.0, 0.0, 0.5 * height])
            )
            made += 1


def carried(arm: str, number: int) -> Done:
    """One scene of an arm."""
    case = CASES[arm](number)
    task = rrtik.Task([rrtik.Alternatives(case.grasps), case.lift, rrtik.Alternatives(case.places)])
    seconds, plan = least(lambda: task.plan(case.world, case.start, seconds=20.0, seed=number), ROUNDS)
    faults, before = 0, case.world.robot.posture(case.start)
    for path, world in zip(plan.paths, plan.worlds, strict=True):
        faults += Judge(world).cuts(path.waypoints) > TOUCHES or np.abs(path.start - before).max() > 1e-9
        before = path.end
    return Done(
        found=plan.found,
        brute=plan.found or _brute(case),
        seconds=seconds,
        motions=len(plan.paths),
        faults=int(faults),
        proven=sum(path.proven for path in plan.paths),
        reason=plan.reason,
    )


def _brute(case: Case) -> bool:
    """Whether any grasp and any place alone has a plan, with ten seeds each and five seconds a stage."""
    for grasp, place in product(case.grasps, case.places):
        task = rrtik.Task([*grasp, case.lift, *place])
        for seed in range(BRUTE_SEEDS):
            if task.plan(case.world, case.start, seconds=BRUTE_SECONDS, seed=seed).found:
                return True
    return False
