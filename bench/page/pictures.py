"""The moving picture of the README and the sheet of the arms that ship with problems. Needs Chromium.

Run it as ``python bench/page/pictures.py``; it writes ``panda_shelf.gif`` and ``arms.png`` to ``bench/reports``.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.film import film

SEED = 1
REPORTS = Path(__file__).parents[1] / "reports"
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
            shot = film(*planned(name), Path(folder, f"{name}.png"), size=(2 * WIDTH, 5 * WIDTH // 4))
            picture = cv2.imread(str(shot))
            assert picture is not None
            shots.append(cv2.resize(picture, (WIDTH, 5 * WIDTH // 8), interpolation=cv2.INTER_AREA))
    rows = [np.hstack(shots[k : k + COLUMNS]) for k in range(0, len(shots), COLUMNS)]
    cv2.imwrite(str(file), np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def main() -> None:
    """Write both."""
    film(*planned(ARMS[0]), REPORTS / "panda_shelf.gif", seconds=3.5, rate=10.0)
    sheet(REPORTS / "arms.png")


if __name__ == "__main__":
    main()
