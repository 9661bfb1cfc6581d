"""A whole task on the page in a browser: a tool is taken by a keyboard and put into its rack by a gamepad."""

from pathlib import Path

import numpy as np
import pytest

from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Running
from rrtik_tests.pilot_hands import Gamepad, Keyboard, pick_and_place

TOOL = Path(find_vehicle("titan4_sdu")).with_name("titan4_tool.yaml")


@pytest.mark.slow
def test_a_tool_is_taken_and_put_into_its_rack(browser):
    with Running(SessionOptions("titan4_sdu", vehicle=TOOL, seed=1)) as running:
        pick_and_place(browser, running, Keyboard, Gamepad)
        made = running.opened.engine.perception.source.camera.places["tool"]
        assert running.opened.engine.session.state.holds == ""
    vehicle = load_vehicle(TOOL)
    pick = vehicle.marker_map.named("tool").grasp("straight").levels[0]
    put = vehicle.marker_map.named("rack").grasp("put").levels[0]
    wanted = vehicle.places["rack"] * put * pick.inverse()
    assert np.linalg.norm(made.translation - wanted.translation) < 2e-3
