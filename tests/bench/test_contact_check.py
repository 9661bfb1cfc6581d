"""The second check of a run sees what happens between two ticks."""

from __future__ import annotations

from rrtik_bench.contact_check import check_contacts
from rrtik_ompl.model.scene import ConstantVelocity
from rrtik_ompl.replanning.replanner import replan
from rrtik_tests.moving_plane import OPTIONS, box, plane


def test_the_second_check_sees_contact_between_two_ticks():
    problem = plane(box("bullet", 10.0, 16.0, 1.0, 1.0, ConstantVelocity([0.0, -60.0, 0.0])), start=(10.0, 10.0))
    run = replan(problem, **{**OPTIONS, "seconds": 0.25, "step": 1e-3})
    found = check_contacts(problem.robot, run, problem.world.scene)
    assert found.contacts
    assert found.contacts[0][3] == "bullet"
    assert found.nearest == 0.0
