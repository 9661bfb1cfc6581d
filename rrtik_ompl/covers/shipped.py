"""Covers of the robots that come along, in a file of the package, so that nobody waits for them on a new machine.

``python bench/ship_covers.py`` writes the file. A cover is found by the hash of its geometry and of the algorithm that
made it, so that one of another version is never taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from rrtik_ompl.arrays import Matrix, frozen
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.named_arrays import NamedArrays

STORE = Path(__file__).with_name("shipped.npz")
COLUMNS = 4  # numbers of a row of any cover


def shipped_cover(key: str) -> Matrix | None:
    """The cover of that hash, shape (n, 4), read-only; None if the package has none."""
    return _stored(STORE).get(key)


def write_store(covers: Mapping[str, Matrix], file: Path = STORE) -> None:
    """Write covers by their hashes; the same ones always make the same file."""
    keys = sorted(covers)
    rows = np.concatenate([np.zeros((0, COLUMNS)), *(covers[key] for key in keys)])
    ends = np.cumsum([len(covers[key]) for key in keys], dtype=np.int64)
    hashes = np.frombuffer(bytes.fromhex("".join(keys)), dtype=np.uint8)
    np.savez_compressed(file, keys=hashes.reshape(len(keys), -1), ends=ends, columns=np.ascontiguousarray(rows.T))


@cache
def _stored(file: Path) -> dict[str, Matrix]:
    """All covers of a file by their hashes; none if it is absent or damaged."""
    try:
        stored = NamedArrays(file)
        keys, ends, rows = stored["keys"], stored["ends"].tolist(), frozen(stored["columns"].T)
    except InputError:
        return {}
    starts = [0, *ends[:-1]]
    return {key.tobytes().hex(): rows[a:b] for key, a, b in zip(keys, starts, ends, strict=True)}
