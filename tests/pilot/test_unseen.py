"""What the camera has not shown lately is no basis of a route, where the vehicle moves; driving by hand remains."""

from dataclasses import replace
from itertools import product

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.document import state_document
from rrtik_ompl.pilot.interlock import FOLLOWING, MANOEUVRE, PROPOSED, UNSEEN_SECONDS
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.state import Press, Way
from rrtik_ompl.pilot.surroundings import Structure
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.world import World
from rrtik_tests.pilot_session import (
    ALWAYS,
    GUIDED,
    MOVING,
    PLACE,
    PRESENT,
    PROBLEM,
    ROBOT,
    VALVE,
    WORLD,
    hold,
    refused,
    seen_at,
)

PANEL = replace(VALVE, name="panel_mark", solids=(), grasps=())
PANEL_PLACE = pin.SE3(np.eye(3), np.array([1.4, 0.4, 0.3]))
HAND = ("jog", "go", "lead", "tool")
MOVES = "base_motion: {drift: [0.001, 0, 0]}"


def panel_at(T):
    return SeenObject(PANEL, T, 1e-8 * np.eye(6), None)


def drifting(structure="valve", place=PLACE, **options):
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, seed=1, structure=Structure(structure, place), **options)
    return made, arm


def proposed(**options):
    made, arm = drifting(**options)
    made.see([seen_at(PLACE)], 0.0)
    made.command("grasp", 0.0, type="front", level=0)
    assert "moves" in made.command("plan", 0.0)
    return made, arm


def see_nothing(made, begin, seconds, step=0.2):
    """Pictures come, and show nothing that is known."""
    for time in np.arange(begin, begin + seconds, step):
        made.see([], float(time))
        made.tick(float(time))
    return float(begin + seconds)


def test_no_route_is_led_past_a_structure_that_was_never_seen():
    made, arm = drifting()
    made.see([], 0.0)
    made.tick(0.0)
    assert "'valve' was not seen yet" in made.message
    for verb in ("plan", "replan", "back", "lift"):
        assert made.command(verb, 0.0).startswith("refused: 'valve' was not seen yet")
    assert made.route is None
    time = hold(made, arm, "jog", 0.1, lambda: False, seconds=1.0, direction=1.0, press=1)
    assert arm.read()[0] > PROBLEM.start[0] + np.radians(5.0)
    assert "'valve' was not seen yet" in made.command("move", time, target=float(arm.read()[0] + 0.1))
    assert state_document(made)["unseen"] == "'valve' was not seen yet"
    made.see([seen_at(PLACE)], time)
    made.tick(time)
    assert "in view" in made.message
    made.command("grasp", time, type="front", level=0)
    assert "moves" in made.command("plan", time)


def scene_of(what, seen):
    """A session whose scene stands on a structure and on a target, of which one was seen before ``seen`` alone."""
    made, arm = drifting("panel_mark", PANEL_PLACE)
    both = {"panel_mark": panel_at(PANEL_PLACE), "valve": seen_at(PLACE)}
    made.see(list(both.values()), 0.0)
    made.command("grasp", 0.0, type="front", level=0)
    made.command("plan", 0.0)
    assert made.mode == PROPOSED
    del both[what]
    for time in np.arange(0.2, seen + 0.1, 0.2):
        made.see(list(both.values()), float(time))
        made.tick(float(time))
    return made, arm, float(time)


@pytest.mark.parametrize("what", ["panel_mark", "valve"])
def test_every_thing_that_the_scene_stands_on_has_an_age_of_its_own(what):
    made, _, time = scene_of(what, UNSEEN_SECONDS - 0.2)
    assert made.known.unseen == ""
    made, _, time = scene_of(what, UNSEEN_SECONDS + 1.0)
    assert made.known.trouble == ""
    made.command("accept", time)
    assert refused(made, f"'{what}'", "3 s")
    document = state_document(made)
    assert document["route"]["withdrawn"] == document["unseen"] == made.known.unseen
    assert "green" not in [lamp["color"] for lamp in document["lamps"]]


def test_only_hands_move_an_arm_whose_surroundings_are_out_of_view():
    made, arm = proposed()
    route = made.route
    follower = made.follower
    made.master = SimulatedArm(ROBOT, PROBLEM.start - 0.04)
    time = see_nothing(made, 0.2, UNSEEN_SECONDS + 1.0)
    arguments = {
        "jog": {"direction": 1.0},
        "tool": {"direction": -1.0},
        "move": {"target": float(PROBLEM.start[0]) + 0.3},
    }
    for mode, verb in product((MANOEUVRE, PROPOSED, FOLLOWING), sorted({*PRESENT, *ALWAYS} & {*MOVING, *GUIDED})):
        arm._q = PROBLEM.start.copy()
        arm._goal = None
        made.stand_still()
        q = arm.read()
        way = Way(route, follower, list_of_moves=route)
        desired = q + 0.2 * np.eye(ROBOT.dof)[0]
        made.state = replace(made.state, way=way, mode=mode, press=Press(), q=q, desired=desired)
        press = {"press": 1} if verb in MOVING else {}
        made.command(verb, time, **arguments.get(verb, {}), **press)
        arm.advance(0.1)
        moved = bool(np.abs(arm.read() - PROBLEM.start).max() > 0.0)
        assert moved == (verb in HAND and mode != FOLLOWING), (mode, verb, made.message)
        assert made.mode != FOLLOWING or mode == FOLLOWING


def test_a_route_ends_when_what_it_stands_on_leaves_the_view_and_nothing_is_touched_that_drifts():
    made, arm = proposed()
    made.command("accept", 0.0)
    drift = np.array([-0.005, 0.002, 0.0])  # [m/s] of the structure, seen from the base
    time = 0.0
    deepest = np.inf
    for press in range(200):
        made.command("next", time, press=press)
        arm.advance(0.1)
        time += 0.1
        made.see([], time)
        made.tick(time)
        away = pin.SE3(np.eye(3), drift * time)
        moved = tuple(replace(each, pose=away * each.pose) for each in WORLD.scene.obstacles)
        deepest = min(deepest, World(ROBOT, replace(WORLD.scene, obstacles=moved)).clearance(made.q))
    assert made.mode == PROPOSED
    assert not made.driving
    assert deepest > 0.0
    assert "has not been in view" in made.known.unseen
    assert "refused" in made.command("accept", time)


def test_a_target_that_is_hidden_for_seconds_does_not_end_a_route():
    made, arm = proposed()
    made.command("accept", 0.0)
    time = 0.0
    for press in range(40):
        made.command("next", time, press=press)
        arm.advance(0.1)
        time += 0.1
        made.see([seen_at(PLACE)] if press % 18 == 17 else [], time)
        made.tick(time)
    assert made.mode == FOLLOWING


def test_what_is_out_of_view_is_where_it_was_for_a_vehicle_that_stands_still():
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, seed=1)
    made.see([seen_at(PLACE)], 0.0)
    time = see_nothing(made, 0.2, 60.0, step=0.4)
    assert made.known.unseen == ""
    made.command("grasp", time, type="front", level=0)
    assert "moves" in made.command("plan", time)


def test_the_patience_is_set_by_the_file_of_the_vehicle(tmp_path):
    shipped = find_vehicle("titan4_sdu")
    text = shipped.read_text().replace("\ncamera: ", f"\ncamera: {shipped.parent}/")
    text = text.replace("\nmap: ", f"\nmap: {shipped.parent}/")
    file = tmp_path / "vehicle.yaml"
    for further, patience in (("", None), ("patience: 7.5", 7.5), (MOVES, UNSEEN_SECONDS)):
        file.write_text(f"{text}\n{further}\n")
        assert load_vehicle(file).patience == patience
    file.write_text(f"{text}\npatience: -1.0\n")
    with pytest.raises(InputError, match="patience"):
        load_vehicle(file)
    made, _ = proposed(patience=7.5)
    time = see_nothing(made, 0.2, 7.0)
    assert made.known.unseen == ""
    see_nothing(made, time, 2.0)
    assert made.known.unseen
