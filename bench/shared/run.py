"""What a report is given by `python -m bench`, and the options that several of them have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from rrtik_bench.report.machine import processes
from rrtik_bench.report.page import Report

REPORTS = Path(__file__).resolve().parent.parent / "reports"

Sets = Annotated[
    Path,
    Argument(help="Holds mbm_panda and mbm_ur5, unpacked problems of MotionBenchMaker.", exists=True, file_okay=False),
]
SetsOrNone = Annotated[
    Path | None,
    Argument(
        help="Holds mbm_panda, mbm_ur5 and, for whole plans, mbm_fetch of MotionBenchMaker.",
        exists=True,
        file_okay=False,
    ),
]
PandaSet = Annotated[
    Path,
    Argument(help="Unpacked problems of MotionBenchMaker for the Panda, as mbm_panda.", exists=True, file_okay=False),
]
PandaSetOrNone = Annotated[
    Path | None, Argument(help="As mbm_panda: unpacked problems of MotionBenchMaker.", exists=True, file_okay=False)
]
Pythons = Annotated[
    list[str] | None, Option(metavar="NAME=INTERPRETER", help="Interpreter of one peer; may be repeated.")
]
Roboplan = Annotated[str, Option(help="Interpreter of an environment with roboplan.")]


@dataclass(frozen=True)
class Run:
    """How a report is made.

    Attributes:
        command: What makes it, as the page says it.
        out: The page; pictures of it go beside it.
        jobs: Processes.
    """

    command: str
    out: Path
    jobs: int = 1

    def report(self, title: str, where: str = "", intro: str = "") -> Report:
        """An empty page; ``where`` stands in place of the number of processes."""
        return Report(title, self.command, where or processes(self.jobs), intro)
