"""Six-joint arms among moving obstacles: the tables and bars of the DRRT-Con report that are about them."""

from __future__ import annotations

import numpy as np

from bench.replanning import runs
from bench.shared.parts import Parts
from rrtik_bench.report.page import Report

HEAD = ["arrived", "length", "repairs", "waits", "evasions", "repair median / p95 [ms]", "tick p95 [ms]"]


def figures(found: list[runs.Outcome]) -> list[str]:
    """Cells of a table, see HEAD."""
    repairs, ticks = (np.concatenate(parts) for parts in zip(*((r.repairs, r.ticks) for r in found), strict=True))
    times = "none" if len(repairs) == 0 else " / ".join(f"{1e3 * np.percentile(repairs, p):.2f}" for p in (50, 95))
    counts = [f"{np.mean([r.counts[event] for r in found]):.1f}" for event in ("repair", "wait", "evade")]
    length = np.mean([r.length for r in found])
    arrived = f"{sum(r.arrived for r in found)} of {len(found)}"
    return [arrived, f"{length:.2f}", *counts, times, f"{1e3 * np.percentile(ticks, 95):.1f}"]


def arm_rows(report: Report, count: int, measure: Parts) -> None:
    """Six joints, 20 obstacles: contact, arrival, repairs."""
    rows = []
    for name, arm in runs.ARMS.items():
        ways = {planner: [(name, seed, planner, slot, seconds) for seed in range(some)]
                for planner, some, slot, seconds in (
                    ("rrt-connect", max(count // 50, 2), 0.5, 6.0),
                    ("drrt", 2, 1.0 / runs.RATE, 6.0),
                    ("drrt-con", count, 0.5, runs.LONGEST),
                )}  # fmt: skip
        done = measure(runs.arm_outcome, [piece for pieces in ways.values() for piece in pieces])
        found = {planner: [done.pop(0) for _ in pieces] for planner, pieces in ways.items()}
        rows += [[name, planner, *figures(some), contacts(some)] for planner, some in found.items()]
        arm_bars(report, name, int(arm["count"]), found["drrt-con"])
    report.table("Six-joint arms among 20 obstacles that wander", ["arm", "planner", *HEAD, "runs with contact"], rows)


def contacts(found: list[runs.Outcome]) -> str:
    """How many runs had contact, and in what ticks it began."""
    events = [r.contacts[0] for r in found if r.contacts]
    return f"{len(events)}" + (f" ({', '.join(sorted(set(events)))})" if events else "")


def arm_bars(report: Report, name: str, count: int, found: list[runs.Outcome]) -> None:
    touched = sum(bool(r.contacts) for r in found)
    reached = np.mean([r.arrived and not r.contacts for r in found])
    repairs, ticks = (np.concatenate(parts) for parts in zip(*((r.repairs, r.ticks) for r in found), strict=True))
    nearest = min(r.nearest for r in found)
    text = f"{touched} of {len(found)} runs; nearest {1e3 * nearest:.1f} mm"
    what = f"{name}, {count} obstacles slower than the bound: runs with contact"
    enough = len(found) >= 1000
    report.bar(what, "0 of 1,000", text + ("" if enough else " (too few runs)"), touched == 0 and enough)
    text = f"{reached:.1%} of {len(found)}"
    report.bar(f"{name}: arrived without contact within {runs.LONGEST:g} s", ">= 95 %", text, reached >= 0.95)
    p95 = 1e3 * np.percentile(repairs, 95) if len(repairs) else 0.0
    report.bar(f"{name}: repair, p95 of {len(repairs)}", "< 20 ms", f"{p95:.1f} ms", p95 < 20.0)
    p95 = 1e3 * np.percentile(ticks, 95)
    report.bar(
        f"{name}: whole tick (obstacles packed, look, repair, step), p95", "< 20 ms", f"{p95:.1f} ms", p95 < 20.0
    )


def repair_rows(report: Report, count: int) -> None:
    """The same repair by other ways, at the same moments."""
    rows = []
    for name in runs.ARMS:
        quick, slower = runs.paired(name, range(count))
        for moments in (m for m in (quick, slower) if m.ours):
            ways = {runs.OURS: moments.ours, **moments.others}
            rows += [[name, what, *repair_cells(way), f"{moments.ratio(what):.1f}"] for what, way in ways.items()]
        for what, moments in (
            (runs.SCRATCH, quick),
            *((w, slower) for w in slower.others if "World" in w),
        ):
            ratio = moments.ratio(what)
            report.bar(f"{name}: median repair against {what}", ">= 5 times faster", f"{ratio:.1f} times", ratio >= 5.0)
    head = [
        "arm",
        "way to a new path",
        "repairs",
        "median [ms]",
        "p95 [ms]",
        "length: new / blocked",
        "seconds: median of ratios to DRRT-Con",
    ]
    report.table("Repairs, each also done by the others at the same moment", head, rows)


def repair_cells(way: list[tuple[float, float]]) -> list[str]:
    """Number of repairs, median and p95 of their milliseconds, and the mean length of what they found."""
    seconds, lengths = np.array(way).T
    times = [f"{1e3 * np.percentile(seconds, p):.3f}" for p in (50, 95)]
    return [str(len(way)), *times, f"{lengths.mean():.3f}"]
