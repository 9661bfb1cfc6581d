"""Read the motions in a table of a dataset of LeRobot (Parquet), by the package pyarrow."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rrtik_ompl.base.errors import InputError, PathWarning
from rrtik_ompl.files.tables import json_value
from rrtik_ompl.files.text import read_text

STREAMS = ("action", "observation.state")
EPISODE = "episode_index"
TIME = "timestamp"
INFO = Path("meta", "info.json")  # in the folder of the dataset, three folders above a table
GRIPPER = "gripper"


def streams_of_parquet(path: Path, joints: tuple[str, ...]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the arrays of each episode, and which one it is; names of joints are those of the dataset.

    Args:
        path: A table, such as ``data/chunk-000/file-000.parquet``.
        joints: All joints of the robot.

    Warns:
        PathWarning: If the opening of a gripper is left out, which is no joint of the robot.

    Raises:
        InputError: If the package is not installed, or the file cannot be read or has no actions and states.
    """
    try:
        import pyarrow.parquet as pq
    except ImportError:
        raise InputError("tables in Parquet need the package pyarrow: pip install 'rrtik-ompl[data]'") from None

    try:
        table = pq.ParquetFile(path)
        has = [name for name in (*STREAMS, TIME, EPISODE) if name in table.schema_arrow.names]
        columns = table.read(columns=has).to_pydict()
    except Exception as error:
        raise InputError(f"not Parquet that pyarrow reads: {str(error).splitlines()[0]}") from None
    streams = [name for name in STREAMS if name in has]
    if not streams:
        raise InputError(f"no column {STREAMS[0]} or {STREAMS[1]}; is it a table of a dataset of LeRobot?")

    episode_of = np.array(columns.get(EPISODE, np.zeros(len(columns[streams[0]]))))
    features = _features(path)
    for episode in np.unique(episode_of).tolist():
        rows = np.flatnonzero(episode_of == episode).tolist()
        times = {TIME: [columns[TIME][k] for k in rows]} if TIME in has else {}
        for name in streams:
            values = [columns[name][k] for k in rows]
            names = _names(features.get(name))
            if names is not None and GRIPPER in names and GRIPPER not in joints:
                warnings.warn(
                    f"{path.name}: '{GRIPPER}' is left out, which is no joint of the robot", PathWarning, stacklevel=2
                )
                at = names.index(GRIPPER)
                values = [[*row[:at], *row[at + 1 :]] for row in values]
                names = [*names[:at], *names[at + 1 :]]
            known = {} if names is None else {"joint_names": names}
            yield f"episode {int(episode)}, {name}", {"positions": values, **times, **known}


def _features(path: Path) -> dict[str, Any]:
    """Return what the dataset says of its columns; nothing for a table that stands alone."""
    file = next((folder / INFO for folder in path.absolute().parents[:4] if (folder / INFO).is_file()), None)
    info = None if file is None else json_value(read_text(file))
    found = info.get("features") if isinstance(info, dict) else None
    return found if isinstance(found, dict) else {}


def _names(feature: object) -> list[str] | None:
    """Return the names of the motors of a column, without what they measure; None if the dataset has none."""
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict) and len(names) == 1:  # {"motors": [...]}, of version 2
        (names,) = names.values()
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return None
    return [name.removesuffix(".pos") for name in names]
