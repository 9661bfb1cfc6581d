"""Large scenes: thousands of boxes, clouds of points, many queries by threads, clusters.

What is done is kept beside the page until that is written.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from typer import Option

from bench.scale.boxes import PLANNER, Among, among_boxes, among_panels
from bench.scale.clouds import RADIUS, Seen, files_of, memory_of, seen_as_points
from bench.scale.cluster import TASKS, Measured, on_workers, simulated
from bench.scale.replans import POINTS, RATE, Walk, walks
from bench.scale.threads import Spread, plans_in_threads, poses_in_threads
from bench.shared.parts import Parts
from bench.shared.run import PandaSet, Run
from bench.speed.machine import machine
from rrtik_bench.report.page import Report

AT_ONCE = 10  # runs of replanning in a part
ROOM_TEXT = (
    "The same room, 1.5 m wide, whatever the number of its panels: what grows is the number of boxes alone. The last "
    "columns tell the motions of the named planner and what one costs, proofs and all else included."
)
DRAWN_TEXT = (
    "Boxes of 2 cm at most, drawn in a ball of 1.5 m, from 1,000 on as much of it. They leave the arm less and less "
    "room, so that each plan takes more motions: time grows with how hard the problems are, too."
)
MANY, MOST = 100_000, 1_000_000  # points


def boxes(report: Report, title: str, found: list[Among], text: str) -> None:
    """How time grows with the number of boxes."""
    heads = ["boxes", "`World()`, a box [us]", "a configuration [us]", "moving one box [us]", "and a check"]
    heads += ["free", "`plan(problem)`, median [ms]", "95 % [ms]", f"`{PLANNER}`, median [ms]", "its motions, median"]
    heads += ["one of them [us]", "found"]
    rows = []
    for a in found:
        plans = np.array(a.plans)
        motion = 1e3 * sum(a.named) / sum(a.motions)
        whole = (np.median(plans), np.quantile(plans, 0.95), np.median(a.named), np.median(a.motions), motion)
        times = [f"{number:.3g}" for number in (a.world, a.check, a.move, a.moved)]
        numbers = [f"{number:.4g}" for number in whole]
        rows.append([f"{a.count:,}", *times, f"{100 * a.free:.0f} %", *numbers, f"{a.found} of {len(plans)}"])
    report.table(title, heads, rows, text=text)
    hundred = max((a for a in found if a.count <= 150), key=lambda a: a.count)
    most = max(found, key=lambda a: a.count)
    last = float(np.median(most.plans))
    grown, root = last / float(np.median(hundred.plans)), (most.count / hundred.count) ** 0.5
    report.bar(
        f"{title}: plan(), {most.count:,} beside {hundred.count}", f"<= {root:.1f} times", f"{grown:.1f}", grown <= root
    )
    report.bar(f"{title}: plan(), {most.count:,}", "<= 12 ms", f"{last:.3g} ms", last <= 12.0)


def single_boxes(report: Report, found: list[Among]) -> None:
    """What one box costs a world, and to be moved."""
    most, thousand = max(found, key=lambda a: a.count), min(found, key=lambda a: abs(a.count - 1000))
    report.bar(f"World() of {most.count:,} boxes, a box", "<= 15 us", f"{most.world:.3g} us", most.world <= 15)
    report.bar(f"moving one of {thousand.count:,} boxes", "<= 50 us", f"{thousand.move:.3g} us", thousand.move <= 50)


def clouds(report: Report, count: int, found: list[Seen], bars: tuple[float, float, float]) -> None:
    """Clouds of so many points; ``bars``: build [ms], a configuration [us], whole plan [ms]."""
    asked = [each for each in found if each.state != "swallowed"]
    planned = [each for each in asked if each.state == "planned"]
    middle = {name: float(np.median([getattr(each, name) for each in asked])) for name in ("build", "world", "check")}
    times = [each.plan for each in asked]
    heads = [
        "points",
        "problems",
        "swallowed",
        "planned",
        "proven",
        "tree [ms]",
        "`World()` [ms]",
        "a configuration [us]",
    ]
    heads += ["`plan(problem)`, median [ms]", "95 % [ms]", f"`{PLANNER}`, median [ms]", "nearest point [mm]"]
    judged = [each.nearest for each in planned if not np.isnan(each.nearest)]
    row = [f"{count:,}", str(len(found)), str(len(found) - len(asked)), str(len(planned))]
    row += [str(sum(each.proven for each in planned)), *(f"{middle[name]:.3g}" for name in ("build", "world", "check"))]
    named = [each.named for each in asked]
    row += [f"{np.median(times):.3g}", f"{np.quantile(times, 0.95):.3g}", f"{np.median(named):.3g}"]
    row += [f"{1e3 * min(judged):.3g}" if judged else "-"]
    text = (
        f"Obstacles of the Panda's problems as points on their surfaces, {1e3 * RADIUS:g} mm each; a path is compared "
    )
    text += "with every point near it by coal alone, every 0.02 rad."
    report.table(f"Clouds of {count:,} points", heads, [row], text=text)
    build, plan = middle["build"] + middle["world"], float(np.median(times))
    name = f"{count:,} points"
    report.bar(f"{name}: build, with the world", f"<= {bars[0]:g} ms", f"{build:.3g} ms", build <= bars[0])
    if bars[1]:
        held = middle["check"] <= bars[1]
        report.bar(f"{name}: one configuration", f"<= {bars[1]:g} us", f"{middle['check']:.3g} us", held)
    report.bar(f"{name}: whole plan, median", f"<= {bars[2]:g} ms", f"{plan:.3g} ms", plan <= bars[2])
    share = len(planned) / len(asked)
    report.bar(f"{name}: solved of those not swallowed", "100 %", f"{100 * share:.3g} %", share == 1.0)
    if judged:
        close = sum(gap <= 0.0 for gap in judged)
        report.bar(f"{name}: paths with a point too near, by coal", "0", f"{close} of {len(judged)}", close == 0)


def threads(report: Report, plans: Spread, poses: Spread) -> None:
    """One thread beside two."""
    heads = ["work", "number", "found", "two threads beside one: median, best", "alike", "best rate [1/s]", "load"]
    rows = []
    for what, s in (("`plan_many`, Panda, bookshelf", plans), ("`solve_ik_many`, UR5", poses)):
        ratios = f"{np.median(s.ratios):.2f}, {max(s.ratios):.2f}"
        alike = "yes" if s.alike else "NO"
        rows.append([what, f"{s.count:,}", f"{s.found:,}", ratios, alike, f"{s.rate:,.0f}", f"{s.load:.1f}"])
    text = "Wall times, by turns, so what else the machine does (its load stands beside it) makes the ratios smaller."
    report.table("Threads", heads, rows, text=text)
    best = max(plans.ratios)
    report.bar("1,000 queries: 2 threads beside 1 (best of turns)", ">= 1.8 times", f"{best:.2f}", best >= 1.8)
    report.bar("1,000 queries: same paths", "all", "all" if plans.alike else "NOT ALL", plans.alike)
    report.bar("whole plans a second, both cores", ">= 3,000", f"{plans.rate:,.0f}", plans.rate >= 3000)


def replanning(report: Report, found: list[Walk]) -> None:
    """Runs from clouds."""
    ticks = np.concatenate([each.ticks for each in found])
    touched, slow = sum(each.contacts > 0 for each in found), float(np.quantile(ticks, 0.95))
    arrived, proven = sum(each.arrived for each in found), float(np.mean([each.proven for each in found]))
    text = (
        f"{len(found)} runs of a UR5 beside a ball that sways, seen as {POINTS:,} points anew {RATE:g} times a second: "
    )
    text += (
        f"{arrived} arrived in time, {100 * proven:.1f} % of the motions proven; ticks of {np.median(ticks):.3g} ms "
    )
    text += (
        f"(median), {slow:.3g} ms (95 %), {ticks.max():.3g} ms (longest) of processor time, the making of the points "
    )
    report.note("Replanning from clouds", text + "left out. Contacts by coal, with the ball itself, six places a tick.")
    report.bar(f"replanning from clouds, {len(found)} runs: with contact", "0", str(touched), touched == 0)
    report.bar("replanning from clouds: tick, 95 %", "<= 20 ms", f"{slow:.3g} ms", slow <= 20.0)


def cluster(report: Report, found: list[Measured]) -> None:
    """Workers that are there, and a thousand that are not."""
    heads = ["workers", "tasks", "solved", "wall [s]", "scheduler, a task [ms of processor time]"]
    rows = [[str(m.workers), str(TASKS), str(m.solved), f"{m.wall:.2f}", f"{1e3 * m.scheduler:.2f}"] for m in found]
    text = "Workers on this machine of 2 cores. A task is the name of a problem: its world is made on the worker, once."
    report.table("A Dask cluster", heads, rows, text=text)
    booked = float(np.median([m.scheduler for m in found]))
    heads = ["workers", "task [s]", "tasks", "wall [s]", "time spent planning", "given out again"]
    rows = []
    for task in (0.01, 1.0, 60.0):
        for workers in (1, 100, 1000):
            s = simulated(workers, max(20 * workers, 1000), task, booked)
            number = max(20 * workers, 1000)
            rows.append(
                [f"{workers:,}", f"{task:g}", f"{number:,}", f"{s.wall:.3g}", f"{100 * s.busy:.1f} %", str(s.again)]
            )
    text = f"One scheduler that books a task in {1e3 * booked:.2f} ms, as measured; workers begin in 3 s, get 50 kB of "
    text += "problem files once each over one line of 1 Gbit/s, and are lost once a day; lengths are log-normal."
    report.table("A thousand workers, by simulation", heads, rows, text=text)


def main(
    run: Run,
    parts: Parts,
    panda: PandaSet,
    *,
    boxed: Annotated[
        list[int] | None, Option("--boxes", help="How many; may be repeated.", show_default="1 to 10,000")
    ] = None,
    problems: int = 50,
    few: Annotated[int, Option("--large", help="Problems with a million points.")] = 10,
    runs: int = 200,
    queries: int = 1000,
) -> Report:
    """Measure."""
    counts = boxed or [1, 10, 100, 1000, 10_000]
    folder = str(panda)
    files = files_of(panda, problems)
    among = parts(among_boxes, [[n] for n in counts])
    inside = parts(among_panels, [[n] for n in counts])
    seen = parts(seen_as_points, [[file, folder, MANY, True] for file in files])
    large = parts(seen_as_points, [[file, folder, MOST, False] for file in files[:few]])
    (memory,) = parts(memory_of, [[MOST]])
    (plans,) = parts(plans_in_threads, [[folder, queries]])
    (poses,) = parts(poses_in_threads, [[100_000]])
    spread = parts(on_workers, [[n] for n in (1, 2, 4)])
    walked = [walk for part in parts(walks, [[first, AT_ONCE] for first in range(0, runs, AT_ONCE)]) for walk in part]

    report = run.report("Large scenes")
    report.note("Machine", machine())
    boxes(report, "A UR5 in a room of panels", inside, ROOM_TEXT)
    boxes(report, "A UR5 among boxes drawn around it", among, DRAWN_TEXT)
    single_boxes(report, among)
    clouds(report, MANY, seen, (25.0, 2.0, 3.0))
    clouds(report, MOST, large, (300.0, 0.0, 6.0))
    report.bar("memory of a cloud of 1,000,000 points", "<= 150 MB", f"{memory:.0f} MB", memory <= 150.0)
    threads(report, plans, poses)
    replanning(report, walked)
    cluster(report, spread)
    return report
