"""Wheels of this repository, made for a measurement."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")


def built_wheel(folder: Path, *, kernels: bool) -> Path:
    """Make the wheel of this checkout in a folder, with the kernels of all kinds of machine or with none."""
    environment = {**os.environ, "RRTIK_KERNELS": "1" if kernels else "0"}
    command = [*PIP, "wheel", "--quiet", "--no-deps", "--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, env=environment)
    (wheel,) = folder.glob("rrtik_ompl-*.whl")
    return wheel
