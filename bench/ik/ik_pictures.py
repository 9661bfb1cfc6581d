"""Pictures of inverse kinematics: solutions as ghosts, a map of reach. Needs Chromium.

Pages are drawn by a headless browser and made smaller with OpenCV.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.shared.run import REPORTS
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.ik.reach import reach_map
from rrtik_ompl.viewer import view
from rrtik_ompl.viewer.drawing.marks import reach_marks
from rrtik_ompl.viewer.subject import Shown

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--hide-scrollbars", "--window-size=1200,760", "--virtual-time-budget=8000",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
WIDTH = 760  # of the pictures [px]


def photograph(page: Path, picture: Path) -> None:
    """Draw a page, and write the picture WIDTH pixels wide."""
    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        raise SystemExit(f"none of {', '.join(BROWSERS)} is on PATH: the pages cannot be drawn")
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "page.png"
        subprocess.run([browser, *OPTIONS, f"--screenshot={raw}", page.as_uri()], capture_output=True, check=True)
        shot = cv2.imread(str(raw))
    assert shot is not None
    small = cv2.resize(shot, (WIDTH, round(shot.shape[0] * WIDTH / shot.shape[1])), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(picture), small, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def ghosts(page: Path) -> None:
    """All solutions of a pose of the UR5 that are not a full turn apart."""
    robot = rrtik.load_robot("ur5_limited")
    goal = rrtik.PoseGoal(pose_from_rpy([0.35, 0.35, 0.35], np.radians([180.0, 0.0, 30.0])))
    found = rrtik.solve_ik(robot, goal, all=True).solutions
    title = f"{robot.name}: {len(found)} solutions of one pose"
    view(Shown(robot, rrtik.Scene(), goal, found[0]), ghosts=found, html=page, title=title)


def reach(page: Path) -> None:
    robot = rrtik.load_robot("titan4", parameters={"limits": "envelope"})
    found = reach_map(robot)
    view(robot, marks=reach_marks(found), html=page, title="titan4: share of directions in reach")


def main(folder: Annotated[Path, Option(help="Of the pictures.")] = REPORTS) -> None:
    """Draw both."""
    with tempfile.TemporaryDirectory() as drawn:
        for name, draw in (("ik_ghosts", ghosts), ("reach_titan4", reach)):
            page = Path(drawn) / f"{name}.html"
            draw(page)
            photograph(page, folder / f"{name}.png")
