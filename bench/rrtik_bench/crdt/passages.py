"""Narrow passages: [1, ch. 6.3] says that they stall C-RDT as they stall the RRT, unless they lie along the axes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_bench.crdt.baseline import TreeRun, crdt_run, rrt_run
from rrtik_bench.report.rows import INFINITE, Bar, Row, judged
from rrtik_bench.tables import Table
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

CLAIM = "stalls, unless along the axes"
WIDTHS = (2.5, 1.25)  # of the passage; the square domain has sides of 25, a step of the RRT is 1
LENGTH = 6.0
BEFORE, ASIDE = 7.0, 5.0  # where the start is: before the middle of the passage, and beside its line
FAR = 40.0  # longer than the domain is wide
TURNS = {"along an axis": 0.0, "across both axes": np.pi / 4}
PLANNERS = {"C-RDT": crdt_run, "RRT": rrt_run}
BARS = {
    "along an axis": Bar((0.0, INFINITE), held=(0.0, 2.0)),
    "across both axes": Bar((0.0, INFINITE), held=(3.0, INFINITE)),
}
READING = "one straight passage of length 6 through the domain of environment E, turned by 0 and 45 degrees; ours"


def passage(width: float, turn: float) -> Problem:
    """A point in the plane, which two walls leave a passage of a width, turned by an angle [rad]."""
    robot = rrtik.load_problem("env_e").world.robot
    middle = 0.5 * (robot.lower + robot.upper)
    along = np.array([np.cos(turn), np.sin(turn)])
    aside = np.array([-along[1], along[0]])

    walls = []
    for side in (-1.0, 1.0):
        place = middle + 0.5 * side * (width + FAR) * aside
        T_world_wall = pin.SE3(pin.utils.rotate("z", turn), np.array([*place, 0.0]))
        walls.append(Obstacle(f"wall {side:+.0f}", Box(np.array([LENGTH, FAR, 2.0])), T_world_wall))

    step = BEFORE * along - ASIDE * aside
    return Problem(World(robot, Scene(tuple(walls)), motion_resolution=0.2), middle - step, JointGoal(middle + step))


@cache
def searched(planner: str, width: float, turn: float, count: int) -> list[TreeRun]:
    """Searches with seeds from 0 on."""
    return [PLANNERS[planner](passage(width, turn), seed) for seed in range(count)]


def passages(quick: bool) -> list[Row]:
    """By what a passage of half the width multiplies the iterations, medians, by how it lies."""
    count = 5 if quick else 20
    rows = []
    narrow = {}
    for planner in PLANNERS:
        for lies, turn in TURNS.items():
            wide, narrow[planner, lies] = (
                float(np.median([run.iterations for run in searched(planner, width, turn, count)])) for width in WIDTHS
            )
            growth = narrow[planner, lies] / wide
            told = f"{wide:.0f} to {narrow[planner, lies]:.0f}: {growth:.2f} times"
            bar = BARS[lies]
            name = f"{planner}, {lies}: iterations at half the width"
            if planner == "C-RDT":
                rows.append(judged(name, CLAIM, told, growth, bar, f"median of {count} runs; {READING}"))
            else:
                rows.append(Row(name, "stalls, in words", told, None, "the same passages, to compare"))

    first, second = (narrow[planner, "across both axes"] for planner in PLANNERS)
    told = f"{first:.0f} / {second:.0f} = {first / second:.2f}"
    bar = Bar((0.0, INFINITE), held=(1.0, INFINITE))
    rows.append(judged("narrow, across both axes: C-RDT over RRT", CLAIM, told, first / second, bar, READING))
    return rows


TABLES = (
    Table(
        "crdt-passages",
        "Narrow passages, iterations",
        "[1, ch. 6.3]",
        passages,
        60,
        8,
        bars="the source says it in words; scene, and what counts as stalled, ours",
    ),
)
