"""The gripper: what it holds is part of the arm, is carried, lifted and put down; what is fixed is not carried away."""

from pathlib import Path

import numpy as np
import pytest

from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.events import Level
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_tests.pilot_session import PLACE, VALVE, arrived, drive_at, follow, refused, session

TOOL = Path(find_vehicle("titan4_sdu")).with_name("titan4_tool.yaml")


class Driver:
    """An engine with the tool and its rack in view, ten times as fast, and its time."""

    def __init__(self, record=None):
        self.opened = open_session(SessionOptions("titan4_sdu", vehicle=TOOL, record=record, seed=1))
        self.engine = self.opened.engine
        self.time = 0.0
        self.presses = 0
        self.session = self.engine.session
        drive_at(self.session, 1.5)
        self.passes(2)

    def passes(self, steps, **command):
        """Time passes: with a picture each, or, while a command is held, without, for they take the longest."""
        for _ in range(steps):
            self.time += 0.05
            if command:
                self.session.see((), self.time)
                self.engine.execute(command, self.time)
            else:
                self.engine.update(self.time)

    def do(self, verb, **arguments):
        self.passes(1)
        said = self.session.command(verb, self.time, **arguments)
        self.passes(1)
        return said

    def go_to(self, name, kind):
        self.do("object", name=name)
        self.do("grasp", type=kind, level=0)
        assert "moves" in self.do("plan")
        self.follow()

    def follow(self):
        self.do("accept")
        while self.session.mode == "following":
            self.presses += 1
            assert self.presses < 60
            for _ in range(60):
                self.passes(1, name="next", press=self.presses)
                if self.session.state.press.over or self.session.mode != "following":
                    break
            self.session.command("release", self.time)
            self.passes(1)
        assert arrived(self.session)

    def place(self, name):
        return self.engine.perception.source.camera.places[name]


def test_a_tool_is_picked_lifted_carried_and_placed(tmp_path):
    hands = Driver(tmp_path / "record.jsonl")
    made = hands.session
    hands.go_to("tool", "straight")
    before = hands.place("tool")

    assert "tool is held" in hands.do("close")
    assert [each.name for each in made.world.scene.attached] == ["tool"]

    assert "moves" in hands.do("lift")
    hands.follow()
    lifted = hands.place("tool").translation - before.translation
    assert lifted == pytest.approx([0.0, 0.0, 0.05], abs=1e-3)

    hands.go_to("rack", "put")
    assert "tool is put down" in hands.do("open")
    hands.passes(3)

    vehicle = load_vehicle(TOOL)
    pick = vehicle.marker_map.named("tool").grasp("straight").levels[0]
    put = vehicle.marker_map.named("rack").grasp("put").levels[0]
    wanted = vehicle.places["rack"] * put * pick.inverse()
    assert np.linalg.norm(hands.place("tool").translation - wanted.translation) < 2e-3
    seen = made.surroundings.named("tool").T_base_object
    assert np.linalg.norm(seen.translation - wanted.translation) < 2e-3
    assert not made.world.scene.attached

    there = made.q.copy()
    hands.presses += 1
    hands.do("select", joint=2)
    hands.passes(10, name="jog", direction=-1.0, press=hands.presses)  # the gripper may leave what it has put down
    assert np.abs(made.q - there).max() > 0.05

    end = made.arm.read()
    hands.opened.close()

    again = open_session(SessionOptions("titan4_sdu", vehicle=TOOL, replay=tmp_path / "record.jsonl"))
    again.engine.update(hands.time + 1.0)
    assert again.engine.session.q == pytest.approx(end)
    assert again.engine.session.state.gripper.closed is False
    placed = again.engine.session.surroundings.named("tool").T_base_object.translation
    assert placed == pytest.approx(wanted.translation, abs=2e-3)
    again.close()


def test_what_is_held_may_not_touch_what_the_arm_may_not_touch():
    hands = Driver()
    hands.go_to("tool", "straight")
    hands.do("close")
    made = hands.session
    assert made.world.valid(made.q)
    rows = made.q + np.outer(np.linspace(-0.3, 0.3, 25), np.eye(6)[1])  # down to the shelf, or up
    met = [row for row in rows if made.world.explain(row).count("tool")]
    assert met
    made.command("select", hands.time, joint=1)
    assert "tool" in made.command("move", hands.time, target=float(met[0][1]))
    hands.opened.close()


def test_a_gripper_closed_on_what_is_fixed_keeps_the_arm_still_until_it_opens():
    made, arm = session()
    for verb, arguments in (("grasp", {"type": "front", "level": 0}), ("plan", {}), ("accept", {})):
        made.command(verb, 0.1, **arguments)
    time = follow(made, arm, 0.1)
    assert "valve" in made.command("close", time)
    assert made.state.gripper.fixed == "valve"
    assert arm.closed
    for verb, arguments in (("jog", {"direction": 1.0, "press": 500}), ("plan", {}), ("move", {"target": 0.0})):
        made.command(verb, time, **arguments)
        assert refused(made, "valve", "open it first")
        assert not made.driving
    made.command("open", time)
    assert made.level is Level.NEWS
    assert not arm.closed
    for verb in ("lift", "open"):
        made.command(verb, time)
        assert refused(made)
    made.command("jog", time, direction=-1.0, press=501)
    assert made.driving


def test_a_gripper_that_closes_far_from_everything_says_how_far():
    made, arm = session()
    said = made.command("close", 0.0)
    away = np.linalg.norm(made.robot.fk(made.q).translation - PLACE.act(VALVE.grasp("front").levels[0].translation))
    assert "nothing is between the fingers" in said
    assert "mm" in said
    assert away > 0.1
    assert isinstance(arm, SimulatedArm)
    assert arm.closed
