"""The sheet of the shipped tasks and of the problems with path constraints or two arms. Needs Chromium.

Run it as ``python bench/page/tasks.py [--single FOLDER]``; it writes ``tasks.png`` to ``bench/reports``, and with
``--single`` each of its pictures in full size, at three moments, to a folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

import rrtik_ompl as rrtik
from rrtik_ompl.tasks.task_file import load_task
from rrtik_ompl.viewer.film import drawn
from rrtik_ompl.viewer.page import page

SEED = 1
REPORTS = Path(__file__).parents[1] / "reports"
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
        task = load_task(name)
        made = task.task.plan(task.world, task.start, seconds=60.0, seed=SEED)
        if not made.found:
            raise SystemExit(f"{name}: {made.reason}")
        return page(task.world, made, still=True)
    problem = rrtik.load_problem(name)
    plan = rrtik.plan(problem, seconds=60.0, seed=SEED)
    if plan.path is None:
        raise SystemExit(f"{name}: {plan.reason}")
    return page(problem, plan.path, still=True)


def main() -> None:
    """Draw all of them and write the sheet."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--single", type=Path, help="a folder for the pictures in full size")
    parser.add_argument("--only", nargs="+", choices=SHOWN, default=list(SHOWN), help="no sheet if some are left out")
    given = parser.parse_args()
    small = []
    for name in given.only:
        pictures = drawn(page_of(name), MOMENTS, FULL)
        if given.single is not None:
            given.single.mkdir(parents=True, exist_ok=True)
            for k, picture in enumerate(pictures):
                picture.save(given.single / f"{name}_{k}.png")
        small.append(cv2.resize(np.asarray(pictures[MOMENTS // 2]), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA))
        print(name, flush=True)
    if tuple(given.only) == SHOWN:
        rows = [np.hstack(small[k : k + COLUMNS]) for k in range(0, len(small), COLUMNS)]
        Image.fromarray(np.vstack(rows)).save(REPORTS / "tasks.png", optimize=True)


if __name__ == "__main__":
    main()
