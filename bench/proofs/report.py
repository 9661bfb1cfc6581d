"""Proofs of motions: what they cost, what they find, and what is left of shortened paths.

An interrupted run goes on where it was.
"""

from __future__ import annotations

from collections import Counter
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from bench.proofs.certificates import verified
from bench.proofs.measurements import Judged, Timed, batch_ratio, benchmark_problem, planned, planted, shortened
from bench.proofs.plane import plane_shortened
from bench.proofs.tampering import TAMPERINGS
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.machine import processes, processor
from rrtik_bench.report.page import Report
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.planning.generated_problems import FAMILIES
from rrtik_ompl.planning.shortening import METHODS

ARMS = ("panda", "ur5", "titan4", "puma560", "planar3", "planar10", "xarm7", "ur5_gripper")
SHORTENED_ARMS = ("panda", "ur5", "titan4", "planar3")
DEEP = 1e-6  # [m]
ROUND = 20  # certificates at a time
BARS = {"panda": (0.1, 0.8, 6.0), "ur5": (0.15, 2.0, 50.0)}  # [ms] proof alone, median of the rest, p95 or worst
BEFORE = {"panda": "12.4", "ur5": "82"}  # [ms] median of the sampled second check before there were proofs


def plans(report: Report, measure: Parts, scenes: int, arms: list[str]) -> None:
    """Plans on generated scenes with thin plates and needles."""
    parts = [(arm, family, seed) for seed, arm, family in product(range(scenes), arms, FAMILIES)]
    found = measure(planned, parts)
    rows = []
    for arm in arms:
        own = [each for part, each in zip(parts, found, strict=True) if part[0] == arm and each.found]
        rows.append([arm, *_judged(own)])
    report.table("Plans on generated scenes", ["arm", *HEADS], rows, text=GENERATED)
    done = [each for each in found if each.found]
    proven = [each for each in done if each.proven]
    cuts = sum(each.cut > DEEP for each in proven)
    report.bar("proven plans that cut something deeper than 1 um", "0", f"{cuts} of {len(proven)}", cuts == 0)
    share = len(proven) / max(len(done), 1)
    report.bar("plans that are proven", ">= 99.5 %", f"{100 * share:.1f} % of {len(done)}", share >= 0.995)


def shortenings(report: Report, measure: Parts, scenes: int, arms: list[str]) -> None:
    """Shortened paths of every method, beside those that were checked in steps alone."""
    parts = [(arm, family, seed) for seed, arm, family in product(range(scenes), arms, FAMILIES)]
    found = [dict(zip(METHODS, each, strict=True)) for each in measure(shortened, parts)]
    rows = []
    for method in METHODS:
        own = [each[method] for each in found if each[method].found]
        sound = [each for each in own if each.cut_before <= DEEP]
        longer = np.sum([each.length for each in sound]) / max(np.sum([each.before for each in sound]), 1e-9) - 1.0
        old = sum(each.cut_before > DEEP for each in own)
        deepest = 1e3 * max((each.cut_before for each in own), default=0.0)
        rows.append([method, *_judged(own), f"{100 * longer:+.2f} %", f"{old}, {deepest:.2f} mm"])
        if not METHODS[method].keeps_moves:
            report.bar(f"{method}: length beside before", "within 0.5 %", f"{100 * longer:+.2f} %", longer <= 0.005)
    heads = ["method", *HEADS, "length beside before (those that cut nothing)", "paths that cut before, deepest"]
    report.table("Shortened paths", heads, rows, text=SHORTENED)
    done = [path for each in found for path in each.values() if path.found]
    proven = [each for each in done if each.proven]
    cuts, share = sum(each.cut > DEEP for each in proven), len(proven) / max(len(done), 1)
    report.bar("proven shortened paths that cut something", "0", f"{cuts} of {len(proven)}", cuts == 0)
    report.bar("shortened paths that are proven", ">= 99 %", f"{100 * share:.1f} % of {len(done)}", share >= 0.99)


def in_the_plane(report: Report, measure: Parts, cases: int) -> None:
    """Shortened paths of planar arms before exact geometry."""
    found = [dict(zip(METHODS, each, strict=True)) for each in measure(plane_shortened, [(k,) for k in range(cases)])]
    rows, cuts, proven = [], 0, 0
    for method in METHODS:
        own = [each[method] for each in found if each[method].found]
        now, before = (sum(getattr(each, name) > DEEP for each in own) for name in ("cut", "cut_before"))
        sure = sum(each.proven for each in own)
        rows.append([method, f"{len(own)}", f"{sure}", f"{now}", f"{before}"])
        cuts, proven = cuts + now, proven + sure
    report.table("Planar arms before exact geometry", PLANE_HEADS, rows, text=PLANE)
    report.bar("planar arms: shortened paths that cut something, by exact geometry", "0", f"{cuts}", cuts == 0)


def certificates(report: Report, measure: Parts, paths: int) -> None:
    """Certificates of random paths, and as many falsified in each way."""
    rounds = paths // ROUND
    found = sum((Counter(each) for each in measure(verified, [(ROUND, seed) for seed in range(rounds)])), Counter())
    wrong = sum(count for name, count in found.items() if name.startswith("WRONG"))
    refused = {name: found[f"{name}: refused"] for name in TAMPERINGS}
    rows = [[name, f"{count}", f"{found[f'WRONG: {name}: accepted']}"] for name, count in refused.items()]
    report.table("Falsified certificates", ["falsified by", "refused", "accepted"], rows, text=FALSIFIED)
    text = f"{found['accepted']} of {rounds * ROUND} accepted; {sum(refused.values())} falsified ones refused"
    report.bar("certificates: all accepted, all falsified ones refused", "all", text, wrong == 0)


def thin(report: Report, measure: Parts, seeds: int, arms: list[str]) -> None:
    """Obstacles that discrete checks step over."""
    parts = list(product([arm for arm in arms if arm in ("panda", "ur5", "titan4", "xarm7")], range(seeds)))
    found = np.array(measure(planted, parts)).reshape(-1, 3).sum(axis=0)
    text = f"{found[1]} and {found[2]} (the other way) of {found[0]}"
    report.bar("needles and plates that discrete checks step over, found", "all", text, (found[1:] == found[0]).all())


def benchmarks(report: Report, measure: Parts, folder: Path, every: int) -> None:
    """MotionBenchMaker problems of two arms."""
    rows = []
    for arm, (proof, median, worst) in BARS.items():
        home = folder / f"mbm_{arm}"
        files = sorted(str(file) for file in (home / "problems").rglob("scene*.yaml"))[::every]
        urdf = str(home / f"{arm}.urdf")
        found: list[Timed] = measure(benchmark_problem, [(file, urdf) for file in files])
        times = [(each.default, each.rest, each.proof, each.sampled) for each in found]
        default, rest, alone, sampled = 1e3 * np.array(times).T
        proven, count = sum(each.proven for each in found), len(found)
        report.bar(f"{arm}: plans that are proven", "all", f"{proven} of {count}", proven == count)
        report.bar(
            f"{arm}: proof of one path [ms], median",
            f"<= {proof:g}",
            f"{np.median(alone):.3f}",
            np.median(alone) <= proof,
        )
        high, what = (np.quantile(rest, 0.95), "95 %") if arm == "panda" else (rest.max(), "worst")
        text = f"{np.median(rest):.2f}, {high:.1f}"
        held = np.median(rest) <= median and high <= worst
        report.bar(f"{arm}: plan() less the attempt [ms], median, {what}", f"<= {median:g}, {worst:g}", text, held)
        cells = [
            f"{np.median(x):.3f} / {np.quantile(x, 0.95):.3f} / {x.max():.3f}" for x in (default, alone, rest, sampled)
        ]
        rows.append([arm, f"{proven} of {count}", *cells, BEFORE[arm]])
        cage = next(file for file in files if "cage" in file)
        discrete, proofs, _ = measure(batch_ratio, [(cage, urdf)])[0]
        text = f"{proofs / discrete:.2f} ({1e6 * discrete:.1f} us a motion discrete, {1e6 * proofs:.1f} proven)"
        report.bar(f"{arm}: motions_proven beside the discrete check, cage", "<= 5", text, proofs <= 5.0 * discrete)
    heads = [
        "arm",
        "proven",
        "plan(problem)",
        "proof of one path",
        "plan() less the attempt",
        "second check in steps",
        "before",
    ]
    report.table("MotionBenchMaker: processor time [ms], median / 95 % / worst", heads, rows, text=MBM)


def _judged(own: list[Judged]) -> list[str]:
    proven = [each for each in own if each.proven]
    cut = max((each.cut for each in proven), default=0.0)
    open_ = max((each.cut for each in own if not each.proven), default=0.0)
    kept = np.median([1e3 * each.clearance for each in proven]) if proven else 0.0
    return [f"{len(own)}", f"{len(proven)}", f"{1e6 * cut:.2f}", f"{1e6 * open_:.2f}", f"{kept:g}"]


HEADS = ["paths", "proven", "deepest cut of these [um]", "of the others [um]", "clearance kept, median [mm]"]
GENERATED = (
    "Scenes of `rrtik_ompl.planning.generated_problems` with up to six plates of 0.1 mm and needles of 0.2 mm radius "
    "about the straight way; planners by turns: fastrrtconnect, bicrdt, OMPL's RRTConnect. The judge samples every "
    "path at 1/50 of the motion resolution with the discrete checks, every 100th sample with coal and numpy alone, and "
    "measures with coal how deep it is in."
)
SHORTENED = (
    "The same scenes and judge. Before: the same method with the same seed, motions checked in steps half as long as "
    "the motion resolution, without clearance and proofs. fewest-moves has 2 s each time. axis, "
    "axis-rounds and fewest-moves take paths of single-joint moves, the others straight motions."
)
PLANE_HEADS = ["method", "paths", "proven", "paths that cut", "before"]
PLANE = (
    "Arms of 2 to 4 links among discs and rectangles, drawn at random; how deep a motion cuts is bounded from both "
    "sides in plane geometry alone, so nothing is stepped over. A cut is deeper than 1 um. Before: as above."
)
FALSIFIED = (
    "Certificates of random paths of six robots are written, read and verified by the module that knows neither "
    "kernels nor planners; then each is falsified in every way that it allows."
)
MBM = (
    "`plan(problem)`, then `plan(problem, 'fastrrtconnect')` of every problem, kernels warm, robot known; the other "
    "columns are of the second. Proof of one path: `World.prove` of the first path found; second check in steps: "
    "`World.certify` at half the resolution. Before: the median of that check over 350 problems as `plan()` made it "
    "before there were proofs."
)


def main(
    run: Run,
    parts: Parts,
    *,
    scenes: Annotated[int, Option(help="Of each arm and family.")] = 6,
    shortened: Annotated[int, Option(help="Scenes of each arm and family that are shortened.")] = 4,
    planted: Annotated[int, Option(help="Rounds of planted obstacles of each arm.")] = 15,
    plane: Annotated[int, Option(help="Arms in the plane whose paths are shortened.")] = 30,
    certified: Annotated[int, Option("--certificates", help="Paths whose certificates are falsified.")] = 60,
    arms: Annotated[list[str] | None, Option(help="This arm; may be repeated.")] = None,
    mbm: Annotated[Path | None, Option(help="Holds mbm_panda and mbm_ur5; without it those rows are left out.")] = None,
    every: Annotated[int, Option(help="Every so many-th of these problems.")] = 2,
) -> Report:
    """Measure."""
    chosen = [one_of(ARMS, name, "arm") for name in arms or ARMS]
    report = run.report("Proofs of motions", f"{processes(run.jobs)}, {processor()}")
    if mbm is not None:
        benchmarks(report, parts, mbm, every)
    plans(report, parts, scenes, chosen)
    thin(report, parts, planted, chosen)
    shortenings(report, parts, shortened, [arm for arm in SHORTENED_ARMS if arm in chosen])
    in_the_plane(report, parts, plane)
    certificates(report, parts, certified)
    return report
