"""Nothing moves on a stale picture, a lost arm or a route that was not accepted; what is let go stops."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.devices.arm import DEFAULT_RATE, SimulatedArm
from rrtik_ompl.pilot.events import Level
from rrtik_ompl.pilot.interlock import FOLLOWING, MODES, PROPOSED
from rrtik_ompl.pilot.routes.follower import Follower
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.state import LEASH_SECONDS, Gripper, Press, Way
from rrtik_tests.pilot_session import ALWAYS, MOVING, PRESENT, PROBLEM, alarmed, refused, session

ARGUMENTS = {
    "jog": {"direction": 1.0, "press": 1},
    "go": {"press": 1},
    "next": {"press": 1},
    "servo": {"press": 1},
    "lead": {"press": 1},
    "tool": {"direction": -1.0, "press": 1},
    "move": {"target": float(PROBLEM.start[0]) + 0.3},
    "select": {"joint": 0},
    "speed": {"share": 0.5},
    "object": {"name": "valve"},
    "grasp": {"type": "front", "level": 0},
    "posture": {"name": "stowed"},
}
PICTURES = {"none": -np.inf, "fresh": 0.0, "stale": -60.0}  # when the last one was taken, before now
ONE_DEGREE = np.radians(1.0)
LEASH = max(LEASH_SECONDS * DEFAULT_RATE, ONE_DEGREE) + 1e-9


@pytest.fixture(scope="module")
def planned():
    made, arm = session()
    made.master = SimulatedArm(PROBLEM.robot, PROBLEM.start - 0.04)
    made.command("grasp", 0.0, type="front", level=0)
    made.command("plan", 0.0)
    assert made.mode == PROPOSED
    return made, arm


def put_into(planned, route, mode, link, picture):
    """A session in a state, at time 100."""
    made, arm = planned
    arm._q = PROBLEM.start.copy()
    arm._goal = None
    arm.lost = link
    made.stand_still()

    q = arm.read()
    made.state = replace(
        made.state,
        mode=mode,
        stopped=False,
        selected=0,
        choice=("front", 0),
        speed=1.0,
        way=Way(route, Follower(route.path, made.means.rates), list_of_moves=route),
        time=100.0,
        pictures=replace(made.state.pictures, time=100.0 + PICTURES[picture]),
        trouble="",
        q=q,
        desired=q + 0.2 * np.eye(PROBLEM.robot.dof)[0],
        press=Press(),
        gripper=Gripper(),
    )
    return made, arm


def test_no_command_in_no_state_moves_the_arm_where_it_may_not(planned):
    route = planned[0].route
    count = 0
    for mode, link, picture, verb in product(MODES, ("", "the line is cut"), PICTURES, (*PRESENT, *ALWAYS)):
        made, arm = put_into(planned, route, mode, link, picture)

        made.command(verb, 100.0, **ARGUMENTS.get(verb, {}))
        after = made.mode
        travel = 0.0
        for step in range(20):  # one second without any renewal
            arm.advance(0.05)
            made.tick(100.0 + 0.05 * step)
            travel = max(travel, float(np.abs(arm.read() - PROBLEM.start).max()))

        known = not link and picture == "fresh"
        may = known and verb in MOVING and (verb == "next") == (mode == FOLLOWING)
        may = may and verb != "servo"  # the grasp is far away
        state = (mode, link, picture, verb, made.message)
        assert (travel > 0.0) == may, state
        assert travel <= LEASH, state
        if after == FOLLOWING:
            assert mode == FOLLOWING or (mode == PROPOSED and verb == "accept" and known), state
        if not known:
            assert made.mode != FOLLOWING, state
            assert verb in ALWAYS or after == mode, state
        count += 1
    assert count == len(MODES) * 2 * len(PICTURES) * len((*PRESENT, *ALWAYS))


def held_for(made, arm, seconds, time=0.0, step=0.03, **arguments):
    for _ in range(round(seconds / step)):
        made.see([], time)
        made.command("jog", time, **{"direction": 1.0, "press": 7, **arguments})
        arm.advance(step)
        time += step
        made.tick(time)
    return time


def coast(made, arm, time, seconds=2.0, step=0.03):
    """How far the arm goes on its own [rad]."""
    before = arm.read()
    for _ in range(round(seconds / step)):
        arm.advance(step)
        time += step
        made.see([], time)
        made.tick(time)
    return float(np.abs(arm.read() - before).max())


@pytest.mark.parametrize("how", ["released", "silent"])
def test_an_arm_that_is_let_go_travels_a_degree_at_most(how):
    made, arm = session()
    time = held_for(made, arm, 2.0)
    assert arm.read()[0] > PROBLEM.start[0] + np.radians(15.0)
    if how == "released":
        made.command("release", time)
    assert coast(made, arm, time) <= ONE_DEGREE + 1e-9
    assert not made.driving


def test_a_stop_outlasts_the_key_that_is_still_held():
    made, arm = session()
    time = held_for(made, arm, 1.0)
    made.command("stop", time)
    there = arm.read()
    time = held_for(made, arm, 1.0, time)
    assert arm.read() == pytest.approx(there, abs=0.0)
    made.command("reset", time)
    held_for(made, arm, 1.0, time, press=8)
    assert arm.read()[0] > there[0] + np.radians(5.0)


def test_a_key_held_while_the_picture_comes_back_does_nothing_until_it_is_pressed_anew():
    made, arm = session()
    made.command("jog", 60.0, direction=1.0, press=7)
    assert refused(made, "picture", "stale")
    time = held_for(made, arm, 1.0, 60.0)
    assert arm.read() == pytest.approx(PROBLEM.start, abs=0.0)
    held_for(made, arm, 1.0, time, press=8)
    assert arm.read()[0] > PROBLEM.start[0]


def test_a_picture_that_grows_stale_stops_the_arm_and_takes_the_route_back():
    made, arm = session()
    for verb, arguments in (("grasp", {"type": "front", "level": 0}), ("plan", {}), ("accept", {})):
        made.command(verb, 0.1, **arguments)
    for k in range(60):
        made.command("next", 0.1 + 0.03 * k, press=1)
        arm.advance(0.03)
        made.tick(0.13 + 0.03 * k)
    assert made.mode == PROPOSED
    assert alarmed(made, "picture", "stale", "stopped")
    assert arm.moving is None
    made.see([], 3.0)
    made.tick(3.0)
    assert "known again" in made.message
    assert "accepted" in made.command("accept", 3.1)


@pytest.mark.parametrize(("share", "speed"), [(1.0, 10.0), (0.25, 2.5), (0.0, 0.5)])
def test_the_speed_is_a_share_of_the_joints_rates_and_of_the_stick(share, speed):
    made, arm = session()
    made.command("speed", 0.0, share=share)
    held_for(made, arm, 3.0)
    assert np.degrees(arm.read()[0] - PROBLEM.start[0]) == pytest.approx(3.0 * speed, rel=0.03)
    half, arm = session()
    half.command("speed", 0.0, share=share)
    held_for(half, arm, 3.0, direction=0.5)
    assert np.degrees(arm.read()[0] - PROBLEM.start[0]) == pytest.approx(1.5 * speed, rel=0.05)


def test_a_joint_is_driven_to_the_end_of_its_range_and_no_farther():
    made, arm = session()
    made.command("move", 0.0, target=float(made.robot.upper[0]))
    held_for(made, arm, 15.0)
    assert arm.read()[0] == pytest.approx(made.robot.upper[0], abs=1e-3)
    assert "end of the range: limit" in made.message


def test_a_clock_that_jumps_back_or_far_ahead_moves_nothing_farther():
    made, arm = session()
    time = held_for(made, arm, 0.3)
    before = arm.read()
    for jump in (-100.0, 0.0, 100.0):
        made.command("jog", time + jump, direction=1.0, press=7)
        arm.advance(10.0)
    assert np.abs(arm.read() - before).max() <= 3 * LEASH


def test_the_outside_view_returns_to_now_when_a_route_is_accepted_or_anything_moves():
    engine = open_session(SessionOptions("titan4_sdu")).engine
    engine.update(0.0)
    play = {"name": "play", "share": 0.7}
    for command in ({"name": "grasp", "type": "straight", "level": 1}, {"name": "plan"}, play):
        engine.execute(command, 0.1)
    assert engine.state()["playing"] == 0.7
    engine.execute({"name": "accept"}, 0.2)
    assert engine.state()["playing"] is None
    engine.execute(play, 0.2)
    assert engine.state()["playing"] is None
    assert "no route to preview" in engine.state()["message"]
    for name in ("stop", "reject"):
        engine.execute({"name": name}, 0.3)
        engine.execute(play, 0.3) if name == "stop" else None
    assert engine.state()["playing"] is None
    engine.execute({"name": "plan"}, 0.4)
    engine.execute(play, 0.4)
    engine.execute({"name": "jog", "direction": 1.0, "press": 1}, 0.4)
    assert engine.state()["playing"] is None


def test_an_arm_over_a_line_is_not_moved_on_photographs(tmp_path):
    with pytest.raises(InputError, match="photographs or a film"):
        open_session(SessionOptions("titan4_sdu", source=tmp_path, arm="127.0.0.1:1"))


def test_the_page_chooses_an_object_by_its_name():
    engine = open_session(SessionOptions("titan4_sdu")).engine
    engine.update(0.0)
    engine.execute({"name": "object", "object": "valve"}, 0.1)
    assert engine.session.target == "valve"
    assert engine.session.level is Level.NEWS


@pytest.mark.parametrize("verb", PRESENT)
def test_after_stop_nothing_moves_until_it_is_reset(planned, verb):
    made, _ = put_into(planned, planned[0].route, FOLLOWING if verb == "next" else PROPOSED, "", "fresh")
    arguments = ARGUMENTS.get(verb, {})
    made.command("stop", 100.0)
    made.command(verb, 100.0, **arguments)
    assert not made.driving
    assert verb in ("next", "settle") or refused(made, "STOP was pressed", "'reset'")

    made.command("reset", 100.0)
    assert not made.state.stopped
    made.command(verb, 100.0, **arguments | {"press": 99} if "press" in arguments else arguments)
    assert "STOP was pressed" not in made.message


def test_reset_says_where_there_is_nothing_to_reset():
    made, _ = session()
    made.command("reset", 0.0)
    assert refused(made, "nothing to reset")
