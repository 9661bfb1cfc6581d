"""A share of the faults of `bench/robustness`: nothing that was said to be done is lost or half, and work goes on."""

import os
import signal
import time

import pytest

from bench.robustness import faults, long_work
from bench.robustness.long_work import LongWork
from rrtik_ompl import JointPath

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]

PATH = '{"version": 1, "waypoints": [[0, 0], [0.5, 0]]}'


@pytest.mark.parametrize("kind", faults.KINDS)
@pytest.mark.parametrize("name", ["films", "reach"])
def test_nothing_is_lost_or_half(name, kind):
    assert faults.trials(name, kind, 0, 2) == []


def test_a_record_of_a_session_outlives_a_full_disk():
    assert faults.trials("pilot --record", "full disk", 0, 1) == []


def writes(text, name="path.json", *, slowly=False):
    def work():
        with open(name, "w") as file:
            for letter in text:
                file.write(letter)
                file.flush()
                end = time.process_time() + 0.002 * slowly
                while time.process_time() < end:
                    pass
        print(f"wrote {name}")
        return 0

    return work


BAD = {
    "a half file": (writes(PATH, slowly=True), "kill", "path.json: "),
    "a file of another name": (writes(PATH, "b.json"), "clock", "nobody asked for"),
    "a word without a file": (lambda: print("wrote path.json") or 0, "clock", "it is not there"),
    "another error": (lambda: 1 // (time.time() > 1.75e9), "clock", "none of ours"),
    "a process that lives on": (lambda: os.spawnlp(os.P_NOWAIT, "sleep", "sleep", "3") and 0, "clock", "lives on"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_seen(monkeypatch, case):
    work, kind, said = BAD[case]
    monkeypatch.setitem(long_work.WORK, "bad", LongWork(work, {"path.json": JointPath.load}))
    monkeypatch.setattr(faults, "OUTLIVE_SECONDS", 0.5)
    found = faults.trials("bad", kind, 0, 3)
    assert any(said in wrong for wrong in found), found


def test_a_kill_ends_a_child_at_once():
    ended = faults._run(_spin, _folder(), lambda: faults._timer(False, 0.05, signal.SIG_DFL))
    assert ended.signal == signal.SIGPROF


def _spin():
    while True:
        pass


def _folder():
    import tempfile
    from pathlib import Path

    return Path(tempfile.mkdtemp())
