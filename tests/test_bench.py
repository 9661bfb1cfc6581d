"""Campaigns lose no run: whatever planners do, however runs are spread, and wherever they are interrupted."""

import csv
import json
import os
import re
import resource
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.request
from contextlib import closing
from importlib.metadata import EntryPoint, version
from pathlib import Path

import numpy as np
import pytest

from rrtik_ompl import catalog, load_problem, load_robot, plan, plan_batch
from rrtik_ompl.benchmark.campaign import machine, run_campaign
from rrtik_ompl.benchmark.records import NAME, RecordFile, key_of, read_head, read_records
from rrtik_ompl.benchmark.report import write_report
from rrtik_ompl.benchmark.scaling import crowded_arm, planar_chain
from rrtik_ompl.benchmark.sources import build
from rrtik_ompl.benchmark.statistics import QUANTITIES, results, spread
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_ompl.benchmark.tables import remark
from rrtik_ompl.cli.app import run
from rrtik_ompl.errors import InputError
from rrtik_planners.suites import FOLDER

SUITE = """\
version: 1
title: Two scenes
problems: [planar3_a, {joints: {counts: [4]}}]
planners: [bicrdt, RRTConnect, {name: RRTConnect, label: short steps, parameters: {range: 0.3}}]
runs: 3
seconds: 5.0
seed: 7
shorten: sequential
"""
TOTAL = 18
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


def found(folder):
    """Records by run, with the paths that were found, without what depends on the clock."""
    keep = ("status", "seed", "waypoints", "counts")
    return {key_of(r): {name: r.get(name) for name in keep} for r in read_records(folder / NAME)}


@pytest.fixture(scope="session")
def suite(tmp_path_factory):
    file = tmp_path_factory.mktemp("suite") / "two.yaml"
    file.write_text(SUITE)
    return file


@pytest.fixture(scope="session")
def campaign(suite, tmp_path_factory):
    """Folder of a campaign that was run two at a time."""
    folder = tmp_path_factory.mktemp("campaign")
    assert run(["bench", str(suite), "--jobs", "2", "--out", str(folder), "--views", "1"]) == 0
    return folder


def test_every_run_is_recorded_with_what_it_measured(campaign):
    records = list(read_records(campaign / NAME))
    assert len({key_of(record) for record in records}) == len(records) == TOTAL
    for record in records:
        assert record["status"] == "solved"
        assert record["length"] <= record["initial_length"] + 1e-9
        assert len(record["waypoints"]) == record["segments"] + 1
        assert 0.0 < record["plan_seconds"] < 5.0
        assert record["counts"]["checked_motions"] > 0


def test_runs_of_one_number_share_their_seed_and_others_do_not(campaign):
    seeds = {}
    for record in read_records(campaign / NAME):
        seeds.setdefault(record["run"], set()).add(record["seed"])
    assert [len(each) for each in seeds.values()] == [1, 1, 1]
    assert len(set.union(*seeds.values())) == 3


def test_an_interrupted_campaign_goes_on_and_finds_the_same_one_at_a_time(campaign, suite, tmp_path, capsys):
    lines = (campaign / NAME).read_text().splitlines(keepends=True)
    (tmp_path / NAME).write_text("".join(lines[:8]) + lines[8][:40])  # half a line, as a power cut leaves it
    assert run(["bench", str(suite), "--out", str(tmp_path), "--views", "0"]) == 2
    assert "holds 7 runs already; continue with --resume" in capsys.readouterr().err
    assert run(["bench", str(suite), "--out", str(tmp_path), "--views", "0", "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcomes"] == {"solved": TOTAL - 7}
    assert found(tmp_path) == found(campaign)


def test_another_machine_is_told_and_a_campaign_that_never_began_begins_anew(suite, tmp_path):
    tiny = load_suite(suite, runs=1)
    head = {"version": 1, "suite": tiny.plain(), "machine": {**machine(3, None), "ompl": "1.0"}}
    with RecordFile(tmp_path / NAME, head) as out:
        pass
    assert read_head(tmp_path / NAME)["machine"]["ompl"] == "1.0"
    first = {"problem": "planar3_a", "planner": "bicrdt", "run": 0, "seed": 1, "status": "hang"}
    with RecordFile(tmp_path / NAME, {**head, "machine": machine(1, None)}) as out:
        out.append({**first, "group": "planar3_a", "axis": "", "value": 0.0})
    assert read_head(tmp_path / NAME)["machine"]["at a time"] == 1

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.warns(UserWarning, match="begun with at a time 1, now 2: times"), pytest.raises(KeyboardInterrupt):
        run_campaign(tiny, tmp_path, jobs=2, resume=True, on_run=stop)


def test_a_campaign_is_not_continued_with_another_suite(campaign, suite, tmp_path, capsys):
    other = tmp_path / "two.yaml"
    other.write_text(SUITE.replace("seed: 7", "seed: 8"))
    assert run(["bench", str(other), "--out", str(campaign), "--resume"]) == 2
    assert "begun with another suite (seed" in capsys.readouterr().err


def test_more_runs_can_be_added_to_a_campaign(campaign, suite, tmp_path):
    (tmp_path / NAME).write_bytes((campaign / NAME).read_bytes())
    run_campaign(load_suite(suite, runs=4), tmp_path, resume=True)
    more = found(tmp_path)
    assert len(more) == 24
    assert {key: more[key] for key in found(campaign)} == found(campaign)


def test_the_database_is_sound_and_has_ompls_columns_and_ours(campaign):
    with closing(sqlite3.connect(campaign / "benchmark.db")) as base:
        assert base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert base.execute("PRAGMA foreign_key_check").fetchall() == []
        columns = {row[1] for row in base.execute("PRAGMA table_info(runs)")}
        names = [row[0] for row in base.execute("SELECT name FROM plannerConfigs")]
        times = base.execute("SELECT time FROM runs ORDER BY time").fetchall()
        (clear,) = base.execute("SELECT COUNT(*) FROM runs WHERE solution_clearance > 0").fetchone()
        (strict,) = base.execute("SELECT SUM(correct_solution_strict) FROM runs").fetchone()
        (graphs,) = base.execute("SELECT COUNT(*) FROM runs WHERE graph_motions > 0 AND graph_states > 0").fetchone()
        fractions = base.execute("SELECT valid_segment_fraction, plannerid = 1 FROM runs").fetchall()
        (solved,) = base.execute("SELECT COUNT(*) FROM runs WHERE solved = 1 AND status = 6").fetchone()
    ompls = {"time", "memory", "solved", "status", "solution_length", "simplified_solution_length", "graph_states"}
    ompls |= {"graph_motions", "valid_segment_fraction"}
    ompls |= {
        f"{first}solution_{name}" for first in ("", "simplified_") for name in ("clearance", "smoothness", "segments")
    }
    ompls |= {f"{first}correct_solution{last}" for first in ("", "simplified_") for last in ("", "_strict")}
    assert ompls | {"transitions", "simplified_transitions", "checked_motions", "iterations", "total_time"} <= columns
    assert names == ["geometric_bicrdt", "geometric_RRTConnect", "geometric_short_steps"]
    np.testing.assert_allclose(
        [time for (time,) in times], sorted(r["plan_seconds"] for r in read_records(campaign / NAME)), rtol=1e-8
    )
    assert solved == clear == strict == graphs == TOTAL
    assert all(ours if share is None else 0.0 < share <= 1.0 for share, ours in fractions)


def test_records_of_an_earlier_version_are_still_reported(campaign, tmp_path):
    later = ("edges", "free_motions")
    with RecordFile(tmp_path / NAME, read_head(campaign / NAME)) as out:
        for record in read_records(campaign / NAME):
            out.append({**record, "counts": {k: v for k, v in record["counts"].items() if k not in later}})
    _, files = write_report(tmp_path / NAME, views=0)
    assert all(file.stat().st_size for file in files)
    with closing(sqlite3.connect(tmp_path / "benchmark.db")) as base:
        told = base.execute("SELECT COUNT(graph_motions), COUNT(valid_segment_fraction), COUNT(*) FROM runs").fetchone()
    assert told == (0, 0, TOTAL)


def test_ompls_own_planners_are_logged_like_ompl_logs_them(campaign):
    text = (campaign / "logs" / "planar_joints_4.log").read_text()
    assert re.search(r"^Experiment planar/joints$", text, re.M)
    assert "joints REAL = 4\n" in text
    assert "range = 0.3\n" in text


def test_planner_arena_shows_our_planners_next_to_ompls(campaign):
    pytest.importorskip("plannerarena", reason="needs plannerarena: pip install 'rrtik-ompl[arena]'")
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    arena = subprocess.Popen(
        [sys.executable, "-m", "shiny", "run", "plannerarena.app:app", "--host", "127.0.0.1", "--port", str(port)],
        env={**os.environ, "DATABASE": str(campaign / "benchmark.db")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert "Planner Arena" in _page(f"http://127.0.0.1:{port}/")
        shown = _what_arena_shows(port, "planar3_a")
    finally:
        arena.kill()
        arena.wait()
    for planner in ("bicrdt", "RRTConnect", "short_steps"):
        assert f'value=\\"{planner}\\" checked' in shown
    assert "data:image/png" in shown


def _what_arena_shows(port, problem):
    """What the page is sent when a person looks at the times of a problem, up to the plot."""
    from websockets.sync.client import connect

    outputs = ("problem_ui", "attribute_ui", "version_ui", "planner_ui", "plot")
    inputs = {
        "problem": problem,
        "attribute": "time",
        "version": f"OMPL {version('ompl')}",
        "planners": ["bicrdt", "RRTConnect"],
    }
    inputs |= dict.fromkeys(
        ("advanced_options", "show_as_cdf", "hide_outliers", "show_simplified", "y_log_scale"), False
    )
    data = {"navbar": "performance", "database": None, ".clientdata_pixelratio": 1}
    data |= {f"performance-{name}": value for name, value in inputs.items()}
    data |= {f".clientdata_output_performance-{name}_hidden": False for name in outputs}
    data |= {f".clientdata_output_performance-plot_{side}": 500 for side in ("width", "height")}
    seen = ""
    with connect(f"ws://127.0.0.1:{port}/websocket/", max_size=None) as page:
        page.send(json.dumps({"method": "init", "data": data}))
        while "data:image/png" not in seen:
            seen += str(page.recv(timeout=30))
    return seen


def _page(address, patience=60.0):
    end = time.monotonic() + patience
    while True:
        try:
            with urllib.request.urlopen(address, timeout=10) as answer:
                return answer.read().decode()
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.2)


def test_tables_say_what_the_records_say(campaign):
    lengths = [r["length"] for r in read_records(campaign / NAME) if key_of(r)[:2] == ("planar3_a", "bicrdt")]
    with (campaign / "summary.csv").open() as file:
        rows = {(row["problem"], row["planner"], row["quantity"]): row for row in csv.DictReader(file)}
    row = rows["planar3_a", "bicrdt", "length"]
    assert (row["solved"], row["valid"], row["total"]) == ("3", "3", "3")
    assert float(row["median"]) == np.median(lengths)
    page = (campaign / "summary.md").read_text()
    assert "seed 7" in page
    assert "| planar3_a | bicrdt | 3 / 3 / 3 |" in page
    assert {f"## {name}" for name, _ in QUANTITIES.values() if name != "vertices"} <= {
        line.split(" [")[0] for line in page.splitlines()
    }


def test_the_page_needs_no_other_file_but_the_views_that_it_links_to(campaign):
    page = (campaign / "index.html").read_text()
    assert set(re.findall(r'src="([^:]+):', page)) == {"data"}
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 1
    assert (campaign / links[0]).stat().st_size > 10_000
    for name in ("solved", "scaling", "box_length"):
        assert (campaign / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (campaign / f"{name}.svg").read_text()


def test_the_results_of_the_readme_are_written_from_campaigns(campaign, tmp_path, monkeypatch, capsys):
    from bench.planning import results_page

    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{results_page.BEGIN}\nold\n{results_page.END}\nafter\n")
    for _ in range(2):  # a second time it takes the place of the first
        monkeypatch.setattr("sys.argv", ["results_page.py", str(campaign), "--readme", str(readme)])
        results_page.main()
    text = readme.read_text()
    assert text.startswith("before\n<!--")
    assert text.endswith("-->\nafter\n")
    assert "old" not in text
    assert text.count("| bicrdt | 3 / 3 / 3 |") == 1
    assert text.count("Written by `rrtik bench two --runs 3 --jobs 2`") == 1
    assert re.search(r"^\| planar/joints \| 4 \|$", text, re.M)


def test_paths_that_came_after_the_time_limit_are_counted(campaign):
    done, head = results(read_records(campaign / NAME)), read_head(campaign / NAME)
    assert "after the limit" not in remark(done, head)
    slowest = max(value for result in done for value in result.values("plan_seconds"))
    head["suite"]["seconds"] = 0.999 * slowest
    assert "1 path(s) came after the limit" in remark(done, head)


def test_a_spread_is_numpys():
    values = [3.0, 1.0, 2.0, 10.0]
    done = spread(values)
    assert (done.mean, done.median, done.least, done.most) == (4.0, 2.5, 1.0, 10.0)
    assert done.p95 == np.quantile(values, 0.95)
    assert spread([]) is None


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
        "runs: 1\nseconds: 1.0\npatience: 2.0\nmemory_mb: 200\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": path}
    process = command("bench", suite, "--out", tmp_path / "out", "--views", 0, "--jobs", 2, env=env)
    said, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (1, "")  # for one of them never did anything but raise
    assert "planar3_a, raiser: 1 x error: ValueError: no idea" in said.splitlines()
    outcomes = {
        record["planner"]: (record["status"], record["reason"]) for record in read_records(tmp_path / "out" / NAME)
    }
    assert outcomes["crasher"] == ("crash", "SIGSEGV")
    assert outcomes["quitter"] == ("crash", "exit code 3: these are my last words")
    assert outcomes["hanger"] == ("hang", "killed after 2 s")
    assert outcomes["eater"][0] == "out of memory"
    assert outcomes["raiser"] == ("error", "ValueError: no idea")
    assert outcomes["bicrdt"] == ("solved", "")
    assert "crash: SIGSEGV" in (tmp_path / "out" / "summary.md").read_text()


def test_ctrl_c_ends_a_campaign_with_one_line_and_leaves_nothing_running(suite, tmp_path):
    file = tmp_path / NAME
    process = command("bench", suite, "--out", tmp_path, "--runs", 1000)
    end = time.monotonic() + 60.0
    while not (file.exists() and file.read_bytes().count(b"\n") > 3):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.05)
    children = _children(process.pid)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    kept = sum(1 for _ in read_records(file))
    note, interrupted = errors.splitlines()
    assert note == f"rrtik: {kept} of 6000 runs are kept in {tmp_path}; continue with --resume"
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
            with pytest.raises(InputError, match=r"cannot be written: .*all runs before are kept.*--resume"):
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


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("{half", "not a record of a run"),
        ("[1]", "found list"),
        ('{"problem": "p"}', "group is missing"),
        ("\udcff", "codec can't decode"),
        ({"axis": None}, "axis cannot be None"),
        ({"status": "great"}, "status 'great' is none of"),
        ({"plan_seconds": "soon"}, "plan_seconds cannot be 'soon'"),
        ({"counts": {"iterations": []}}, "count iterations cannot be []"),
        ({"waypoints": 3}, "waypoints cannot be 3"),
    ],
)
def test_a_corrupt_record_is_named_by_its_line_and_nothing_is_lost(campaign, suite, tmp_path, capsys, line, words):
    lines = (campaign / NAME).read_text().splitlines()
    lines[4] = line if isinstance(line, str) else json.dumps({**json.loads(lines[4]), **line})
    text = "\n".join([*lines, ""])
    (tmp_path / NAME).write_text(text, errors="surrogateescape")
    assert run(["bench", str(suite), "--out", str(tmp_path), "--resume"]) == 2
    message = capsys.readouterr().err
    assert f"{NAME}:5: " in message
    assert words in message
    assert message.count("\n") == 1
    assert (tmp_path / NAME).read_text(errors="surrogateescape") == text


def test_a_solved_run_without_its_path_and_a_head_without_its_machine_are_told(campaign, tmp_path):
    head, *lines = (campaign / NAME).read_text().splitlines()
    lines[0] = json.dumps({key: value for key, value in json.loads(lines[0]).items() if key != "waypoints"})
    (tmp_path / NAME).write_text("\n".join([head, *lines, ""]))
    with pytest.raises(InputError, match=f"{NAME}:2: not a record of a run .waypoints is missing"):
        write_report(tmp_path / NAME)
    (tmp_path / NAME).write_text(json.dumps({**json.loads(head), "machine": {"ompl": "2"}}) + "\n")
    with pytest.raises(InputError, match=f"{NAME}:1: machine lacks rrtik-ompl, pin"):
        write_report(tmp_path / NAME)


@pytest.mark.parametrize("other", [{"problem": "planar3_z"}, {"group": "planar3_z"}, {"planner": "nobody"}])
def test_a_run_that_the_suite_does_not_name_is_told(campaign, tmp_path, other):
    head, *lines = (campaign / NAME).read_text().splitlines()
    lines[0] = json.dumps({**json.loads(lines[0]), **other})
    (tmp_path / NAME).write_text("\n".join([head, *lines, ""]))
    with pytest.raises(InputError, match=r"nobody|planar3_z"):
        write_report(tmp_path / NAME)


def test_a_file_that_is_no_campaign_is_refused(suite, tmp_path, capsys):
    (tmp_path / NAME).write_text('{"a": 1}\n{"b": 2}\n')
    with pytest.raises(InputError, match="not the head of a campaign"):
        read_head(tmp_path / NAME)
    assert run(["bench", str(suite), "--out", str(tmp_path), "--resume"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("planners: [bicrdt,", "planners: [bicrtd,", r":4: planners\[0\]: no planner 'bicrtd'; have .*bicrdt"),
        ("planners: [bicrdt,", "planners: [EST,", r"OMPL's wheel lacks .* EST,"),
        ("range: 0.3", "rnage: 0.3", r":4: planners\[2\].parameters.rnage: no parameter .*'rnage'; have .*range"),
        ("runs: 3", "rums: 3", r":5: rums: unknown key 'rums'; did you mean 'runs'"),
        ("runs: 3", "runs: 0", r":5: runs: must be 1 or more"),
        ("seconds: 5.0", "seconds: soon", r":6: seconds: must be a number"),
        ("planar3_a", "planar3_z", r":3: problems\[0\]: no problem 'planar3_z'"),
        ("planar3_a", "scenes/x.yaml", r":3: problems\[0\]: no such problem file"),
        ("{joints:", "{joint:", r":3: problems\[1\]: a problem needs one of the keys generated"),
        ("{joints: {counts: [4]}}", "{generated: {robot: ur5, family: cave}}", r"no family .*'cave'; have clutter"),
        ("{joints: {counts: [4]}}", "planar3_a", r"'planar3_a' stands there 2 times"),
        (", label: short steps", "", r"'RRTConnect' stands there 2 times"),
        ("shorten: sequential", "shorten: axle", r":8: shorten: no shortening method 'axle'"),
        ("problems: [planar3_a, {joints: {counts: [4]}}]", "problems: []", r"give a folder of them with --problems"),
    ],
)  # fmt: skip
def test_a_typo_in_a_suite_is_one_line_that_names_its_place(tmp_path, capsys, old, new, words):
    file = tmp_path / "s.yaml"
    assert old in SUITE
    file.write_text(SUITE.replace(old, new))
    assert run(["bench", str(file), "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert re.search(words, message), message
    assert message.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_parameter_of_the_wrong_kind_is_told_and_the_other_planners_run(tmp_path, capsys):
    file = tmp_path / "s.yaml"
    file.write_text(SUITE.replace("range: 0.3", "range: soon").replace("runs: 3", "runs: 1"))
    assert run(["bench", str(file), "--out", str(tmp_path / "out"), "--views", "0"]) == 1
    said = capsys.readouterr().out
    assert "planar3_a, short steps: 1 x error: planner RRTConnect: parameter range cannot be 'soon'" in said
    assert "this round: 4 solved, 2 error" in said


def test_a_scheduler_that_does_not_answer_is_one_line(suite, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    monkeypatch.setattr("rrtik_ompl.benchmark.spread.CONNECT", 0.3)
    assert run(["bench", str(suite), "--out", str(tmp_path), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("rrtik: --scheduler tcp://127.0.0.1:9: no Dask scheduler answers")


def test_a_worker_of_a_cluster_is_killed_and_no_run_is_lost(campaign, suite, tmp_path):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    started = [
        subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet)
    ]
    worker = [*dask, "worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    started += [subprocess.Popen(worker, **quiet) for _ in range(2)]
    try:
        _wait_for_workers(address, 2)
        done = []

        def kill_one(progress, record):
            done.append(record)
            if len(done) == 6:
                started[1].kill()

        run_campaign(load_suite(suite), tmp_path / "out", scheduler=address, on_run=kill_one)
    finally:
        for process in started:
            process.kill()
            process.wait()
    assert found(tmp_path / "out") == found(campaign)


def _wait_for_workers(address, count):
    from distributed import Client

    with Client(address, timeout=60) as client:
        client.wait_for_workers(count, timeout=60)


def test_a_batch_of_queries_comes_in_order_and_finds_what_plan_finds(tmp_path):
    problem = load_problem("planar3_a")
    (tmp_path / "planar3_a.yaml").write_text("version: 1\n")  # of the same name, and no problem
    queries = ["titan4_prisms", "planar3_a", tmp_path / "planar3_a.yaml"]
    records = plan_batch(queries, "RRTConnect", seconds=20.0, seed=3, parameters={"range": 0.5}, jobs=2)
    assert [record["problem"] for record in records] == ["titan4_prisms", "planar3_a", "planar3_a"]
    assert [record["status"] for record in records] == ["solved", "solved", "error"]
    assert "robot" in records[2]["reason"]
    alone = plan(problem, "RRTConnect", seconds=20.0, seed=records[1]["seed"], parameters={"range": 0.5})
    assert records[1]["waypoints"] == alone.path.waypoints.tolist()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"problems": ["planar3_z"]}, "no problem 'planar3_z'"),
        ({"problems": "planar3_a"}, "must be a list"),
        ({"planner": "bicrtd"}, "no planner 'bicrtd'"),
        ({"parameters": {"rnage": 1}}, "no parameter of planner bicrdt 'rnage'"),
        ({"shorten": "axle"}, "no shortening method 'axle'"),
        ({"seconds": 0}, "seconds"),
        ({"jobs": 0}, "jobs"),
    ],
)
def test_a_batch_refuses_what_makes_no_sense(given, words):
    with pytest.raises(InputError, match=words):
        plan_batch(**{"problems": ["planar3_a"], **given})


@pytest.mark.parametrize("name", sorted(file.stem for file in FOLDER.glob("*.yaml")))
def test_shipped_suites_name_what_there_is(name):
    file = FOLDER / f"{name}.yaml"
    if name == "mbm_panda":
        with pytest.raises(InputError, match="--problems FOLDER"):
            load_suite(file)
        return
    campaign = load_suite(file)
    assert f"# {campaign.total:,} runs" in file.read_text()  # its head says what a person lets himself in for


def test_suites_are_found_by_name_and_unknown_ones_listed(monkeypatch, capsys):
    offers = {"suites": {"ours": EntryPoint("ours", "rrtik_planners.suites:FOLDER", "rrtik_ompl.suites")}}
    usual = catalog._offers
    monkeypatch.setattr(catalog, "_offers", lambda group: offers.get(group) or usual(group))
    assert run(["list", "suites"]) == 0
    assert "scaling\n" in capsys.readouterr().out
    assert load_suite("quick").name == "quick"
    assert run(["bench", "quik"]) == 2
    assert "did you mean 'quick'" in capsys.readouterr().err


def test_a_folder_of_motion_bench_maker_pairs_is_a_list_of_problems(tmp_path):
    for name in ("box/scene1", "box/request1", "box/scene2", "box/request2", "cage/scene1", "cage/request1"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.yaml").write_text("robot_model_name: panda\n")
    sources = load_suite(FOLDER / "mbm_panda.yaml", folder=tmp_path).sources
    top = tmp_path.name
    assert [source.name for source in sources] == [f"{top}/box/scene1", f"{top}/box/scene2", f"{top}/cage/scene1"]
    assert [source.group for source in sources] == [f"{top}/box", f"{top}/box", f"{top}/cage"]


def test_scaling_problems_have_what_was_asked_for_and_are_not_trivial():
    for problem, dof, obstacles in (
        (planar_chain(12), 12, 4),
        (crowded_arm(load_robot("ur5"), 1), 6, 1),
        (crowded_arm(load_robot("ur5"), 12), 6, 12),
    ):
        assert problem.robot.dof == dof
        assert len(problem.world.scene.obstacles) == obstacles
        assert not problem.world.motion_valid(problem.start, problem.goal.q)
        assert plan(problem, "fastrrtconnect", seconds=20.0, seed=1).found


def test_start_and_goal_of_a_crowd_do_not_depend_on_its_number():
    few, many = (crowded_arm(load_robot("titan4"), count, seed=3) for count in (1, 20))
    assert np.array_equal(few.start, many.start)
    assert np.array_equal(few.goal.q, many.goal.q)


def test_a_source_survives_json(suite):
    from rrtik_ompl.benchmark.sources import from_plain

    source = load_suite(suite).sources[1]
    again = from_plain(json.loads(json.dumps(source.plain())))
    assert again == source
    assert build(again).robot.dof == 4
