"""Campaigns lose no run: whatever planners do, and wherever they are interrupted."""

import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.campaign import machine
from rrtik_ompl.benchmark.records import NAME, RecordFile, read_records
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_ompl.cli.app import run
from rrtik_tests.waiting import until

pytestmark = pytest.mark.slow

BAD_PLANNERS = """\
import ctypes, os, numpy as np
from ompl import base as ob

class Bad(ob.Planner):
    def __init__(self, si):
        super().__init__(si, type(self).__name__)

class Crasher(Bad):
    def solve(self, ptc):
        ctypes.string_at(0)

class Quitter(Bad):
    def solve(self, ptc):
        print("these are my last words")
        os._exit(3)

class Hanger(Bad):
    def solve(self, ptc):
        while True:
            pass

class Eater(Bad):
    def solve(self, ptc):
        kept = []
        while True:
            kept.append(np.ones(1_000_000))

class Raiser(Bad):
    def solve(self, ptc):
        raise ValueError("no idea")
"""

RAISING = 1 + BAD_PLANNERS.splitlines().index('        raise ValueError("no idea")')
CRASHING = 1 + BAD_PLANNERS.splitlines().index("        ctypes.string_at(0)")
CRASHED = (
    f"SIGSEGV: crasher is derived from ompl.base.Planner (bad_planners.py, line {CRASHING}); OMPL 2.0.1's bindings "
    "free states twice that such a class keeps or frees; derive it from rrtik_ompl.ompl_bridge.SafePlanner, which "
    "searches on arrays"
)


def command(*arguments, **options):
    """`rrtik` in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "rrtik_ompl.cli.app", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )


def test_planners_that_crash_hang_quit_or_eat_the_memory_do_not_end_a_campaign(tmp_path):
    folder = tmp_path / "bad-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: bad\nVersion: 1.0\n")
    names = ("crasher", "quitter", "hanger", "eater", "raiser")
    offers = "\n".join(f"{name} = bad_planners:{name.capitalize()}" for name in names)
    (folder / "entry_points.txt").write_text(f"[rrtik_ompl.planners]\n{offers}\n")
    (tmp_path / "bad_planners.py").write_text(BAD_PLANNERS)
    suite = tmp_path / "bad.yaml"
    suite.write_text(
        f"version: 1\nproblems: [planar3_a]\nplanners: [{', '.join(names)}, bicrdt]\n"
        "runs: 1\nseconds: 1.0\npatience: 4.0\nmemory_mb: 200\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": path}
    process = command("bench", suite, "--out", tmp_path / "out", "--views", 0, "--jobs", 2, env=env)
    said, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (1, "")  # for some of them never did anything but raise or crash
    broken = f"planner Raiser broke: ValueError: no idea (bad_planners.py, line {RAISING})"
    assert f"planar3_a, raiser: 1 x error: {broken}" in said.splitlines()
    assert f"planar3_a, crasher: 1 x crash: {CRASHED}" in said.splitlines()
    outcomes = {
        record["planner"]: (record["status"], record["reason"]) for record in read_records(tmp_path / "out" / NAME)
    }
    assert outcomes["crasher"] == ("crash", CRASHED)
    assert outcomes["quitter"] == ("crash", "exit code 3: these are my last words")
    assert outcomes["hanger"] == ("hang", "killed after 4 s")
    assert outcomes["eater"][0] == "out of memory"
    assert outcomes["raiser"] == ("error", broken)
    assert outcomes["bicrdt"] == ("solved", "")
    assert f"crash: {CRASHED}" in (tmp_path / "out" / "summary.md").read_text()


def test_ctrl_c_ends_a_campaign_with_one_line_and_leaves_nothing_running(suite, tmp_path):
    file = tmp_path / NAME
    process = command("bench", suite, "--out", tmp_path, "--runs", 1000)
    until(lambda: process.poll() is not None or (file.exists() and file.read_bytes().count(b"\n") > 3))
    assert process.poll() is None
    children = _children(process.pid)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    kept = sum(1 for _ in read_records(file))
    note, interrupted = errors.splitlines()
    assert re.fullmatch(rf"rrtik: {kept} of 6000 .*{re.escape(str(tmp_path))}.*--resume", note)
    assert interrupted.startswith("rrtik: interrupted")
    assert children
    assert not any(_lives(pid) for pid in children)


def _children(pid):
    return [int(word) for task in Path(f"/proc/{pid}/task").glob("*/children") for word in task.read_text().split()]


def _lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_where_the_disk_is_full_all_records_before_stay_whole(tmp_path):
    head = {"version": 1, "suite": {}, "machine": {}}
    record = {"problem": "p", "planner": "a", "seed": 1, "group": "p", "axis": "", "value": 0, "status": "hang"}
    file = tmp_path / NAME
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with RecordFile(file, head) as out:
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
            with pytest.raises(InputError, match=r"cannot be written.*--resume"):
                _append(out, ({**record, "run": number} for number in range(100)))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    kept = [each["run"] for each in read_records(file)]
    assert kept == list(range(len(kept)))
    assert 5 < len(kept) < 100
    with RecordFile(file, head) as out:
        out.append({**record, "run": 99})
    assert [each["run"] for each in read_records(file)] == [*kept, 99]


def test_two_campaigns_do_not_write_one_file(suite, tmp_path, capsys):
    head = {"version": 1, "suite": load_suite(suite).plain(), "machine": machine(1, None)}
    with RecordFile(tmp_path / NAME, head):
        assert run(["bench", str(suite), "--out", str(tmp_path), "--resume"]) == 2
    assert f"{NAME}: another campaign is writing it" in capsys.readouterr().err


def _append(out, records):
    for record in records:
        out.append(record)
