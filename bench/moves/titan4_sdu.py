"""The main job many times over: TITAN-4 from the bay of the subsea unit to its button, one joint at a time.

python bench/moves/titan4_sdu.py [--seeds 50] [--out bench/reports/titan4_sdu.md]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from bench.shared.pages import add_out
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl import load_problem, plan, shorten


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50)
    add_out(parser, "titan4_sdu.md")
    options = parser.parse_args()
    problem = load_problem("titan4_sdu")
    rows, failed = [], []
    for seed in range(1, options.seeds + 1):
        begin = time.perf_counter()
        found = plan(problem, "bicrdt", seed=seed)
        if found.path is None:
            failed.append(f"seed {seed}: {found.reason}")
            continue
        path = shorten(found.path, problem, method="axis")
        seconds = time.perf_counter() - begin
        rows.append((found.path.transitions, path.transitions, found.path.length, path.length, found.seconds, seconds))
    table = np.array(rows)
    names = (
        "transitions, raw",
        "transitions, double cut",
        "length raw [rad]",
        "length cut [rad]",
        "search [s]",
        "all [s]",
    )
    report = Report(
        "TITAN-4 at the subsea distribution unit",
        "python bench/moves/titan4_sdu.py",
        intro=f"BiCRDT and the double axis cut, seeds 1 to {options.seeds}: {len(rows)} of {options.seeds} solved, all "
        f"checked again. {versions()}.",
    )
    lines = [[name, *(f"{value:.3g}" for value in spread(column))] for name, column in zip(names, table.T, strict=True)]
    report.table("", ("", "mean", "median", "95 %", "min", "max"), lines)
    report.note("", "\n".join(failed))
    report.finish(options.out)
    raise SystemExit(1 if failed else 0)


def spread(column: np.ndarray) -> tuple[float, ...]:
    """Mean, median, 95th percentile, least and largest."""
    return column.mean(), np.median(column), np.quantile(column, 0.95), column.min(), column.max()


if __name__ == "__main__":
    main()
