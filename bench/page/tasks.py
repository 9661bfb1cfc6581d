"""The sheet of the shipped tasks and of the problems with path constraints or two arms, `tasks.png`. Needs Chromium."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from PIL import Image
from typer import Option

import rrtik_ompl as rrtik
from bench.shared.run import REPORTS
from rrtik_ompl.tasks import Task
from rrtik_ompl.viewer.film import drawn
from rrtik_ompl.viewer.page import page

SEED = 1
MOMENTS = 3  # that are drawn of each: the beginning, the middle, which stands in the sheet, and the end
SHOWN = (
    "panda_pick_place", "panda_bookshelf", "panda_serve", "ur5_bin", "titan4_drawer", "titan4_valve_level",
    "ur5_upright", "panda_upright", "two_titan4",
)  # fmt: skip
COLUMNS, WIDTH, HEIGHT = 3, 400, 250  # of the sheet; of one of its pictures [px]
FULL = (640, 400)  # as they are drawn [px]


def page_of(name: str) -> str:
    """The page of a task or of a problem, with what was planned."""
    if name in rrtik.list_tasks():
        task = Task.load(name)
        made = task.plan(seconds=60.0, seed=SEED)
        if not made.found:
            raise SystemExit(f"{name}: {made.reason}")
        return page(task.world, made.played(), still=True)
    problem = rrtik.load_problem(name)
    plan = rrtik.plan(problem, seconds=60.0, seed=SEED)
    if plan.path is None:
        raise SystemExit(f"{name}: {plan.reason}")
    return page(problem, plan.path, still=True)


def drawn_once(name: str, folder: Path) -> Image.Image:
    """The picture that stands in the sheet; those that a folder has already are not drawn again."""
    files = [folder / f"{name}_{k}.png" for k in range(MOMENTS)]
    if not all(file.exists() for file in files):
        for file, picture in zip(files, drawn(page_of(name), MOMENTS, FULL), strict=True):
            picture.save(file)
    return Image.open(files[MOMENTS // 2]).convert("RGB")


def main(
    out: Annotated[Path, Option(help="The sheet.")] = REPORTS / "tasks.png",
    single: Annotated[Path | None, Option(help="A folder for the pictures in full size, at three moments.")] = None,
) -> None:
    """Draw all of them; pictures that the folder has are kept."""
    with tempfile.TemporaryDirectory() as spare:
        folder = single or Path(spare)
        folder.mkdir(parents=True, exist_ok=True)
        size = WIDTH, HEIGHT
        small = [cv2.resize(np.asarray(drawn_once(name, folder)), size, interpolation=cv2.INTER_AREA) for name in SHOWN]
    rows = [np.hstack(small[k : k + COLUMNS]) for k in range(0, len(small), COLUMNS)]
    Image.fromarray(np.vstack(rows)).save(out, optimize=True)
