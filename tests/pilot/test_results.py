"""What the pilot's tool could not do is a value with a reason and a stage, not a text to take apart."""

import numpy as np
import pytest

from rrtik_ompl import load_problem
from rrtik_ompl.base.poses import pose
from rrtik_ompl.pilot.devices.arm import joint_rates
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, RED, STAGES, diagnose, lamps, stage_poses
from rrtik_ompl.pilot.routes.route import route_to_grasp
from rrtik_ompl.pilot.routes.route_search import NoRoute

PROBLEM = load_problem("titan4_sdu")
VEHICLE = load_vehicle(find_vehicle("titan4_sdu"))
VALVE, PLACE = VEHICLE.marker_map.named("valve"), VEHICLE.places["valve"]


def test_a_lamp_names_the_stage_that_fails_in_a_field_of_its_own():
    found = lamps(PROBLEM.world, VALVE, PLACE, PROBLEM.start, holding=PROBLEM.world)
    assert {lamp.color for lamp in found} >= {GREEN}
    for lamp in found:
        assert (lamp.stage is None) == (lamp.color == GREEN) == (lamp.reason == "")
        if lamp.stage is not None:
            assert lamp.stage in STAGES
            assert lamp.color in (AMBER, RED)
            assert lamp.reason.startswith(f"{lamp.stage}: ")
        why = diagnose(lamp, VALVE, PLACE, PROBLEM.start, PROBLEM.world, PROBLEM.world)
        assert (why == "") == (lamp.stage is None)


def test_a_grasp_out_of_reach_is_no_route_with_a_stage():
    grasp = next(iter(VALVE.grasps))
    stages = stage_poses(pose([9.0, 0.0, 0.0]), grasp, 0)
    rates = joint_rates(PROBLEM.robot)
    start = np.array(PROBLEM.start)
    found = route_to_grasp(PROBLEM.world, PROBLEM.world, start, stages, start, rates, 1)
    assert isinstance(found, NoRoute)
    assert found.stage == "the pose before the object"
    assert found.reason
    assert str(found) == f"the pose before the object: {found.reason}"


@pytest.mark.parametrize(("stage", "text"), [("", "blocked"), ("the grasp", "the grasp: blocked")])
def test_no_route_reads_as_one_line(stage, text):
    assert str(NoRoute("blocked", stage)) == text
