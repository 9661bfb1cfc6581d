"""Memory of one call of a kernel in a single piece: to ask numpy where an array is takes as long as a small kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.fast.tables.layout import ALIGNMENT

WORD = 8  # bytes


class CallLayout:
    """Where the arrays of a call lie, for all calls of the same size.

    Args:
        arrays: How many words of 8 bytes each has, by the place of its address among the fields. They lie one after
            the other, the first on a multiple of ``ALIGNMENT`` bytes. One of no words has the address 0.
        numbers: The other fields.

    Attributes:
        spans: The words of each array.
        words: Of all.
        fields: Numbers, and how far arrays are from the first one in bytes.
        pointing: 1 for each field that is the address of an array, else 0.
    """

    def __init__(self, arrays: Mapping[int, int], numbers: Mapping[int, int]) -> None:
        self.spans: dict[int, slice] = {}
        self.fields, self.pointing = np.zeros((2, len(arrays) + len(numbers)), dtype=np.int64)
        self.words = 0
        for place, size in arrays.items():
            self.spans[place] = slice(self.words, self.words + size)
            if size:
                self.fields[place], self.pointing[place] = WORD * self.words, 1
            self.words += size
        for place, number in numbers.items():
            self.fields[place] = number


class CallMemory:
    """The fields of a call and the arrays that they point at. Each call has its own, so that threads do not meet.

    Attributes:
        fields: As the kernel reads them.
        address: Where they are.
    """

    def __init__(self, layout: CallLayout) -> None:
        whole = np.empty(ALIGNMENT // WORD + layout.words + len(layout.fields))
        begin = int(whole.ctypes.data)
        unaligned = -begin % ALIGNMENT
        self._spans, self._words = layout.spans, whole[unaligned // WORD :]
        self.fields: NDArray[np.int64] = self._words[layout.words :].view(np.int64)[: len(layout.fields)]
        self.fields[:] = layout.pointing * (begin + unaligned)
        self.fields += layout.fields
        self.address = begin + unaligned + WORD * layout.words

    def __getitem__(self, place: int) -> NDArray[Any]:
        """One of the arrays, its words as float64; not set."""
        return self._words[self._spans[place]]
