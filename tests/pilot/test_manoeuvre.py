"""Commands by hand: what is refused and why, how much room is left, the way out of a contact."""

import numpy as np
import pytest

from rrtik_ompl import Cylinder, Obstacle, load_robot, pose
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.routes.manoeuvre import check_move, escape_move, free_until, joint_range
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.world.world import World
from rrtik_tests.pilot_session import PROBLEM, ROBOT, WORLD, hold


@pytest.mark.slow
def test_no_command_of_many_leads_beyond_limits_or_into_anything():
    rng = np.random.default_rng(0)
    q = np.array(PROBLEM.start)
    accepted = []
    for _ in range(200):
        joint = int(rng.integers(6))
        target = float(q[joint] + rng.normal(0.0, 0.6))
        if check_move(WORLD, q, joint, target).allowed:
            end = q.copy()
            end[joint] = target
            accepted.append((q, end))
            q = end
    starts, ends = (np.array(rows) for rows in zip(*accepted, strict=True))
    share = np.linspace(0.0, 1.0, 25)[:, None]
    rows = np.concatenate([a + share * (b - a) for a, b in zip(starts, ends, strict=True)])
    assert len(accepted) > 30
    assert ROBOT.within_limits(rows).all()
    assert WORLD.certify(rows).all()


def test_a_refusal_names_the_pair_and_how_far_it_is_free():
    down = check_move(WORLD, PROBLEM.goal.q, 2, float(ROBOT.lower[2]))
    assert not down.allowed
    assert "overlap" in down.reason
    assert "elbow_pitch at" in down.reason
    until = free_until(WORLD, PROBLEM.goal.q, 2, float(ROBOT.lower[2]))
    assert check_move(WORLD, PROBLEM.goal.q, 2, until).allowed
    assert not check_move(WORLD, PROBLEM.goal.q, 2, until - 0.02).allowed


def test_a_move_beyond_a_limit_names_it():
    verdict = check_move(WORLD, PROBLEM.start, 0, 9.0)
    assert not verdict.allowed
    assert "azimuth" in verdict.reason


def test_little_room_is_warned_of():
    until = free_until(WORLD, PROBLEM.goal.q, 2, float(ROBOT.lower[2]))
    verdict = check_move(WORLD, PROBLEM.goal.q, 2, until)
    assert any("mm between" in warning for warning in verdict.warnings)
    assert 0.0 <= verdict.clearance < 0.02


def test_a_move_that_steps_over_a_needle_is_warned_of():
    needle = Obstacle("needle", Cylinder(2e-4, 1.0), pose([2.0, 0.0, 0.0]))
    world = World(load_robot("planar3", parameters={"radius": 0.01}), Scene([needle]), motion_resolution=0.2)
    over = [q for q in np.linspace(-1.2, -0.4, 40) if world.motion_valid([q, 0.0, 0.0], [0.9, 0.0, 0.0])]
    assert over  # the check in steps does not see what stands in the way
    for first in over:
        verdict = check_move(world, np.array([first, 0.0, 0.0]), 0, 0.9)
        assert "free in steps, but not proven in between" in verdict.warnings
    beside = check_move(world, np.array([0.1, 0.0, 0.0]), 0, 0.9)
    assert not any("proven" in warning for warning in beside.warnings)


def test_the_room_of_a_joint_names_what_ends_it_and_where_the_arm_is_singular():
    q = np.array(PROBLEM.start)
    room = joint_range(WORLD, q, 0)
    assert (room.above, room.high) == ("limit", pytest.approx(ROBOT.upper[0]))
    assert "meets bay_wall" in room.below
    assert check_move(WORLD, q, 0, room.low + 1e-3).allowed
    assert "bay_wall" in check_move(WORLD, q, 0, room.low - 0.01).reason
    yaw = joint_range(WORLD, q, 4)
    low, high, case = yaw.singular[0]
    assert yaw.low < low < high <= yaw.high
    assert any(case in warning for warning in check_move(WORLD, q, 4, 0.5 * (low + high)).warnings)
    assert not check_move(WORLD, q, 4, low - 0.1).warnings


def test_an_arm_without_named_singular_postures_is_warned_by_its_jacobian():
    robot = load_robot("xarm7")
    world = World(robot, Scene())
    q = np.array([0.0, 0.4, 0.0, 1.2, 0.4, 0.9, 0.2])
    low, high, case = joint_range(world, q, 3).singular[0]
    middle = 0.5 * (low + high)
    assert case == ""
    assert np.linalg.svd(robot.jacobian([*q[:3], middle, *q[4:]]), compute_uv=False)[-1] < 0.05
    assert "near a singular posture" in check_move(world, q, 3, middle).warnings
    assert not check_move(world, q, 3, 1.0).warnings


def test_an_arm_that_touches_something_may_go_out_of_it_and_no_deeper():
    q = np.array(PROBLEM.goal.q)
    q[2] = free_until(WORLD, q, 2, float(ROBOT.lower[2])) - np.radians(0.5)
    assert not WORLD.valid(q)
    joint, target = escape_move(WORLD, q)
    end = q.copy()
    end[joint] = target
    assert WORLD.valid(end)
    assert check_move(WORLD, q, joint, target).warnings == ("out of contact",)
    deeper = check_move(WORLD, q, 2, q[2] - np.radians(1.0))
    assert not deeper.allowed
    assert "does not get it free" in deeper.reason
    made = Session(PROBLEM, SimulatedArm(ROBOT, q), seed=1, past=True)
    assert f"{ROBOT.joint_names[joint]} to" in made.command("plan", 0.0)
    made.command("select", 0.1, joint=joint)
    assert "out of contact" in made.command("move", 0.2, target=target)
    now = hold(made, made.arm, "go", 0.3, lambda: abs(made.q[joint] - target) < 1e-6, press=1)
    assert "moves" in made.command("plan", now)
