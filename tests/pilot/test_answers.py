"""Every answer of the session carries its level, and the page shows it by that alone."""

import ast
import inspect
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

import rrtik_ompl.pilot
from rrtik_ompl.pilot import events
from rrtik_ompl.pilot.events import Answer, Level
from rrtik_ompl.pilot.interlock import MODES
from rrtik_ompl.pilot.machine import VERBS
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.server import PAGE
from rrtik_tests.pilot_session import session

FOLDER = Path(rrtik_ompl.pilot.__file__).parent
MAKERS = {"news": Level.NEWS, "refused": Level.REFUSAL, "alarm": Level.ALARM}
WORDS = {
    "target": 0.3,
    "joint": 1,
    "share": 0.5,
    "press": 3,
    "direction": 1.0,
    "level": 0,
    "type": "front",
    "name": "valve",
}


def arguments(act):
    return {name: WORDS[name] for name in list(inspect.signature(act).parameters)[2:]}


def test_every_command_of_the_session_answers_with_a_level_in_every_mode():
    made, _ = session()
    for mode, (verb, row) in product(MODES, VERBS.items()):
        made.state = replace(made.state, mode=mode, answer=events.news(""))
        text = made.command(verb, 0.0, **arguments(row.act))
        assert isinstance(made.state.answer, Answer), (mode, verb)
        assert made.state.answer.text == text == made.message


def said_in(file):
    """Line and maker of every answer that a module makes; whatever is said must come from a maker or from a call."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        if name in MAKERS and isinstance(node.func, ast.Name):
            yield node.lineno, name
        if name == "say":
            (said,) = node.args
            assert not isinstance(said, ast.Constant | ast.JoinedStr), f"{file.name}:{node.lineno}: says bare text"
        assert name != "Answer" or file.name == "events.py", f"{file.name}:{node.lineno}: use news, refused or alarm"


def test_every_line_that_the_pilots_tool_says_is_made_with_a_level():
    found = {}
    for file in sorted(FOLDER.rglob("*.py")):
        found |= {(file.name, line): maker for line, maker in said_in(file)}
    assert set(found.values()) == set(MAKERS)
    assert len(found) > 50
    for name, level in MAKERS.items():
        assert getattr(events, name)("words").level is level


@pytest.mark.parametrize(
    ("verb", "given", "text", "level"),
    [
        ("grasp", {"type": "front", "level": 0}, "no object is chosen; choose one that is in view", Level.REFUSAL),
        ("settle", {}, "no route is being followed", Level.REFUSAL),
        ("object", {"name": "valve"}, "valve chosen; now a grasp", Level.NEWS),
        ("object", {"name": "lost_tool"}, "no object in view 'lost_tool'", Level.REFUSAL),
        ("close", {}, "nothing is between the fingers", Level.REFUSAL),
        ("halt", {}, "the pilot has left", Level.ALARM),
        ("stop", {}, "stopped", Level.NEWS),
        ("select", {"joint": 0}, "azimuth selected", Level.NEWS),
    ],
)
def test_what_22_words_of_english_took_for_the_other_is_told_by_its_level(verb, given, text, level):
    made, _ = session()
    made.state = replace(made.state, target=None)
    assert text in made.command(verb, 0.0, **given)
    assert made.level is level


def test_the_state_has_the_level_and_no_word_of_a_message_is_looked_for_by_the_page():
    engine = open_session(SessionOptions("titan4_sdu")).engine
    engine.update(0.0)
    engine.execute({"name": "accept"}, 0.0)
    assert engine.state()["level"] == "refusal"
    engine.execute({"name": "play", "share": 0.5}, 0.0)
    assert (engine.state()["level"], "no route" in engine.state()["message"]) == ("refusal", True)
    for script in PAGE.glob("*.js"):
        text = script.read_text(encoding="utf-8")
        assert "WORRYING" not in text
        for search in (".test(said.message", "message.match", "message.includes", "message.startsWith"):
            assert search not in text, script.name
