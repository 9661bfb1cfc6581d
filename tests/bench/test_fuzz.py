"""A small share of the fuzz of the public face, with fixed seeds: answers, and errors of ours in one line."""

import pytest

from bench import fuzz

CALLS = 400


@pytest.fixture(scope="module")
def finds(tmp_path_factory):
    return list(fuzz.run(0, CALLS, tmp_path_factory.mktemp("fuzz")))


def test_no_call_crashes_hangs_or_takes_all_memory(finds):
    bad = ("crash", "hang", "out of memory", "an error that cannot be shown")
    assert [(seed, wrong) for seed, wrong in finds if wrong.startswith(bad)] == []


def test_no_spoilt_file_gives_more_than_a_line(finds):
    assert [(seed, wrong) for seed, wrong in finds if any(f"| {name}:" in wrong for name in fuzz.FILES)] == []


def test_no_call_ends_in_an_error_of_python_or_numpy(finds):
    assert finds == []


@pytest.mark.parametrize("break_", ["os.abort()", "time.sleep(99)", "raise KeyError(3)", "[0] * 10**12"])
def test_the_fuzz_sees_what_is_wrong_and_goes_on(monkeypatch, tmp_path, break_):
    import os
    import time

    def call(seed, folder):
        if seed == 1:
            exec(break_, {"os": os, "time": time})

    monkeypatch.setattr(fuzz, "call", call)
    monkeypatch.setattr(fuzz, "SECONDS", 1)
    ((seed, wrong),) = fuzz.run(0, 4, tmp_path)
    kind = {"os.abort()": "crash", "time.sleep(99)": "hang", "raise KeyError(3)": "KeyError", "[0] * 10**12": "out of"}
    assert (seed, wrong.startswith(kind[break_])) == (1, True)
