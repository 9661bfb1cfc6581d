"""The test scenes of [1, ch. 5.2]: figures without numbers, so that what is compared is what its text says."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from rrtik_bench.contact_check import check_contacts
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.replanning.connecting import PythonConnect, TreeOptions
from rrtik_ompl.replanning.drrt_con import DrrtCon
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.world.moving_world import MovingWorld

SOURCE = "[1, ch. 5.2]"
SCENE = "coordinates, speeds and steps chosen here: none is printed"
REPAIR_SECONDS = 2.0  # [s] for a repair, so that a run does not depend on how busy the machine is
FASTEST = 2.5  # [m/s]: no triangle is faster
STOP, GO = "wait", "go"


def _runs(scenario: Scenario, count: int, speed_bound: float | None = None) -> list[ReplanRun]:
    return [scenario.run(seed=seed, repair_budget=REPAIR_SECONDS, speed_bound=speed_bound) for seed in range(count)]


def static(quick: bool) -> list[Row]:
    """Two walls that stand: what was walked, beside RRT-Connect with one pass of post-processing."""
    scenario, count = Scenario.load("replan_walls"), 3 if quick else 30
    problem, edge = scenario.problem, scenario.settings.edge_length(scenario.problem.robot)
    assert isinstance(problem.goal, JointGoal)
    walked = [run.length for run in _runs(scenario, count)]
    once = []
    for seed in range(count):
        options = TreeOptions(problem.robot.lower, problem.robot.upper, edge, seed)
        planner = DrrtCon(PythonConnect(options), edge)
        planner.begin(problem.start, problem.goal.q[None], MovingWorld(problem.world))
        assert planner.path is not None
        once.append(route_length(planner.path))
    shorter = float(np.mean(np.array(walked) <= np.array(once)))
    measured = f"{np.mean(walked):.2f} beside {np.mean(once):.2f}; shorter in {shorter:.0%} of {count}"
    return [judged("length walked, beside RRT-Connect and one pass of post-processing", "shorter", measured, shorter,
                   Bar((0.0, 1.0), held=(0.9, 1.0)), SCENE)]  # fmt: skip


def triangles(quick: bool) -> list[Row]:
    """Six triangles that wander: new routes, arrival, no contact; and what the printed loop would do."""
    scenario, count = Scenario.load("replan_triangles"), 3 if quick else 30
    runs = _runs(scenario, count)
    arrived, repairs = sum(run.found for run in runs), [run.count("repair") for run in runs]
    clean = sum(_kept_free(scenario, run) for run in runs)
    untouched, bounded = _untouched(scenario, runs), _untouched(scenario, _runs(scenario, count, speed_bound=FASTEST))
    lengths = [len(run.ticks) for run in runs]
    ticks = [tick for run in runs for tick in run.ticks]
    idle = np.mean([tick.event == "walk" and "look" in tick.seconds for tick in ticks])
    return [
        judged("arrival", "by the eighth frame", f"{arrived} of {count}, after {np.mean(lengths):.0f} ticks",
               arrived / count, all_of(), f"the time between frames is not printed; {SCENE}"),
        judged("new routes where triangles close the first one", "one is shown", f"{np.mean(repairs):.1f} a run",
               min(repairs), Bar((0.0, 1e4), held=(1.0, 1e4)), f"repairs, small ones included; {SCENE}"),
        judged("runs in which every step along the path is free when it is made", "implied", f"{clean} of {count}",
               clean / count, all_of(), "evasive steps left out"),
        judged("runs without contact, in continuous time", "implied", f"{untouched} of {count}", untouched / count,
               all_of(refutes=True), "no margin, as printed: what is free when a tick begins can be run over before "
               f"it ends, in {count - untouched} of {count} runs"),
        judged("the same, told how fast triangles are", "not in the print", f"{bounded} of {count}", bounded / count,
               all_of(), f"speed_bound {FASTEST:g}: the robot keeps as far as they come in a tick"),
        judged("ticks with a free path while things move, for which there is no branch", "none, by implication",
               f"{idle:.0%} of the ticks", float(idle), Bar((0.0, 1.0), held=(0.0, 0.0), refuted=(0.0, 1.0)),
               "to the letter the robot stands still in them; treated as if nothing had moved"),
    ]  # fmt: skip


def _kept_free(scenario: Scenario, run: ReplanRun) -> bool:
    """Whether every step along the path was free of the obstacles where they were when it was made."""
    world, scene = MovingWorld(scenario.problem.world), scenario.problem.world.scene
    for tick, after in zip(run.ticks[:-1], run.ticks[1:], strict=True):
        world.move(scene.at(tick.time))
        if tick.event in ("plan", "walk", "repair") and not world.motion_valid(tick.q, after.q):
            return False
    return True


def _untouched(scenario: Scenario, runs: list[ReplanRun]) -> int:
    """How many runs had no contact at any time, by an independent check."""
    problem = scenario.problem
    return sum(not check_contacts(problem.robot, run, problem.world.scene).contacts for run in runs)


def pockets(quick: bool) -> list[Row]:
    """Two pockets, one of them sliding: the path ahead becomes shorter as the robot goes."""
    count = 3 if quick else 30
    runs = _runs(Scenario.load("replan_pockets"), count)
    shrinking = [
        route_length(b.path) < route_length(a.path)
        for run in runs
        for a, b in zip(run.ticks[:-1], run.ticks[1:], strict=True)
        if a.path is not None and b.path is not None and b.event == "walk"
    ]
    arrived, share = sum(run.found for run in runs), float(np.mean(shrinking))
    return [
        judged("arrival", "in the sixth frame", f"{arrived} of {count}", arrived / count, all_of(), SCENE),
        judged("the path ahead becomes shorter", "at every step shown", f"in {share:.0%} of the steps", share,
               Bar((0.0, 1.0), held=(1.0, 1.0), differs=(0.9, 1.0)), f"{len(shrinking)} ticks without a repair"),
    ]  # fmt: skip


def planar_arm(quick: bool) -> list[Row]:
    """A planar arm whose goal posture is covered for a while: the order of events."""
    count = 3 if quick else 30
    runs = _runs(Scenario.load("replan_planar_arm"), count)
    orders = [_order(run) for run in runs]
    kept = sum([event for event, _ in order] == [GO, STOP, GO, "arrive"] for order in orders)
    steps = [step for _, step in orders[0][1:]]
    first = f"stops at step {steps[0]}, goes on at {steps[min(1, len(steps) - 1)]}, arrives at {steps[-1]}"
    return [
        judged("follows, stops, holds, goes on, arrives", "steps 6, 14, 39, 68, 86",
               f"in this order in {kept} of {count}; the first: {first}", kept / count, all_of(),
               f"the order, not the numbers; {SCENE}"),
    ]  # fmt: skip


def _order(run: ReplanRun) -> list[tuple[str, int]]:
    """Kinds of events in the order in which they came, each with the number of its first tick."""
    kinds = [GO if tick.event in ("plan", "walk", "repair") else tick.event for tick in run.ticks]
    return [(event, next(group)[0]) for event, group in groupby(enumerate(kinds), key=lambda pair: pair[1])]


TABLES = (
    Table("drrt-con-static", "Static scene: what is walked", f"{SOURCE}, figure of the static scene", static, 2, 1),
    Table("drrt-con-pockets", "Two obstacles, one sliding", f"{SOURCE}, figure of two obstacles", pockets, 2, 1),
    Table("drrt-con-triangles", "Six triangles", f"{SOURCE}, figure of six triangles", triangles, 5, 1),
    Table("drrt-con-arm", "Planar arm, goal covered for a while", f"{SOURCE}, figure of the arm", planar_arm, 3, 1),
)
