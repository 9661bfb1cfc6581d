"""Which lamps burn, and what their words say."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.pilot.lamps import AMBER, GREEN, RED, lamps, stage_poses
from rrtik_ompl.pilot.surroundings import Surroundings, gripper_links
from rrtik_ompl.poses import pose
from rrtik_tests.pilot_session import PLACE, PROBLEM, ROBOT, VALVE, WORLD, seen_at, session


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
