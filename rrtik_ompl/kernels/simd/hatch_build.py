"""What hatch does when it builds a wheel: kernels go along as LLVM bitcode, so that nobody who installs it compiles.

A wheel that is made to be installed at once has the bitcode of this machine's width. With ``RRTIK_KERNELS=1`` in the
environment it has that of both widths, which fits every kind of machine (:mod:`rrtik_ompl.kernels.simd.targets`),
wherever it is built, and it is an error if one is missing: so wheels are published. Both have what pages run.
``RRTIK_KERNELS=0`` goes without. That takes minutes of all cores and numba, which the built package needs anyway.
Whatever goes wrong without the setting, there is a wheel: kernels are then compiled when they are first used. Editable
installs compile at first use too, because their sources change.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SETTING = os.environ.get("RRTIK_KERNELS", "")
WITHOUT, REQUIRED = "0", "1"
WIDTHS = ("8", "16")
MOST_PARTS = 6  # processes of a width; each takes up to 2 GB of memory
ENDINGS = (".bitcode", ".wasm")
PATIENCE = None if SETTING == REQUIRED else 1800.0  # [s]; a wheel that must have all kernels waits for them
PORTABLE = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}  # nothing that only this processor can do


class KernelBitcode(BuildHookInterface):  # type: ignore[misc]
    """Adds the bitcode of all kernels, of both widths, to a wheel."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """What the build environment needs besides hatch."""
        return [] if SETTING == WITHOUT else ["numba>=0.62.1"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the wheel is packed.

        Raises:
            RuntimeError: If a kernel is missing from a wheel that must have them all.
        """
        if version == "editable" or SETTING == WITHOUT:
            return
        try:
            self._made = tempfile.TemporaryDirectory(prefix="rrtik-kernels-")
            complete = _compiled(Path(self.root), Path(self._made.name))
        except OSError as error:
            self.app.display_warning(f"kernels as bitcode: {error}")
            return
        made = sorted(file for ending in ENDINGS for file in Path(self._made.name).glob(f"*{ending}"))
        build_data["force_include"].update({str(file): f"rrtik_ompl/kernels/{file.name}" for file in made})
        names = ", ".join(file.name for file in made)
        self.app.display_info(f"kernels as bitcode: {names or 'none (is numba there?)'}")
        if SETTING == REQUIRED and not complete:
            raise RuntimeError("kernels as bitcode: not all could be compiled, see above")


def _compiled(root: Path, folder: Path) -> bool:
    """Compile all kernels into files of a folder, with all cores; whether all could be."""
    widths = WIDTHS if SETTING == REQUIRED else ("",)
    parts = min(max((os.cpu_count() or 1) // len(widths), 1), MOST_PARTS)
    shares = [(width, part) for width in widths for part in range(parts)]
    return all([_ended_well(compiler) for compiler in [_compiler(*share, parts, root, folder) for share in shares]])


def _ended_well(compiler: subprocess.Popen[bytes]) -> bool:
    """Wait for a process, or end it."""
    try:
        return compiler.wait(PATIENCE) == 0
    except subprocess.TimeoutExpired:
        compiler.kill()
        return False


def _compiler(width: str, part: int, parts: int, root: Path, folder: Path) -> subprocess.Popen[bytes]:
    """A process that compiles a part of the kernels of a width, this machine's if it is empty, into a folder."""
    places = {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(folder), "RRTIK_CACHE": str(folder)}
    environment = {**os.environ, **PORTABLE, **places, **({"RRTIK_LANES": width} if width else {})}
    command = [sys.executable, "-m", "rrtik_ompl.kernels.shipped", str(folder), str(part), str(parts)]
    errors = None if SETTING == REQUIRED else subprocess.DEVNULL
    return subprocess.Popen(command, env=environment, cwd=root, stderr=errors)
