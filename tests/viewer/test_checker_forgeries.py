"""Both checkers of certificates beside each other; `python -m bench checkers` does so a thousand times."""

import pytest

from bench.proofs.checkers import compared, tasks_compared
from bench.proofs.forgeries import FORGERS

pytestmark = pytest.mark.kernels


OF_CONSTRAINTS = ("other constraint", "left region")


@pytest.mark.parametrize(
    ("arm", "seed", "forged", "kinds"),
    [
        ("planar", 3, len(FORGERS), FORGERS),
        ("titan4", 3, len(FORGERS), FORGERS),
        ("panda", 3, 12, FORGERS),
        ("planar timed", 3, len(FORGERS), FORGERS),
        ("planar moving", 3, len(FORGERS), FORGERS),
        ("ur5 moving", 5, 3, FORGERS),  # of a seed with which the first motions have certificates
        ("planar piles", 3, 6, FORGERS),
        ("planar held timed", 3, 12, OF_CONSTRAINTS),
        ("titan4 holding held", 3, 8, (*OF_CONSTRAINTS, "other hold", "left out pair")),
    ],
)
def test_both_accept_what_is_true_and_refuse_what_is_forged(arm, seed, forged, kinds):
    found = compared(arm, seed, 1, forged, tuple(kinds))
    assert found.wrong == []
    assert found.accepted == found.true == 1
    assert sum(found.refused.values()) == sum(found.forged.values()) == forged
    assert kinds is FORGERS or set(found.forged) == set(kinds)


def test_both_accept_the_certificate_of_a_task_and_refuse_forged_ones():
    found = tasks_compared("panda_pick_place", 1, 11)
    assert found.wrong == []
    assert found.accepted == 1
    assert sum(found.refused.values()) >= 10
