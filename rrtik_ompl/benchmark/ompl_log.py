"""Write OMPL's log format and its database, which Planner Arena displays."""

from __future__ import annotations

import os
import re
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.run import INVALID, NOT_FOUND, SOLVED, STATUSES
from rrtik_ompl.benchmark.statistics import Result, by_label, measured
from rrtik_ompl.files.text import make_folder, write_text

DATABASE = "benchmark.db"
OMPL_STATUSES = ("Unknown status", "Invalid start", "Invalid goal", "Unrecognized goal type", "Timeout",
                 "Approximate solution", "Exact solution", "Crash")  # fmt: skip
TIMEOUT, EXACT, CRASH = 4, 6, 7  # indices in OMPL_STATUSES
# OMPL's name and type of each run property, and our quantity for it.
PROPERTIES = {
    "time REAL": "plan_seconds",
    "memory REAL": "memory_mb",
    "solution length REAL": "initial_length",
    "solution smoothness REAL": "initial_smoothness",
    "solution clearance REAL": "initial_clearance",
    "solution segments INTEGER": "initial_segments",
    "simplification time REAL": "shorten_seconds",
    "simplified solution length REAL": "length",
    "simplified solution smoothness REAL": "smoothness",
    "simplified solution clearance REAL": "clearance",
    "simplified solution segments INTEGER": "segments",
    "graph states INTEGER": "vertices",
    "graph motions INTEGER": "edges",
    "valid segment fraction REAL": "free_share",
    "total time REAL": "total_seconds",
    "transitions INTEGER": "initial_transitions",
    "simplified transitions INTEGER": "transitions",
    "seed INTEGER": "seed",
}
# These columns come first: the outcome of a run. `plan` returns only paths that pass its second check, so every
# path counts as correct. It is strictly correct if four times as many checks as the planner's find no collision, too.
FLAGS = (
    "solved BOOLEAN",
    "status ENUM",
    "outcome ENUM",
    "approximate solution BOOLEAN",
    "solution difference REAL",
    "correct solution BOOLEAN",
    "correct solution strict BOOLEAN",
    "simplified correct solution BOOLEAN",
    "simplified correct solution strict BOOLEAN",
)


def write_logs(found: Sequence[Result], head: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write one log, with one experiment, for each label.

    Args:
        found: Results of a campaign.
        head: Head of its records, with suite and machine.
        folder: Created if it does not exist.

    Raises:
        InputError: If a file cannot be written.
    """
    make_folder(folder)
    files: list[Path] = []
    for label, results in by_label(found).items():
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", label)
        file = folder / f"{name}.log"
        files.append(folder / f"{name}-{len(files)}.log" if file in files else file)
        write_text(files[-1], log_text(results, head))

    return files


def write_database(logs: Sequence[Path], file: Path, runs: int) -> None:
    """Convert logs to a database with OMPL's own reader; it replaces an older one only when it is complete.

    Args:
        logs: Files of the logs.
        file: The database.
        runs: Expected number of runs.

    Raises:
        InputError: If the reader cannot read a log, or the database does not hold all ``runs``.
    """
    from ompl import tools

    fresh = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    fresh.unlink(missing_ok=True)
    try:
        with redirect_stdout(StringIO()):
            tools.readBenchmarkLog(str(fresh), [str(log) for log in logs], False)
        with closing(sqlite3.connect(fresh)) as base:
            held = base.execute("SELECT COUNT(*) FROM runs").fetchone()[0]
            sound = base.execute("PRAGMA integrity_check").fetchone()[0]
            if held != runs or sound != "ok" or base.execute("PRAGMA foreign_key_check").fetchall():
                raise InputError(f"{file}: holds {held} runs instead of {runs} ({sound}); the records are kept")
        os.replace(fresh, file)
    except (OSError, sqlite3.Error) as error:
        raise InputError(
            f"{file}: cannot be written: {error}; the records are kept: make room, then repeat with --resume"
        ) from error
    except (ValueError, IndexError, TypeError) as error:
        raise InputError(f"{file}: OMPL's reader does not understand a log: {error}; the records are kept") from error
    finally:
        fresh.unlink(missing_ok=True)


def log_text(results: Sequence[Result], head: Mapping[str, Any]) -> str:
    """Return the text of one experiment: all planners on the same problems."""
    suite = head["suite"]
    machine = head["machine"]
    first = results[0]
    scaled = [f"{first.axis} REAL = {first.value:g}"] if first.axis else []
    seconds = sum(measured(run, "total_seconds") or 0.0 for result in results for run in result.runs)

    lines = [
        f"OMPL version {machine['ompl']}",
        f"Experiment {_word(first.group if first.axis else first.label)}",
        f"{len(scaled)} experiment properties",
        *scaled,
        f"Running on {_word(machine['system'])}",
        f"Starting at {machine['begun']}",
        *("<<<|", f"suite {suite['name']}: {suite['title']}", "|>>>"),
        *("<<<|", *(f"{key}: {value}" for key, value in machine.items()), "|>>>"),
        f"{suite['seed']} is the random seed",
        f"{suite['seconds']:g} seconds per run",
        f"{suite['memory_mb']:g} MB per run",
        f"{max(result.total for result in results)} runs per planner",
        f"{seconds:g} seconds spent to collect the data",
        "2 enum types",
        "|".join(("status", *OMPL_STATUSES)),
        "|".join(("outcome", *STATUSES)),
        f"{len(results)} planners",
    ]

    settings = {entrant["label"]: entrant for entrant in suite["entrants"]}
    for result in results:
        lines += _planner(result, settings.get(result.planner, {}))

    return "\n".join([*lines, ""])


def _planner(result: Result, entrant: Mapping[str, Any]) -> list[str]:
    """Return the lines of one planner: its settings, the names of the columns, and one row for each run."""
    common = {"planner": entrant.get("name", result.planner), "shorten": entrant.get("shorten", "")}
    common |= entrant.get("parameters", {})

    taken = (*PROPERTIES.values(),)
    counts = sorted({key for run in result.runs for key in run.get("counts", {}) if key not in taken})
    extra = {f"{_column(key)} REAL": key for key in counts}

    heads = (*FLAGS, *PROPERTIES, *extra)
    rows = [[*_flags(run), *(_number(measured(run, key)) for key in (*PROPERTIES.values(), *counts))]
            for run in result.runs]  # fmt: skip

    return [
        f"geometric_{_word(result.planner)}",
        f"{len(common)} common properties",
        *(" ".join(f"{key} = {value}".split()) for key, value in common.items()),
        f"{len(heads)} properties for each run",
        *heads,
        f"{result.total} runs",
        *("".join(f"{cell}; " for cell in row) for row in rows),
        ".",
    ]


def _flags(run: Mapping[str, Any]) -> list[str]:
    """Return the values of ``FLAGS``; without a path, those of a solution are empty, as in OMPL's own logs."""
    status = {SOLVED: EXACT, INVALID: EXACT, NOT_FOUND: TIMEOUT}.get(run["status"], CRASH)
    found = run["status"] in (SOLVED, INVALID)
    valid = run["status"] == SOLVED
    strict = (run.get("initial_strict", False), valid and run.get("strict", False))

    outcome = (int(found), status, STATUSES.index(run["status"]))
    solution = (0, 0, 1, int(strict[0]), int(valid), int(strict[1])) if found else ("",) * 6
    return [*map(str, (*outcome, *solution))]


def _number(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if value.is_integer() else f"{value:.9g}"


def _column(name: str) -> str:
    """Return a name that is valid in SQL."""
    return re.sub(r"\W+", " ", name).replace("_", " ").strip()


def _word(text: str) -> str:
    return "_".join(text.split())
