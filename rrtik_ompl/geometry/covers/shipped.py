"""Covers of the robots that come along, in a file of the package, so that nobody waits for them on a new machine.

``python -m bench ship_covers`` writes the file. A cover is found by the hash of its geometry and of the algorithm that
made it, so that one of another version is never taken.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.named_arrays import NamedArrays

STORE = Path(__file__).with_name("shipped.npz")
COLUMNS = 4  # numbers of a row of any cover


def shipped_cover(key: str, file: Path = STORE) -> Matrix | None:
    """The cover of that hash, shape (n, 4), read-only; None if the package has none."""
    packed = _stored(file).get(key)
    return None if packed is None else _unpacked(packed)


def write_store(covers: Mapping[str, Matrix], file: Path = STORE) -> None:
    """Write covers by their hashes; the same ones always make the same file.

    Each is packed by itself: a robot needs few of them, and to unpack all takes longer than to load the robot.
    """
    keys = sorted(covers)
    packed = [zlib.compress(np.ascontiguousarray(covers[key].T, dtype=np.float64).tobytes(), 9) for key in keys]
    ends = np.cumsum([len(part) for part in packed], dtype=np.int64)
    hashes = np.frombuffer(bytes.fromhex("".join(keys)), dtype=np.uint8)
    data = np.frombuffer(b"".join(packed), dtype=np.uint8)
    np.savez(file, keys=hashes.reshape(len(keys), -1), ends=ends, packed=data)


@cache
def _stored(file: Path) -> dict[str, bytes]:
    """All covers of a file by their hashes, packed; none if it is absent or damaged."""
    try:
        stored = NamedArrays(file)
        keys = stored["keys"]
        ends = stored["ends"].tolist()
        packed = stored["packed"].tobytes()
    except InputError:
        return {}

    starts = [0, *ends[:-1]]
    return {key.tobytes().hex(): packed[a:b] for key, a, b in zip(keys, starts, ends, strict=True)}


@cache
def _unpacked(packed: bytes) -> Matrix | None:
    """A cover; None if it is damaged."""
    try:
        columns = np.frombuffer(zlib.decompress(packed)).reshape(COLUMNS, -1)
    except (zlib.error, ValueError):
        return None
    return frozen(columns).T
