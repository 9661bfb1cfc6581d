"""Every run that a test of replanning makes is judged: what a record calls proven holds."""

from __future__ import annotations

import pytest

from rrtik_ompl.replanning import in_time, replanner, scenario
from rrtik_tests.run_judge import judged


@pytest.fixture(autouse=True)
def every_run_is_judged(monkeypatch):
    """Judges what `replan`, `Scenario.run` and `plan_in_time` return, by the scenes of the record."""
    replan_with, record = replanner.replan_with, in_time._record

    def judged_replan(settings, problem, *args, **options):
        return judged(replan_with(settings, problem, *args, **options), problem, may_touch=True)

    def judged_record(problem, *args):
        return judged(record(problem, *args), problem)

    for module in (replanner, scenario):
        monkeypatch.setattr(module, "replan_with", judged_replan)
    monkeypatch.setattr(in_time, "_record", judged_record)
