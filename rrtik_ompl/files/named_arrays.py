"""Named arrays of a `.npz` file of numpy. Pickled objects are never read."""

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

LARGEST_FILE = 2**30  # [bytes] largest size of the file, and of its unpacked content
_NOT_WHOLE: tuple[type[Exception], ...] = (BadZipFile, zlib.error, ValueError, KeyError, OSError, EOFError)
# These are raised for other kinds of zip archives and for wrong sizes in headers.
_NOT_WHOLE += (NotImplementedError, RuntimeError, MemoryError, OverflowError)


class NamedArrays:
    """The arrays of a file, by their names.

    Args:
        path: The file.

    Raises:
        InputError: If the file is not a complete `.npz` file. Lookups raise it for missing arrays; their messages do
            not name the file (see :func:`rrtik_ompl.base.errors.in_file`).
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

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the arrays."""
        return tuple(self._arrays)

    def __contains__(self, name: object) -> bool:
        return name in self._arrays

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return the array of a given name.

        Raises:
            InputError: If there is none.
        """
        if name not in self._arrays:
            raise InputError(f"'{name}' is missing; save it again")
        return self._arrays[name]

    def whole_numbers(self, name: str) -> NDArray[np.int64]:
        """Return an integer array.

        Raises:
            InputError: If there is none of that name, or its numbers are not integers.
        """
        found = self[name]
        if not np.issubdtype(found.dtype, np.integer):
            raise InputError(f"{name}: expected whole numbers")
        return found.astype(np.int64)

    def count(self, name: str) -> int:
        """Return a single integer of at least 0.

        Raises:
            InputError: If there is none of that name, or it is something else.
        """
        found = self.whole_numbers(name)
        if found.ndim != 0 or found < 0:
            raise InputError(f"{name}: expected a whole number of at least 0")
        return int(found)
