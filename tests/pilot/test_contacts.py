"""What touches may overlap by as much as where it was taken and a little more: nothing is allowed without a depth."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl.pilot
from rrtik_ompl import AttachedObject, Box, Obstacle, Problem, Scene, World, pose
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.events import Level
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.surroundings import MAX_SHIFT, Surroundings, gripper_links
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MountedMarker
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_tests.distances import least_distances
from rrtik_tests.pilot_session import PROBLEM, ROBOT, WORLD, alarmed, arrived, hold, session

DEEPER = 1e-3  # [m]
Q = np.array(PROBLEM.goal.q)
AHEAD = pose([0.0, 0.0, 0.3])  # T_tip_bar
BAR = MarkedObject(
    "bar",
    "target",
    (MountedMarker(7, 0.08),),
    (Obstacle("body", Box([0.04, 0.04, 0.3])),),
    (GraspType("front", [AHEAD.inverse()], approach=0.05, lift=0.05),),
    loose=True,
)
TOOL = load_vehicle(Path(find_vehicle("titan4_sdu")).with_name("titan4_tool.yaml"))


def depth(plate, rows):
    """How deep the bar in the gripper gets into a plate [m]; negative for a gap."""
    scene = Scene((plate,), (AttachedObject("bar", ROBOT.tip, BAR.solids[0].shape, AHEAD),))
    return -least_distances(ROBOT, scene, rows, step=0.002)["bar", "plate"]


def plate_below(depth_there):
    """A plate into which the bar reaches so deep at Q."""
    low = -0.5
    high = 0.0
    at = ROBOT.fk(Q).act(AHEAD.translation)
    for _ in range(40):
        middle = 0.5 * (low + high)
        plate = Obstacle("plate", Box([0.3, 0.3, 0.1]), pose(at + np.array([0.0, 0.0, middle])))
        low, high = (low, middle) if depth(plate, Q[None]) > depth_there else (middle, high)
    return plate


def with_bar(depth_there):
    """A session whose arm stands at Q, where the bar is in the gripper and so deep in a plate."""
    plate = plate_below(depth_there)
    arm = SimulatedArm(ROBOT, Q)
    made = Session(Problem(World(ROBOT, Scene((plate,))), PROBLEM.start, Q), arm, seed=1)
    made.see([SeenObject(BAR, ROBOT.fk(Q) * AHEAD, 1e-12 * np.eye(6), None)], 0.0)
    made.tick(0.0)
    return made, arm, plate


@pytest.mark.parametrize("there", [-2e-4, 0.0, 1e-3, 4e-3])
def test_what_the_gripper_takes_gets_a_millimetre_deeper_into_what_it_rests_on_and_no_more(there):
    made, _, plate = with_bar(there)
    said = made.command("close", 0.1)
    assert "bar is held" in said
    assert ("'plate' may overlap" in said) == (there >= 0.0)
    around = made.surroundings
    most = max(there, 0.0) + DEEPER
    touched = 0
    for joint in range(ROBOT.dof):
        made.command("select", 0.2, joint=joint)
        free = made.joint_range()
        for end in (free.low, free.high):
            assert depth(plate, np.array([Q, np.where(np.arange(ROBOT.dof) == joint, end, Q)])) <= most + 1e-6
        for off in np.linspace(-0.2, 0.2, 21):
            q = ROBOT.clamp(Q + off * np.eye(ROBOT.dof)[joint][None])[0]
            if around.world.motion_valid(Q, q) or around.world.motion_proven(Q, q):
                found = depth(plate, np.array([Q, q]))
                assert found <= most + 1e-6
                touched += found > 0.0
    assert touched or there < 0.0


def test_what_was_taken_from_a_plate_is_kept_away_from_it_once_the_two_have_parted():
    made, arm, plate = with_bar(1e-3)
    made.command("close", 0.1)
    (contact,) = made.world.scene.contacts
    assert str(contact) in made.command("lift", 0.1)
    assert set(contact.names) == {"bar", "plate"}
    assert contact.distance == pytest.approx(-2e-3, abs=1e-6)
    made.command("accept", 0.1)
    time = 0.1
    for press in range(20):
        due = made.follower.current
        time = hold(made, arm, "next", time, lambda now=due: made.follower.current != now, seconds=5.0, press=press)
        if made.mode != "following":
            break
    assert arrived(made)
    assert made.world.scene.contacts == ()
    assert depth(plate, made.q[None]) < 0.0
    assert not made.world.valid(Q)
    assert made.world.explain(Q).count("plate")


def test_what_stands_just_inside_the_margin_of_something_may_be_taken():
    plate = plate_below(-2e-3)
    margined = Problem(World(ROBOT, Scene((replace(plate, margin=5e-3),))), PROBLEM.start, Q)
    made = Session(margined, SimulatedArm(ROBOT, Q), seed=1)
    made.see([SeenObject(BAR, ROBOT.fk(Q) * AHEAD, 1e-12 * np.eye(6), None)], 0.0)
    made.tick(0.0)
    assert "'plate' may overlap by 1 mm" in made.command("close", 0.1)
    assert "moves" in made.command("lift", 0.1)


@pytest.mark.parametrize("there", [0.0, 4e-3])
def test_who_lets_go_of_something_deep_in_something_else_is_told(there):
    made, _, _ = with_bar(there)
    made.command("close", 0.1)
    made.command("open", 0.2)
    assert alarmed(made, "'bar'", "4 mm", "'plate'", "1 mm") if there else made.level is Level.NEWS
    assert made.state.holds == ""
    assert made.world.scene.attached == ()


def tool_and_rack(q):
    """What a session knows while it holds the tool where it is put into the rack, at q."""
    around = Surroundings(WORLD)
    marker_map = TOOL.marker_map
    tool = marker_map.named("tool")
    rack = marker_map.named("rack")
    seen = SeenObject(tool, ROBOT.fk(q) * tool.grasp("straight").levels[0].inverse(), 1e-10 * np.eye(6), None)
    around = around.see([seen])
    around = around.hold(seen, ROBOT.fk(q).actInv(seen.T_base_object), q)
    place = ROBOT.fk(q) * rack.grasp("put").levels[0].inverse()
    around = around.see([SeenObject(rack, place, 1e-10 * np.eye(6), None)])
    return around


def near(q, count):
    return ROBOT.clamp(q + np.random.default_rng(1).normal(scale=0.02, size=(count, ROBOT.dof)))


def distances(world, q):
    return least_distances(ROBOT, world.scene, q[None])


def touching(world, q):
    return [{contact.first, contact.second} for contact in world.contacts(q)]


def test_what_is_put_down_gets_a_millimetre_deeper_into_its_place_than_there_and_no_more():
    around = tool_and_rack(Q)
    holding = around.holding("rack")
    there = distances(holding, Q)["tool", "rack"]
    touched = 0
    for q in near(Q, 300):
        if {"tool", "rack"} not in touching(holding, q):
            away = distances(holding, q)["tool", "rack"]
            assert away >= min(there, 0.0) - DEEPER - 1e-6
            touched += away < 0.0
    assert touched


def test_the_gripper_gets_no_deeper_into_what_it_is_to_grasp_than_at_a_grasp_and_a_little():
    around = Surroundings(WORLD)
    tool = TOOL.marker_map.named("tool")
    levels = tool.grasp("straight").levels
    around = around.see([SeenObject(tool, ROBOT.fk(Q) * levels[0].inverse(), 1e-10 * np.eye(6), None)])
    world = around.holding("tool")
    assert world.scene.allowed_collisions == WORLD.scene.allowed_collisions
    places = [ROBOT.fk(Q) * level.inverse() for level in levels]
    solid = tool.solids[0]
    grasped = [Scene((Obstacle("tool", solid.shape, place * solid.pose),)) for place in places]
    deepest = min(least_distances(ROBOT, scene, Q[None])["gripper", "tool"] for scene in grasped)
    refused = 0
    for q in near(Q, 300):
        away = distances(world, q)["gripper", "tool"]
        if {"gripper", "tool"} in touching(world, q):
            refused += 1
        else:
            assert away >= deepest - DEEPER - MAX_SHIFT - 1e-6
    assert refused


def test_nothing_but_what_is_buried_in_the_gripper_is_ever_left_out_of_the_comparison():
    around = tool_and_rack(Q)
    marker_map = TOOL.marker_map
    worlds = [around.world, around.holding("rack"), around.world_at(Q, "rack")]
    around = around.release(ROBOT.fk(Q))
    worlds += [around.world, around.holding("tool"), around.holding("rack"), around.world_at(Q, "tool")]
    links = set(gripper_links(ROBOT))
    solids = {name for each in marker_map.objects for name in each.solid_names}
    for world in worlds:
        for first, second in set(world.scene.allowed_collisions) - set(WORLD.scene.allowed_collisions):
            assert first in links
            assert second in solids
            assert distances(world, Q)[first, second] < 0.0


def test_the_pilot_leaves_pairs_out_in_one_place_and_to_count_errors():
    found = []
    for file in Path(rrtik_ompl.pilot.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call):
                words = {word.arg for word in node.keywords} & {"allowed_collisions", "allow", "allowed"}
                found += [(file.name, word) for word in words]
    assert sorted(found) == [("route_search.py", "allowed_collisions"), ("surroundings.py", "allowed_collisions")]


def test_a_route_to_what_is_buried_in_the_gripper_says_that_it_is_not_compared():
    made, _ = session()
    made.command("grasp", 0.0, type="front", level=0)
    said = made.command("plan", 0.0)
    assert "not compared" in said
    assert "valve" in said
