"""Both checkers of certificates beside each other; `python -m bench checkers` does so a thousand times."""

import pytest

from bench.proofs.checkers import compared, tasks_compared
from bench.proofs.forgeries import FORGERS

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize(
    ("arm", "forged"),
    [
        ("planar", len(FORGERS)),
        ("titan4", len(FORGERS)),
        ("panda", 12),
        ("planar timed", len(FORGERS)),
        ("planar moving", len(FORGERS)),
        ("ur5 moving", 3),
    ],
)
def test_both_accept_what_is_true_and_refuse_what_is_forged(arm, forged):
    found = compared(arm, 3, 1, forged)
    assert found.wrong == []
    assert found.accepted == found.true == 1
    assert sum(found.refused.values()) == sum(found.forged.values()) == forged


def test_both_accept_the_certificate_of_a_task_and_refuse_forged_ones():
    found = tasks_compared("panda_pick_place", 1, 11)
    assert found.wrong == []
    assert found.accepted == 1
    assert sum(found.refused.values()) >= 10
