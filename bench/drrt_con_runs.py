"""Runs of replanning for the DRRT-Con report, and repairs by several ways side by side at the same moments."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.planning import plan
from rrtik_ompl.replanning import Run, replan
from rrtik_ompl.replanning.connecting import KernelConnect, KernelCuts, PlainConnect
from rrtik_ompl.replanning.drrt_con import DrrtCon, FromScratch
from rrtik_ompl.replanning.generate import moving_problem
from rrtik_ompl.replanning.judge import Verdict, judge
from rrtik_ompl.replanning.loop import Loop
from rrtik_ompl.replanning.settings import settings
from rrtik_ompl.scene import Scene

ARMS = {
    "ur5": {"count": 20, "speed": 0.2, "step": 0.05},
    "titan4": {"count": 20, "speed": 0.1, "step": 0.02},
}
RATE, MARGIN, LONGEST = 50.0, 0.02, 20.0


def arm_problem(name: str, seed: int) -> rrtik.Problem:
    arm = ARMS[name]
    return moving_problem(rrtik.load_robot(name), arm["count"], arm["speed"], seed, seconds=LONGEST)


def arm_options(name: str) -> dict:
    """A repair may take half a second, so that figures do not depend on how busy the machine is."""
    arm = ARMS[name]
    bound = {"margin": MARGIN, "speed_bound": arm["speed"], "seconds": LONGEST}
    return {"step": arm["step"], "rate": RATE, "slot": 0.5, **bound}


def arm_run(name: str, seed: int, **changes: object) -> tuple[Run, Verdict]:
    problem = arm_problem(name, seed)
    run = replan(problem, seed=seed, **{**arm_options(name), **changes})
    return run, judge(problem.robot, run, problem.world.scene, fine=5)


def executed_valid(problem: rrtik.Problem, run: Run) -> bool:
    """Whether every step along a path was free, by the exact world of its moment."""
    scene = problem.world.scene
    for tick, after in zip(run.ticks[:-1], run.ticks[1:], strict=True):
        if tick.event in ("plan", "walk", "repair") and (tick.q != after.q).any():
            now = rrtik.World(
                problem.robot, still(scene.at(tick.time)), motion_resolution=problem.world.motion_resolution
            )
            if not now.certify(np.linspace(tick.q, after.q, 11)).all():
                return False
    return True


def still(scene: Scene) -> Scene:
    """The scene without its motions."""
    frozen = tuple(rrtik.Obstacle(o.name, o.shape, o.pose) for o in scene.obstacles)
    return Scene(frozen, scene.attached, scene.allowed_collisions)


@dataclass
class Moments:
    """Seconds that each way to a new path took at the same moments, and whether it found one."""

    ours: list[float] = field(default_factory=list)
    others: dict[str, list[float]] = field(default_factory=dict)

    def add(self, name: str, seconds: float) -> None:
        """Note what another way took."""
        self.others.setdefault(name, []).append(seconds)

    def ratio(self, name: str) -> float:
        """Median of another way's seconds over ours, pair by pair."""
        return float(np.median(np.array(self.others[name]) / np.array(self.ours)))


def paired(name: str, seeds: range, slow_every: int = 8) -> tuple[Moments, Moments]:
    """Runs of DRRT-Con in which at each repair the same is planned from scratch too, by the same kernels.

    The second result: at every ``slow_every``-th repair also by `plan()` in a new `World`, RRT-Connect of OMPL, and
    with the published search in Python.
    """
    quick, slow = Moments(), Moments()
    for seed in seeds:
        loop = _loop(name, seed)
        with_pairs(loop, quick, slow, slow_every)
        for number in range(int(LONGEST * RATE)):
            if not loop.tick(number):
                break
    return quick, slow


def _loop(name: str, seed: int) -> Loop:
    problem = arm_problem(name, seed)
    usual = {"planner": "drrt-con", "eps": None, "limits": None, "predict": 0, "seed": seed}
    return Loop(problem, problem.world.scene.at, settings(problem.robot, **usual, **arm_options(name)), None)


def with_pairs(loop: Loop, quick: Moments, slow: Moments, slow_every: int) -> None:
    """Make a loop's planner time the others before each of its repairs."""
    planner, repair, world, robot = loop._planner, loop._planner.repair, loop._world, loop._problem.robot
    lower, upper = robot.finite_range()
    eps, count = planner.eps, 0
    scratch = FromScratch(KernelConnect(world, lower, upper, eps, 1), eps, post=KernelCuts(world, 1))
    plain = [kind(PlainConnect(lower, upper, eps, 1), eps) for kind in (DrrtCon, FromScratch)]

    def timed(motions: object, stop: object) -> bool:
        nonlocal count
        count += 1
        spent = [
            _repair_seconds(other, planner, motions) for other in (scratch, *(plain if count % slow_every == 0 else ()))
        ]
        begin = time.perf_counter()
        found = repair(motions, stop)
        ours = time.perf_counter() - begin
        if found and spent[0] is not None:
            quick.ours.append(ours)
            quick.add("from scratch, same kernels", spent[0])
        if found and count % slow_every == 0 and None not in spent:
            slow.ours.append(ours)
            slow.add("DRRT-Con as published, in Python", spent[1])
            slow.add("from scratch as published, in Python", spent[2])
            slow.add("from scratch: new World, fastrrtconnect, shortcut", _by_plan(loop, "fastrrtconnect"))
            slow.add("from scratch: new World, OMPL's RRT-Connect, shortcut", _by_plan(loop, "RRTConnect"))
        return found

    planner.repair = timed


def _repair_seconds(other: DrrtCon, planner: DrrtCon, motions: object) -> float | None:
    other.path, other._dense, other._hits = planner.path.copy(), planner._dense, planner._hits
    begin = time.perf_counter()
    return time.perf_counter() - begin if other.repair(motions, _after(begin + 2.0)) else None


def _after(deadline: float):
    return lambda: time.perf_counter() > deadline


def _by_plan(loop: Loop, planner: str) -> float:
    """A new world and `plan()` from where the robot is, and as much shortening as a repair has."""
    begin = time.perf_counter()
    world = rrtik.World(loop._problem.robot, still(loop._world.scene), accuracy="conservative")
    problem = rrtik.Problem(world, loop.q, loop._goals[0])
    found = plan(problem, planner, seconds=2.0, seed=1)
    if found.found and len(found.path.waypoints) > 2:
        rrtik.shorten(found.path, problem, method="sequential", seed=1)
    return time.perf_counter() - begin
