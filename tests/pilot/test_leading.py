"""All joints at once: a route as one motion, the last centimetres by sight, a master arm's joints."""

import numpy as np
import pytest

from rrtik_ompl.base.poses import apart, pose
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.document import state_document
from rrtik_ompl.pilot.motion.leading import ALIGNED, NEAR
from rrtik_ompl.pilot.session import Session
from rrtik_tests.pilot_session import PLACE, PROBLEM, ROBOT, WORLD, arrived, follow, hold, refused, seen_at, session


def test_a_route_of_all_joints_is_free_shorter_in_time_and_ends_where_the_list_does():
    made, arm = session()
    made.command("grasp", 0.0, type="front", level=0)
    made.command("plan", 0.0)
    listed = made.route
    assert "all joints at once" in made.command("together", 0.0)
    route = made.route
    assert route.seconds < listed.seconds
    assert route.path.end == pytest.approx(listed.path.end, abs=0.0)
    assert WORLD.prove(route.path.waypoints[: route.grasp_from + 1]).proven
    assert state_document(made)["route"]["together"]
    made.command("accept", 0.0)
    time = hold(made, arm, "next", 0.0, lambda: made.mode != "following", press=1)
    assert arrived(made)
    away, turned = apart(ROBOT.fk(arm.read()), ROBOT.fk(listed.path.end))
    assert away <= 5e-4
    assert turned <= np.radians(0.1)
    assert time < 1.3 * route.seconds + 1.0
    made.command("next", time, press=2)
    assert refused(made, "'plan'")
    assert "all joints at once" in made.command("back", time)


def test_the_list_comes_back():
    made, _ = session()
    made.command("plan", 0.0)
    before = made.route
    made.command("together", 0.0)
    made.command("together", 0.0)
    assert made.route is before


def at_the_valve():
    made, arm = session()
    made.command("grasp", 0.0, type="front", level=0)
    made.command("plan", 0.0)
    made.command("accept", 0.0)
    return made, arm, follow(made, arm, 0.0)


def test_servoing_leads_to_where_the_grasp_is_seen_now():
    made, arm, time = at_the_valve()
    moved = PLACE * pose([0.004, -0.003, 0.002])
    time += 0.03
    made.see([seen_at(moved)], time)

    def there():
        made.see([seen_at(moved)], made.time)
        return made.message.startswith("at the grasp")

    hold(made, arm, "servo", time, there, seconds=20.0, press=90)
    assert made.message.startswith("at the grasp"), made.message
    away, turned = apart(ROBOT.fk(arm.read()), made.surroundings.named("valve").grasp_pose("front", 0))
    assert away <= 1e-3
    assert turned <= np.radians(0.2)


def test_servoing_stops_when_the_target_is_out_of_view_and_begins_only_near_it():
    made, arm, time = at_the_valve()
    made.see([seen_at(PLACE * pose([0.02, 0.0, 0.0]))], time + 0.03)
    time = hold(made, arm, "servo", time + 0.03, lambda: "not in view" in made.message, seconds=5.0, press=91)
    assert made.message == made.command("servo", time, press=91) or "not in view" in made.message
    assert not made.driving
    far, _ = session()
    far.command("grasp", 0.0, type="front", level=0)
    assert f"the last {100 * NEAR:.0f} cm" in far.command("servo", 0.0, press=1)
    assert not far.driving


def test_servoing_stops_when_the_target_jumps():
    made, arm, time = at_the_valve()
    for k, aside in enumerate((0.01, 0.012, 0.06)):
        time += 0.03
        made.see([seen_at(PLACE * pose([aside, 0.0, 0.0]))], time)
        said = made.command("servo", time, press=92)
        assert ("has jumped" in said) == (k == 2), said
        arm.advance(0.03)
        made.tick(time)
    assert not made.driving


def with_master(q):
    arm = SimulatedArm(ROBOT, PROBLEM.start)
    master = SimulatedArm(ROBOT, q)
    made = Session(PROBLEM, arm, seed=1, master=master)
    made.see([seen_at(PLACE)], 0.0)
    return made, arm, master


def test_a_master_arm_leads_as_long_as_it_is_aligned_and_the_way_is_free():
    made, arm, master = with_master(PROBLEM.start)
    assert made.world.valid(PROBLEM.start - 0.5 * ALIGNED)
    master._q = PROBLEM.start - 0.5 * ALIGNED
    hold(made, arm, "lead", 0.0, lambda: False, seconds=3.0, press=1)
    assert arm.read() == pytest.approx(ROBOT.clamp(master.read()), abs=1e-6)
    master._q = PROBLEM.start - 3.0 * ALIGNED
    made.command("lead", made.time, press=2)
    assert refused(made, "master", f"{np.degrees(2.5 * ALIGNED):.1f} deg")  # the arm has gone half a tolerance
    master.lost = "the line is cut"
    made.command("lead", made.time, press=3)
    assert refused(made, "master", master.lost)
    plain, _ = session()
    plain.command("lead", 0.0, press=1)
    assert refused(plain, "--master")


def test_a_master_arm_leads_into_nothing():
    made, arm, master = with_master(PROBLEM.start)
    rng = np.random.default_rng(3)
    for press in range(12):
        goal = arm.read() + rng.uniform(-0.8, 0.8, ROBOT.dof)
        master._q = arm.read()
        made.command("lead", made.time, press=press)
        master._q = goal
        hold(made, arm, "lead", made.time, lambda: made.state.press.over, seconds=3.0, step=0.05, press=press)
        assert made.world.valid(arm.read())
