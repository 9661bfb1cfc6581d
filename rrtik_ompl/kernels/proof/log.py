"""What the kernels tell of a proof: by what each pair is proven apart on each interval."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.kernels.tables.memory import aligned
from rrtik_ompl.model.certificate import MotionEntries

FIRST_ROOM = 4096  # records


def logged(packed: ProofPairs, run: Callable[[], object], first_room: int = FIRST_ROOM) -> MotionEntries:
    """What kernels tell while they prove one motion: an entry for each pair and interval, part -1 of a body as a whole.

    Args:
        packed: The table that they read.
        run: Lets them prove the motion; called again where there was too little room.
        first_room: For how many records there is room at first.
    """
    table = packed.table
    room = first_room
    try:
        _give_room(table, room)
        run()
        while table.log_count > room:
            room = 2 * table.log_count  # another run need not come to the same planes
            _give_room(table, room)
            run()
    finally:
        table.log_room = 0

    count = table.log_count
    records = table.log.reshape(-1, layout.LOG_SIZE)[:count].astype(np.int64)
    intervals = records[:, [layout.LOG_LEVEL, layout.LOG_NUMBER]]
    normals = np.array(table.log_ways.reshape(-1, 3)[:count])
    return MotionEntries(packed.sides[records[:, layout.LOG_PAIR]], intervals, normals)


def _give_room(table: ProofTable, room: int) -> None:
    """Empty the log and give it room; the table's address stays."""
    if len(table.log_ways) != 3 * room:
        records = np.zeros(layout.LOG_SIZE * room, dtype=np.int32)
        table.put(log=aligned(records), log_ways=aligned(np.zeros(3 * room)))
    table.log_room = room
    table.log_count = 0
