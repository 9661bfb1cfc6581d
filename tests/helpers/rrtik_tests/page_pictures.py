"""Pages in a headless Chromium; tests are skipped where there is none."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PANE = np.s_[50:700, 0:860]  # of a window of 1280 x 800: where the 3-D picture is


def chromium(url: str, *options: str) -> str:
    """What Chromium writes after it has shown a page."""
    if CHROMIUM is None:
        pytest.skip("no chromium on PATH: pages cannot be looked at")
    common = (
        "--headless=new",
        "--no-sandbox",
        "--hide-scrollbars",
        "--window-size=1280,800",
        "--virtual-time-budget=8000",
    )
    graphics = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    ended = subprocess.run(
        [CHROMIUM, *common, *graphics, *options, url], capture_output=True, text=True, timeout=120, check=True
    )
    return ended.stdout


def screenshot(target: Path, fragment: str) -> np.ndarray:
    """The 3-D picture of a page, shape (rows, columns, 3), red first."""
    import cv2

    picture = target.with_suffix(".png")
    chromium(f"{target.as_uri()}{fragment}", f"--screenshot={picture}")
    return cv2.imread(str(picture))[PANE][..., ::-1].astype(float)
