"""Planning under path constraints on generated problems, every path judged densely.

About a second a problem. An interrupted run goes on where it was.
"""

from __future__ import annotations

import sys
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import NDArray
from typer import Option

from bench.constraints.pairs import TIPS, Pair, pair
from bench.constraints.peers import DELTA, Other, Others, others, versions
from bench.constraints.problems import MOST_SCENES
from bench.constraints.runs import EXPLORED, EXPLORED_LONG, LIMIT, LONG, ROUNDS, Outcome, branches, measured
from bench.shared.parts import Parts
from bench.shared.run import Roboplan, Run
from rrtik_bench.report.page import Report

LARGEST_TILT, ROUNDING = 5.0, 1e-6  # [deg]; of the judge [mm or deg]
BRANCHES = (("ur5", "upright"), ("ur5", "orientation"), ("titan4", "upright"), ("titan4", "orientation"))
Set: TypeAlias = tuple[str, str]
Outcomes: TypeAlias = dict[tuple[str, str, int], Outcome]
Theirs: TypeAlias = dict[tuple[str, str, str, int], Others]
CUP_ARMS, ARMS = ("ur5", "panda"), ("titan4", "ur5", "panda")
KINDS = ("plane", "line", "orientation")


def beside(name: str, kind: str, ours: list[Outcome], theirs: list[Others]) -> list[list[str]]:
    """Lines of the table of the peers: ours, then theirs, of the same problems."""
    solvable = sum(each.solvable for each in ours)
    found = 1e3 * np.array([each.search for each in ours if each.found])
    most = max(each.metres for each in ours), max(each.degrees for each in ours), sum(each.contacts for each in ours)
    lines = [_line(name, kind, "ours, with proofs", solvable, found, most)]
    for peer in ("ompl", "roboplan"):
        some: list[Other] = [getattr(each, peer) for each in theirs]
        times = 1e3 * np.array([each.seconds for each in some if each.found])
        seen = (
            max(each.metres for each in some),
            max(each.degrees for each in some),
            sum(each.contacts for each in some),
        )
        lines.append(_line("", "", PEERS[peer], solvable, times, seen))
    return lines


def _line(
    name: str, kind: str, who: str, solvable: int, times: NDArray[np.float64], seen: tuple[float, float, int]
) -> list[str]:
    spread = f"{np.median(times):.2f} / {np.quantile(times, 0.95):.1f}" if len(times) else "-"
    amounts = [f"{1e3 * seen[0]:.2f}", f"{seen[1]:.3f}", str(seen[2])]
    return [name, kind, who, f"{len(times)} of {solvable}", spread, *amounts]


PEERS = {"ompl": "OMPL, ProjectedStateSpace", "roboplan": "roboplan"}


def row(name: str, kind: str, outcomes: list[Outcome]) -> list[str]:
    """A line of the table."""
    found = [each for each in outcomes if each.found]
    solvable = sum(each.solvable for each in outcomes)
    if not found:
        return [name, kind, f"0 / {solvable} / {len(outcomes)}", *["-"] * 8]
    search, whole = (np.array([getattr(each, what) for each in found]) * 1e3 for what in ("search", "whole"))
    return [
        name,
        kind,
        f"{len(found)} / {solvable} / {len(outcomes)}",
        _unsolved(outcomes),
        f"{np.median(search):.2f} / {np.quantile(search, 0.95):.1f}",
        f"{np.median(whole):.1f} / {np.quantile(whole, 0.95):.1f}",
        f"{sum(each.proven for each in found)}",
        f"{np.median([each.rows for each in found]):g}",
        f"{1e3 * max(each.metres for each in outcomes):.2f}",
        f"{max(each.degrees for each in outcomes):.3f}",
        str(sum(each.contacts for each in outcomes)),
    ]


def _unsolved(outcomes: list[Outcome]) -> str:
    """How many were not solved, for lack of a way without obstacles, and with one."""
    left = [each for each in outcomes if not each.solvable]
    joined = sum(each.joined for each in left)
    return f"{len(left) - joined} / {joined}" if left else "-"


HEADS = [
    "robot",
    "constraint",
    "solved / solvable / all",
    "no way even without obstacles / one",
    "search, ms (median / 95 %)",
    "auto, ms",
    "proven free",
    "waypoints",
    "beyond, mm",
    "beyond, degrees",
    "contacts",
]


def main(
    run: Run,
    parts: Parts,
    *,
    problems: Annotated[int, Option(help="With a cup, of each of two robots.")] = 100,
    further: Annotated[
        list[str] | None,
        Option(
            "--others", help="Of each other constraint: a number, or ARM=NUMBER; may be repeated.", show_default="100"
        ),
    ] = None,
    branched: Annotated[int, Option("--branches", help="Goals of any branch, of each of four sets.")] = 30,
    pairs: Annotated[int, Option(help="Scenes of each robot with two arms.")] = 20,
    peers: Annotated[int, Option(help="Problems of each set for OMPL and roboplan too.")] = 0,
    python: Roboplan = sys.executable,
) -> Report:
    """Measure."""
    counts = _counts(further or ["100"])
    cups = [(name, "upright", seed) for name in CUP_ARMS for seed in range(problems)]
    rest = [(name, kind, seed) for name in ARMS for kind in KINDS for seed in range(counts[name])]
    ends = [(*which, seed) for which in BRANCHES for seed in range(branched)]
    sets = list(dict.fromkeys((name, kind) for name, kind, _ in cups + rest))
    asked = [(python, *which, seed) for which in sets for seed in range(peers)]
    twos = [(name, number) for name in TIPS for number in range(pairs)]
    outcomes = dict(zip(cups + rest, parts(measured, cups + rest), strict=True))
    seen = dict(zip(ends, parts(branches, ends), strict=True))
    found = dict(zip(twos, parts(pair, twos), strict=True))
    theirs = dict(zip(asked, parts(others, asked), strict=True))

    report = run.report("Path constraints")
    report.intro = (
        "Generated problems: an arm among 5 to 20 boxes, balls and cylinders, a start and a goal that keep the "
        "constraint. Times are processor time of whole calls of `plan()`, with the second check, in a world that has "
        f"been used before; the quickest of {ROUNDS}. Solvable is what a path is known of: it was solved, or found in "
        f"{LONG:g} s with another seed. Whether the rest can be solved is not known. A search of {EXPLORED_LONG:,} "
        "samples that sees no obstacles tells it apart: what that cannot connect either is most likely kept apart by "
        "the constraint and the limits of the joints. The "
        "judge looks at poses, by Pinocchio alone, at 1/50 of every stored motion and every 2 mm, and at contacts, by "
        "coal alone, at every second of them."
    )
    for name in CUP_ARMS:
        some = [outcomes[name, "upright", seed] for seed in range(problems)]
        _bars(report, f"{name}, cup upright within 5 degrees", some)
        tilt = max(each.tilt for each in some)
        report.bar(
            f"{name}, largest tilt",
            f"<= {LARGEST_TILT} degrees",
            f"{tilt:.3f} degrees",
            tilt <= LARGEST_TILT + ROUNDING,
        )
    for name in ARMS:
        for kind in KINDS:
            some = [outcomes[name, kind, seed] for seed in range(counts[name])]
            _bars(report, f"{name}, {kind}", some)
    wrong = sum(each.apart and each.solvable for each in outcomes.values())
    wrong += sum(each.apart and each.joined for each in seen.values())
    report.bar("claims that start and goal are apart, although there is a path", "0", str(wrong), wrong == 0)
    left = [each for each in seen.values() if not each.joined]
    said = [each for each in left if each.apart]
    slowest = max((each.seconds for each in said), default=0.0)
    share, text = len(said) / max(len(left), 1), f"{len(said)} of {len(left)}, the slowest after {slowest:.2f} s"
    report.bar("start and goal apart: said", ">= 90 % within 1 s", text, share >= 0.9 and slowest <= LIMIT)
    contacts = sum(each.contacts for each in outcomes.values())
    report.bar("contacts that the judge saw", "0", str(contacts), contacts == 0)
    table = [row(name, "upright", [outcomes[name, "upright", seed] for seed in range(problems)]) for name in CUP_ARMS]
    table += [
        row(name, kind, [outcomes[name, kind, seed] for seed in range(counts[name])]) for name in ARMS for kind in KINDS
    ]
    most, unmade = max(each.scenes for each in outcomes.values()), sum(not each.made for each in outcomes.values())
    text = (
        f"A problem is the first of at most {MOST_SCENES} scenes in which start and goal were found; the most that one "
        f"took were {most}, and {unmade} of {len(outcomes)} were not made. Beyond: how far the judge saw the frame "
        "outside the tolerance that was stated. The goals of these problems are not proven to be apart from their "
        "starts."
    )
    report.table("Problems", HEADS, table, text=text)
    heads = ["robot", "constraint", "all", "connected without obstacles", "proven apart", "neither"]
    lines = []
    for name, kind in BRANCHES:
        some = [seen[name, kind, seed] for seed in range(branched)]
        joined, apart = sum(each.joined for each in some), sum(each.apart for each in some)
        lines.append([name, kind, str(len(some)), str(joined), str(apart), str(len(some) - joined - apart)])
    text = f"Goals of any branch of inverse kinematics, without obstacles; {EXPLORED} samples for what is connected."
    report.table("Start and goal apart", heads, lines, text=text)
    _pairs(report, {name: [found[name, k] for k in range(pairs)] for name in TIPS})
    if theirs:
        _peers(report, python, peers, sets, outcomes, theirs)
    return report


def _pairs(report: Report, outcomes: dict[str, list[Pair]]) -> None:
    """Bars and table of arms in pairs."""
    rows = []
    for name, own in outcomes.items():
        found, solvable = sum(each.found for each in own), sum(each.solvable for each in own)
        times, faults = 1e3 * np.array([each.seconds for each in own if each.found]), sum(each.faults for each in own)
        median = float(np.median(times))
        report.bar(f"{name}, both hands: solved in 5 s", "100 %", f"{found} of {solvable}", found == solvable)
        report.bar(f"{name}, both hands: median", "<= 50 ms", f"{median:.1f} ms", median <= 50.0)
        report.bar(f"{name}, both hands: faults that the judge saw", "0", str(faults), faults == 0)
        spread = f"{median:.1f} / {np.quantile(times, 0.95):.1f} / {times.max():.1f}"
        proven = str(sum(each.proven for each in own))
        rows.append([name, f"{found} / {solvable} / {len(own)}", spread, proven])
    heads = ["robot", "solved / solvable / all", "ms, median / 95 % / worst", "proven free"]
    text = (
        "Both hands go to poses of their own (`MultiGoal`) among six balls, from a random configuration to the "
        "poses of another one. Whole calls of `plan()`, inverse kinematics, shortening, proofs, second check included."
    )
    report.table("Arms in pairs", heads, rows, text=text)


def _counts(words: list[str]) -> dict[str, int]:
    """How many problems each arm gets, from words such as ``100 panda=40``."""
    counts = dict.fromkeys(ARMS, 0)
    for word in words:
        name, _, number = word.rpartition("=")
        counts |= {name: int(number)} if name else dict.fromkeys(ARMS, int(number))
    return counts


def _peers(report: Report, python: str, count: int, sets: list[Set], outcomes: Outcomes, theirs: Theirs) -> None:
    """The table of the libraries of others, on the first problems of each set."""
    rows = []
    for which in sets:
        ours = [outcomes[(*which, seed)] for seed in range(count)]
        rows += beside(*which, ours, [theirs[(python, *which, seed)] for seed in range(count)])
    heads = ["robot", "constraint", "who", "solved / solvable", "ms (median / 95 %)", *HEADS[-3:]]
    text = (
        f"The first {count} problems of each set, {LIMIT:g} s of processor time. OMPL: RRTConnect in a "
        f"ProjectedStateSpace of step {DELTA:g}, motions checked by our world from Python. roboplan: its RRT-Connect "
        "with the same region as a PoseConstraint, its own checks of 32 a radian, no second check. Ours: `plan()` with "
        "proofs and second check, the quickest of 3 calls; theirs once. The judge is the same for all."
    )
    report.table("Beside others", heads, rows, text=text)
    report.note("Versions", versions(python))


def _bars(report: Report, what: str, outcomes: list[Outcome]) -> None:
    """The rows of one set of problems."""
    solvable = sum(each.solvable for each in outcomes)
    found = [each for each in outcomes if each.found]
    if not found:
        return
    share = len(found) / max(solvable, 1)
    median = 1e3 * float(np.median([each.search for each in found]))
    report.bar(
        f"{what}: solved in {LIMIT:g} s", ">= 99 % of the solvable", f"{len(found)} of {solvable}", share >= 0.99
    )
    report.bar(f"{what}: median", "<= 5 ms", f"{median:.2f} ms", median <= 5.0)
