"""Tables as an image of another memory: every table and array gets a place there, and fields that point move along.

Which fields point is said by their kinds (:mod:`rrtik_ompl.kernels.record`), not guessed.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.kernels.layout import ALIGNMENT
from rrtik_ompl.kernels.record import Record, holds_array, holds_table, holds_tables

Block: TypeAlias = Record | NDArray[Any]


class MemoryImage:
    """Blocks of memory one behind the other from an address on.

    Args:
        base: Address of the first one, a multiple of ``ALIGNMENT``.
    """

    def __init__(self, base: int) -> None:
        self._base = base
        self._end = base
        self._places: dict[int, int] = {}  # by the address here
        self._parts: list[tuple[int, NDArray[Any]]] = []
        self._blocks: list[Block] = []  # which must live as long as their addresses are asked for

    @property
    def end(self) -> int:
        """The first address behind it."""
        return self._end

    def place(self, block: Block) -> int:
        """The address of a table or an array in the other memory.

        Raises:
            KeyError: If it has not been added.
        """
        return self._places[_address(block)]

    def add(self, block: Block) -> int:
        """Add a table with all that it points to, or an array, unless it is there already; its address."""
        address = _address(block)
        if address in self._places:
            return self._places[address]

        self._blocks.append(block)
        return self._append(address, block if isinstance(block, np.ndarray) else self._moved(block))

    def bytes(self) -> bytes:
        """The memory from the base on."""
        whole = np.zeros(self._end - self._base, dtype=np.uint8)
        for place, data in self._parts:
            start = place - self._base
            whole[start : start + data.nbytes] = np.frombuffer(data.tobytes(), dtype=np.uint8)
        return whole.tobytes()

    def _moved(self, record: Record) -> NDArray[np.int64]:
        """The fields of a table in the other memory, after all that they point to."""
        header: NDArray[np.int64] = record.memory.header.copy()
        arrays = record.memory.arrays

        for name, place in record.places.items():
            kind = record.kinds[name]
            if holds_table(kind):
                table = getattr(record, name)
                header[place] = 0 if table is None else self.add(table)
            elif holds_tables(kind):
                addresses = [self.add(table) for table in getattr(record, name)]
                header[place] = self._append(_address(arrays[place]), np.array(addresses, dtype=np.int64))
            elif holds_array(kind) and place in arrays:
                header[place] = self.add(arrays[place])

        return header

    def _append(self, address: int, data: NDArray[Any]) -> int:
        place, self._end = self._end, self._end + -(-max(data.nbytes, 1) // ALIGNMENT) * ALIGNMENT
        self._places[address] = place
        self._parts.append((place, data))
        return place


def _address(block: Block) -> int:
    return int(block.ctypes.data) if isinstance(block, np.ndarray) else block.address
