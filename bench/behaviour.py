"""Does the library still give the same results, bit for bit? Hashes of some hundred results, stored and compared.

``store`` runs all cases and writes their hashes; ``compare`` runs them again and prints each case that differs.

A case is a plan, a shortened path, a call of inverse kinematics, a trajectory, a replanning run or a batch of checks;
the files ``behaviour_*.py`` hold them. An entry is the SHA-256 of the result's arrays (base64) and a line of flags and
counts, or the error that was raised. Results depend on the processor and on the libraries' versions, which the file
names: ``compare`` says so if they are others. Covers of links come from the user's cache; with ``RRTIK_CACHE`` set to
an empty folder they are made anew, and the kernels' machine code too.

Exit code 0 if nothing differs, else 1. An error of the same kind in other words is printed, but is no difference.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import llvmlite.binding as llvm
import numpy as np
from ompl import util as ou
from typer import Argument, Option

import rrtik_ompl
from bench.behaviour_calls import inverse_kinematics, others, replans
from bench.behaviour_paths import plain, plans, shortenings, trajectories
from bench.behaviour_problems import Result
from rrtik_ompl.base.choices import one_of

LIBRARIES = ("ompl", "pin", "coal", "numpy", "scipy", "numba", "llvmlite")
GROUPS = (plans, plain, shortenings, trajectories, inverse_kinematics, replans, others)
SLOW = 5.0  # [s] a case that takes longer is named


def main(
    verb: Annotated[str, Argument(help="store or compare")],
    file: Path,
    only: Annotated[str, Option(help="Cases whose name contains this text.")] = "",
) -> int:
    """Run the cases."""
    storing = one_of(("store", "compare"), verb, "verb") == "store"
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    warnings.simplefilter("ignore")
    before = None if storing else json.loads(file.read_text())
    begin = time.process_time()
    found = {name: entry_of(name, case) for group in GROUPS for name, case in group() if only in name}
    took = time.process_time() - begin
    where = Path(rrtik_ompl.__file__).parent
    print(f"{len(found)} cases of {where}, {took:.0f} s of processor time")
    if before is None:
        file.write_text(as_text(machine(), found))
        return 0
    expected = {name: entry for name, entry in before["cases"].items() if only in name}
    return compare(before["machine"], expected, found)


def machine() -> dict[str, str]:
    """What results depend on beside the code; ``width`` is that of the kernels: 16 lanes with AVX-512, else 8."""
    features = llvm.get_host_cpu_features()
    asked = os.environ.get("RRTIK_LANES", "")
    width = asked if asked in ("8", "16") else "16" if features.get("avx512f", False) else "8"
    system = f"{platform.system()} {platform.machine()}"
    found = {
        "python": platform.python_version(),
        "system": system,
        "processor": llvm.get_host_cpu_name(),
        "width": width,
    }
    return found | {name: version(name) for name in LIBRARIES}


def entry_of(name: str, case: Callable[[], Result]) -> list[str]:
    """The hash of a case's arrays and its flags; no hash and the error if it raised one."""
    begin = time.perf_counter()
    try:
        flags, arrays = case()
        entry = [digest(arrays), flags]
    except Exception as error:
        entry = ["", f"{type(error).__name__}: {error}"]
    took = time.perf_counter() - begin
    if took > SLOW:
        print(f"slow, {took:.1f} s: {name}", file=sys.stderr)
    return entry


def digest(arrays: Iterable[Any]) -> str:
    """SHA-256 of shapes and bytes of arrays, masks as they are and numbers as float64."""
    total = hashlib.sha256()
    for array in map(np.asarray, arrays):
        exact = np.ascontiguousarray(array, dtype=bool if array.dtype == bool else np.float64)
        total.update(f"{exact.dtype}{exact.shape}".encode() + exact.tobytes())
    return base64.b64encode(total.digest()).decode().rstrip("=")


def as_text(machine: dict[str, str], found: dict[str, list[str]]) -> str:
    """JSON, a line a case."""
    lines = [f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in found.items()]
    return f'{{"machine": {json.dumps(machine)},\n"cases": {{\n' + ",\n".join(lines) + "\n}}\n"


def compare(machine_then: dict[str, str], then: dict[str, list[str]], now: dict[str, list[str]]) -> int:
    """Print what differs; the exit code."""
    here = machine()
    others = [
        f"{key} {machine_then.get(key)} -> {here.get(key)}"
        for key in sorted({*here, *machine_then})
        if machine_then.get(key) != here.get(key)
    ]
    if others:
        print("NOT THE SAME MACHINE OR LIBRARIES, results may differ because of that: " + ", ".join(others))
    differing = 0
    for name in dict.fromkeys([*then, *now]):
        old, new = then.get(name), now.get(name)
        if old == new:
            continue
        if old and new and not old[0] and not new[0] and old[1].split(":")[0] == new[1].split(":")[0]:
            print(f"other words: {name}\n    {old[1]}\n    {new[1]}")
            continue
        differing += 1
        print(f"differs: {name}\n    stored {_shown(old)}\n    now    {_shown(new)}")
    print(f"{differing} of {len(then)} stored cases differ" if differing else "no case differs")
    return 1 if differing else 0


def _shown(entry: list[str] | None) -> str:
    return "no such case" if entry is None else f"{entry[0][:10]} {entry[1]}"
