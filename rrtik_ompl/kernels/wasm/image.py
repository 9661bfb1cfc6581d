"""Tables as an image of another memory: every table and array gets a place there, and fields that point move along.

Which fields point is said, not guessed. A record knows by the kinds of its fields. Of a table without a class it is
said: to an array of the table itself or to a part of it (the table knows), to another table or an array that belongs to
nobody (``links``), to where another field of the same table points (``same``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.kernels.layout import ALIGNMENT
from rrtik_ompl.kernels.record import Record, holds_array, holds_table, holds_tables
from rrtik_ompl.kernels.tables.memory import PlannedTable, Table

Block: TypeAlias = Record | Table | PlannedTable | NDArray[Any]


class MemoryImage:
    """Blocks of memory one behind the other from an address on.

    Args:
        base: Address of the first one, a multiple of ``ALIGNMENT``.
    """

    def __init__(self, base: int) -> None:
        self._base, self._end = base, base
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

    def add(self, block: Block, links: Mapping[int, Block] | None = None, same: Mapping[int, int] | None = None) -> int:
        """Add a table or an array, unless it is there already; its address.

        Args:
            block: What is added; what ``links`` name must have been added before.
            links: Tables or arrays that fields of the table point to.
            same: Fields that point to where another field does.
        """
        address = _address(block)
        if address in self._places:
            return self._places[address]
        self._blocks.append(block)
        if isinstance(block, np.ndarray):
            return self._append(address, block)
        if isinstance(block, Record):
            return self._append(address, self._moved(block, links or {}))
        header = block.header.copy()
        parts = block.parts if isinstance(block, Table) else ()
        there = {part.address: self.add(part) for part in parts}
        for place, array in block.arrays.items():
            header[place] = self._add_pointing(array, there)
        for place, other in (links or {}).items():
            header[place] = self.place(other)
        for place, other_place in (same or {}).items():
            header[place] = header[other_place]
        return self._append(address, header)

    def bytes(self) -> bytes:
        """The memory from the base on."""
        whole = np.zeros(self._end - self._base, dtype=np.uint8)
        for place, data in self._parts:
            start = place - self._base
            whole[start : start + data.nbytes] = np.frombuffer(data.tobytes(), dtype=np.uint8)
        return whole.tobytes()

    def _moved(self, record: Record, links: Mapping[int, Block]) -> NDArray[np.int64]:
        """The fields of a record in the other memory, after all that they point to."""
        header: NDArray[np.int64] = record.memory.header.copy()
        arrays = record.memory.arrays
        for name, place in record.places.items():
            other = getattr(record, name) if holds_table(record.kinds[name]) else links.get(place)
            if holds_tables(record.kinds[name]):
                moved = np.array([self.add(each) for each in getattr(record, name)], dtype=np.int64)
                header[place] = self._append(_address(arrays[place]), moved)
            elif other is not None:
                header[place] = self.add(other)
            elif place in arrays and holds_array(record.kinds[name]):
                header[place] = self.add(arrays[place])
        return header

    def _add_pointing(self, array: NDArray[Any], there: Mapping[int, int]) -> int:
        """Add an array of a table; addresses of the table's parts in it become those of the other memory."""
        addresses = array.tolist() if there and array.dtype == np.int64 else []
        if not addresses or not there.keys() >= set(addresses):
            return self.add(array)
        return self._append(_address(array), np.array([there[address] for address in addresses]))

    def _append(self, address: int, data: NDArray[Any]) -> int:
        place, self._end = self._end, self._end + -(-max(data.nbytes, 1) // ALIGNMENT) * ALIGNMENT
        self._places[address] = place
        self._parts.append((place, data))
        return place


def _address(block: Block) -> int:
    return int(block.ctypes.data) if isinstance(block, np.ndarray) else block.address
