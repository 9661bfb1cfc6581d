"""Demonstrations as a dataset of LeRobot, version 3.0 of its layout (github.com/huggingface/lerobot, `datasets/`).

States and actions have the units of LeRobot's motors: joints that turn in degrees, joints that slide in metres, the
gripper from 0 (closed) to 100 (open). The action of a tick is the state of the next one.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from PIL import Image

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.demos.episode import POSE
from rrtik_ompl.demos.folder import AttemptFile, DemoFolder
from rrtik_ompl.model.robot import Robot

VERSION = "v3.0"
FOLDER = "lerobot"
CHUNK = 1000  # files of a folder, at most
FILE_MB = 100  # size of a file, about
TOGETHER = 1000  # rows of episodes that are written at once
MEGABYTE = 2**20
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
STATE = "observation.state"
ACTION = "action"
SURROUNDINGS = "observation.environment_state"
IMAGES = "observation.images"
INDICES = ("frame_index", "episode_index", "index", "task_index")
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)
FULLY_OPEN = 100.0

Columns = dict[str, NDArray[Any]]
Statistics = dict[str, dict[str, NDArray[Any]]]
FewStatistics = dict[str, NDArray[Any]]


def write_lerobot(folder: DemoFolder, robot: Robot, count: int) -> Path:
    """Write the first demonstrations of a folder as a dataset, which is there whole or not at all.

    Raises:
        InputError: If there is no room, or a file of a demonstration is damaged.
    """
    target = folder.path / FOLDER
    unfinished = folder.path / f".{FOLDER}.tmp"
    try:
        shutil.rmtree(unfinished, ignore_errors=True)
        _Writer(unfinished, folder, robot).write(count)
        shutil.rmtree(target, ignore_errors=True)
        unfinished.rename(target)
    except OSError as error:
        said = error.strerror or str(error)
        raise InputError(f"{target}: cannot be written: {said}; {AttemptFile.full}") from None
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return target


class _Writer:
    """Writes a dataset.

    Args:
        root: Its folder, which does not exist.
        folder: The demonstrations.
        robot: Whose motion they are.
    """

    def __init__(self, root: Path, folder: DemoFolder, robot: Robot) -> None:
        self.root = root
        self.demos = folder
        self.fps = int(folder.head["rate"])
        self.has_gripper = robot.gripper is not None
        self.per_unit = np.where(robot.prismatic, 1.0, 180.0 / np.pi)
        motors = [*robot.joint_names, *(["gripper"] if self.has_gripper else [])]
        names = {STATE: [f"{name}.pos" for name in motors], ACTION: [f"{name}.pos" for name in motors]}
        if objects := folder.head["objects"]:
            names[SURROUNDINGS] = [f"{name}.{part}" for name in objects for part in POSE]
        self.features: dict[str, dict[str, Any]] = {
            name: {"dtype": "float32", "shape": [len(parts)], "names": parts} for name, parts in names.items()
        }
        self.cameras: dict[str, str] = {}
        if folder.drawn is not None:
            self.cameras = {name: f"{IMAGES}.{name}" for name in folder.drawn.names}
            width, height = folder.drawn.size
            axes = ["height", "width", "channels"]
            for column in self.cameras.values():
                self.features[column] = {"dtype": "image", "shape": [height, width, 3], "names": axes}
        self.features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
        for name in INDICES:
            self.features[name] = {"dtype": "int64", "shape": [1], "names": None}

    def write(self, count: int) -> None:
        """Write the first demonstrations."""
        (self.root / "meta").mkdir(parents=True)
        rows: list[dict[str, Any]] = []
        statistics: list[Statistics] = []
        files = _Files(self.root / "data")
        try:
            for episode, (columns, arrays) in enumerate(self._episodes(count)):
                table, seen = self._with_pictures(self._table(columns), arrays)
                place = files.write(table)
                statistics.append({**statistics_of(columns), **seen})
                begin = int(columns["index"][0])
                rows.append(
                    {
                        "episode_index": episode,
                        "tasks": [self.demos.head["instruction"]],
                        "length": len(table),
                        "data/chunk_index": place[0],
                        "data/file_index": place[1],
                        "dataset_from_index": begin,
                        "dataset_to_index": begin + len(table),
                    }
                )
        finally:
            files.close()

        self._write_episodes(rows, statistics)
        self._write_tasks()
        self._write_json("stats", _plain(joined(statistics)))
        self._write_json("info", self._info(rows))

    def _with_pictures(self, table: pa.Table, arrays: Mapping[str, NDArray[Any]]) -> tuple[pa.Table, Statistics]:
        """Return the rows of a demonstration with its pictures (PNG), and the statistics of these."""
        cells: dict[str, list[dict[str, Any]]] = {name: [] for name in self.cameras}
        counts = {name: np.zeros((3, 256), dtype=np.int64) for name in self.cameras}
        for tick, seen in enumerate(self.demos.pictures(arrays)):
            for name, picture in seen.items():
                cells[name].append({"bytes": png(picture), "path": f"frame-{tick:06d}.png"})
                counts[name] += [np.bincount(picture[:, :, k].ravel(), minlength=256) for k in range(3)]
        kind = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
        for name, column in self.cameras.items():
            table = table.append_column(column, pa.array(cells[name], kind))
        return table, {self.cameras[name]: statistics_of_colors(each, len(table)) for name, each in counts.items()}

    def _episodes(self, count: int) -> Iterator[tuple[Columns, Mapping[str, NDArray[Any]]]]:
        """Yield the columns of each demonstration, and its arrays."""
        begin = 0
        for episode, (_, arrays) in enumerate(self.demos.episodes(count)):
            state = self._state(arrays)
            length = len(state)
            columns: Columns = {STATE: state, ACTION: np.vstack([state[1:], state[-1:]])}
            if SURROUNDINGS in self.features:
                columns[SURROUNDINGS] = arrays["object_pose"].reshape(length, -1).astype(np.float32)
            columns["timestamp"] = (np.arange(length) / self.fps).astype(np.float32)
            columns["frame_index"] = np.arange(length)
            columns["episode_index"] = np.full(length, episode)
            columns["index"] = np.arange(begin, begin + length)
            columns["task_index"] = np.zeros(length, dtype=np.int64)
            begin += length
            yield columns, arrays

    def _state(self, arrays: Mapping[str, NDArray[Any]]) -> Matrix:
        """Return the positions of all motors at each tick, shape (k, motors)."""
        rows = arrays["position"] * self.per_unit
        if self.has_gripper:
            rows = np.column_stack([rows, FULLY_OPEN * arrays["gripper"]])
        return rows.astype(np.float32)

    def _table(self, columns: Columns) -> pa.Table:
        """Return the rows of a demonstration."""
        arrays = {}
        for name, values in columns.items():
            flat = pa.array(values.ravel())
            arrays[name] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        return pa.table(arrays)

    def _write_episodes(self, rows: list[dict[str, Any]], statistics: list[Statistics]) -> None:
        """Write what is said of each demonstration, and its statistics."""
        files = _Files(self.root / "meta" / "episodes")
        whole = []
        for row, found in zip(rows, statistics, strict=True):
            own = {f"stats/{name}/{what}": value.tolist() for name, each in found.items()
                   for what, value in each.items()}  # fmt: skip
            whole.append({**row, **own})
        try:
            for first in range(0, len(whole), TOGETHER):
                files.write_rows(whole[first : first + TOGETHER])
        finally:
            files.close()

    def _write_tasks(self) -> None:
        """Write the only task in words, as pandas writes a table whose index is called `task`."""
        table = pa.table({"task_index": pa.array([0]), "task": pa.array([self.demos.head["instruction"]])})
        kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
        columns = [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": stored, "metadata": None}
            for name, (kind, stored) in kinds.items()
        ]
        about = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
        pq.write_table(
            table.replace_schema_metadata({"pandas": json.dumps(about)}), self.root / "meta" / "tasks.parquet"
        )

    def _info(self, rows: list[dict[str, Any]]) -> dict[str, Any]:
        """Return what `meta/info.json` says."""
        return {
            "codebase_version": VERSION,
            "robot_type": self.demos.head["robot"],
            "total_episodes": len(rows),
            "total_frames": rows[-1]["dataset_to_index"] if rows else 0,
            "total_tasks": 1,
            "chunks_size": CHUNK,
            "data_files_size_in_mb": FILE_MB,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": {"train": f"0:{len(rows)}"},
            "data_path": f"data/{FILE}",
            "video_path": None,
            "features": self.features,
        }

    def _write_json(self, name: str, content: Mapping[str, Any]) -> None:
        (self.root / "meta" / f"{name}.json").write_text(json.dumps(content, indent=4), encoding="utf-8")


class _Files:
    """Files of a table that grows, each of about `FILE_MB`."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._number = 0
        self._bytes = 0
        self._writer: pq.ParquetWriter | None = None

    @property
    def place(self) -> tuple[int, int]:
        """Number of the folder of the present file, and its number in there."""
        return divmod(self._number, CHUNK)

    def write(self, table: pa.Table) -> tuple[int, int]:
        """Append rows, in a new file if the present one is full, and return their place."""
        chunk, file = self._place_for(table)
        if self._writer is None:
            path = self._root / FILE.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, table.schema)
            self._bytes = 0
        self._writer.write_table(table)
        self._bytes += table.nbytes
        return chunk, file

    def write_rows(self, rows: list[dict[str, Any]]) -> None:
        """Append rows that name their own place."""
        names = ("meta/episodes/chunk_index", "meta/episodes/file_index")
        table = pa.Table.from_pylist([{**row, **dict.fromkeys(names, 0)} for row in rows])
        for name, number in zip(names, self._place_for(table), strict=True):
            column = pa.array(np.full(len(rows), number))
            table = table.set_column(table.schema.get_field_index(name), name, column)
        self.write(table)

    def _place_for(self, table: pa.Table) -> tuple[int, int]:
        """Return the place of rows that are to be appended; if the present file is full, that of the next one."""
        if self._writer is not None and self._bytes + table.nbytes > FILE_MB * MEGABYTE:
            self.close()
            self._number += 1
        return self.place

    def close(self) -> None:
        """Complete the present file."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None


def statistics_of(columns: Mapping[str, NDArray[Any]]) -> Statistics:
    """Return the statistics of each column of a demonstration: the values that LeRobot's own writer computes.

    Its quantiles come from histograms of 5,000 bins; these are exact.
    """
    found: Statistics = {}
    for name, values in columns.items():
        rows = values.reshape(len(values), -1).astype(np.float64)
        quantiles = np.quantile(rows, QUANTILES, axis=0, method="inverted_cdf")
        found[name] = {
            "min": rows.min(axis=0),
            "max": rows.max(axis=0),
            "mean": rows.mean(axis=0),
            "std": rows.std(axis=0),
            "count": np.array([len(rows)]),
            **{f"q{round(100 * q):02d}": row for q, row in zip(QUANTILES, quantiles, strict=True)},
        }
    return found


def statistics_of_colors(counts: NDArray[np.int64], pictures: int) -> FewStatistics:
    """Return the statistics of some pictures, from 0 to 1, by how often each channel has each value, shape (3, 256).

    Every pixel counts, where LeRobot's own writer takes a part of the pictures, and of their pixels.
    """
    values = np.arange(256) / 255.0
    shares = counts / counts.sum(axis=1, keepdims=True)
    mean = shares @ values
    below = np.cumsum(shares, axis=1)
    found = {
        "min": values[(counts > 0).argmax(axis=1)],
        "max": values[255 - (counts[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt(np.maximum(shares @ values**2 - mean**2, 0.0)),
        **{f"q{round(100 * q):02d}": values[(below >= q - 1e-12).argmax(axis=1)] for q in QUANTILES},
    }
    return {**{word: row.reshape(3, 1, 1) for word, row in found.items()}, "count": np.array([pictures])}


def png(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture as PNG."""
    file = BytesIO()
    Image.fromarray(picture).save(file, "PNG", compress_level=6)
    return file.getvalue()


def joined(statistics: list[Statistics]) -> Statistics:
    """Return the statistics of several demonstrations together, as LeRobot joins them.

    Quantiles are means of those of the demonstrations, weighted by their lengths.
    """
    found: Statistics = {}
    for name in statistics[0] if statistics else ():
        parts = [each[name] for each in statistics]
        counts = np.array([part["count"] for part in parts])
        total = counts.sum()
        mean = sum(part["mean"] * part["count"] for part in parts) / total
        variances = [(part["std"] ** 2 + (part["mean"] - mean) ** 2) * part["count"] for part in parts]
        found[name] = {
            "min": np.min([part["min"] for part in parts], axis=0),
            "max": np.max([part["max"] for part in parts], axis=0),
            "mean": mean,
            "std": np.sqrt(sum(variances) / total),
            "count": np.array([total]),
        }
        for word in (word for word in parts[0] if word.startswith("q")):
            found[name][word] = sum(part[word] * part["count"] for part in parts) / total
    return found


def _plain(statistics: Statistics) -> dict[str, dict[str, list[float]]]:
    return {name: {word: value.tolist() for word, value in each.items()} for name, each in statistics.items()}
