"""Visual servoing: to the target by either method, within limits, free, and not on without a sighting."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.motion.following.visual_servo import VisualServo, interaction_matrix

ROBOT = rrtik.load_robot("panda")
START = ROBOT.posture("default")
CAMERA = pose_from_rpy([1.4, 0.3, 0.9], [-2.2, 0.0, 1.8])
DT = 0.02


def leading(method="position", world=None, **options):
    world = rrtik.World(ROBOT) if world is None else world
    return VisualServo(rrtik.following.Servo(world), ROBOT, method, T_base_camera=CAMERA, **options)


def led(made, goal, seconds, q=START):
    """Where the arm is after a time, and all steps; `goal` gives what is seen at a time."""
    steps, rows = [], [np.array(q)]
    for k in range(round(seconds / DT)):
        steps.append(made.step(rows[-1], goal(k * DT), DT))
        rows.append(rows[-1] + DT * steps[-1].rates)
    return np.array(rows), steps


def test_the_interaction_matrix_is_the_derivative_of_projection():
    rng, step = np.random.default_rng(0), 1e-7
    places = rng.uniform([-0.5, -0.5, 0.4], [0.5, 0.5, 2.0], (5, 3))
    matrix = interaction_matrix(places[:, :2] / places[:, 2:], places[:, 2])
    for k in range(6):
        twist = np.zeros(6)
        twist[k] = step
        moved = places - (twist[:3] + np.cross(twist[3:], places))  # points at rest, seen by a camera that moves
        slope = (moved[:, :2] / moved[:, 2:] - places[:, :2] / places[:, 2:]).ravel() / step
        assert matrix[:, k] == pytest.approx(slope, abs=1e-5)
    with pytest.raises(InputError, match="depths must be above 0"):
        interaction_matrix([[0.0, 0.0]], [0.0])


@pytest.mark.parametrize("method", ["position", "image"])
def test_the_tip_comes_to_the_target_within_its_speed(method):
    goal = ROBOT.fk(START) * pose_from_rpy([0.02, -0.03, 0.04], [0.1, -0.1, 0.2])
    rows, steps = led(leading(method), lambda _: goal, 8.0)
    off = ROBOT.fk(rows[-1]).actInv(goal)
    assert steps[-1].state == "done"
    assert np.linalg.norm(off.translation) <= 5e-4
    assert np.linalg.norm(pin.log3(off.rotation)) <= np.deg2rad(0.1)
    places = ROBOT.fk_batch(rows)[:, :3, 3]
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= 1.02 * 0.05 * DT
    assert (np.abs(np.diff(rows, axis=0)) <= ROBOT.velocity * DT + 1e-12).all()


def test_by_position_the_tip_moves_straight_and_nearer_by_the_same_share_in_each_step():
    goal = ROBOT.fk(START) * pose_from_rpy([0.01, -0.02, 0.015], [0.0, 0.0, 0.0])
    rows, _ = led(leading(gain=2.0, speed=1.0), lambda _: goal, 1.0)
    from_goal = ROBOT.fk_batch(rows)[:, :3, 3] - goal.translation
    far = np.linalg.norm(from_goal, axis=1)
    assert far[1:] / far[:-1] == pytest.approx(1.0 - 2.0 * DT, abs=2e-3)
    assert np.linalg.norm(np.cross(from_goal, from_goal[0] / far[0]), axis=1).max() < 0.01 * far[0]


def test_a_swaying_target_is_followed():
    goal = ROBOT.fk(START) * pose_from_rpy([0.0, 0.0, 0.03], [0.0, 0.0, 0.1])

    def seen(time):
        aside = np.array([0.0, 0.01 * np.sin(2 * np.pi * time / 6.0), 0.0])
        return pin.SE3(goal.rotation, goal.translation + aside)

    _, steps = led(leading(gain=6.0), seen, 10.0)
    assert max(step.away for step in steps[-200:]) < 3e-3


def test_without_a_sighting_the_arm_stops_and_with_one_far_off_too():
    goal = ROBOT.fk(START) * rrtik.pose([0.0, 0.0, 0.08])
    rows, steps = led(leading(), lambda time: goal if time < 0.5 else None, 1.5)
    states = [step.state for step in steps]
    assert states[-1] == "lost"
    lost = states.index("lost")
    assert lost * DT <= 0.5 + 0.15 + 2 * DT
    assert np.array_equal(rows[lost], rows[-1])
    far = goal * rrtik.pose([0.05, 0.0, 0.0])
    rows, steps = led(leading(), lambda time: goal if time < 0.5 else far, 1.0)
    assert steps[-1].state == "jumped"
    assert np.array_equal(rows[30], rows[-1])
    assert leading().step(START, None, DT).state == "lost"


def test_it_never_touches_what_is_in_the_way():
    tip = ROBOT.fk(START)
    wall = rrtik.Obstacle("wall", rrtik.Box([0.4, 0.4, 0.02]), tip * rrtik.pose([0.0, 0.0, 0.06]))
    world = rrtik.World(ROBOT, rrtik.Scene((wall,)))
    goal = tip * rrtik.pose([0.0, 0.0, 0.1])
    rows, steps = led(leading(world=world), lambda _: goal, 6.0)
    assert world.motion_valid_batch(rows[:-1], rows[1:]).all()
    assert steps[-1].state in ("blocked", "moving")
    assert steps[-1].away > 0.04


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"method": "both"}, "method"),
        ({"gain": 0.0}, "gain"),
        ({"speed": -1.0}, "speed"),
        ({"patience": 0.0}, "patience"),
    ],
)
def test_wrong_options_are_refused(options, word):
    with pytest.raises(InputError, match=word):
        leading(**options)
    with pytest.raises(InputError, match="T_base_camera"):
        VisualServo(rrtik.following.Servo(rrtik.World(ROBOT)), ROBOT, "image")
