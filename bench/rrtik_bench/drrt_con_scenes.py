"""DRRT-Con among obstacles that appear and that change their shape, which [1, ch. 5.2] names and does not show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from rrtik_bench.drrt_con import REPAIR_SECONDS, SOURCE, _kept_free
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.scene import Obstacle, TimedPoses
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

SUDDEN = 0.01  # [s], less than a tick: an obstacle is elsewhere in the next one
NOWHERE = pin.SE3(np.eye(3), np.array([-60.0, -60.0, 0.0]))
HALF, AHEAD = 0.3, 0.6  # of the way walked without the obstacle: when it comes, where it stands
GROWN = 1.0  # [s] after which it changes its shape
SMALL, LARGE = (1.6, 1.6, 1.0), (1.0, 4.0, 1.0)


def present(place: Vector, begin: float, end: float | None) -> TimedPoses:
    """A motion that is nowhere near but from ``begin`` to ``end`` [s], when it is at a place, shape (2,)."""
    here = pin.SE3(np.eye(3), np.array([*place, 0.0]))
    times, poses = [begin, begin + SUDDEN], [NOWHERE, here]
    if end is not None:
        times, poses = [*times, end, end + SUDDEN], [*poses, here, NOWHERE]
    return TimedPoses(times, poses)


def appearing(seed: int, *, changes: bool) -> tuple[Scenario, ReplanRun]:
    """A run between the walls into whose way a box comes from nowhere; it ``changes`` into another, longer one."""
    scenario = Scenario.load("replan_walls")
    alone = scenario.run(seed=seed, repair_budget=REPAIR_SECONDS)
    ticks = alone.ticks
    begin = ticks[int(HALF * len(ticks))].time
    place = ticks[int(AHEAD * len(ticks))].q
    boxes = [Obstacle("small", Box(SMALL), NOWHERE, present(place, begin, begin + GROWN if changes else None))]
    if changes:
        boxes.append(Obstacle("large", Box(LARGE), NOWHERE, present(place, begin + GROWN, None)))
    old = scenario.problem
    scene = replace(old.world.scene, obstacles=(*old.world.scene.obstacles, *boxes))
    world = World(old.robot, scene, motion_resolution=old.world.motion_resolution)
    changed = replace(scenario, problem=Problem(world, old.start, old.goal, name=old.name))
    return changed, changed.run(seed=seed, repair_budget=REPAIR_SECONDS)


def unannounced(quick: bool) -> list[Row]:
    """Boxes that come from nowhere onto the way, and boxes that change."""
    count, rows = 2 if quick else 30, []
    for name, changes in (("a box appears on the way", False), ("it becomes a longer one", True)):
        pairs = [appearing(seed, changes=changes) for seed in range(count)]
        arrived = sum(run.found for _, run in pairs)
        repairs = [run.count("repair") for _, run in pairs]
        clean = sum(_kept_free(scenario, run) for scenario, run in pairs)
        reading = "scene chosen here; a solid that changes is one that leaves and one that comes"
        least = min(repairs)
        rows += [
            judged(f"{name}: arrival", "covered, in words", f"{arrived} of {count}", arrived / count, all_of(),
                   reading),
            judged(f"{name}: repairs", "at least one", f"{np.mean(repairs):.1f} a run, least {least}", least,
                   Bar((0.0, 1e4), held=(1.0, 1e4)), reading),
            judged(f"{name}: runs in which every step along the path is free when it is made", "implied",
                   f"{clean} of {count}", clean / count, all_of()),
        ]  # fmt: skip
    return rows


TABLES = (
    Table(
        "drrt-con-unannounced",
        "Obstacles that appear and change",
        SOURCE,
        unannounced,
        10,
        1,
        bars="the source says that they are covered; numbers ours",
    ),
)
