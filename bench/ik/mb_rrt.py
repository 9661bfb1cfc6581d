"""MB-RRT: the published tables of [3] beside ours, every acceptance row, and what lies beyond [3].

Takes five to fifteen minutes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from bench.ik import mb_rrt_beyond as beyond
from bench.ik import mb_rrt_tables as published
from bench.shared.run import Run
from rrtik_bench.mb_rrt.runs import Measured, arm
from rrtik_bench.mb_rrt.runs import laws as laws_of
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl.ik.mb_rrt.arc import grow_on_arcs
from rrtik_ompl.ik.mb_rrt.growth import grow
from rrtik_ompl.ik.mb_rrt.links import Links, headings_to_joints, joints_to_chain, sunflower
from rrtik_ompl.viewer.plots.mb_rrt_tree import plot_tree


def structure(rng: np.random.Generator) -> float:
    """The largest fault of an edge or of forward kinematics in trees of both kinds of arm, as a share of the reach."""
    worst = 0.0
    for count in (3, 10):
        links = arm(count)
        for goal in sunflower(links, 20):
            run = grow(links, goal, tolerance=0.01, rng=rng)
            again = joints_to_chain(links.lengths, headings_to_joints(run.chain))
            worst = max(worst, run.edge_error(), float(np.abs(again - run.chain).max()))
    return worst


def acceptance_of_tables(report: Report, found: dict[int, dict[str, Measured]]) -> None:
    """Acceptance rows that tables 6 to 9 decide."""
    three, ten = found[3], found[10]
    a, b = (three["surface-a"].converged, ten["surface-a"].converged), ("surface-b", "surface-a")
    uniform = ("uniform-a", "uniform-b", "uniform-a-star", "uniform-b-star")
    least = min(found[n][u].rho_all[0] for n in (3, 10) for u in uniform)
    rho = {(n, v): found[n][v].rho_all[0] for n in (3, 10) for v in b}
    half = all(rho[n, v] < 0.5 * found[n][u].rho_all[0] for n in (3, 10) for v in b for u in uniform)
    ub, ua = (three["uniform-b"].converged, ten["uniform-b"].converged), three["uniform-a"].converged
    star = [(found[n]["uniform-b-star"].converged, found[n]["uniform-b-star"].mean) for n in (3, 10)]
    c = three["c-space"].converged, ten["c-space"].converged
    below = [found[n]["surface-b"].converged - found[n]["surface-a"].converged for n in (3, 10)]
    report.bar(
        "Surface-A",
        "10-50 % (3), 45-75 % (10), 25 points below B",
        f"{a[0]:.0f} %, {a[1]:.0f} %",
        10 <= a[0] <= 50 and 45 <= a[1] <= 75 and min(below) >= 25,
    )
    report.bar(
        "Uniform-B; Uniform-A with 3 joints",
        "35-72 % (3), 40-68 % (10); 3-35 %",
        f"{ub[0]:.0f} %, {ub[1]:.0f} %; {ua:.0f} %",
        35 <= ub[0] <= 72 and 40 <= ub[1] <= 68 and 3 <= ua <= 35,
    )
    report.bar(
        "Uniform-B*",
        "100 %; mean 55-130 (3), 230-400 (10)",
        "; ".join(f"{r:.0f} %, {m:.0f}" for r, m in star),
        all(r == 100 for r, _ in star) and 55 <= star[0][1] <= 130 and 230 <= star[1][1] <= 400,
    )
    report.bar(
        "C-space, 3 degrees",
        "30-75 % (3), 10-60 % (10)",
        f"{c[0]:.0f} %, {c[1]:.0f} %",
        30 <= c[0] <= 75 and 10 <= c[1] <= 60,
    )
    report.bar(
        "rho_10000",
        "Uniform >= 0.55; B <= 0.22 (3), <= 0.20 (10), < A (3 joints); both below half of Uniform",
        f"Uniform >= {least:.2f}; B {rho[3, b[0]]:.3f}, {rho[10, b[0]]:.3f}; A {rho[3, b[1]]:.3f}, {rho[10, b[1]]:.3f}",
        least >= 0.55 and rho[3, b[0]] <= 0.22 and rho[10, b[0]] <= 0.20 and rho[3, b[0]] < rho[3, b[1]] and half,
    )


def main(run: Run, *, quick: Annotated[bool, Option(help="Without the published tables 6 to 9.")] = False) -> Report:
    """Measure; the pictures go beside the page."""
    rng = np.random.default_rng(0)
    about = (
        f"{versions('numpy')}; seed 0. Goals of the published tables: a sunflower of points, since [3] does not "
        "say which they were. Lengths in cm."
    )
    report = run.report("MB-RRT", intro=about)
    small = Report("", "")
    exact = published.precision(small, rng)
    acceptance_of_precision(report, exact, structure(rng))
    report.note("The published tables", "")
    if not quick:
        acceptance_of_tables(report, published.tables(report))
    report.add(small)
    further = left_open(rng)
    laws(report, rng, exact)
    report.add(further)
    _pictures(run.out.parent)
    return report


def acceptance_of_precision(report: Report, exact: published.Exact, fault: float) -> None:
    """Rows that tables 10 and 11 decide, and the structure of the trees."""
    means = {n: [m[1].max() for m in exact[n].values()] for n in (3, 10)}
    everything = all(m[0] == 100.0 for n in (3, 10) for m in exact[n].values())
    longest = max(m[2] for n in (3, 10) for m in exact[n].values())
    short = np.all(np.array(means[3]) <= [8, 45, 130]) and np.all(np.array(means[10]) <= [12, 55, 140])
    report.bar("structure: edges, parents, forward kinematics", "1e-9", f"{fault:.1e} cm", fault < 1e-9)
    report.bar(
        "Surface-B, 5 random states",
        "100 %; mean <= 8 / 45 / 130 (3), 12 / 55 / 140 (10); none above 1,500",
        f"{'100' if everything else 'less than 100'} %; largest mean {_slashed(means[3])}, {_slashed(means[10])}; "
        f"longest run {longest}",
        everything and longest <= 1500 and bool(short),
    )


def laws(report: Report, rng: np.random.Generator, exact: published.Exact) -> None:
    ks, third = laws_of(rng)
    ratios = [exact[n][0.001][1].mean() / exact[n][0.01][1].mean() for n in (3, 10)]
    kept = ks < 0.01 and abs(third - 1 / 3) < 0.01 and all(2 <= r <= 5 for r in ratios)
    measured = f"{ks:.4f}; {third:.4f}; {ratios[0]:.2f}, {ratios[1]:.2f}"
    bar = "laws: arcsine KS, share outside, mu(0.001) / mu(0.01)"
    report.bar(bar, "< 0.01; 1/3 +- 0.01; 2 to 5", measured, kept)


def left_open(rng: np.random.Generator) -> Report:
    """The sections on what [3] leaves open, and the acceptance rows that they decide."""
    report = Report("", "")
    worst, outside = beyond.arcs(report, rng)
    limited = beyond.limits(report, rng)
    share, mean = beyond.obstacles(report, rng)
    axes = beyond.one_axis(report, rng)
    times, faster = beyond.against_fabrik(rng)
    report.bar(
        "arcs, 2 to 100 links, plane and space",
        "1 pass, error < 1e-9 of the reach, rho = 0",
        f"1 pass, {worst:.1e}, {outside} nodes outside",
        worst < 1e-9 and outside == 0,
    )
    report.bar(
        "arcs with limits of 60 degrees",
        ">= 95 %, mean <= 10 passes",
        f"{100 * limited[60][0]:g} %, {limited[60][1]:.2f}",
        limited[60][0] >= 0.95 and limited[60][1] <= 10,
    )
    report.bar("arcs with obstacles", "all solved", f"{100 * share:g} %, {mean:.2f} passes", share == 1.0)
    report.bar(
        "7 one-axis joints in space, 0.01 cm, polish",
        "100 % in at most 3 passes",
        f"{100 * axes[7][0]:g} %, at most {axes[7][1]}",
        axes[7][0] == 1.0 and axes[7][1] <= 3,
    )
    report.bar(
        "time, 10 joints, 0.001 cm, arcs", "below FABRIK's in the same run", "; ".join(times) + " a goal", faster
    )
    beyond.beside(report, rng)
    beyond.arms(report)
    beyond.plans(report)
    return report


def _slashed(values: list[float]) -> str:
    return " / ".join(f"{value:.1f}" for value in values)


def _pictures(folder: Path) -> None:
    """The tree of MB-RRT and that of the arcs for the arm that [3] draws: 4 links, goal (20, 30)."""
    links, goal = Links([10.0] * 4), np.array([20.0, 30.0])
    run = grow(links, goal, tolerance=0.05, rng=np.random.default_rng(1))
    plot_tree(run, folder / "mb_rrt_tree.png")
    plot_tree(grow_on_arcs(links, goal, rng=np.random.default_rng(1), passes=20), folder / "mb_rrt_arcs.png")
