"""The story of a record: who commanded what, what was said, and whether the arm was told to move."""

import json
import re

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.explain import explain
from rrtik_ompl.pilot.interlock import Sight
from rrtik_ompl.pilot.record import read_record
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_tests.command_line import rrtik


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A session in which page 3 drives, a hold lapses, page 4 stops, and the arm then moves untold."""
    file = tmp_path_factory.mktemp("record") / "session.jsonl"
    opened = open_session(SessionOptions("titan4_sdu", record=file))
    engine = opened.engine
    arm = engine.session.arm
    engine.execute({"name": "control"}, 0.0, Sight(np.inf, np.inf, 3))
    engine.update(0.0)
    time = 0.1
    for step in range(30):
        engine.execute({"name": "jog", "direction": 1.0, "press": 1}, time, Sight(0.05, 0.06, 3))
        time += 0.03
        (engine.watch if step % 5 else engine.update)(time)
    for _ in range(10):
        time += 0.05
        engine.update(time)
    engine.execute({"name": "stop"}, time, Sight(np.inf, np.inf, 4))
    for _ in range(20):
        time += 0.1
        engine.update(time)
    arm._q = arm._q + np.eye(6)[1] * 0.1
    engine.watch(time + 0.1)
    opened.close()
    return file


def test_it_tells_who_did_what_when_and_what_was_not_told_to(record):
    lines = list(explain(record))
    text = "\n".join(lines)
    assert re.match(r"session of titan4_sdu, 20\d\d-\d\d-\d\d \d\d:\d\d:\d\d UTC, version .*, arm simulated", lines[0])
    assert all(re.match(r"\d\d:\d\d:\d\d\.\d{3}  ", line) for line in lines[1:])
    in_order = [
        "page 3: has the control",
        "page 3: 'jog' (direction 1)",
        "moved: azimuth +",
        "ALARM: no command for 0.25 s",
        "page 4: STOP",
        "moved: shoulder_pitch +5.7 deg WITHOUT A SET POINT",
        "the session ended",
    ]
    places = [text.index(words) for words in in_order]
    assert places == sorted(places)
    azimuth = next(line for line in lines if "moved: azimuth" in line)
    assert "WITHOUT" not in azimuth


def test_a_record_holds_set_points_ages_and_where_the_session_was_last(record):
    entries = list(read_record(record))
    jog = next(entry for entry in entries if entry["kind"] == "command" and entry["name"] == "jog")
    assert (jog["page"], jog["seen"], jog["shown"]) == (3, 0.05, 0.06)
    assert len([entry for entry in entries if entry["kind"] == "set"]) == 30
    assert entries[-1]["kind"] == "end"
    alive = [entry["time"] for entry in entries if entry["kind"] == "alive"]
    assert alive[-1] > entries[-1]["time"] - 1.2


def test_a_session_that_was_killed_is_told_to_its_last_line(record, tmp_path):
    (tmp_path / "cut.jsonl").write_text("".join(record.read_text().splitlines(keepends=True)[:-1])[:-3])
    assert "breaks off" in list(explain(tmp_path / "cut.jsonl"))[-1]


def test_what_is_no_record_is_named(record, tmp_path, capsys):
    first = record.read_text().splitlines()[0]
    for name, text, words in [
        ("none", "", "begin"),
        ("other", '{"time": 0, "kind": "joints", "q": []}\n', "begin"),
        ("bad", first + '\n{"time": 1, "kind": "joints", "q": "far"}\n{"time": 2, "kind": "end"}\n', "bad:2"),
        ("undated", json.dumps(json.loads(first) | {"date": "today"}) + "\n", "undated:1"),
    ]:
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=words):
            list(explain(tmp_path / name))
    code, out, _ = rrtik(capsys, "pilot", "--explain", record)
    assert (code, out.count("STOP")) == (0, 2 if "STOP was" in out else 1)
    assert rrtik(capsys, "pilot", "--explain", tmp_path / "none")[0] == 2
    assert rrtik(capsys, "pilot")[0] == 2
