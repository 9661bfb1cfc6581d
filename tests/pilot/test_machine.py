"""The session is a function of a state and an event; what it needs and decides stands in one place."""

import ast
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl.pilot
from rrtik_ompl.pilot.events import Command, Judged, Measured, Seen, SetPoint, Stop
from rrtik_ompl.pilot.interlock import FOLLOWING, MODES, PROPOSED
from rrtik_ompl.pilot.machine import VERBS, handle
from rrtik_tests.pilot_session import ALWAYS, GUIDED, MOVING, PLACE, PRESENT, seen_at, session

FOLDER = Path(rrtik_ompl.pilot.__file__).parent
IN_ONE_MODE = {"accept": (PROPOSED,), "together": (PROPOSED,), "next": (FOLLOWING,), "settle": (FOLLOWING,)}
NOT_ON_A_ROUTE = ("jog", "go", "move", "servo", "lead", "close", "open", "lift", "posture", "keep", "tool")


def given(verb, time=0.0, **arguments):
    return Command(verb, time, arguments=arguments)


def test_the_table_of_the_verbs_needs_what_was_reviewed():
    assert set(VERBS) == {*PRESENT, *ALWAYS}
    assert {verb for verb, row in VERBS.items() if row.present} == set(PRESENT)
    assert {verb for verb, row in VERBS.items() if row.held} == set(MOVING)
    assert {verb for verb, row in VERBS.items() if row.guided} == set(GUIDED)
    assert {verb for verb, row in VERBS.items() if row.gripping} == {"back", "close", "open"}
    for verb, row in VERBS.items():
        usual = tuple(mode for mode in MODES if mode != FOLLOWING) if verb in NOT_ON_A_ROUTE else MODES
        assert row.modes == IN_ONE_MODE.get(verb, usual), verb
        assert bool(row.otherwise) == (row.modes != MODES), verb


def test_the_same_state_and_event_give_the_same_and_change_neither_state_nor_arm():
    made, arm = session()
    made.command("grasp", 0.0, type="front", level=0)
    made.command("plan", 0.0)
    made.command("accept", 0.0)
    before = made.state
    q = arm.read()
    kept = {each.name: getattr(before, each.name) for each in fields(before)}
    for event in (
        given("next", press=1),
        given("stop"),
        Seen([seen_at(PLACE)], 0.1),
        Measured(q + 0.1, 0.1),
        Judged("azimuth jumped"),
    ):
        (first, effects), (again, same) = (handle(made.means, before, event) for _ in range(2))
        assert first.mode == again.mode
        assert first.answer == again.answer
        assert np.array_equal(first.desired, again.desired)
        assert [type(each) for each in effects] == [type(each) for each in same]
        assert all(getattr(before, name) is value for name, value in kept.items())
    assert made.state is before
    assert arm.moving is None


@pytest.mark.parametrize("event", [given("stop"), given("halt"), Judged("azimuth jumped"), Measured(np.zeros(6), 9.0)])
def test_what_stops_the_arm_is_an_effect_of_its_own_and_drives_nothing(event):
    made, _ = session()
    driving, effects = handle(made.means, made.state, given("jog", press=1, direction=1.0))
    assert [type(each) for each in effects if isinstance(each, Stop | SetPoint)] == [SetPoint]
    assert driving.drive.active
    after, effects = handle(made.means, driving, event)
    assert Stop() in effects
    assert not any(isinstance(each, SetPoint) for each in effects)
    assert not after.drive.active
    again, effects = handle(made.means, after, given("jog", press=1, direction=1.0))
    assert not again.drive.active  # the press that is still held does nothing
    assert not any(isinstance(each, SetPoint) for each in effects)


def test_nobody_but_the_session_puts_its_state_in_the_place_of_another():
    writers = set()
    for file in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            targets = node.targets if isinstance(node, ast.Assign) else []
            names = [each.attr for target in targets for each in ast.walk(target) if isinstance(each, ast.Attribute)]
            writers |= {file.name} if "state" in names else set()
    assert writers == {"session.py"}


def test_a_state_is_not_written_to():
    made, _ = session()
    with pytest.raises(AttributeError):
        made.state.mode = FOLLOWING
    assert replace(made.state, mode=FOLLOWING) is not made.state
