"""Files that try to run something: none is executed, whatever opens them; see `bench.truth.hostile`."""

from pathlib import Path

import pytest

import rrtik_ompl as rrtik
from bench.truth import hostile
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.cli.app import COMMANDS, OPEN_NO_FILES
from rrtik_ompl.files.kinds import KINDS, found
from rrtik_tests.command_line import rrtik as rrtik_command

pytestmark = pytest.mark.filterwarnings("ignore")  # files that are taken have nothing to collide with
EVERY = 19  # of the hostile files whose names say nothing about them, each loader gets one in so many


def test_every_public_loader_and_the_reader_of_every_kind_is_found():
    public = {value for name, value in public_values(rrtik).items() if name.split(".")[-1].startswith("load")}
    assert public | {found(kind.reader) for kind in KINDS.values()} <= set(hostile.loaders().values())


def test_every_command_is_asked():
    assert set(hostile.command_calls(Path())) == {*COMMANDS, "markers"}


@pytest.mark.parametrize("name", hostile.loaders())
def test_nothing_that_a_loader_opens_is_executed(name):
    assert hostile.executed_by(name, EVERY) == []


@pytest.mark.parametrize("name", hostile.command_calls(Path()))
def test_nothing_that_a_command_opens_is_executed(name):
    assert hostile.executed_by_command(name) == []


@pytest.mark.parametrize("name", ["check", "convert", "reach"])
def test_what_a_command_executes_by_an_explicit_word_is_seen(name):
    pytest.importorskip("xacro")
    assert any("EXECUTED" in each for each in hostile.executed_by_command(name, "--trust-xacro"))


@pytest.mark.parametrize("name", [*(name for name in COMMANDS if name not in OPEN_NO_FILES), "markers"])
def test_every_command_that_opens_robots_has_the_word(name, capsys):
    _, said, _ = rrtik_command(capsys, name, *(["sense"] if name == "markers" else []), "--help")
    assert "--trust-xacro" in said


def test_what_a_loader_would_execute_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(rrtik.JointPath, "load", lambda path: __import__("pickle").loads(Path(path).read_bytes()))
    (tmp_path / "a.pkl").write_bytes(hostile.CONTENTS["a pickle"])
    assert hostile.opened(tmp_path, lambda: rrtik.JointPath.load("a.pkl")) == "EXECUTED"


@pytest.mark.parametrize("text", [*hostile.EXPRESSIONS, *hostile.ELEMENTS.values()])
def test_macros_that_reach_for_more_than_the_list_are_refused(text):
    pytest.importorskip("xacro")
    assert hostile.executed_expression(text) == []


@pytest.mark.parametrize("name", hostile.BOMBS)
def test_macros_that_fill_time_or_memory_end_with_a_line(name):
    pytest.importorskip("xacro")
    assert hostile.survived_bomb(name, 0.7, 0.3) == []
