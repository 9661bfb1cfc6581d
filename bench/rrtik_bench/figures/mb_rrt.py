"""Figures of [3]: growth of a tree, directions of its first links, passes beside the print. Lengths in cm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_bench.mb_rrt.runs import GOALS, PRECISION, arm, precise
from rrtik_bench.report.figures import Figure
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.ik.mb_rrt.links import Links, sunflower
from rrtik_ompl.ik.mb_rrt.published import grow, grow_in_joint_space, one_link, projected, square, surface
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

GOAL = np.array([20.0, 30.0])
PASSES = (1, 4, 16, 64)
BINS = 90


def growth(drawing: Drawing, quick: bool) -> None:
    """A tree of four links after some passes, with the circles on which its joints can lie."""
    del quick
    from matplotlib.collections import LineCollection

    links = Links([10.0] * 4)
    whole = grow(links, GOAL, tolerance=1e-9, rng=np.random.default_rng(0), passes=PASSES[-1], stop=False)
    for panel, passes in zip(drawing.subplots(1, len(PASSES), sharey=True), PASSES, strict=True):
        for index, radius in enumerate(links.max_span[1:-1], start=1):
            _circle(panel, radius, COLORS[index])
        for index in range(1, links.count + 1):
            parents = whole.nodes[index - 1][whole.parents[index - 1][:passes]]
            edges = np.stack([parents, whole.nodes[index][:passes]], axis=1)
            panel.add_collection(LineCollection(list(edges), colors=COLORS[index], linewidths=0.8))
        panel.plot(*GOAL, "+", color="#1d2733")
        panel.set(aspect="equal", xlim=(-12, 52), ylim=(-12, 62), title=f"{passes} pass{'es' if passes > 1 else ''}")
        tidy(panel)


def _circle(panel: Axes, radius: float, color: str) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    around = GOAL + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    panel.plot(*around.T, color=color, linewidth=0.7, linestyle="dashed")


def first_directions(draw: str, count: int, rng: np.random.Generator) -> Vector:
    """Directions of first links, from that of the goal [rad], shape (count,)."""
    links = Links([10.0] * 4)
    samples = {"uniform": square, "projected": projected, "surface": surface}[draw](links, GOAL, 1, count, rng)
    nodes = one_link(np.zeros((count, 2)), samples, 10.0, rng)
    angle = np.arctan2(nodes[:, 1], nodes[:, 0]) - np.arctan2(GOAL[1], GOAL[0])
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def two_joints(drawing: Drawing, quick: bool) -> None:
    """The arm of two joints: the classical tree in its joint space, and the answer in the workspace."""
    links, goal = Links([10.0, 10.0]), np.array([6.0, 11.0])
    run = grow_in_joint_space(
        links, goal, tolerance=0.2, rng=np.random.default_rng(1), passes=2_000 if quick else 10_000
    )
    joints, arm_panel = drawing.subplots(1, 2)
    first = np.arctan2(run.nodes[1][:, 1], run.nodes[1][:, 0])
    second = run.nodes[2] - run.nodes[1]
    bend = np.arctan2(second[:, 1], second[:, 0]) - first
    joints.plot(
        np.degrees(first), np.degrees((bend + np.pi) % (2.0 * np.pi) - np.pi), ".", color=COLORS[5], markersize=3
    )
    joints.set(xlim=(-180, 180), ylim=(-180, 180), aspect="equal", xlabel="theta1 [deg]", ylabel="theta2 [deg]",
               title=f"{run.passes} vertices")  # fmt: skip
    arm_panel.plot(*run.nodes[2].T, ".", color=COLORS[5], markersize=3)
    arm_panel.plot(*run.chain.T, "o-", color="#1d2733")
    arm_panel.plot(*goal, "+", color=COLORS[1], markersize=12)
    arm_panel.set(xlim=(-21, 21), ylim=(-21, 21), aspect="equal", xlabel="x [cm]", ylabel="y [cm]",
                  title=f"{run.misses.min():.2f} cm from the goal")  # fmt: skip
    tidy(joints)
    tidy(arm_panel)


def directions(drawing: Drawing, quick: bool) -> None:
    """Histograms of the first link's direction by the three ways of sampling, with their laws."""
    count, rng = 10_000 if quick else 100_000, np.random.default_rng(0)
    titles = {"uniform": "in the square", "projected": "projected to the circle", "surface": "on the circle"}
    for panel, (draw, title) in zip(drawing.subplots(1, 3), titles.items(), strict=True):
        angles = first_directions(draw, count, rng)
        panel.hist(np.degrees(angles), BINS, density=True, color=COLORS[5], label=f"{count:,} samples")
        law = _law(draw)
        if law is not None:
            panel.plot(*law, color=COLORS[1], linewidth=1.2, label="law")
        panel.set(xlabel="direction from the goal's [deg]", title=title)
        panel.legend(frameon=False, fontsize=8, loc="upper center")
        tidy(panel)


def _law(draw: str) -> tuple[Vector, Vector] | None:
    """The density of a direction [1/deg]; of projected samples none is known in closed form."""
    if draw == "projected":
        return None
    if draw == "uniform":
        angle = np.linspace(-np.pi, np.pi, 2000)
        axis = (angle + np.arctan2(GOAL[1], GOAL[0]) + np.pi / 4) % (np.pi / 2) - np.pi / 4
        return np.degrees(angle), np.pi / 180.0 / (8.0 * np.cos(axis) ** 2)
    ratio = float(np.linalg.norm(GOAL)) / 30.0
    tangent = np.arcsin(1.0 / ratio)
    angle = np.linspace(-0.999, 0.999, 2000) * tangent
    density = ratio * np.cos(angle) / (np.pi * np.sqrt(1.0 - (ratio * np.sin(angle)) ** 2))
    return np.degrees(angle), np.minimum(density * np.pi / 180.0, 0.06)


def goal_clouds(drawing: Drawing, quick: bool) -> None:
    """The goals of the two arms, which [3] does not give, and one answer for every fifth of them."""
    rng = np.random.default_rng(0)
    for panel, (count, goals) in zip(drawing.subplots(1, 2), GOALS.items(), strict=True):
        links, cloud = arm(count), sunflower(arm(count), goals)
        for goal in cloud[:: 10 if quick else 5]:
            panel.plot(
                *grow(links, goal, tolerance=0.01 * links.reach, rng=rng).chain.T, color=COLORS[5], linewidth=0.9
            )
        panel.plot(*cloud.T, ".", color=COLORS[1], markersize=5)
        panel.set(aspect="equal", title=f"{count} joints, {goals} goals", xlabel="x [cm]", ylabel="y [cm]")
        tidy(panel)


def precision(drawing: Drawing, quick: bool) -> None:
    """Passes by tolerance, with the printed means of tables 10 and 11."""
    panel, rng = drawing.subplots(), np.random.default_rng(0)
    for k, (count, rows) in enumerate(PRECISION.items()):
        tolerances = np.array(list(rows)) / (10.0 * count)
        runs = [precise(count, tolerance, 1 if quick else 5, rng)[0] for tolerance in rows]
        low, mean, high = (np.array([f(hits.mean(axis=1)) for hits in runs]) for f in (np.min, np.mean, np.max))
        panel.errorbar(tolerances, mean, [mean - low, high - mean], color=COLORS[k], capsize=3, marker="o",
                       label=f"{count} joints, measured")  # fmt: skip
        panel.plot(tolerances, [row[1] for row in rows.values()], "x", color=COLORS[k], markersize=9,
                   label=f"{count} joints, published")  # fmt: skip
    panel.set(xscale="log", yscale="log", xlabel="tolerance [of the reach]", ylabel="mean passes")
    panel.legend(frameon=False)
    tidy(panel)


TABLES = "[3, tables 10 and 11]"
FIGURES: dict[str, tuple[Figure, ...]] = {
    "mb-rrt-example": (
        Figure("mb_rrt_two_joints", "RRT in the joint space of two joints: steps of 3 degrees, tolerance 0.2 cm",
               "[3, figure 11]", two_joints, size=(9.0, 4.8)),
        Figure("mb_rrt_growth", "A tree of four links grows, with its solution regions", "[3, figures 12, 13, 16, 21]",
               growth, size=(11.0, 3.6)),
        Figure("mb_rrt_directions", "Directions of the first link", "[3, figures 14 to 20]", directions,
               size=(11.0, 3.6)),
    ),
    "mb-rrt-8": (Figure("mb_rrt_goals", "Goals and answers", "[3, figures 24, 25]", goal_clouds, size=(9.0, 4.6)),),
    "mb-rrt-10": (
        Figure("mb_rrt_precision", "Passes by tolerance", TABLES, precision, "published means as crosses"),
    ),
}  # fmt: skip
