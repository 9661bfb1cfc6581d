"""Which lamps burn, and what their words say."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.poses import pose
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.pilot.devices.arm import joint_rates
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, RED, lamps, stage_poses
from rrtik_ompl.pilot.routes.route import Route, propose
from rrtik_ompl.pilot.surroundings import Surroundings, gripper_links
from rrtik_tests.pilot_session import PLACE, PROBLEM, ROBOT, VALVE, WORLD, seen_at, session


def random_places(count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield pin.SE3(
            pin.exp3(rng.normal(0.0, 0.4, 3)) @ PLACE.rotation, rng.uniform([0.9, -0.4, 0.0], [1.5, 0.7, 0.7])
        )


def test_lamps_agree_with_all_branches_looked_at_one_by_one():
    colors = []
    surroundings = Surroundings(WORLD)
    for T in random_places(25, seed=3):
        surroundings = surroundings.see([seen_at(T)])
        world = surroundings.world
        holding = surroundings.holding("valve")
        for lamp in lamps(world, VALVE, T, PROBLEM.start, holding=holding):
            stages = stage_poses(T, VALVE.grasp(lamp.type), lamp.level)
            before, at, after = (branches(stage) for stage in stages)
            free = [row for row in at if holding.valid(row)]
            assert len(lamp.grasps) == len(free)
            assert (lamp.color == RED) == (len(at) == 0), lamp
            if any(map(world.valid, before)) and free and any(map(holding.valid, after)):
                assert lamp.color == GREEN, lamp
            elif not free or not any(map(holding.valid, after)):
                assert lamp.color != GREEN, lamp
            assert (lamp.reason == "") == (lamp.color == GREEN)
            colors.append(lamp.color)
    assert {GREEN, AMBER, RED} == set(colors)


def branches(stage):
    found = solutions(ROBOT, stage.homogeneous[None])
    return found.branches[0][found.valid[0]]


def test_red_lamps_do_not_plan_and_green_ones_do():
    surroundings = Surroundings(WORLD)
    colors = []
    rates = joint_rates(ROBOT)
    for T in random_places(6, seed=5):
        surroundings = surroundings.see([seen_at(T)])
        holding = surroundings.holding("valve")
        for lamp in lamps(surroundings.world, VALVE, T, PROBLEM.start, holding=holding):
            found = propose(PROBLEM, surroundings, "valve", lamp, np.array(PROBLEM.start), rates, 1)
            if lamp.color != AMBER:
                assert isinstance(found, Route) == (lamp.color == GREEN), lamp
            colors.append(lamp.color)
    assert {GREEN, RED} <= set(colors)


def test_the_postures_of_a_green_lamp_reach_its_stages():
    made, _ = session()
    green = [lamp for lamp in made.lamps() if lamp.color == GREEN]
    assert green
    for lamp in green:
        stages = stage_poses(PLACE, VALVE.grasp(lamp.type), lamp.level)
        there = [pair for pair in zip(lamp.q, stages, strict=True) if not np.isnan(pair[0]).any()]
        assert len(there) >= 2  # the approach may be made from beside its pose
        for q, T in there:
            assert ROBOT.fk(q).homogeneous == pytest.approx(T.homogeneous, abs=1e-6)


def test_a_grasp_that_cannot_be_made_says_by_how_much_or_what_would_touch():
    far, _ = session()
    far.see([seen_at(pin.SE3(PLACE.rotation, np.array([3.0, 0.0, 0.0])))], 0.1)
    assert " m away" in far.command("grasp", 0.2, type="front", level=0)
    assert "the closest configuration is " in far.fault()
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
    surroundings = surroundings.see([seen_at(PLACE)])
    links = gripper_links(ROBOT)
    assert ROBOT.model.frames[ROBOT.model.getFrameId(ROBOT.tip)].name in ROBOT.tip
    scene = surroundings.holding("valve").scene
    not_compared = {frozenset(pair) for pair in set(scene.allowed_collisions) - set(WORLD.scene.allowed_collisions)}
    in_contact = {contact.pair for contact in scene.contacts}
    assert {frozenset((link, "valve")) for link in links} == not_compared | in_contact


def test_trembling_is_no_reason_to_build_another_world():
    surroundings = Surroundings(WORLD).see([seen_at(PLACE)])
    assert surroundings.see([seen_at(PLACE * pose([0.0004, 0.0, 0.0]))]) is surroundings
    moved = surroundings.see([seen_at(PLACE * pose([0.01, 0.0, 0.0]))])
    assert moved.world is not surroundings.world
