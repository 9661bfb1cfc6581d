"""Campaigns of benchmarks: suites, guarded runs, records that are never lost, reports.

From Python::

    suite = load_suite("quick")
    records = run_campaign(suite, Path("bench-quick"), jobs=2)
    results, files = write_report(records)
"""

from rrtik_ompl.benchmark.campaign import run_campaign
from rrtik_ompl.benchmark.report import write_report
from rrtik_ompl.benchmark.suite import load_suite

__all__ = ["load_suite", "run_campaign", "write_report"]
