"""Campaigns of benchmarks: suites, guarded runs, records that are never lost, reports.

From Python::

    suite = load_suite("quick")
    records = run_campaign(suite, Path("bench-quick"), jobs=2)
    results, files = write_report(records)
    records = plan_batch(["titan4_sdu", "my_problem.yaml"], jobs=2)  # queries, without a file
"""

from rrtik_ompl.benchmark.batch import plan_batch
from rrtik_ompl.benchmark.campaign import run_campaign
from rrtik_ompl.benchmark.report import write_report
from rrtik_ompl.benchmark.suite import load_suite

__all__ = ["load_suite", "plan_batch", "run_campaign", "write_report"]
