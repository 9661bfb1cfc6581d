"""The whole session without its page: from seeing to the grasp, and its record."""

import json

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.events import alarm, news
from rrtik_ompl.pilot.interlock import CHOOSING, FOLLOWING, MANOEUVRE, PROPOSED
from rrtik_ompl.pilot.record import Record, read_record
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.state import MAX_ALARMS
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MountedMarker
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_tests.pilot_session import PLACE, PROBLEM, ROBOT, VALVE, arrived, follow, hold, session


def test_from_seeing_to_the_grasp_through_every_state():
    made, arm = session()
    assert made.mode == MANOEUVRE
    assert made.target == "valve"
    assert "chosen" in made.command("object", 0.1, name="valve")
    assert made.mode == CHOOSING
    assert "can be reached" in made.command("grasp", 0.2, type="front", level=0)
    assert "moves" in made.command("plan", 0.3)
    assert made.mode == PROPOSED
    assert made.route.path.one_joint_at_a_time
    assert "accept" in made.command("next", 0.4, press=0)
    assert made.mode == PROPOSED
    made.command("accept", 0.5)
    assert made.mode == FOLLOWING
    follow(made, arm, 0.5)
    assert made.mode == MANOEUVRE
    tip = ROBOT.fk(made.q).translation
    assert np.linalg.norm(tip - PLACE.act(VALVE.grasp("front").levels[0].translation)) < 1e-3


def test_what_makes_no_sense_is_said_and_changes_nothing():
    made, _ = session()
    made.see([], 1.0)
    for verb, arguments, word in [
        ("fly", {}, "no command"),
        ("select", {"joint": 9}, "1 to 6"),
        ("select", {}, "takes joint"),
        ("move", {"target": "far"}, "finite number"),
        ("move", {"target": float("nan")}, "finite number"),
        ("object", {"name": "anchor"}, "no object in view"),
        ("grasp", {"type": "side", "level": 0}, "no grasp type"),
        ("grasp", {"type": "front", "level": 7}, "1 to 3"),
        ("accept", {}, "no route"),
        ("next", {"press": 1}, "no route"),
        ("jog", {"press": 1, "direction": "up"}, "finite number"),
        ("speed", {}, "takes share"),
        ("back", {}, "no route"),
    ]:
        assert word in made.command(verb, 1.0, **arguments), verb
        assert made.mode == MANOEUVRE
        assert made.route is None


def test_an_arm_that_is_elsewhere_may_not_begin_and_finds_a_new_route():
    made, arm = session()
    made.command("grasp", 0.1, type="front", level=0)
    made.command("plan", 0.2)
    arm.move(5, float(PROBLEM.start[5]) + 0.3)
    arm.advance(10.0)
    made.tick(0.3)
    made.see([], 0.35)
    assert "not where the route starts" in made.command("accept", 0.4)
    assert made.mode == PROPOSED
    assert "moves" in made.command("replan", 0.5)
    made.command("accept", 0.6)
    follow(made, arm, 0.6)
    assert made.mode == MANOEUVRE


def test_a_joint_driven_by_mistake_stops_the_route():
    made, arm = session()
    made.command("grasp", 0.1, type="front", level=0)
    made.command("plan", 0.2)
    made.command("accept", 0.3)
    other = next(j for j in range(6) if j != made.follower.joint())
    arm.move(other, float(made.q[other]) + 0.1)
    arm.advance(10.0)
    made.see([], 1.0)
    made.tick(1.0)
    assert "off the route" in made.message
    assert arm.moving is None
    assert "replan" in made.message


def test_an_object_that_comes_into_the_way_blocks_the_next_move():
    made, arm = session()
    made.command("grasp", 0.1, type="front", level=0)
    made.command("plan", 0.2)
    made.command("accept", 0.3)
    middle = made.route.path.waypoints[len(made.route.path.waypoints) // 2]
    blocker = MarkedObject("crate", "obstacle", (MountedMarker(9, 0.08),), (Obstacle("crate", Box([0.1, 0.1, 0.1])),))
    made.see([SeenObject(blocker, pose(ROBOT.fk(middle).translation), 1e-8 * np.eye(6), None)], 0.4)
    assert "withdrawn" in made.message
    assert made.mode == PROPOSED
    assert made.state.way.withdrawn
    assert "accept" in made.command("next", 0.5, press=0)
    assert "withdrawn" in made.command("accept", 0.5)
    assert arm.moving is None
    made.see([SeenObject(blocker, pose([0.0, -3.0, 0.0]), 1e-8 * np.eye(6), None)], 0.6)
    assert "free again" in made.message
    assert "accepted" in made.command("accept", 0.7)


def test_without_an_object_the_problems_own_goal_is_planned_for():
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, seed=1, past=True)
    assert "moves" in made.command("plan", 0.0)
    made.command("accept", 0.1)
    follow(made, arm, 0.1)
    assert arrived(made)
    off = ROBOT.fk(PROBLEM.goal.q).actInv(ROBOT.fk(made.q))
    assert np.linalg.norm(off.translation) <= 5e-4
    assert np.linalg.norm(pin.log3(off.rotation)) <= np.radians(0.1)


def test_the_way_back_leads_to_the_start():
    made, arm = session()
    made.command("grasp", 0.1, type="front", level=0)
    made.command("plan", 0.2)
    made.command("accept", 0.3)
    time = hold(made, arm, "next", 0.4, lambda: made.follower.current == 1, press=0)
    assert "way back" in made.command("back", time)
    made.command("accept", time)
    follow(made, arm, time)
    assert np.abs(made.q - PROBLEM.start).max() < np.radians(0.01)


def test_who_lets_go_before_the_end_of_a_move_has_to_make_it_to_its_end():
    made, arm = session()
    for verb, arguments in (("grasp", {"type": "front", "level": 0}), ("plan", {}), ("accept", {})):
        made.command(verb, 0.1, **arguments)
    joint = made.follower.joint()
    end = made.follower.target
    time = hold(made, arm, "next", 0.1, lambda: abs(made.q[joint] - end[joint]) < np.radians(0.8), press=0)
    assert made.follower.current == 0
    assert "are left of the move" in made.message
    hold(made, arm, "next", time, lambda: made.follower.current == 1, press=1)
    assert made.q[joint] == pytest.approx(end[joint], abs=1e-4)


def test_a_record_repeats_the_session(tmp_path):
    def run(file):
        made, arm = session(Record(file))
        for time, verb, arguments in [
            (0.1, "grasp", {"type": "front", "level": 0}),
            (0.2, "plan", {}),
            (0.3, "accept", {}),
        ]:
            made.command(verb, time, **arguments)
        follow(made, arm, 0.3)
        return made

    first = run(tmp_path / "a.jsonl")
    run(tmp_path / "b.jsonl")
    assert (tmp_path / "a.jsonl").read_text() == (tmp_path / "b.jsonl").read_text()
    entries = list(read_record(tmp_path / "a.jsonl"))
    assert [e["name"] for e in entries if e["kind"] == "command"][:3] == ["grasp", "plan", "accept"]
    assert [e["q"] for e in entries if e["kind"] == "joints"][-1] == pytest.approx(first.q.tolist())
    text = (tmp_path / "a.jsonl").read_text()
    (tmp_path / "cut.jsonl").write_text(text[:-20])
    assert len(list(read_record(tmp_path / "cut.jsonl"))) == len(entries) - 1
    (tmp_path / "bad.jsonl").write_text(json.dumps([1]) + "\n" + text)
    with pytest.raises(InputError, match=r"bad\.jsonl:1"):
        list(read_record(tmp_path / "bad.jsonl"))
    with pytest.raises(InputError, match="missing"):
        list(read_record(tmp_path / "missing.jsonl"))


def test_alarms_are_kept_once_each_with_their_time():
    made, _ = session()
    for number in range(20):
        made.see([], float(number))
        made.say(alarm(f"fault {number}"))
        made.say(alarm(f"fault {number}"))
        made.say(news("all is well"))
    assert len(made.state.alarms) == MAX_ALARMS
    assert made.state.alarms[-1] == (19.0, "fault 19")
