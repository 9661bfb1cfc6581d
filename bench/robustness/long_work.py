"""Work that takes long, and how each file that it leaves is read: a half file is one that cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.records import NAME, key_of, read_head, read_records
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.app import run
from rrtik_ompl.cli.terminal import stoppable
from rrtik_ompl.ik.reach import ReachMap
from rrtik_ompl.model.certificate import Certificate
from rrtik_ompl.pilot.overlay.film import write_film
from rrtik_ompl.pilot.record import read_record
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.tasks import TaskPlan

SUITE = "version: 1\nproblems: [planar3_a]\nplanners: [bicrdt, fastrrtconnect]\nruns: 3\nseconds: 0.5\n"
RUNS = 6
PICTURES, PLACES = 12, 6
UNFINISHED = ".film.unfinished.avi"  # which says by its name that it is none

Reader = Callable[[Path], object]


@dataclass(frozen=True)
class LongWork:
    """Something that takes long.

    Attributes:
        work: Does it in the current folder; returns the exit code.
        files: What it leaves there, and how each is read.
        again: Does it once more after a fault; as ``work`` if None.
        waits: Whether it waits for other processes rather than works: its moments are of wall time then.
        grows: Files that grow line by line: what stood in them before a fault must still stand there.
    """

    work: Callable[[], int]
    files: Mapping[str, Reader] = field(default_factory=dict)
    again: Callable[[], int] | None = None
    waits: bool = False
    grows: tuple[str, ...] = ()


def _command(*words: str) -> Callable[[], int]:
    return lambda: run(list(words))


def _page(file: Path) -> object:
    text = file.read_text(encoding="utf-8")
    if not text.rstrip().endswith("</html>"):
        raise InputError(f"{file}: half a page")
    return text


def _table(file: Path) -> object:
    text = file.read_text(encoding="utf-8")
    if not text.endswith("\n") or "|" not in text:
        raise InputError(f"{file}: half a table")
    return text


def _sheet(file: Path) -> object:
    data = file.read_bytes()
    if not data.startswith(b"%PDF") or not data.rstrip().endswith(b"%%EOF"):
        raise InputError(f"{file}: half a sheet")
    return data


def _film(file: Path) -> object:
    film = cv2.VideoCapture(str(file))
    count = int(film.get(cv2.CAP_PROP_FRAME_COUNT)) if film.isOpened() else 0
    film.release()
    if count != PICTURES:
        raise InputError(f"{file}: a film of {count} pictures, not of {PICTURES}")
    return count


def _campaign(file: Path) -> object:
    read_head(file)
    keys = [key_of(record) for record in read_records(file)]
    if len(keys) != len(set(keys)):
        raise InputError(f"{file}: a run stands there twice")
    return len(keys)


def _whole_campaign(file: Path) -> object:
    count = _campaign(file)
    if count != RUNS:
        raise InputError(f"{file}: {count} of {RUNS} runs")
    return count


def _lines(file: Path) -> object:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def _left_over(file: Path) -> object:
    raise InputError(f"{file}: it is done, and this is still there")


def _drawn_film() -> int:
    rows = np.random.default_rng(1).integers(0, 256, (PICTURES, 120, 160, 3), dtype=np.uint8)
    write_film(Path("film.avi"), iter(rows), 10.0)
    return FOUND


def _session(name: str) -> Callable[[], int]:
    """A session of a simulated pilot who drives all joints, recorded."""

    @stoppable()  # as the command is
    def work() -> int:
        opened = open_session(SessionOptions("titan4_sdu", record=Path(name)))
        engine = opened.engine
        with PilotServer() as server:
            loop, session = Loop(engine, server), engine.session
            for step in range(PLACES):
                engine.perception.update(session, 0.05 * step)
                engine.execute({"name": "select", "joint": step % 6}, 0.05 * step)
                engine.execute({"name": "jog", "direction": 1.0, "press": step}, 0.05 * step + 0.02)
            loop.run(lambda: True)
        opened.close()
        if opened.record.fault:
            raise InputError(opened.record.fault)
        return FOUND

    return work


def _many() -> int:
    plans = rrtik.plan_many(["planar3_a", "planar3_boxes"], "bicrdt", seed=1, processes=2)
    return FOUND if all(plan.found for plan in plans) else NOT_FOUND


PLAN = ("plan", "planar3_boxes", "--planner", "bicrdt", "--seed", "1")
PLAN_FILES = ("--out", "path.json", "--html", "page.html", "--certificate", "proof.json")
BENCH = ("bench", "suite.yaml", "--out", "out", "--views", "0")
WORK: dict[str, LongWork] = {
    "plan": LongWork(
        _command(*PLAN, *PLAN_FILES),
        {"path.json": rrtik.JointPath.load, "page.html": _page, "proof.json": Certificate.load},
    ),
    "task": LongWork(
        _command("task", "titan4_drawer", "--out", "task.json", "--trajectory", "motion.json", "--html", "page.html"),
        {"task.json": TaskPlan.load, "motion.json": lambda file: json.loads(file.read_text()), "page.html": _page},
    ),
    "replan --record": LongWork(
        _command("replan", "replan_walls", "--seconds", "1", "--record", "run.json", "--html", "page.html"),
        {"run.json": ReplanRun.load, "page.html": _page},
    ),
    "pilot --record": LongWork(
        _session("session.jsonl"),
        {"session.jsonl": lambda file: list(read_record(file))},
        _session("second.jsonl"),
        grows=("session.jsonl",),
    ),
    "reproduce": LongWork(
        _command("reproduce", "drrt-con-arm", "--quick", "--markdown", "table.md"),
        {"table.md": _table, "table.parts.jsonl": _lines},
    ),
    "reach": LongWork(
        _command("reach", "planar3", "--samples", "20000", "--out", "map.npz", "--html", "page.html"),
        {"map.npz": ReachMap.load, "page.html": _page},
    ),
    "documents": LongWork(_command("markers", "print", "sheet.pdf"), {"sheet.pdf": _sheet}),
    "films": LongWork(_drawn_film, {"film.avi": _film}),
    "bench": LongWork(
        _command(*BENCH),
        {f"out/{NAME}": _campaign},
        _command(*BENCH, "--resume"),
        waits=True,
        grows=(f"out/{NAME}",),
    ),
    "plan_many": LongWork(_many, waits=True),
}  # fmt: skip
WHOLE: dict[str, Reader] = {
    f"out/{NAME}": _whole_campaign,
    "table.parts.jsonl": _left_over,
}  # what is read otherwise once the work is done
