"""Pages that plan: answers and searches beside Python's, drags in a browser, sizes. Needs node and Chromium."""

from __future__ import annotations

from functools import cache
from typing import Annotated

import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.page.browser import Dragged, dragged
from bench.page.node import PROBLEMS, ROBOTS, Answers, Searches, answers_of, goal_of, in_node, searched
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.viewer.page_planner import page_planner

IN_A_BROWSER = ("panda pipes 1", "titan4_sdu", "ur5 clutter 0")
ONE_JOINT = ("titan4_sdu", "titan4_prisms", "planar3_a")
SIDE = 0.1  # [m] of the obstacles that a page can add
SMALL, QUICK = 1_250_000, 300.0  # bytes; ms
MEDIAN, TAIL = 16.0, 50.0  # [ms]
SEED = 1


@cache
def problem_of(name: str) -> rrtik.Problem:
    """One of the problems."""
    return PROBLEMS[name]()


def search_counts(name: str, one_joint: bool, seeds: int) -> Searches:
    """Searches of a problem in node and here."""
    problem = problem_of(name)
    plan = page_planner(problem, goal_of(problem), SIDE)
    if plan is None:
        raise SystemExit(f"{name}: its page cannot plan")
    found = in_node(plan, seeds=list(range(1, seeds + 1)), oneJoint=one_joint)
    return searched(problem, one_joint=one_joint, seeds=seeds, found=found)


def answer_counts(robot: str, configurations: int) -> Answers:
    """Answers of a robot in node and here."""
    return answers_of(rrtik.load_robot(robot), configurations, np.random.default_rng(SEED))


def drags_of(name: str, drags: int, timed: int) -> Dragged:
    """Drags in the page of a problem."""
    return dragged(problem_of(name), drags, timed, SEED)


def fill(
    report: Report,
    answers: dict[str, Answers],
    searches: dict[tuple[str, bool], Searches],
    drags: dict[str, Dragged],
) -> None:
    """What came out."""
    asked = sum(each.configurations for each in answers.values()), sum(each.motions for each in answers.values())
    differ = sum(each.differ for each in answers.values())
    report.bar(
        "answers of the page that differ from Python's",
        "0",
        f"{differ} of {asked[0]} configurations and {asked[1]} motions, {len(answers)} robots",
        differ == 0,
    )
    rash = sum(each.rash for each in answers.values())
    report.bar("of these: free in the page, and not in Python", "0", f"{rash}", rash == 0)
    total, other = sum(each.seeds for each in searches.values()), sum(each.other for each in searches.values())
    rounded = sum(each.rounded for each in searches.values())
    report.bar(
        "searches with another path than Python's",
        "0, or accounted for",
        f"{other} of {total}; {rounded} differ by rounding alone (at most 1e-12)",
        other == 0,
    )
    refused = sum(len(each.refused) for each in drags.values())
    paths, made = sum(each.paths for each in drags.values()), sum(each.drags for each in drags.values())
    report.bar(
        "saved paths that `rrtik check` refuses",
        "0 of 1,000 drags",
        f"{refused} of {paths} ({made} drags)",
        refused == 0,
    )
    for name, each in drags.items():
        for what, times in (("there", each.waits), ("on screen, drawn by the processor", each.times)):
            median, tail = np.percentile(times, (50, 95)) if times else (np.inf, np.inf)
            good = bool(median <= MEDIAN and tail <= TAIL)
            wanted = "median 16 ms, 95 % 50 ms"
            report.bar(f"drag to new path {what}, {name}", wanted, f"{median:.1f} ms, {tail:.0f} ms", good)
    titan = drags["titan4_sdu"]
    report.bar("page of titan4_sdu", "1.25 MB", f"{titan.size / 1e6:.2f} MB", titan.size <= SMALL)
    report.bar("until its kernels are ready", "300 ms", f"{titan.kernels:.0f} ms", titan.kernels <= QUICK)
    report.bar(
        "until it can plan, drawn by the processor",
        "300 ms",
        f"{titan.loaded:.0f} ms, of which {titan.drawing:.0f} ms start the engine and its renderer",
        titan.loaded <= QUICK,
    )
    rows = [
        [name, f"{a.configurations}", f"{a.motions}", f"{a.free}", f"{a.differ}", f"{a.rash}"]
        for name, a in answers.items()
    ]
    report.table(
        "Answers",
        ["robot", "configurations", "motions", "of the configurations free", "answers that differ", "rashly free"],
        rows,
        text="A box, a ball, a cylinder and a capsule, each moved, turned and made another size twenty times, in node. "
        "A base is compared by its triangles; one of more than 10,000 (so101, kinova) by the convex pieces around it.",
    )
    kinds = {False: "RRT-Connect", True: "one joint at a time"}
    rows = [
        [name, kinds[one], f"{s.seeds}", f"{s.equal}", f"{s.rounded}", f"{s.other}", f"{s.milliseconds:.2f}"]
        for (name, one), s in searches.items()
    ]
    heads = [
        "problem",
        "planner",
        "seeds",
        "equal to the bit",
        "equal but for rounding",
        "other",
        "median in node [ms]",
    ]
    report.table("Searches", heads, rows)
    rows = [
        [
            name,
            f"{d.drags}",
            f"{d.paths}",
            f"{len(d.refused)}",
            f"{np.median(d.waits):.1f}" if d.waits else "",
            f"{np.median(d.times):.1f}" if d.times else "",
            f"{d.kernels:.0f}",
            f"{d.loaded:.0f}",
            f"{d.size / 1e6:.2f}",
        ]
        for name, d in drags.items()
    ]
    heads = ["problem", "drags", "with a path", "refused", "path there, median [ms]", "drawn, median [ms]"]
    heads += ["kernels ready [ms]", "loaded [ms]", "page [MB]"]
    report.table(
        "Drags in headless Chromium, drawn by the processor",
        heads,
        rows,
        text="Wall times on a shared machine without a graphics card: SwiftShader draws on the processor, "
        "whose two cores it takes from the page.",
    )
    for name, each in drags.items():
        if each.refused:
            report.note(f"Refused: {name}", "\n".join(f"- {line}" for line in each.refused))


def main(
    run: Run,
    parts: Parts,
    *,
    seeds: int = 1000,
    drags: int = 1000,
    timed: Annotated[int, Option(help="Drags of each problem that are timed.")] = 60,
    configurations: Annotated[int, Option(help="Of all robots together.")] = 100_000,
) -> Report:
    """Measure."""
    share = -(-drags // len(IN_A_BROWSER))
    kinds = [(name, False) for name in PROBLEMS] + [(name, True) for name in ONE_JOINT]
    dragged = parts(drags_of, [(name, share, timed) for name in IN_A_BROWSER])
    searches = parts(search_counts, [(name, one, seeds) for name, one in kinds])
    answers = parts(answer_counts, [(robot, configurations // len(ROBOTS)) for robot in ROBOTS])
    report = run.report("Pages that plan")
    fill(
        report,
        dict(zip(ROBOTS, answers, strict=True)),
        dict(zip(kinds, searches, strict=True)),
        dict(zip(IN_A_BROWSER, dragged, strict=True)),
    )
    return report
