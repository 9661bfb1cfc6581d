"""The tool without its page: what is refused, which lamps burn, routes that are followed, lost and found again."""

import json

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl import load_problem, load_robot
from rrtik_ompl.errors import InputError
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.path import JointPath
from rrtik_ompl.pilot.devices.arm import SimulatedArm, joint_rates
from rrtik_ompl.pilot.lamps import AMBER, GREEN, RED, lamps, stage_poses
from rrtik_ompl.pilot.record import Record, read_record
from rrtik_ompl.pilot.routes.follower import REACTION_SECONDS, Follower
from rrtik_ompl.pilot.routes.manoeuvre import check_move, escape_move, free_until, joint_range
from rrtik_ompl.pilot.session import CHOOSING, FOLLOWING, MANOEUVRE, PROPOSED, Session
from rrtik_ompl.pilot.surroundings import Surroundings, gripper_links
from rrtik_ompl.poses import pose, pose_from_rpy
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MountedMarker
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.shapes import Box
from rrtik_ompl.world import World

PROBLEM = load_problem("titan4_sdu")
ROBOT, WORLD = PROBLEM.robot, PROBLEM.world
VALVE = MarkedObject(
    "valve",
    "target",
    (MountedMarker(7, 0.08),),
    (Obstacle("body", Box([0.02, 0.02, 0.02])),),
    tuple(
        GraspType(name, [pose_from_rpy([0, 0, 0.03 * k], [roll, 0, 0]) for k in range(3)], approach=0.08, lift=0.05)
        for name, roll in (("front", 0.0), ("rolled", np.pi / 2))
    ),
)
PLACE = pin.SE3(ROBOT.fk(PROBLEM.goal.q).rotation, np.array([1.30, 0.17, 0.09]))


def seen_at(T):
    return SeenObject(VALVE, T, 1e-8 * np.eye(6), None)


def session(record=None):
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, record=record, seed=1)
    made.see([seen_at(PLACE)], 0.0)
    return made, arm


def drive(made, arm, time, most=200.0, step=0.05):
    """Do what the list says until it is done."""
    while made.mode == FOLLOWING and time < most:
        if arm.moving is None:
            made.command("next", time)
        arm.advance(step)
        time += step
        made.tick(time)
    return time


# --- manoeuvre ---------------------------------------------------------------------------------------------------


def test_no_command_of_many_leads_beyond_limits_or_into_anything():
    rng = np.random.default_rng(0)
    q, accepted = np.array(PROBLEM.start), []
    for _ in range(400):
        joint = int(rng.integers(6))
        target = float(q[joint] + rng.normal(0.0, 0.6))
        if check_move(WORLD, q, joint, target).allowed:
            end = q.copy()
            end[joint] = target
            accepted.append((q, end))
            q = end
    starts, ends = (np.array(rows) for rows in zip(*accepted, strict=True))
    share = np.linspace(0.0, 1.0, 40)[:, None]
    rows = np.concatenate([a + share * (b - a) for a, b in zip(starts, ends, strict=True)])
    assert len(accepted) > 60
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
    with pytest.raises(InputError, match="0 to 5"):
        check_move(WORLD, PROBLEM.start, 6, 0.0)
    with pytest.raises(InputError, match="finite"):
        check_move(WORLD, PROBLEM.start, 0, np.nan)


def test_little_room_is_warned_of():
    until = free_until(WORLD, PROBLEM.goal.q, 2, float(ROBOT.lower[2]))
    verdict = check_move(WORLD, PROBLEM.goal.q, 2, until)
    assert any("mm between" in warning for warning in verdict.warnings)
    assert 0.0 <= verdict.clearance < 0.02


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
    robot = load_robot("ur5")
    world = World(robot, Scene())
    q = np.array([0.0, -1.2, 1.0, -1.4, 1.0, 0.0])
    stretches = joint_range(world, q, 2).singular
    assert any(low <= 0.0 <= high for low, high, _ in stretches)  # the elbow straight
    assert "near a singular posture" in check_move(world, q, 2, 0.0).warnings
    assert not check_move(world, q, 2, 1.2).warnings


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
    made = Session(PROBLEM, SimulatedArm(ROBOT, q), seed=1)
    assert f"{ROBOT.joint_names[joint]} to" in made.command("plan", 0.0)
    made.command("select", 0.1, joint=joint)
    assert "out of contact" in made.command("move", 0.2, target=target)
    made.arm.advance(10.0)
    made.tick(1.0)
    assert "moves" in made.command("plan", 1.1)


# --- lamps -------------------------------------------------------------------------------------------------------


def test_lamps_agree_with_all_branches_looked_at_one_by_one():
    rng, colors = np.random.default_rng(3), []
    surroundings = Surroundings(WORLD)
    for _ in range(25):
        T = pin.SE3(pin.exp3(rng.normal(0.0, 0.4, 3)) @ PLACE.rotation, rng.uniform([0.9, -0.4, 0.0], [1.5, 0.7, 0.7]))
        surroundings.see([seen_at(T)])
        world, holding = surroundings.world, surroundings.holding("valve")
        for lamp in lamps(world, VALVE, T, PROBLEM.start, holding=holding):
            expected = GREEN
            for stage, where in zip(stage_poses(T, VALVE.grasp(lamp.type), lamp.level), (world, holding, holding)):  # noqa: B905
                found = solutions(ROBOT, stage.homogeneous[None])
                rows = found.branches[0][found.valid[0]]
                if len(rows) == 0:
                    expected = RED
                elif expected == GREEN and not any(where.valid(row) for row in rows):
                    expected = AMBER
            assert lamp.color == expected, lamp
            assert (lamp.reason == "") == (lamp.color == GREEN)
            colors.append(lamp.color)
    assert {GREEN, AMBER, RED} == set(colors)


def test_the_postures_of_a_green_lamp_reach_its_stages():
    made, _ = session()
    green = [lamp for lamp in made.lamps() if lamp.color == GREEN]
    assert green
    for lamp in green:
        for q, T in zip(lamp.q, stage_poses(PLACE, VALVE.grasp(lamp.type), lamp.level), strict=True):
            assert ROBOT.fk(q).homogeneous == pytest.approx(T.homogeneous, abs=1e-6)


def test_a_grasp_that_cannot_be_made_says_by_how_much_or_what_would_touch():
    far, _ = session()
    far.see([seen_at(pin.SE3(PLACE.rotation, np.array([3.0, 0.0, 0.0])))], 0.1)
    assert "m and" in far.command("grasp", 0.2, type="front", level=0)
    assert "away from the goal" in far.fault()
    inside, _ = session()
    inside.see([seen_at(pin.SE3(PLACE.rotation, np.array([1.45, 0.17, 0.09])))], 0.1)  # within the panel
    assert inside.lamps()[0].color == AMBER
    assert "'panel'" in inside.command("grasp", 0.2, type="front", level=0)
    near, _ = session()
    green = next(lamp for lamp in near.lamps() if lamp.color == GREEN)
    near.command("grasp", 0.2, type=green.type, level=green.level)
    assert near.fault() == ""


def test_the_gripper_may_touch_what_it_holds_and_nothing_else():
    surroundings = Surroundings(WORLD)
    surroundings.see([seen_at(PLACE)])
    links = gripper_links(ROBOT)
    assert ROBOT.model.frames[ROBOT.model.getFrameId(ROBOT.tip)].name in ROBOT.tip
    allowed = surroundings.holding("valve").scene.allowed_collisions
    assert {(link, "valve") for link in links} <= set(allowed)
    assert all("valve" in pair for pair in set(allowed) - set(WORLD.scene.allowed_collisions))


def test_trembling_is_no_reason_to_build_another_world():
    surroundings = Surroundings(WORLD)
    assert surroundings.see([seen_at(PLACE)])
    before = surroundings.world
    assert not surroundings.see([seen_at(PLACE * pose([0.0004, 0.0, 0.0]))])
    assert surroundings.world is before
    assert surroundings.see([seen_at(PLACE * pose([0.01, 0.0, 0.0]))])
    assert surroundings.world is not before


# --- following ---------------------------------------------------------------------------------------------------

CORNERS = np.zeros((4, 6))
CORNERS[1:, 0], CORNERS[2:, 1], CORNERS[3:, 0] = 0.5, -0.4, 0.2


def follower():
    return Follower(JointPath.of(ROBOT, CORNERS), joint_rates(ROBOT))


def test_moves_are_followed_in_their_order_with_advice_in_time():
    following, rate = follower(), float(joint_rates(ROBOT)[0])
    assert following.update(CORNERS[0]).advice == "move"
    half = following.update([0.25, 0, 0, 0, 0, 0] * np.ones(6))
    assert half.share == pytest.approx(0.5)
    near = following.update(np.array([0.5 - 0.9 * rate * REACTION_SECONDS, 0, 0, 0, 0, 0]))
    assert (near.advice, near.move) == ("stop", 0)
    assert following.update(CORNERS[1]).move == 1
    assert following.update(CORNERS[2]).move == 2
    assert following.update(CORNERS[3]).advice == "done"
    assert following.done


def test_a_move_shorter_than_the_tolerance_has_to_be_made_all_the_same():
    rows = np.zeros((3, 6))
    rows[1:, 0], rows[2:, 1] = np.radians(0.8), 0.5
    following = Follower(JointPath.of(ROBOT, rows), joint_rates(ROBOT))
    assert following.update(rows[0]).move == 0
    assert following.update(rows[1]).move == 1


def test_the_wrong_joint_or_the_wrong_way_is_lost_and_named():
    wrong = follower().update(np.array([0.0, 0.1, 0, 0, 0, 0]))
    assert wrong.advice == "lost"
    assert ROBOT.joint_names[1] in wrong.fault
    assert follower().update(np.array([-0.1, 0, 0, 0, 0, 0])).advice == "lost"
    assert follower().update(np.array([0.6, 0, 0, 0, 0, 0])).advice == "lost"


def test_the_way_back_is_the_way_reversed():
    following = follower()
    following.update(CORNERS[1])
    here = CORNERS[1].copy()
    here[1] = -0.2
    following.update(here)
    assert following.back(here).waypoints == pytest.approx(np.vstack([here, CORNERS[1], CORNERS[0]]))
    assert following.rest(here).waypoints == pytest.approx(np.vstack([here, CORNERS[2:]]))


# --- the whole session -------------------------------------------------------------------------------------------


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
    assert "accept" in made.command("next", 0.4)
    assert made.mode == PROPOSED
    made.command("accept", 0.5)
    assert made.mode == FOLLOWING
    drive(made, arm, 0.5)
    assert made.mode == MANOEUVRE
    tip = ROBOT.fk(made.q).translation
    assert np.linalg.norm(tip - PLACE.act(VALVE.grasp("front").levels[0].translation)) < 0.03


def test_what_makes_no_sense_is_said_and_changes_nothing():
    made, _ = session()
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
        ("next", {}, "no route"),
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
    assert "not where the route starts" in made.command("accept", 0.4)
    assert made.mode == PROPOSED
    assert "moves" in made.command("replan", 0.5)
    made.command("accept", 0.6)
    drive(made, arm, 0.6)
    assert made.mode == MANOEUVRE


def test_a_joint_driven_by_mistake_stops_the_route():
    made, arm = session()
    made.command("grasp", 0.1, type="front", level=0)
    made.command("plan", 0.2)
    made.command("accept", 0.3)
    other = next(j for j in range(6) if j != made.follower.joint())
    arm.move(other, float(made.q[other]) + 0.1)
    arm.advance(10.0)
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
    assert "blocked" in made.message
    assert "blocked" in made.command("next", 0.5)
    assert arm.moving is None


def test_without_an_object_the_problems_own_goal_is_planned_for():
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, seed=1)
    assert "moves" in made.command("plan", 0.0)
    made.command("accept", 0.1)
    drive(made, arm, 0.1)
    assert np.abs(made.q - PROBLEM.goal.q).max() < np.radians(1.01)


def test_the_way_back_leads_to_the_start():
    made, arm = session()
    made.command("grasp", 0.1, type="front", level=0)
    made.command("plan", 0.2)
    made.command("accept", 0.3)
    made.command("next", 0.4)
    arm.advance(100.0)
    made.tick(1.0)
    assert "way back" in made.command("back", 1.1)
    made.command("accept", 1.2)
    drive(made, arm, 1.2)
    assert np.abs(made.q - PROBLEM.start).max() < np.radians(1.01)


def test_a_record_repeats_the_session(tmp_path):
    def run(file):
        made, arm = session(Record(file))
        for time, verb, arguments in [
            (0.1, "grasp", {"type": "front", "level": 0}),
            (0.2, "plan", {}),
            (0.3, "accept", {}),
        ]:
            made.command(verb, time, **arguments)
        drive(made, arm, 0.3)
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
