"""Demonstrations as one HDF5 file, laid out as robomimic has it (robomimic.github.io, "Dataset structure").

``data/demo_K`` has `actions`, `obs/...`, `states`, `rewards`, `dones`; the action of a tick is the next state.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.demos.folder import AttemptFile, DemoFolder

NAME = "demos.hdf5"
OVERHEAD = 4096  # [bytes] of HDF5 for each column of a demonstration, at most
OBSERVED = {"position": "joint_pos", "velocity": "joint_vel", "gripper": "gripper", "object_pose": "object"}


def write_hdf5(folder: DemoFolder, count: int) -> Path:
    """Write the first demonstrations of a folder to one file, which is there whole or not at all.

    Raises:
        InputError: If there is no room, or a file of a demonstration is damaged.
    """
    target = folder.path / NAME
    unfinished = folder.path / f".{NAME}.tmp"
    try:
        _reserve(unfinished, _size(folder, count))
        _write(folder, count, unfinished)
        os.replace(unfinished, target)
    except (OSError, RuntimeError) as error:
        said = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{target}: cannot be written: {said}; {AttemptFile.full}") from None
    finally:
        unfinished.unlink(missing_ok=True)
    return target


def _size(folder: DemoFolder, count: int) -> int:
    """Return how large the file will be at most [bytes]."""
    for record, arrays in folder.episodes(1):
        columns = _columns(arrays)
        a_tick = sum(values.nbytes for values in columns.values()) / max(record["ticks"], 1)
        if folder.drawn is not None:
            a_tick += len(folder.drawn.names) * (3.1 * np.prod(folder.drawn.size) + OVERHEAD)
        found = [each for _, each in sorted(folder.records.items()) if each["found"]][:count]
        return int(a_tick * sum(each["ticks"] for each in found)) + len(found) * len(columns) * OVERHEAD + OVERHEAD
    return OVERHEAD


def _reserve(file: Path, size: int) -> None:
    """Raise an error if there is no room for a file of a size [bytes]: HDF5 crashes the process where there is none."""
    with open(file, "wb") as reserved:
        os.posix_fallocate(reserved.fileno(), 0, size)


def _write(folder: DemoFolder, count: int, file: Path) -> None:
    """Write the file."""
    with h5py.File(file, "w") as out:
        data = out.create_group("data")
        total = 0
        for number, (record, arrays) in enumerate(folder.episodes(count)):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["num_samples"] = record["ticks"]
            demo.attrs["attempt"] = record["attempt"]
            for name, values in _columns(arrays).items():
                demo.create_dataset(name, data=values)
            if folder.drawn is not None:
                width, height = folder.drawn.size
                shape = (record["ticks"], height, width, 3)
                films = {
                    name: demo.create_dataset(
                        f"obs/{name}_image", shape, np.uint8, chunks=(1, *shape[1:]), compression=1
                    )
                    for name in folder.drawn.names
                }
                for tick, seen in enumerate(folder.pictures(arrays)):
                    for name, picture in seen.items():
                        films[name][tick] = picture
            total += record["ticks"]
        data.attrs["total"] = total
        data.attrs["env_args"] = json.dumps({"env_name": folder.head["task"], "type": 0, "env_kwargs": folder.head})


def _columns(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns of a demonstration by their names in the file."""
    length = len(arrays["time"])
    parts = [arrays["position"], *([arrays["gripper"][:, None]] if "gripper" in arrays else [])]
    states = np.hstack(parts)
    over = np.zeros(length, dtype=np.int64)
    over[-1:] = 1
    seen = {f"obs/{word}": arrays[name].reshape(length, -1) for name, word in OBSERVED.items() if name in arrays}
    actions = np.vstack([states[1:], states[-1:]])
    return {"states": states, "actions": actions, "rewards": over.astype(np.float64), "dones": over, **seen}
