"""Where a page was measured, as the page says it."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def processes(count: int) -> str:
    """How many there were."""
    return "one process" if count == 1 else f"{count} processes"


def package_version(name: str) -> str:
    """The version of an installed package, or that it is missing."""
    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"{name} not installed"


def versions(*packages: str) -> str:
    """Versions of Python and of packages."""
    return ", ".join((f"Python {platform.python_version()}", *map(package_version, packages)))


def processor() -> str:
    """The processor's name as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
