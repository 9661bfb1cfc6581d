"""Every kind of goal of the tip, 100 seeds each: the share that is solved, and the time it takes.

python bench/ik/goal_regions.py [SEEDS [SEEDS_OF_UR5]] [--out bench/reports/goal_regions.md]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from bench.shared.pages import add_out
from rrtik_bench.report.page import Report
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.shapes import Box

PLANNERS = ("RRTConnect", "bicrdt", "fastrrtconnect")
SECONDS = 5.0
FREE, NONE = (-np.pi, np.pi), (0.0, 0.0)
UR5_START, UR5_GOAL = (-0.9, -1.2, 1.6, -1.9, -1.5, 0.0), (0.8, -1.0, 1.5, -2.0, -1.5, 0.0)


def cell() -> rrtik.World:
    """A UR5 on a table, a post and a beam between its two sides."""
    obstacles = (
        rrtik.Obstacle("table", Box([1.6, 1.6, 0.04]), pose([0, 0, -0.05])),
        rrtik.Obstacle("post", Box([0.1, 0.1, 0.8]), pose([0.5, 0.0, 0.4])),
        rrtik.Obstacle("beam", Box([0.9, 0.08, 0.08]), pose([0.55, 0.0, 0.8])),
    )
    return rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene(obstacles))


def goals(tip: Any) -> dict[str, Goal]:
    """One goal of each kind round one pose of the tip."""
    up = np.array([0.0, 0.0, 1.0])
    line = np.array([(-0.15, 0.15), NONE, NONE, NONE, NONE, NONE])
    box = np.array([(-0.1, 0.1), (-0.1, 0.1), (-0.05, 0.05), (-0.2, 0.2), (-0.2, 0.2), FREE])
    turned = [tip * pose([0, 0, 0], [0, 0, np.sin(a / 2), np.cos(a / 2)]) for a in (0.0, 1.5, 3.0, -1.5)]
    far = pose([4.0, 0, 0.3])
    return {
        "a pose": rrtik.PoseGoal(tip),
        "a position": rrtik.PositionGoal(tip.translation),
        "four poses": rrtik.GoalSet([rrtik.PoseGoal(T) for T in turned]),
        "free turn about the tool": rrtik.GoalSet([rrtik.PoseGoal(tip)], free_rotation_axis="z"),
        "free turn about an upright line 0.1 m away": rrtik.TaskRegion.about_axis(
            tip, up, through=tip.translation + np.array([0.1, 0.0, 0.0])
        ),
        "a line of 0.3 m": rrtik.TaskRegion(tip, line),
        "a box, roll and pitch within 0.2 rad, yaw free": rrtik.TaskRegion(tip, box),
        "a grasp set: a pose out of reach, a line, a free turn": rrtik.GoalSet(
            [rrtik.PoseGoal(far), rrtik.TaskRegion(tip, line), rrtik.TaskRegion.about_axis(tip, up)]
        ),
    }


def measured(problem: rrtik.Problem, planner: str, seeds: int) -> list[str]:
    """Cells of the table: share solved, median and 95th percentile of the processor time [ms], attempts at most."""
    times, plans = [], []
    for seed in range(seeds):
        begin = time.process_time()
        plans.append(rrtik.plan(problem, planner, seconds=SECONDS, seed=seed))
        times.append(1e3 * (time.process_time() - begin))
    solved = sum(each.found for each in plans)
    attempts = max(each.statistics["attempts"] for each in plans)
    return [f"{solved} of {seeds}", f"{np.median(times):.0f}", f"{np.percentile(times, 95):.0f}", str(attempts)]


def problems(seeds: int, seeds_of_ur5: int) -> Iterator[tuple[str, rrtik.Problem, int]]:
    """Names, problems and how many seeds each gets."""
    bar, side = rrtik.load_problem("titan4_bar"), cell()
    yield "TITAN-4, two grasps of a bar (titan4_bar)", bar, seeds
    for kind, goal in goals(pose([1.33, 0.2, -0.1], [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])).items():
        yield f"TITAN-4, {kind}", rrtik.Problem(bar.world, bar.start, goal), seeds
    for kind, goal in goals(side.robot.fk(np.array(UR5_GOAL))).items():
        yield f"UR5, {kind}", rrtik.Problem(side, np.array(UR5_START), goal), seeds_of_ur5


def main() -> None:
    """Measure all and write the report after each row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", type=int, nargs="?", default=100)
    parser.add_argument("seeds_of_ur5", type=int, nargs="?", default=100)
    add_out(parser, "goal_regions.md")
    options = parser.parse_args()
    rows: list[list[str]] = []
    for name, problem, count in problems(options.seeds, options.seeds_of_ur5):
        for planner in PLANNERS:
            rrtik.plan(problem, planner, seed=0)  # what is loaded once
            rows.append([name, planner, *measured(problem, planner, count)])
            print(*rows[-1], sep=" | ", flush=True)
            page(rows, f"python bench/ik/goal_regions.py {options.seeds} {options.seeds_of_ur5}").save(options.out)


def page(rows: list[list[str]], command: str) -> Report:
    """What has been measured so far."""
    report = Report("Goals of the tip", command, intro=INTRODUCTION)
    report.table("", ("goal", "planner", "solved", "median [ms]", "95 % [ms]", "attempts, at most"), rows)
    return report


INTRODUCTION = (
    "TITAN-4 (closed form) before the bar of `titan4_bar`, and a UR5 (numeric) between table, post and beam; "
    f"{SECONDS:g} s each. The time is that of the processor in `plan()`, inverse kinematics included."
)


if __name__ == "__main__":
    main()
