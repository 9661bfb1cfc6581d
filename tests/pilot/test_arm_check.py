"""A marker on the gripper: an arm that reads wrong angles is found out, and stands still."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.poses import pose, quaternion_xyzw
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.state import STILL_SECONDS
from rrtik_tests.pilot_session import PROBLEM, ROBOT, session


def plate():
    """A marker on a sheet before the gripper, above the shelf; it faces the camera where the arm begins."""
    tip = ROBOT.fk(PROBLEM.start)
    eye = load_vehicle(find_vehicle("titan4_sdu")).T_base_camera.translation
    towards = eye - tip.translation
    z = towards / np.linalg.norm(towards)
    x = np.cross([0.0, 0.0, 1.0], z)
    turn = np.c_[x / np.linalg.norm(x), np.cross(z, x / np.linalg.norm(x)), z]
    T = tip.actInv(pin.SE3(turn, tip.translation + 0.45 * z))
    place = f"xyz: {T.translation.tolist()}, quat_xyzw: {quaternion_xyzw(T).tolist()}"
    behind = T * pose([0.0, 0.0, -0.003])
    sheet = f"xyz: {behind.translation.tolist()}, quat_xyzw: {quaternion_xyzw(behind).tolist()}"
    return f"""  - name: plate
    role: arm
    markers: [{{id: 12, side: 0.08, pose: {{{place}}}}}]
    solids: [{{name: sheet, box: [0.11, 0.11, 0.004], pose: {{{sheet}}}}}]
"""


def vehicle_with(folder, offset):
    shipped = find_vehicle("titan4_sdu")
    markers = (shipped.parent / "titan4_panel_markers.yaml").read_text()
    (folder / "map.yaml").write_text(markers + plate())
    text = shipped.read_text().replace("\ncamera: ", f"\ncamera: {shipped.parent}/")
    text = text.replace("titan4_panel_markers.yaml", "map.yaml")
    (folder / "vehicle.yaml").write_text(f"{text}\narm: {{offset_deg: {offset}}}\n")
    return folder / "vehicle.yaml"


@pytest.mark.parametrize("offset", [0.0, 1.5])
def test_an_arm_that_reads_wrong_angles_stands_still(tmp_path, offset):
    opened = open_session(SessionOptions("titan4_sdu", vehicle=vehicle_with(tmp_path, offset)))
    engine = opened.engine
    made = opened.engine.session
    for count in range(5):
        engine.update((1.0 + STILL_SECONDS) * count / 4)
    assert any(each.object.role == "arm" for each in engine.perception._sensor._last.values())
    said = made.command("plan", made.time)
    assert ("from where the joints say" in said) == (offset > 0.0), said
    opened.close()


def test_nothing_is_said_of_an_arm_that_moves_and_it_is_taken_back():
    made, _ = session()
    tip = made.robot.fk(made.q)
    spread = 1e-8 * np.eye(6)
    made.tick(0.0)
    made.see_arm(tip * pose([0.0, 0.0, 0.02]), spread, 0.1)
    assert made.known.arm_off == ""
    made.see_arm(tip * pose([0.0, 0.0, 0.02]), spread, 2.0)
    assert "20 mm" in made.known.trouble
    made.see_arm(tip * pose([0.0, 0.0, 0.02]), 1e-4 * np.eye(6), 2.1)  # within what is not certain
    assert made.known.arm_off == ""
