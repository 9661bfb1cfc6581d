"""Contract cases as those of `contract_cases`, in spaces that all have coordinates of SO(2).

An interrupted run goes on where it was.
"""

from __future__ import annotations

from bench.planning.contract_cases import ALL_TURNING, page
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report


def main(run: Run, parts: Parts, *, cases: int = ALL_TURNING) -> Report:
    """Ask."""
    return page(run, parts, cases, turning=True)
