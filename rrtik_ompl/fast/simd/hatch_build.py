"""What hatch does when it builds a wheel: kernels go along as LLVM bitcode, so that nobody who installs it compiles.

That takes a minute or two and numba, which the built package needs anyway; ``RRTIK_KERNELS=0`` in the environment
goes without. Whatever goes wrong, there is a wheel: kernels are then compiled when they are first used. Editable
installs compile then too, because their sources change.
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
WIDTHS = ("8", "16")
PATIENCE = 600.0  # [s]
PORTABLE = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}  # nothing that only this processor can do


class KernelBitcode(BuildHookInterface):  # type: ignore[misc]
    """Adds the bitcode of all kernels, for both widths, to a wheel."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """What the build environment needs besides hatch."""
        return [] if SETTING == "0" else ["numba>=0.68.1"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the wheel is packed."""
        if version == "editable" or SETTING == "0":
            return
        try:
            self._made = tempfile.TemporaryDirectory(prefix="rrtik-kernels-")
            made = _bitcode(Path(self.root), Path(self._made.name))
        except OSError as error:
            self.app.display_warning(f"kernels as bitcode: {error}")
            return
        build_data["force_include"].update({str(file): f"rrtik_ompl/fast/{file.name}" for file in made})
        names = ", ".join(file.name for file in made)
        self.app.display_info(f"kernels as bitcode: {names or 'none (is numba there?)'}")


def _bitcode(root: Path, folder: Path) -> list[Path]:
    """Compile all kernels into files of a folder."""
    compilers = [_compiler(width, root, folder) for width in WIDTHS]
    for compiler in compilers:
        try:
            compiler.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            compiler.kill()
    return sorted(folder.glob("*.bitcode"))


def _compiler(width: str, root: Path, folder: Path) -> subprocess.Popen[bytes]:
    """A process that compiles all kernels for a width into a folder."""
    places = {"PYTHONPATH": os.pathsep.join([str(root), *sys.path]), "NUMBA_CACHE_DIR": str(folder)}
    environment = {**os.environ, **PORTABLE, **places, "RRTIK_LANES": width}
    command = [sys.executable, "-m", "rrtik_ompl.fast.simd.bitcode", str(folder)]
    return subprocess.Popen(command, env=environment, cwd=folder, stderr=subprocess.DEVNULL)
