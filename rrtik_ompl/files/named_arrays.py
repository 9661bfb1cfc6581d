"""Arrays by their names in a file of numpy's `.npz` kind. Objects, which would be unpickled, are never read."""

from __future__ import annotations

import os
import zlib
from io import BytesIO
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.files.text import read_bytes

LARGEST_FILE = 2**30  # bytes, of the file and of what it holds when unpacked
_NOT_WHOLE: tuple[type[Exception], ...] = (BadZipFile, zlib.error, ValueError, KeyError, OSError, EOFError)
_NOT_WHOLE += (NotImplementedError, RuntimeError, MemoryError, OverflowError)  # other kinds of zip; sizes that lie


class NamedArrays:
    """What a file holds.

    Args:
        path: The file.

    Raises:
        InputError: If it is no such file, or half of one; later, if it lacks an array. Messages of the lookups do not
            name the file (see :func:`rrtik_ompl.base.errors.in_file`).
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        stored = read_bytes(path, LARGEST_FILE)
        try:
            with ZipFile(BytesIO(stored)) as archive:
                unpacked = sum(member.file_size for member in archive.infolist())
                at_most(unpacked, LARGEST_FILE, f"{path}: bytes when unpacked", "it is damaged, or not yours")
            with np.load(BytesIO(stored), allow_pickle=False) as data:
                self._arrays = {name: np.asarray(data[name]) for name in data.files}
        except _NOT_WHOLE:
            raise InputError(f"{path}: not a whole .npz file of numbers; save it again") from None

    def __contains__(self, name: object) -> bool:
        return name in self._arrays

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return an array.

        Raises:
            InputError: If there is none of that name.
        """
        if name not in self._arrays:
            raise InputError(f"'{name}' is missing; save it again")
        return self._arrays[name]

    def whole_numbers(self, name: str) -> NDArray[np.int64]:
        """Return an array of whole numbers.

        Raises:
            InputError: If there is none of that name, or it holds anything else.
        """
        found = self[name]
        if not np.issubdtype(found.dtype, np.integer):
            raise InputError(f"{name}: expected whole numbers")
        return found.astype(np.int64)

    def count(self, name: str) -> int:
        """Return a whole number of at least 0.

        Raises:
            InputError: If there is none of that name, or it is anything else.
        """
        found = self.whole_numbers(name)
        if found.ndim != 0 or found < 0:
            raise InputError(f"{name}: expected a whole number of at least 0")
        return int(found)
