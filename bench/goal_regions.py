"""Every kind of goal of the tip, 100 seeds each: the share that is solved, and the time it takes.

python bench/goal_regions.py [SEEDS]  writes bench/reports/goal_regions.md
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.goal import Goal
from rrtik_ompl.poses import pose
from rrtik_ompl.shapes import Box

PLANNERS = ("RRTConnect", "bicrdt", "fastrrtconnect")
SECONDS = 5.0
FREE, NONE = (-np.pi, np.pi), (0.0, 0.0)
REPORT = Path(__file__).parent / "reports" / "goal_regions.md"
START, AT_GOAL = (-0.9, -1.2, 1.6, -1.9, -1.5, 0.0), (0.8, -1.0, 1.5, -2.0, -1.5, 0.0)


def cell() -> rrtik.World:
    """A UR5 on a table, a post and a beam between its two sides."""
    obstacles = [
        rrtik.Obstacle("table", Box([1.6, 1.6, 0.04]), pose([0, 0, -0.05])),
        rrtik.Obstacle("post", Box([0.1, 0.1, 0.8]), pose([0.5, 0.0, 0.4])),
        rrtik.Obstacle("beam", Box([0.9, 0.08, 0.08]), pose([0.55, 0.0, 0.8])),
    ]
    return rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene(obstacles))


def goals(robot: rrtik.Robot) -> dict[str, Goal]:
    """One goal of each kind round one pose of the tip."""
    tip = robot.fk(np.array(AT_GOAL))
    up = np.array([0.0, 0.0, 1.0])
    line = np.array([(-0.15, 0.15), NONE, NONE, NONE, NONE, NONE])
    box = np.array([(-0.1, 0.1), (-0.1, 0.1), (-0.05, 0.05), (-0.2, 0.2), (-0.2, 0.2), FREE])
    turned = [tip * pose([0, 0, 0], [0, 0, np.sin(a / 2), np.cos(a / 2)]) for a in (0.0, 1.5, 3.0, -1.5)]
    far = pose([1.6, 0, 0.3])
    return {
        "a pose": rrtik.PoseGoal(tip),
        "a position": rrtik.PositionGoal(tip.translation),
        "four poses": rrtik.GoalRegion([rrtik.PoseGoal(T) for T in turned]),
        "free turn about the tool": rrtik.GoalRegion([rrtik.PoseGoal(tip)], free_rotation_axis="z"),
        "free turn about an upright line 0.1 m away": rrtik.TaskRegion.about_axis(
            tip, up, through=tip.translation + np.array([0.1, 0.0, 0.0])
        ),
        "a line of 0.3 m": rrtik.TaskRegion(tip, line),
        "a box, roll and pitch within 0.2 rad, yaw free": rrtik.TaskRegion(tip, box),
        "a grasp set: a pose out of reach, a line, a free turn": rrtik.GoalRegion(
            [rrtik.PoseGoal(far), rrtik.TaskRegion(tip, line), rrtik.TaskRegion.about_axis(tip, up)]
        ),
    }


def measured(problem: rrtik.Problem, planner: str, seeds: int) -> str:
    """A row of the table: share solved, median and 95th percentile of the time [ms], attempts at most."""
    plans = [rrtik.plan(problem, planner, seconds=SECONDS, seed=seed) for seed in range(seeds)]
    times = 1e3 * np.array([each.seconds for each in plans])
    solved = sum(each.found for each in plans)
    attempts = max(each.statistics["attempts"] for each in plans)
    return f"{solved} of {seeds} | {np.median(times):.0f} | {np.percentile(times, 95):.0f} | {attempts}"


def main(seeds: int = 100) -> None:
    """Measure all and write the report."""
    world = cell()
    problems = {kind: rrtik.Problem(world, np.array(START), goal) for kind, goal in goals(world.robot).items()}
    problems["titan4_bar: two grasps of a bar"] = rrtik.load_problem("titan4_bar")
    lines = [
        "# Goals of the tip",
        "",
        f"A UR5 between table, post and beam, and the shipped TITAN-4 problem; {seeds} seeds, {SECONDS:g} s each. The time",
        "is that of `plan()`, inverse kinematics included, on a busy shared machine: compare ratios.",
        "Made by `python bench/goal_regions.py`.",
        "",
        "| goal | planner | solved | median [ms] | 95 % [ms] | attempts, at most |",
        "|---|---|---|---|---|---|",
    ]
    for kind, problem in problems.items():
        for planner in PLANNERS:
            rrtik.plan(problem, planner, seed=0)  # what is loaded once
            lines.append(f"| {kind} | {planner} | {measured(problem, planner, seeds)} |")
            print(lines[-1], flush=True)
    REPORT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(*(int(text) for text in sys.argv[1:]))
