"""Arcs of intersection, the growth of MB-RRT that [3] expected to be costly: exact in one pass, and beside FABRIK.

The published tables of [3] are measured by ``rrtik reproduce mb-rrt``. A minute.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from bench.shared.clocks import least
from bench.shared.mb_rrt_tree import plot_tree
from bench.shared.run import Run
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl.ik.mb_rrt.exact import arc_chains, grow_on_arcs
from rrtik_ompl.ik.mb_rrt.links import Links, directions, sunflower
from rrtik_ompl.ik.mb_rrt.published import grow

TIGHT = 1e-3  # [cm]
GOALS = 100
ROUNDS = 3
COUNTS = (3, 6, 10, 20, 50, 100)  # of joints
JUDGED = 10
RINGS = (
    "The rings in which a joint is useful, and branches through them:\n\n"
    "![published tree](mb_rrt_tree.png) ![arcs](mb_rrt_arcs.png)"
)
BESIDE = (
    f"Links of 10 cm, the same {GOALS} goals for both, as one batch and one by one; FABRIK to {TIGHT:g} cm, at most "
    "1,000 sweeps (200 above 20 joints)."
)


def main(run: Run) -> Report:
    """Measure; the pictures go beside the page."""
    rng = np.random.default_rng(0)
    about = f"{versions('numpy')}; seed 0. Lengths in cm; processor time, the least of three runs."
    report = run.report("MB-RRT on arcs", intro=about)
    arcs(report, rng)
    beside_fabrik(report, rng)
    pictures(run.out.parent)
    return report


def arcs(report: Report, rng: np.random.Generator, goals: int = 200) -> None:
    """Chains of 2 to 100 links: the error of one pass in reaches, and nodes outside of their rings."""
    rows: list[list[str]] = []
    worst = 0.0
    outside = 0
    for dimension, name in ((2, "plane"), (3, "space")):
        for count in (2, 3, 10, 30, 100):
            for kind in ("equal", "unequal"):
                errors = []
                beyond = 0
                for _ in range(goals):
                    lengths = np.full(count, 10.0) if kind == "equal" else rng.uniform(0.5, 20.0, count)
                    links = Links(lengths, dimension)
                    goal = rng.uniform(links.min_span[0], links.reach) * directions(1, dimension, rng)[0]
                    run = grow_on_arcs(links, goal, rng=rng)
                    errors.append(run.misses[0] / links.reach)
                    beyond += run.outside(1e-12)
                share = 100.0 * np.mean(np.array(errors) < 1e-9)
                cells = [str(count), name, kind, str(goals), f"{share:g} %", f"{max(errors):.1e}", str(beyond)]
                rows.append(cells)
                worst, outside = max(worst, *errors), outside + beyond
    heads = ("links", "space", "lengths", "goals", "solved in 1 pass", "worst error / reach", "nodes outside")
    report.table("Arcs of intersection", heads, rows, text=RINGS)
    report.bar(
        "arcs, 2 to 100 links, plane and space",
        "1 pass, error < 1e-9 of the reach, rho = 0",
        f"1 pass, {worst:.1e}, {outside} nodes outside",
        worst < 1e-9 and outside == 0,
    )


def beside_fabrik(report: Report, rng: np.random.Generator) -> None:
    """Time for the same goals: arcs, and FABRIK."""
    rows = []
    for count in COUNTS:
        cells, times = compared(count, rng)
        rows.append([str(count), *cells, *(f"{each:.4f}" for each in times)])
        if count == JUDGED:
            batch, batch_fabrik, single, single_fabrik = times
            text = f"one batch: {batch:.4f} beside {batch_fabrik:.4f} ms"
            text += f"; one by one: {single:.4f} beside {single_fabrik:.4f} ms a goal"
            faster = batch < batch_fabrik and single < single_fabrik
    heads = ("joints", "FABRIK: sweeps", "solved", "batch: arcs", "batch: FABRIK", "one by one: arcs", "FABRIK")
    report.table("Beside FABRIK [28]: ms a goal", heads, rows, text=BESIDE)
    report.bar(f"time, {JUDGED} joints, {TIGHT:g} cm, arcs", "below FABRIK's in the same run", text, faster)


def compared(count: int, rng: np.random.Generator) -> tuple[list[str], list[float]]:
    """FABRIK's sweeps and share solved; ms a goal of arcs and of FABRIK, as one batch and one by one."""
    links = Links([10.0] * count)
    goals = sunflower(links, GOALS)
    start = rng.uniform(-np.pi, np.pi, (GOALS, count))
    most = 200 if count > 20 else 1000

    def on_arcs(step: int) -> None:
        for k in range(0, GOALS, step):
            arc_chains(links, goals[k : k + step], rng)

    def by_fabrik(step: int) -> None:
        for k in range(0, GOALS, step):
            fabrik(links.lengths, goals[k : k + step], start[k : k + step], TIGHT, most)

    nodes, sweeps = fabrik(links.lengths, goals, start, TIGHT, most)
    solved = np.linalg.norm(nodes[:, -1] - goals, axis=1) < TIGHT
    times = [1e3 * least(partial(way, step), ROUNDS)[0] / GOALS for step in (GOALS, 1) for way in (on_arcs, by_fabrik)]
    return [f"{sweeps[solved].mean():.1f}", f"{solved.mean():.0%}"], times


def fabrik(
    lengths: np.ndarray, goals: np.ndarray, joints: np.ndarray, tolerance: float, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """FABRIK for planar chains, many goals at a time.

    Returns:
        Chains of nodes, shape (m, n + 1, 2), and sweeps taken by each, shape (m,).
    """
    nodes = chain(lengths, joints)
    sweeps = np.zeros(len(goals), dtype=int)
    left = np.arange(len(goals))
    for _ in range(most):
        left = left[np.linalg.norm(nodes[left, -1] - goals[left], axis=1) >= tolerance]
        if len(left) == 0:
            break
        x = nodes[left]
        x[:, -1] = goals[left]
        for i in range(len(lengths) - 1, -1, -1):
            x[:, i] = x[:, i + 1] + lengths[i] * unit(x[:, i] - x[:, i + 1])
        x[:, 0] = 0.0
        for i in range(len(lengths)):
            x[:, i + 1] = x[:, i] + lengths[i] * unit(x[:, i + 1] - x[:, i])
        nodes[left] = x
        sweeps[left] += 1
    return nodes, sweeps


def chain(lengths: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Nodes for joint angles, shape (m, n): (m, n + 1, 2)."""
    heading = np.cumsum(joints, axis=1)
    edges = lengths[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.concatenate([np.zeros((len(joints), 1, 2)), np.cumsum(edges, axis=1)], axis=1)


def unit(vectors: np.ndarray) -> np.ndarray:
    ends: np.ndarray = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return ends


def pictures(folder: Path) -> None:
    """The tree of MB-RRT and that of the arcs for the arm that [3] draws: 4 links, goal (20, 30)."""
    links = Links([10.0] * 4)
    goal = np.array([20.0, 30.0])
    run = grow(links, goal, tolerance=0.05, rng=np.random.default_rng(1))
    plot_tree(run, folder / "mb_rrt_tree.png")
    plot_tree(grow_on_arcs(links, goal, rng=np.random.default_rng(1), passes=20), folder / "mb_rrt_arcs.png")
