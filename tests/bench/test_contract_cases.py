"""A small share of the contract cases that `bench/planning/contract_cases.py` draws by the hundred thousand."""

from __future__ import annotations

import pytest

from bench.planning.contract_cases import block


@pytest.mark.usefixtures("quiet_ompl")
@pytest.mark.parametrize(("number", "turning"), [(1_000_001, False), (1_000_002, True)])
def test_no_planner_breaks_off_or_calls_exact_what_is_not(number: int, turning: bool) -> None:
    statuses, wrong = block(number, turning, 100)
    assert wrong == []
    assert statuses["Exact solution"] > 0
    assert statuses.total() == 100
