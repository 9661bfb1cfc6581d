"""Whatever is called free, proven or exact, judged by independent means.

Each module beside this one that has a function ``section(parts, size)`` is a section: it returns a `Report` whose
acceptance rows and tables are added to the page. What is done stands beside the page until that is written: an
interrupted run goes on where it was.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated

from typer import Option

from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.choices import one_of

Section = Callable[[Parts, float], Report]


def sections() -> dict[str, Section]:
    """The sections by the names of their modules."""
    names = [module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)]) if module.name != "report"]
    modules = {name: import_module(f"bench.truth.{name}") for name in sorted(names)}
    return {name: module.section for name, module in modules.items() if hasattr(module, "section")}


def main(
    run: Run,
    parts: Parts,
    *,
    size: Annotated[float, Option(help="Share of the full numbers of cases.")] = 1.0,
    only: Annotated[list[str] | None, Option(help="This section; may be repeated.")] = None,
) -> Report:
    """Judge."""
    known = sections()
    wanted = [one_of(known, name, "section") for name in only or known]

    report = run.report("Nothing is called free that is not")
    for name in wanted:
        report.add(known[name](parts, size))
    return report
