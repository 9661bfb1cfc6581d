"""An arm that is wrong by stated amounts, and what the pilot's tool does with it."""

import numpy as np
import pytest

from bench.pilot.hands import follow_route, hold_next
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle
from rrtik_ompl.pilot.devices.wrong_arm import Faults, WrongArm
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_tests.pilot_session import PROBLEM, ROBOT, WORLD, alarmed, arrived, refused

START = np.array(PROBLEM.start)
RATE = np.deg2rad(10.0)


def wrong(**amounts):
    return WrongArm(ROBOT, START, Faults(**amounts))


def driven(arm, joint, way, seconds=30.0, step=0.03):
    arm.move(joint, float(arm.read()[joint]) + way)
    for _ in range(round(seconds / step)):
        arm.advance(step)
    return float(arm.links()[joint] - START[joint])


def test_without_faults_it_is_the_simulated_arm():
    arm = wrong()
    plain = SimulatedArm(ROBOT, START)
    rng = np.random.default_rng(0)
    for _ in range(200):
        joint = int(rng.integers(ROBOT.dof))
        way = rng.uniform(-0.1, 0.1)
        seconds = rng.uniform(0.0, 0.5)
        for each in (arm, plain):
            if way > 0.08:
                each.stop()
            else:
                each.move(joint, float(plain.read()[joint] + way))
        arm.advance(seconds)
        plain.advance(seconds)
        assert arm.read() == pytest.approx(plain.read(), abs=1e-12)
        assert np.array_equal(arm.read(), arm.links())


def test_a_lag_puts_off_moves_and_stops():
    arm = wrong(lag=0.5)
    arm.move(0, float(START[0]) + 0.5)
    arm.advance(0.4)
    assert np.array_equal(arm.links(), START)
    arm.advance(0.6)
    assert arm.links()[0] - START[0] == pytest.approx(0.5 * RATE)
    arm.stop()
    arm.advance(2.0)
    assert arm.links()[0] - START[0] == pytest.approx(1.0 * RATE)


def test_a_joint_that_sticks_makes_no_small_moves():
    arm = wrong(stick=0.02)
    assert driven(arm, 1, 0.019) == 0.0
    assert driven(arm, 1, 0.021) == pytest.approx(0.021)


def test_a_joint_goes_too_far_when_it_arrives_and_when_it_is_stopped():
    assert driven(wrong(overshoot=0.03), 0, 0.2) == pytest.approx(0.23)
    assert driven(wrong(overshoot=0.03), 0, 0.02) == pytest.approx(0.03)  # by half of its way at most
    arm = wrong(overshoot=0.03)
    arm.move(0, float(START[0]) + 0.5)
    arm.advance(1.0)
    arm.stop()
    arm.advance(1.0)
    assert arm.links()[0] - START[0] == pytest.approx(RATE + 0.03)


def test_play_is_crossed_before_the_link_goes_back():
    arm = wrong(backlash=0.02)
    assert driven(arm, 0, 0.1) == pytest.approx(0.09)
    assert driven(arm, 0, -0.1) == pytest.approx(0.01)
    assert arm.read()[0] == pytest.approx(START[0])


def test_wrong_angles_are_read_and_commanded():
    arm = wrong(offset=0.05)
    assert arm.read() == pytest.approx(START + 0.05)
    arm.move(0, float(START[0]))
    arm.advance(10.0)
    assert arm.read()[0] == pytest.approx(START[0])
    assert arm.links()[0] == pytest.approx(START[0] - 0.05)


def test_set_points_of_a_trajectory_lag_as_well():
    arm = wrong(lag=0.2, offset=0.01)
    arm.follow(START + 0.03)
    arm.advance(0.1)
    assert np.array_equal(arm.links(), START)
    arm.advance(5.0)
    assert arm.links() == pytest.approx(START + 0.02)


@pytest.mark.parametrize(
    "amounts", [{"lag": -1.0}, {"lag": 99.0}, {"stick": -0.1}, {"offset": np.nan}, {"backlash": [1]}]
)
def test_amounts_that_cannot_be_are_refused(amounts):
    with pytest.raises(InputError, match=next(iter(amounts))):
        wrong(**amounts)


AMOUNTS = [{}, {"lag": 0.2}, {"stick": 0.003}, {"overshoot": 0.015}, {"backlash": 0.009},
           {"lag": 0.2, "stick": 0.003, "overshoot": 0.01, "backlash": 0.005, "offset": -0.004}]  # fmt: skip


def routed(amounts, hasty):
    """A session that has followed a route with "next", its arm, and where the links were. Shape (n, dof)."""
    arm = wrong(**amounts)
    made = Session(PROBLEM, arm, seed=1, past=True)
    rows = follow_route(made, arm, hasty=hasty).rows
    assert made.progress.advice == "done"
    return made, arm, rows


@pytest.mark.parametrize("amounts", AMOUNTS)
def test_with_the_tool_a_wrong_arm_comes_to_the_end_of_its_route_and_touches_nothing(amounts):
    made, arm, rows = routed(amounts, hasty=False)
    assert WORLD.motion_valid_batch(rows[:-1], rows[1:]).all()
    # On top comes what the arm does not know of itself.
    unknown = amounts.get("backlash", 0.0) + abs(amounts.get("offset", 0.0)) + amounts.get("overshoot", 0.0)
    assert np.abs(arm.links() - made.route.path.end).max() < np.deg2rad(0.2) + unknown


@pytest.mark.parametrize("amounts", [{}, {"stick": 0.009}, {"overshoot": 0.009}])
def test_who_lets_go_before_the_end_of_moves_touches_nothing_and_ends_at_the_same_place_or_is_told(amounts):
    made, arm, rows = routed(amounts, hasty=True)
    assert WORLD.valid_batch(rows).all()
    assert WORLD.motion_valid_batch(rows[:-1], rows[1:]).all()
    away = np.linalg.norm(ROBOT.fk(arm.links()).translation - ROBOT.fk(made.route.path.end).translation)
    assert arrived(made) if away <= 5e-4 else refused(made, f"{1e3 * away:.1f} mm")


def test_an_arm_that_follows_too_late_is_not_driven_and_one_line_says_why():
    arm = wrong(lag=0.5)
    made = Session(PROBLEM, arm, seed=1, past=True)
    followed = follow_route(made, arm)
    assert made.mode == "following"
    assert followed.refused >= 0.9 * followed.presses
    assert np.abs(np.diff(followed.rows, axis=0)).max() <= np.deg2rad(1.0) + 1e-9  # of one press, after all
    hold_next(made, arm, followed.presses)
    assert alarmed(made, "does not move", "0.0 deg", "0.4 s")
    assert any(name in made.message for name in ROBOT.joint_names)


def test_the_file_of_a_simulated_vehicle_says_how_wrong_its_arm_is(tmp_path):
    shipped = find_vehicle("titan4_sdu")
    text = (
        shipped.read_text()
        .replace("camera: ", f"camera: {shipped.parent}/")
        .replace("map: ", f"map: {shipped.parent}/")
    )
    file = tmp_path / "vehicle.yaml"
    file.write_text(text + "\narm: {lag: 0.1, offset_deg: 2.0}\n")
    opened = open_session(SessionOptions("titan4_sdu", vehicle=file))
    arm = opened.engine.session.arm
    assert arm.read() - arm.links() == pytest.approx(np.where(ROBOT.prismatic, 0.0, np.deg2rad(2.0)))
    opened.close()
    file.write_text(text + "\narm: {stick_deg: -1}\n")
    with pytest.raises(InputError, match="stick_deg"):
        open_session(SessionOptions("titan4_sdu", vehicle=file))
