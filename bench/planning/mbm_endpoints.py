"""Load all MotionBenchMaker problems of the Panda set and check that start and goal are free, with the exact meshes.

Run: ``python bench/planning/mbm_endpoints.py FOLDER``, the unpacked set (``panda.urdf``, ``panda.srdf``,
``problems/``). Prints a table; exit code 0 if every problem loads and start and goal of each are collision-free,
else 1.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from bench.shared.pages import add_out
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker


def main() -> int:
    """Check every family and print one row for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="the unpacked set, for instance mbm_panda")
    add_out(parser, "mbm_endpoints.md")
    options = parser.parse_args()
    folder = options.folder
    families = sorted(path for path in (folder / "problems").glob("*") if path.is_dir())
    rows = [check_family(family, folder / "panda.urdf") for family in families]
    total = ("all", *(sum(column) for column in list(zip(*rows, strict=True))[1:]))
    title = "Ends of the MotionBenchMaker problems for the Panda, exact meshes"
    report = Report(title, "python bench/planning/mbm_endpoints.py FOLDER")
    cells = [[*map(str, row[:-1]), f"{row[-1]:.1f}"] for row in [*rows, total]]
    report.table("", ("family", "problems", "loaded", "start free", "goal free", "seconds"), cells)
    report.finish(options.out)
    good = bool(rows) and all(row[1] == row[2] == row[3] == row[4] for row in rows)
    print("all start and goal configurations are free" if good else "NOT all problems are loaded and free")
    return 0 if good else 1


def check_family(family: Path, urdf: Path) -> tuple[str, int, int, int, int, float]:
    """Name, problems, loaded, start free, goal free, seconds."""
    begin = time.perf_counter()
    scenes = sorted(family.glob("scene*.yaml"))
    loaded = starts = goals = 0
    for scene in scenes:
        try:
            problem = load_motion_bench_maker(scene, robot=urdf)
        except RrtikError as error:
            print(error)
            continue
        loaded += 1
        starts += problem.world.valid(problem.start)
        goals += isinstance(problem.goal, JointGoal) and problem.world.valid(problem.goal.q)
    return family.name, len(scenes), loaded, starts, goals, time.perf_counter() - begin


if __name__ == "__main__":
    raise SystemExit(main())
