"""What hatch does when it builds a wheel: kernels go along as LLVM bitcode, so that nobody who installs it compiles.

One wheel has the bitcode of every kind of machine (:mod:`rrtik_ompl.fast.simd.targets`) and what pages run, wherever it
is built. That takes a minute or two and numba, which the built package needs anyway; ``RRTIK_KERNELS=0`` in the
environment goes without. Whatever goes wrong, there is a wheel: kernels are then compiled when they are first used. For
a wheel that is to be published, ``RRTIK_KERNELS=1`` makes that an error. Editable installs compile at first use too,
because their sources change.
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
ENDINGS = (".bitcode", ".wasm")
PATIENCE = None if SETTING == REQUIRED else 1800.0  # [s]; a wheel that must have all kernels waits for them
# Nothing that only this processor can do, and nothing of the kind left in the cache of whoever builds.
PORTABLE = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "RRTIK_CACHE": ""}


class KernelBitcode(BuildHookInterface):  # type: ignore[misc]
    """Adds the bitcode of all kernels, for all kinds of machine and widths, to a wheel."""

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
        build_data["force_include"].update({str(file): f"rrtik_ompl/fast/{file.name}" for file in made})
        names = ", ".join(file.name for file in made)
        self.app.display_info(f"kernels as bitcode: {names or 'none (is numba there?)'}")
        if SETTING == REQUIRED and not complete:
            raise RuntimeError("kernels as bitcode: not all could be compiled, see above")


def _compiled(root: Path, folder: Path) -> bool:
    """Compile all kernels into files of a folder; whether all could be."""
    return all([_ended_well(compiler) for compiler in [_compiler(width, root, folder) for width in WIDTHS]])


def _ended_well(compiler: subprocess.Popen[bytes]) -> bool:
    """Wait for a process, or end it."""
    try:
        return compiler.wait(PATIENCE) == 0
    except subprocess.TimeoutExpired:
        compiler.kill()
        return False


def _compiler(width: str, root: Path, folder: Path) -> subprocess.Popen[bytes]:
    """A process that compiles all kernels of a width into a folder, for all kinds of machine that have it."""
    places = {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(folder)}
    environment = {**os.environ, **PORTABLE, **places, "RRTIK_LANES": width}
    command = [sys.executable, "-m", "rrtik_ompl.fast.shipped", str(folder)]
    errors = None if SETTING == REQUIRED else subprocess.DEVNULL
    return subprocess.Popen(command, env=environment, cwd=root, stderr=errors)
