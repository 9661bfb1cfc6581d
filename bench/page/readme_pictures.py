"""The README's film `panda_shelf.gif`, its sheet of arms `arms.png` and its page `titan4_sdu.png`. Needs Chromium."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.ik.ik_pictures import photograph
from bench.shared.run import REPORTS
from rrtik_ompl.viewer import view
from rrtik_ompl.viewer.film import film, picture

SEED = 1
ARMS = ("panda_shelf", "ur5_table", "ur10_bin", "xarm7_cage", "kinova_table", "so101_bin")
COLUMNS, WIDTH = 3, 400  # of the sheet; of one of its pictures [px]


def planned(name: str) -> tuple[rrtik.Problem, rrtik.JointPath]:
    """A shipped problem and its path."""
    problem = rrtik.load_problem(name)
    found = rrtik.plan(problem, seed=SEED, seconds=20.0)
    if found.path is None:
        raise SystemExit(f"{name}: {found.reason}")
    return problem, rrtik.shorten(found.path, problem, seed=SEED)


def sheet(file: Path) -> None:
    """All arms at their starts, with their goals as ghosts and the trails of their tips."""
    shots = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ARMS:
            problem, path = planned(name)
            shot = picture(problem, Path(folder, f"{name}.png"), path, size=(2 * WIDTH, 5 * WIDTH // 4))
            pixels = cv2.imread(str(shot))
            assert pixels is not None
            shots.append(cv2.resize(pixels, (WIDTH, 5 * WIDTH // 8), interpolation=cv2.INTER_AREA))
    rows = [np.hstack(shots[k : k + COLUMNS]) for k in range(0, len(shots), COLUMNS)]
    cv2.imwrite(str(file), np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def moves(picture: Path) -> None:
    """The page of an arm that is driven one joint at a time, with the list of its moves."""
    problem = rrtik.load_problem("titan4_sdu")
    plan = rrtik.plan(problem, "bicrdt", seed=SEED)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "titan4_sdu.html")
        view(plan, html=page)
        photograph(page, picture)


def main(folder: Annotated[Path, Option(help="Of the pictures.")] = REPORTS) -> None:
    """Draw all three."""
    problem, path = planned(ARMS[0])
    film(problem, folder / "panda_shelf.gif", path, seconds=3.5, rate=10.0)
    sheet(folder / "arms.png")
    moves(folder / "titan4_sdu.png")
