"""A vehicle that drifts and sways: what is seen stays where it is, and routes are withdrawn when they hold no more."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.devices.simulation import BaseMotion
from rrtik_ompl.pilot.interlock import PROPOSED
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.surroundings import Structure, Surroundings
from rrtik_tests.pilot_session import PLACE, WORLD, seen_at


def vehicle_file(folder, motion):
    shipped = find_vehicle("titan4_sdu")
    text = shipped.read_text()
    for key in ("camera: ", "map: "):
        text = text.replace(f"\n{key}", f"\n{key}{shipped.parent}/")
    file = folder / "vehicle.yaml"
    file.write_text(f"{text}\nstructure: valve\n{motion}\n")
    return file


def test_drift_and_sway_are_what_is_stated():
    motion = BaseMotion([0.01, 0, 0], sway=[0, 0.05, 0], tilt=[0, 0, 0.1], period=8.0)
    assert motion.at(0.0).isApprox(pin.SE3.Identity())
    assert motion.at(2.0).translation == pytest.approx([0.02, 0.05, 0.0])
    assert pin.log3(motion.at(2.0).rotation) == pytest.approx([0, 0, 0.1])
    assert motion.at(8.0).translation == pytest.approx([0.08, 0.0, 0.0])
    for amounts in ({"drift": [9, 0, 0]}, {"sway": [np.nan, 0, 0]}, {"period": 0.0}, {"tilt": [1, 2]}):
        with pytest.raises(InputError, match=next(iter(amounts))):
            BaseMotion(**amounts)


def test_obstacles_stay_with_the_structure_that_they_are_fixed_to():
    around = Surroundings(WORLD, Structure("valve", PLACE))
    shift = pose_from_rpy([0.02, -0.03, 0.01], [0.0, 0.02, 0.05])
    around = around.see([seen_at(shift * PLACE)])
    for before in WORLD.scene.obstacles:
        after = around.world.scene.obstacle(before.name)
        assert after.pose.isApprox(shift * before.pose)
        assert after.margin > before.margin  # as far as it is not known where the structure is


def test_a_file_says_how_the_vehicle_moves_and_a_wrong_one_is_refused_in_a_line(tmp_path):
    good = "base_motion: {drift: [0.001, 0, 0], sway: [0, 0.02, 0], tilt_deg: [0, 0, 1], period: 6}"
    vehicle = load_vehicle(vehicle_file(tmp_path, good))
    assert vehicle.base_motion.at(1.5).translation == pytest.approx([0.0015, 0.02, 0.0])
    assert vehicle.structure == "valve"
    for bad, word in [("base_motion: {period: 0.01}", "period"), ("base_motion: {sway: [1]}", "sway"),
                      ("base_motion: {drift: [50, 0, 0]}", "drift")]:  # fmt: skip
        with pytest.raises(InputError, match=word) as caught:
            load_vehicle(vehicle_file(tmp_path, bad))
        assert "\n" not in str(caught.value)
        assert "vehicle.yaml" in str(caught.value)


def test_a_route_is_withdrawn_when_the_vehicle_has_drifted_and_the_arm_stands_still(tmp_path):
    file = vehicle_file(tmp_path, "base_motion: {drift: [0.004, -0.003, 0.002]}")
    opened = open_session(SessionOptions("titan4_sdu", vehicle=file))
    engine = opened.engine
    time = 0.0
    session = engine.session

    def passes(seconds, **command):
        nonlocal time
        for _ in range(round(10 * seconds)):
            time += 0.1
            engine.update(time)
            if command:
                engine.execute(command, time)

    passes(0.3)
    for command in ({"name": "grasp", "type": "straight", "level": 1}, {"name": "plan"}, {"name": "accept"}):
        engine.execute(command, time)
    passes(0.5, name="next", press=1)
    assert session.driving
    passes(2.0, name="next", press=1)
    assert "valve has moved by" in session.state.way.withdrawn
    assert session.mode == PROPOSED
    there = session.arm.read()
    passes(0.5, name="next", press=2)
    assert np.array_equal(session.arm.read(), there)
    assert engine.state()["route"]["withdrawn"] == session.state.way.withdrawn
    truth = engine.perception.source._motion.at(time).actInv(load_vehicle(file).places["valve"])
    assert np.linalg.norm(session.surroundings.named("valve").T_base_object.translation - truth.translation) < 3e-3
    opened.close()
