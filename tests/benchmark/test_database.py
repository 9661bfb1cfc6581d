"""The database that a campaign writes is the one that Planner Arena reads."""

import json
import os
import re
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.request
from contextlib import closing
from importlib.metadata import version

import numpy as np
import pytest

from rrtik_ompl.benchmark.records import NAME, read_records
from rrtik_tests.campaigns import TOTAL

pytestmark = pytest.mark.slow


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
