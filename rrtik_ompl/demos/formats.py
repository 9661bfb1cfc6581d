"""Datasets of demonstrations in the formats of others, each written whole or not at all."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.demos.folder import EPISODES, DemoFolder
from rrtik_ompl.tasks import Task

PACKAGES = {"hdf5": "h5py", "lerobot": "pyarrow"}


def check_format(format: str, rate: float) -> None:
    """Refuse a format before the work is done if it could not be written later.

    Raises:
        InputError: If the package that it needs is not installed, or it cannot express the rate.
    """
    package = PACKAGES.get(format)
    if package is not None and find_spec(package) is None:
        raise InputError(f"format {format}: needs {package}, which is not installed: pip install 'rrtik-ompl[data]'")
    if format == "lerobot" and rate != int(rate):
        raise InputError(f"format lerobot: its rate is a whole number of ticks per second, got {rate:g}")


def write_dataset(format: str, folder: DemoFolder, task: Task, count: int) -> Path:
    """Write the first demonstrations of a folder as a dataset, and return its file or folder.

    Raises:
        InputError: If there is no room, or a file of a demonstration is damaged.
    """
    if format == "hdf5":
        from rrtik_ompl.demos.hdf5 import write_hdf5

        return write_hdf5(folder, count)
    if format == "lerobot":
        from rrtik_ompl.demos.lerobot import write_lerobot

        return write_lerobot(folder, task.world.robot, count)
    return folder.path / EPISODES
