"""A small share of the fuzz of the public face, with fixed seeds: answers, and errors of ours in one line."""

import os
import time

import numpy as np
import pytest
from typer.core import TyperOption

import rrtik_ompl as rrtik
from bench import fuzz
from bench.robustness import calls, commands, spoilt_files
from bench.robustness.spoilt_files import Drawn
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.lazy import public_values

CALLS = 400

# On a machine ten times as busy kernels may have to be compiled first, and nothing here may fail for being slow.
pytestmark = pytest.mark.timeout(3600)


@pytest.fixture(scope="module")
def finds(tmp_path_factory):
    if not hasattr(TyperOption, "bare_type"):
        pytest.skip("this typer does not say the types of options, by which words for the command line are drawn")
    return list(fuzz.run(0, CALLS, tmp_path_factory.mktemp("fuzz")))


def test_no_call_crashes_hangs_or_takes_all_memory(finds):
    bad = ("crash", "hang", "out of memory", "an error that cannot be shown")
    assert [(seed, wrong) for seed, wrong in finds if wrong.startswith(bad)] == []


def test_no_spoilt_file_gives_more_than_a_line(finds):
    assert [(seed, wrong) for seed, wrong in finds if any(f"| {name}:" in wrong for name in spoilt_files.FILES)] == []


def test_no_call_ends_in_an_error_of_python_or_numpy(finds):
    assert finds == []


BREAKS = {
    "os.abort()": "crash",
    "time.sleep(99)": "hang",
    "while True: pass": "hang",
    "raise KeyError(3)": "KeyError",
    "[0] * 10**12": "out of",
}


@pytest.mark.parametrize("break_", BREAKS)
def test_the_fuzz_sees_what_is_wrong_and_goes_on(monkeypatch, tmp_path, break_):
    def call(seed):
        if seed == 1:
            exec(break_, {"os": os, "time": time})

    monkeypatch.setattr(fuzz, "draw", lambda seed: Drawn(lambda: "", lambda folder: call(seed)))
    monkeypatch.setattr(fuzz, "PROCESSOR_SECONDS", 1.0)
    monkeypatch.setattr(fuzz, "WALL_SECONDS", 5.0 if "sleep" in break_ else 1200.0)
    ((seed, wrong),) = fuzz.run(0, 4, tmp_path)
    assert (seed, wrong.startswith(BREAKS[break_])) == (1, True)


def test_who_waits_uses_no_processor_time_and_is_no_hang(monkeypatch, tmp_path):
    monkeypatch.setattr(fuzz, "draw", lambda seed: Drawn(lambda: "", lambda folder: time.sleep(1.5)))
    monkeypatch.setattr(fuzz, "PROCESSOR_SECONDS", 1.0)
    assert list(fuzz.run(0, 1, tmp_path)) == []


ANSWERS = {
    "a traceback": (1, "Traceback (most recent call last):\n  File\nKeyError: 3\n", "none of ours"),
    "another code": (3, "", "exit code 3"),
    "bad input without a word": (2, "", "without a word"),
    "a line that steers a terminal": (2, "rrtik: \x1b[2J\n", "none of ours"),
    "one good line": (2, "rrtik: a.yaml: no such file\n", None),
    "a warning and an answer": (0, "rrtik: warning: slow\n", None),
}


@pytest.mark.parametrize("case", ANSWERS)
def test_answers_of_commands_are_judged(case):
    code, errors, wrong = ANSWERS[case]
    if wrong is None:
        commands.judge(code, errors)
    else:
        with pytest.raises(commands.UnfitAnswer, match=wrong):
            commands.judge(code, errors)


def test_every_command_is_drawn():
    from rrtik_ompl.cli.app import COMMANDS

    assert {name for name, *_ in commands.commands()} == {*COMMANDS, "markers"}
    assert commands.said(["check", "none.yaml"])[0] == 2


def test_every_public_name_is_drawn():
    drawn = {name for name, *_ in calls.functions()}
    named = {name for name, value in public_values(rrtik).items() if callable(value)}
    assert named <= drawn
    assert {"plan_many", "view", "replan", "ompl.GoalSampler"} <= drawn


def test_spoilt_files_are_most_often_refused(tmp_path):
    refused = 0
    for seed in range(60):
        try:
            spoilt_files.draw(np.random.default_rng(seed)).make(tmp_path)
        except InputError:
            refused += 1
    assert 20 < refused < 60
