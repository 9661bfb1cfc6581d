"""The machine and the versions, as pages on speed say them."""

from __future__ import annotations

import os
import platform

from bench.speed.ours import PLANNER
from rrtik_bench.report.machine import package_version, processor
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH

PACKAGES = ("rrtik-ompl", "numba", "llvmlite", "numpy", "ompl", "pin", "coal", "roboplan", "vamp-planner")


def machine() -> str:
    """Processor, width of the kernels, versions, the planner that was measured."""
    packages = ", ".join(package_version(name) for name in PACKAGES)
    about = f"{processor()}, {os.cpu_count()} cores; Python {platform.python_version()}; {packages}."
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())  # what else ran shows in wall times
    about += f" Load at the start (1, 5, 15 minutes): {load}."
    calls = f"`plan(problem)` is the default call; where a planner is named, it is `{PLANNER}`."
    return f"{about}\n\n{calls} Kernels: {lanes()}. CPU time of the process unless said otherwise."


def lanes() -> str:
    """Width of the kernels on this machine."""
    return "none, plain numpy" if library("checks.check_kernels") is None else f"{WIDTH} lanes"
