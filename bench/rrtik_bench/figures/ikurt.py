"""Figures of [1, ch. 5.1]: examples of IKURT, and what keeps it from goals at limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.figures.plane import INK, between, draw_arm, draw_scene
from rrtik_bench.ikurt import as_published, letter_steps, repaired_search
from rrtik_bench.ikurt_limits import (
    EVALUATIONS,
    FEW_EVALUATIONS,
    LETTER,
    RULES,
    WRIST,
    approach,
    letter_search,
    outward_share,
)
from rrtik_bench.report.figures import Figure
from rrtik_ompl.model.goal import PoseGoal, PositionGoal
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

JOINT_5 = 4  # the place of theta5
PLANAR = {"planar3_boxes": "1: position", "planar6_c": "2: position", "planar6_c_pose": "3: pose"}
POSTURES, SAMPLES, FEW_SAMPLES = 14, 40_000, 8_000


def limit(drawing: Drawing, quick: bool) -> None:
    """The singular goal with theta5 at its limit: how near each rule comes, and the share of steps that lead there."""
    seeds, most = (1, FEW_EVALUATIONS) if quick else (3, EVALUATIONS)
    near, gaps, share = drawing.subplots(1, 3)
    for k, rule in enumerate(RULES):
        dash = "dashed" if k == 1 else "solid"  # it lies upon the first
        for seed in range(seeds):
            run = approach(WRIST, rule, seed, most)
            steps = np.arange(1, run.evaluations + 1)
            gap = 90.0 - np.degrees(run.at[:, JOINT_5])
            near.loglog(steps, run.nearest, color=COLORS[k], linestyle=dash, label="" if seed else rule)
            gaps.loglog(steps, np.maximum(gap, 0.1), color=COLORS[k], linestyle=dash)
        away = np.geomspace(0.1, 180.0, 200)
        share.loglog(away, outward_share(rule, away, 180.0), color=COLORS[k], linestyle=dash)
    near.axhline(LETTER.accuracy, color=INK, linewidth=0.8)
    near.set(xlabel="evaluations", ylabel="distance from the goal in the metric", title="line: arrived")
    gaps.set(
        xlabel="evaluations", ylabel="gap of theta5 from its limit [deg]", title="gap of the nearest configuration"
    )
    share.set(xlabel="gap of theta5 from its limit [deg]", ylabel="share of steps outwards", title="why")
    near.legend(frameon=False, fontsize=8)
    for panel in (near, gaps, share):
        tidy(panel)


def planar(drawing: Drawing, quick: bool) -> None:
    """The planar examples: postures along one path each."""
    del quick
    for panel, (name, title) in zip(drawing.subplots(1, 3), PLANAR.items(), strict=True):
        problem = as_published(rrtik.load_problem(name))
        path, _ = repaired_search(problem, 0)
        draw_scene(panel, problem.world.scene)
        if path is not None:
            row = between(path, POSTURES)
            for k, q in enumerate(row):
                draw_arm(panel, problem.robot, q, COLORS[0], width=0.9, strength=0.15 + 0.5 * k / POSTURES)
            draw_arm(panel, problem.robot, row[-1], COLORS[1], width=1.8)
        draw_arm(panel, problem.robot, problem.start, INK, width=1.8)
        if isinstance(problem.goal, PositionGoal):
            panel.plot(*problem.goal.position[:2], "x", color=COLORS[1], markersize=9)
        elif isinstance(problem.goal, PoseGoal):
            panel.plot(*problem.goal.T_world_tip.translation[:2], "x", color=COLORS[1], markersize=9)
        panel.set_title(title, fontsize=9)
        tidy(panel)


def joint_space(drawing: Drawing, quick: bool) -> None:
    """Example 1 in its joint space: configurations in collision, the tree to the letter, its path."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    problem = rrtik.load_problem("planar3_boxes")
    panel = drawing.add_subplot(projection="3d")
    lower, upper = problem.robot.finite_range()
    Q = np.random.default_rng(0).uniform(lower, upper, (FEW_SAMPLES if quick else SAMPLES, 3))
    blocked = Q[~problem.world.valid_batch(Q)]
    panel.plot(*blocked.T, ".", color=COLORS[1], markersize=1.5, alpha=0.25)
    search, _ = letter_search(problem, letter_steps(problem), 0, FEW_EVALUATIONS if quick else EVALUATIONS)
    search.run()
    q, parents = search.tree.grown()
    edges = np.stack([q[parents[parents >= 0]], q[parents >= 0]], axis=1)
    panel.add_collection(Line3DCollection(list(edges), colors=COLORS[0], linewidths=0.6))
    path, _ = repaired_search(problem, 0)
    if path is not None:
        panel.plot(*path.T, color=COLORS[2], linewidth=2.2)
    panel.set(xlabel="theta1 [rad]", ylabel="theta2 [rad]", zlabel="theta3 [rad]")


SOURCE = "[1, ch. 5.1]"
FIGURES: dict[str, tuple[Figure, ...]] = {
    "ikurt-limits": (
        Figure("ikurt_limit", "TITAN-4, theta5 = 90 deg: what keeps the algorithm to the letter from the goal",
               f"{SOURCE}, example 6", limit, "no figure of the source: an explanation", size=(12.0, 4.2)),
    ),
    "ikurt-examples": (
        Figure("ikurt_planar", "Planar examples; black: start, red: goal", f"{SOURCE}, figures of examples 1 to 3",
               planar, size=(11.0, 4.2)),
        Figure("ikurt_joint_space", "Example 1, joint space: collision red, tree (letter) blue, repaired path green",
               f"{SOURCE}, figure of example 1", joint_space, size=(7.0, 6.0)),
    ),
}  # fmt: skip
