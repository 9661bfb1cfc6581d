"""Whatever is called free, proven or exact, judged by independent means; makes `bench/reports/truth.md`.

    python bench/truth/report.py [--size 1.0] [--only SECTION ...] [--jobs N]

Each module beside this one that has a function ``section(parts, size)`` is a section: it returns a `Report` whose
acceptance rows and tables are added to the page. ``size`` scales the numbers of cases; 1 is the full size. What is done
stands beside the page until that is written: an interrupted run goes on where it was.
"""

from __future__ import annotations

import argparse
import pkgutil
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from bench.shared.parts import Parts, add_options
from rrtik_bench.report.machine import processes
from rrtik_bench.report.page import Report

PAGE = "truth.md"
Section = Callable[[Parts, float], Report]


def sections() -> dict[str, Section]:
    """The sections by the names of their modules."""
    names = [module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)]) if module.name != "report"]
    modules = {name: import_module(f"bench.truth.{name}") for name in sorted(names)}
    return {name: module.section for name, module in modules.items() if hasattr(module, "section")}


def main() -> int:
    """Judge, and write the page."""
    known = sections()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_options(parser, PAGE)
    parser.add_argument("--size", type=float, default=1.0, help="share of the full numbers of cases")
    parser.add_argument("--only", nargs="+", choices=list(known), default=list(known), help="sections")
    given = parser.parse_args()

    command = f"python bench/truth/report.py --size {given.size:g}"
    if given.only != list(known):
        command += f" --only {' '.join(given.only)}"
    report = Report("Nothing is called free that is not", command, processes(given.jobs))
    with Parts(given.out, given.jobs) as parts:
        for name in given.only:
            report.add(known[name](parts, given.size))
    return report.finish(given.out)


if __name__ == "__main__":
    raise SystemExit(main())
