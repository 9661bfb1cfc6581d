"""The genetic algorithm with range reduction: tables of [2] beside both presets, acceptance rows, extensions.

Usage: ``python bench/ik/genetic_report.py [--quick] [--out bench/reports/genetic.md]``; a few minutes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bench.ik.genetic_extensions import extensions
from bench.shared.pages import add_out
from rrtik_bench.genetic.published import FIRST_POINT, INCH, REFERENCE, TABLE_4, TABLE_5, curve, expanded_tip
from rrtik_bench.genetic.runs import JUMP, TRAJECTORIES, TrajectoryRun, arm, mean, median, run, runs
from rrtik_bench.report.page import Report
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.genetic.options import HISTORICAL, STANDARD
from rrtik_ompl.viewer.plots.joints import COLORS, save_figure, tidy

SLOW = replace(HISTORICAL, gene_mutation=0.005, stall=None)  # the other fit that the sources name
D7 = (2.2, 4.0, 8.0)


def kinematics(report: Report) -> None:
    """Reference values, the expanded formulas, the closed form and its branches inside the limits."""
    worst = 0.0
    for degrees, wanted in REFERENCE.items():
        tip = arm(len(degrees)).fk_batch(np.radians([degrees]))[0, :3, 3] / INCH
        worst = max(worst, float(np.abs(tip - wanted).max()))
    report.bar("kinematics: reference values [in]", "to 1e-4", f"{worst:.1e}", worst <= 1e-4)
    five = arm(5)
    Q = np.random.default_rng(0).uniform(five.lower, five.upper, (10_000, 5))
    off = float(np.abs(five.fk_batch(Q)[:, :3, 3] / INCH - expanded_tip(Q)).max())
    report.bar("kinematics: expanded = compact [in]", "to 1e-12", f"{off:.1e}", off <= 1e-12)
    residual, branches = 0.0, []
    for number in TRAJECTORIES:
        found = solutions(arm(3), curve(number) * INCH)
        assert found.residuals is not None
        residual = max(residual, float(found.residuals[found.real][:, 0].max()) / INCH)
        branches.append(int(found.valid.all(axis=0).sum()))
    report.bar("closed form: residual [in]", "< 1e-9", f"{residual:.1e}", residual < 1e-9)
    report.bar(
        "branches inside the limits at all 251 points, by trajectory", "2", str(branches)[1:-1], branches == [2] * 4
    )


def standard(report: Report, seeds: int) -> dict[int, list[TrajectoryRun]]:
    """Three joints, gain 1."""
    done = runs(arm(3), replace(STANDARD, gain=1.0), seeds)
    every = [each for rows in done.values() for each in rows]
    complete, counts = min(each.completed for each in every), [each.generations for each in every]
    means = [mean(rows, "generations") for rows in done.values()]
    what = f"3 joints, standard, gain 1, {seeds} states x 4: "
    report.bar(what + "complete", "100 %", f"{complete:.0f} %", complete == 100.0)
    shown = " / ".join(f"{value:.0f}" for value in means)
    report.bar(what + "mean generations by trajectory", "<= 800", shown, max(means) <= 800)
    report.bar(what + "most generations", "<= 2,500", str(max(counts)), max(counts) <= 2500)
    step, error = max(each.largest_step for each in every), max(each.errors.max() for each in every)
    report.bar(what + "largest step [deg]", "<= 1", f"{step:.2f}", step <= 1.0)
    report.bar(what + "largest error [in]", "< 0.002", f"{error:.6f}", error < 0.002)
    off = max(each.off_branch for each in every)
    report.bar(what + "off one branch of the closed form [deg]", "<= 0.03", f"{off:.4f}", off <= 0.03)
    seconds = float(np.median([each.seconds for each in every]))
    slowest = max(each.seconds for each in every)
    report.bar(
        "processor time of a trajectory, 3 joints, standard [s], median (slowest)",
        "<= 0.2",
        f"{seconds:.2f} ({slowest:.2f})",
        seconds <= 0.2,
    )
    rows = [
        [
            str(number),
            f"{mean(each, 'generations'):.0f}",
            f"{mean(each, 'first'):.0f}",
            f"{mean(each, 'single'):.0f}",
            f"{max(one.largest_step for one in each):.2f}",
            f"{min(one.errors.min() for one in each):.1e} .. {max(one.errors.max() for one in each):.1e}",
            str(sum(one.jumps for one in each)),
        ]
        for number, each in done.items()
    ]
    head = [
        "trajectory",
        "generations",
        "first point",
        "points in one generation [%]",
        "largest step [deg]",
        "errors [in]",
        "jumps",
    ]
    report.table(f"Three joints, standard, gain 1, {seeds} runs each", head, rows)
    return done


def without_reduction(
    report: Report, with_it: dict[int, list[TrajectoryRun]], seeds: int
) -> dict[int, list[TrajectoryRun]]:
    """How much the reduction saves."""
    bare = runs(arm(3), replace(STANDARD, window=None), seeds)
    shares = [mean(bare[n], "generations") / mean(with_it[n], "generations") for n in TRAJECTORIES]
    shown = " / ".join(f"{share:.1f}" for share in shares)
    report.bar("generations without / with range reduction, by trajectory", ">= 4", shown, min(shares) >= 4.0)
    return bare


def historical(report: Report, bare: dict[int, list[TrajectoryRun]], seeds: int) -> None:
    """Table 4 of [2] beside both presets."""
    old = runs(arm(3), replace(HISTORICAL, gain=0.0), seeds)
    old_bare = runs(arm(3), replace(HISTORICAL, window=None), seeds)
    unfaithful = runs(arm(3), replace(STANDARD, gain=0.0), seeds)
    rows = []
    for number in TRAJECTORIES:
        (share, per_point), (generations, per_point_with) = TABLE_4[number]
        rows.append(
            [str(number), "published", f"10000, {share} %", str(per_point), str(generations), str(per_point_with)]
        )
        rows.append([str(number), "historical, gain 0", *_cells(old_bare[number]), *_cells(old[number])])
        rows.append([str(number), "standard, gain 0", *_cells(bare[number]), *_cells(unfaithful[number])])
    head = ["trajectory", "", "without reduction", "Ger/Pt", "with it", "Ger/Pt"]
    report.table(
        f"Table 4: three joints, mean of {seeds} runs (share of the points where not all were reached)", head, rows
    )
    shares = [mean(old_bare[n], "completed") for n in TRAJECTORIES]
    shown = " / ".join(f"{share:.0f} %" for share in shares)
    report.bar("historical without reduction: points at 10,000 generations", "<= 60 %", shown, max(shares) <= 60.0)
    counts = [mean(old[n], "generations") for n in TRAJECTORIES]
    shown = " / ".join(f"{count:.0f}" for count in counts)
    report.bar(
        "historical with reduction: mean on trajectory 1", "1,000-3,000", f"{counts[0]:.0f}", 1000 <= counts[0] <= 3000
    )
    ordered = counts[0] < counts[2] < min(counts[1], counts[3])
    report.bar("historical with reduction: order 1 < 3 < 2, 4", "so ordered", shown, ordered)
    firsts = [f"{mean(old[n], 'first'):.0f}" for n in TRAJECTORIES]
    report.table(
        "Generations to the first point, three joints",
        ["", *(str(n) for n in TRAJECTORIES)],
        [
            ["published", *(str(n) for n in FIRST_POINT[3])],
            [f"historical, mean of {seeds}", *firsts],
            ["standard", *(f"{mean(unfaithful[n], 'first'):.0f}" for n in TRAJECTORIES)],
            ["points in one generation, published (average) [%]", "25", "25", "25", "25"],
            ["the same, historical [%]", *(f"{mean(old[n], 'single'):.0f}" for n in TRAJECTORIES)],
        ],
    )


def _cells(each: list[TrajectoryRun]) -> list[str]:
    """Mean generations, the share of points if it is not 100 %, and generations per point."""
    share = mean(each, "completed")
    text = f"{mean(each, 'generations'):.0f}" + (f", {share:.0f} %" if share < 100.0 else "")
    points = np.mean([len(one.result.q) for one in each])
    return [text, f"{int(mean(each, 'generations') / points)}"]


def five_joints(report: Report, seeds: int) -> None:
    """Table 5, gain 0, three lengths of the last segment."""
    ours = {d7: runs(arm(5, d7), replace(STANDARD, gain=0.0), seeds) for d7 in D7}
    every = [one for cell in ours.values() for rows in cell.values() for one in rows]
    share = 100.0 * float(np.mean([one.completed == 100.0 for one in every]))
    middles = [median(rows, "generations") for cell in ours.values() for rows in cell.values()]
    step = max(one.largest_step for one in every)
    what = f"5 joints, standard, gain 0, d7 = 2.2, 4, 8, {seeds} states x 4: "
    report.bar(what + "complete within 20,000", ">= 98 %", f"{share:.1f} %", share >= 98.0)
    report.bar(what + "largest median of generations", "<= 3,500", f"{max(middles):.0f}", max(middles) <= 3500)
    report.bar(what + "largest step [deg]", "<= 10", f"{step:.1f}", step <= 10.0)
    few = max(2, seeds // 3)
    old = runs(arm(5), replace(HISTORICAL, gain=0.0), few)
    slow = runs(arm(5), replace(SLOW, gain=0.0), few)
    rows = []
    for number in TRAJECTORIES:
        middle = " / ".join(f"{median(ours[d7][number], 'generations'):.0f}" for d7 in D7)
        published = f"{TABLE_5[number][0]} ({TABLE_5[number][1]})"
        rows.append(
            [str(number), published, middle, *(f"{_cells(x[number])[0]} ({_cells(x[number])[1]})" for x in (old, slow))]
        )
    head = ["trajectory", "published (Ger/Pt)", f"standard, d7 = 2.2 / 4 / 8 in, median of {seeds}"]
    head += [f"historical, 2.2 in, mean of {few}", f"historical at 0.005 a gene, no restarts, mean of {few}"]
    report.table("Table 5: five joints, gain 0", head, rows)
    first = [[f"{mean(x[n], 'first'):.0f}" for n in TRAJECTORIES] for x in (ours[2.2], old)]
    report.table(
        "Generations to the first point, five joints",
        ["", *(str(n) for n in TRAJECTORIES)],
        [["published", *(str(n) for n in FIRST_POINT[5])], ["standard", *first[0]], ["historical", *first[1]]],
    )


def divergence(report: Report, seeds: int) -> None:
    """Five joints with gain 1, the documented failure."""
    done = runs(arm(5), replace(STANDARD, gain=1.0, start_over=None), seeds)
    rows = []
    for number, each in done.items():
        jumps = f"{sum(one.jumps for one in each) / len(each):.1f}"
        rows.append(
            [str(number), f"{mean(each, 'completed'):.0f}", f"{max(one.largest_step for one in each):.0f}", jumps]
        )
    failed = float(np.mean([one.completed < 100.0 for each in done.values() for one in each]))
    head = ["trajectory", "points [%]", "largest step [deg]", f"jumps above {JUMP:.0f} deg a run"]
    report.table(f"Five joints, gain 1: it diverges ({seeds} runs each, 20,000 generations)", head, rows)
    shown = f"{100 * failed:.0f} % of the runs end at the limit"
    report.bar("5 joints, gain 1", "shown to diverge", shown, failed > 0.5)


def picture(file: Path) -> None:
    """The distance of the best individual over the generations, with and without the reduction, both presets."""
    figure = Figure(figsize=(9.0, 7.5), layout="constrained")
    axes = figure.subplots(2, 1)
    for axis, name, preset, gain in ((axes[0], "standard", STANDARD, 1.0), (axes[1], "historical", HISTORICAL, 0.0)):
        for label, window, colour in (
            ("whole range throughout", None, COLORS[1]),
            ("5 degrees", preset.window, COLORS[0]),
        ):
            one = run(arm(3), 1, replace(preset, gain=gain, window=window), 0)
            text = f"{label}: {len(one.result.q)} points in {one.generations} generations"
            axis.plot(np.arange(1, one.generations + 1), one.result.distances / INCH, lw=0.6, color=colour, label=text)
        axis.axhline(0.002, color=COLORS[6], lw=0.8, ls="--", label="tolerance")
        axis.set(
            yscale="log", xscale="log", ylabel="distance of the best [in]", title=f"Trajectory 1, three joints, {name}"
        )
        axis.set_xlim(1, None)
        axis.legend(loc="upper right", fontsize=9, frameon=False)
        tidy(axis)
    axes[1].set_xlabel("generation")
    save_figure(figure, file, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two runs of everything")
    add_out(parser, "genetic.md")
    options = parser.parse_args()
    many, few = (2, 1) if options.quick else (10, 5)
    report = Report("Genetic algorithm with range reduction (GA-REB)", "python bench/ik/genetic_report.py")
    picture(options.out.with_suffix(".png"))
    report.note("Distance over generations", f"![distance of the best individual]({options.out.stem}.png)")
    kinematics(report)
    done = standard(report, many)
    bare = without_reduction(report, done, few)
    historical(report, bare, few)
    five_joints(report, many)
    divergence(report, max(1, few - 2))
    extensions(report, few)
    report.finish(options.out)


if __name__ == "__main__":
    main()
