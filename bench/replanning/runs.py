"""Runs of replanning for the DRRT-Con report, and repairs by several ways side by side at the same moments."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from bench.replanning import scenes
from rrtik_bench.contact_check import ContactReport, check_contacts
from rrtik_bench.moving_scenes import moving_problem
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.replanning.connecting import PythonConnect, TreeOptions
from rrtik_ompl.replanning.drrt_con import DrrtCon, FromScratch, KernelDrrtCon
from rrtik_ompl.replanning.feed import feed_of
from rrtik_ompl.replanning.loop import Loop
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.world.motion_queries import MotionQueries

ARMS = {
    "ur5": {"count": 20, "speed": 0.2, "step": 0.05},
    "titan4": {"count": 20, "speed": 0.1, "step": 0.02},
}
RATE, MARGIN, LONGEST = 50.0, 0.02, 20.0
OURS, SCRATCH = "DRRT-Con", "from scratch, same kernels"
PLANS = (("auto", "the default call"), ("RRTConnect", "OMPL's RRT-Connect"))


def arm_problem(name: str, seed: int) -> rrtik.Problem:
    arm = ARMS[name]
    return moving_problem(rrtik.load_robot(name), int(arm["count"]), arm["speed"], seed, seconds=LONGEST)


def arm_options(name: str) -> dict[str, Any]:
    """A repair may take half a second, so that figures do not depend on how busy the machine is."""
    arm = ARMS[name]
    bound = {"margin": MARGIN, "speed_bound": arm["speed"], "seconds": LONGEST}
    return {"step": arm["step"], "rate": RATE, "repair_budget": 0.5, **bound}


@dataclass(frozen=True)
class Outcome:
    """What the tables need of a run; times [s] are of the processor.

    Attributes:
        counts: Ticks of each kind.
        repairs, ticks: Seconds of each repair that found a path, and of each tick.
        contacts: Kind of each tick with contact, by the independent check; empty without one.
        nearest: Smallest distance between arm and obstacles [m], 0 for a contact.
    """

    arrived: bool
    length: float
    counts: dict[str, int]
    repairs: list[float]
    ticks: list[float]
    contacts: tuple[str, ...] = ()
    nearest: float = np.inf


def outcome(run: ReplanRun, report: ContactReport | None = None) -> Outcome:
    """A run in short, with its contacts."""
    seen: dict[str, Any] = (
        {} if report is None else {"contacts": tuple(c[1] for c in report.contacts), "nearest": report.nearest}
    )
    counts = {event: run.count(event) for event in ("repair", "wait", "evade")}
    times = run.tick_seconds("repair", "repair").tolist(), run.tick_seconds("all").tolist()
    return Outcome(run.found, run.length, counts, *times, **seen)


def arm_outcome(name: str, seed: int, planner: str, slot: float, seconds: float) -> Outcome:
    """A run of an arm among obstacles, checked for contacts."""
    problem = arm_problem(name, seed)
    changes = {"planner": planner, "repair_budget": slot, "seconds": seconds, "clock": time.process_time}
    run = replan(problem, seed=seed, **{**arm_options(name), **changes})
    return outcome(run, check_contacts(problem.robot, run, problem.world.scene, samples_per_tick=5))


def plane_run(problem: rrtik.Problem, seed: int, **changes: Any) -> ReplanRun:
    """A run of the point in the plane."""
    options = {"clock": time.process_time, "seconds": 40.0, **scenes.OPTIONS, **changes}
    return replan(problem, limits=scenes.limits(), seed=seed, **options)


def executed_valid(problem: rrtik.Problem, run: ReplanRun) -> bool:
    """Whether every step along a path was free, by the exact world of its moment."""
    scene = problem.world.scene
    for tick, after in zip(run.ticks[:-1], run.ticks[1:], strict=True):
        if tick.event in ("plan", "walk", "repair") and (tick.q != after.q).any():
            now = problem.world.with_scene(still(scene.at(tick.time)))
            if not now.certify(np.linspace(tick.q, after.q, 11)).all():
                return False
    return True


def still(scene: Scene) -> Scene:
    """The scene without its motions."""
    frozen = tuple(rrtik.Obstacle(o.name, o.shape, o.pose) for o in scene.obstacles)
    return Scene(frozen, scene.attached, scene.allowed_collisions)


@dataclass
class Moments:
    """What each way to a new path took at the same moments [s], and the new path's length over the blocked one's."""

    ours: list[tuple[float, float]] = field(default_factory=list)
    others: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def add(self, found: dict[str, tuple[float, float]]) -> None:
        """Note a moment at which all ways found a path."""
        self.ours.append(found[OURS])
        for name, measured in found.items():
            if name != OURS:
                self.others.setdefault(name, []).append(measured)

    def ratio(self, name: str) -> float:
        """Median of a way's seconds over ours, pair by pair."""
        way = self.ours if name == OURS else self.others[name]
        return float(np.median([theirs[0] / mine[0] for theirs, mine in zip(way, self.ours, strict=True)]))


def paired(name: str, seeds: range, slow_every: int = 8) -> tuple[Moments, Moments]:
    """Runs of DRRT-Con in which at each repair the same is planned from scratch too, by the same kernels.

    The second result: at every ``slow_every``-th repair also by `plan()` in a new `World`, RRT-Connect of OMPL, and
    with the published search in Python.
    """
    quick, slow = Moments(), Moments()
    for seed in seeds:
        loop = _loop(name, seed)
        with_pairs(loop, quick, slow, slow_every)
        loop.run_ticks()
    return quick, slow


def _loop(name: str, seed: int) -> Loop:
    problem = arm_problem(name, seed)
    return Loop(problem, feed_of(problem.world.scene), ReplanSettings(seed=seed, **arm_options(name)), None)


def with_pairs(loop: Loop, quick: Moments, slow: Moments, slow_every: int) -> None:
    """Make a loop's planner time the others before each of its repairs."""
    planner, repair, world = loop._planner, loop._planner.repair, loop._world
    lower, upper = loop._problem.robot.finite_range()
    eps, count = planner.max_edge, 0
    options = TreeOptions(lower, upper, eps, 1)
    scratch = {SCRATCH: KernelDrrtCon(world, options, forgetting=True)}
    plain = {
        "DRRT-Con as published, in Python": DrrtCon(PythonConnect(options), eps),
        "from scratch as published, in Python": FromScratch(PythonConnect(options), eps),
    }

    def timed(motions: MotionQueries, stop: Callable[[], Any]) -> bool:
        nonlocal count
        count += 1
        assert planner.path is not None
        path, often = planner.path.copy(), count % slow_every != 0
        found = {what: _repaired(other, path, motions) for what, other in (scratch if often else plain).items()}
        if not often:
            found |= {f"from scratch: new World, {title}, shortcut": _by_plan(loop, kind) for kind, title in PLANS}
        planner.check_path(motions)  # once more: what a repair reads is as fresh in memory as for the others
        begin = time.process_time()
        ours = repair(motions, stop)
        found[OURS] = (time.process_time() - begin, _length(planner.path) / _length(path)) if ours else None
        if None not in found.values():
            (quick if often else slow).add({what: each for what, each in found.items() if each is not None})
        return ours

    planner.repair = timed  # type: ignore[method-assign, assignment]


def _repaired(other: DrrtCon, path: np.ndarray, motions: MotionQueries) -> tuple[float, float] | None:
    """Seconds of another's repair and the share of the path's length that the new one has."""
    other.path = path
    other.check_path(motions)
    begin = time.process_time()
    found = other.repair(motions, _after(begin + 2.0))
    return (time.process_time() - begin, _length(other.path) / _length(path)) if found else None


def _length(path: np.ndarray | None) -> float:
    assert path is not None
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _after(deadline: float) -> Callable[[], bool]:
    return lambda: time.process_time() > deadline


def _by_plan(loop: Loop, planner: str) -> tuple[float, float] | None:
    """A new world and `plan()` from where the robot is, and as much shortening as a repair has."""
    begin = time.process_time()
    world = rrtik.World(loop._problem.robot, still(loop._world.scene), accuracy="conservative")
    problem = rrtik.Problem(world, loop.q, loop._goals[0])
    found = plan(problem, planner, seconds=2.0, seed=1, shorten=False)
    if found.path is None:
        return None
    several = len(found.path.waypoints) > 2
    path = rrtik.shorten(found.path, problem, method="sequential", seed=1) if several else found.path
    return time.process_time() - begin, path.length / _length(loop._planner.path)
