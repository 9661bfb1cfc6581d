"""The main job many times over: TITAN-4 from the bay of the subsea unit to its button, one joint at a time.

python bench/moves/titan4_sdu.py [--seeds 50] [--out bench/reports/titan4_sdu.md]
"""

from __future__ import annotations

import argparse
import platform
import time
from pathlib import Path

import numpy as np

from rrtik_ompl import load_problem, plan, shorten


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "reports" / "titan4_sdu.md")
    options = parser.parse_args()
    problem = load_problem("titan4_sdu")
    rows, failed = [], []
    for seed in range(1, options.seeds + 1):
        begin = time.perf_counter()
        found = plan(problem, "bicrdt", seed=seed)
        if found.path is None:
            failed.append(f"seed {seed}: {found.reason}")
            continue
        path = shorten(found.path, problem)
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
    lines = [
        "# TITAN-4 at the subsea distribution unit",
        "",
        f"BiCRDT and the double axis cut, seeds 1 to {options.seeds}: {len(rows)} of {options.seeds} solved, all",
        f"checked again. {platform.machine()}, Python {platform.python_version()}.",
        "Made by `python bench/moves/titan4_sdu.py`.",
        "",
        "| | mean | median | 95 % | min | max |",
        "|---|---|---|---|---|---|",
    ]
    for name, column in zip(names, table.T, strict=True):
        values = (column.mean(), np.median(column), np.quantile(column, 0.95), column.min(), column.max())
        lines.append(f"| {name} | " + " | ".join(f"{v:.3g}" for v in values) + " |")
    lines += ["", *failed] if failed else []
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    raise SystemExit(1 if failed else 0)


if __name__ == "__main__":
    main()
