"""Scratch memory: what kernels compute in."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import Table, table, whole_lanes


def scratch_table(arm: Table, balls: tuple[Table, ...], bounds: Table, primitives: tuple[Table, ...]) -> Table:
    """Memory for one thread that checks with these tables; the frame of the world is in place."""

    def most(tables: tuple[Table, ...], place: int) -> int:
        return max(int(t.header[place]) for t in tables)

    frames = np.zeros((int(arm.header[layout.JOINT_COUNT]) + 1, layout.POSE_NUMBERS, WIDTH), dtype=np.float32)
    frames[0, layout.ROTATION : layout.ROTATION + 9] = np.eye(3).reshape(9, 1)
    ball_count = max(len(t[layout.BALLS]) // layout.BALL_FLOATS for t in balls)
    numbers = np.zeros(most(primitives, layout.PADDED_COUNT), dtype=np.int32)
    crossing = most(balls, layout.BODY_COUNT) * most(primitives, layout.STANDING_COUNT)
    return table(
        {
            layout.VALUES: np.zeros((len(frames), WIDTH)),
            layout.FRAMES: frames,
            layout.GROUP_CENTRES: np.zeros((most(balls, layout.GROUP_COUNT), 3, WIDTH), dtype=np.float32),
            layout.CENTRES: np.zeros((ball_count, 3, WIDTH), dtype=np.float32),
            layout.PLACED: np.zeros(most(balls, layout.CLUSTER_COUNT), dtype=np.int32),
            layout.FOUND: numbers,
            layout.NEAR: numbers,
            layout.MET: numbers,
            layout.WAITING: np.zeros(WIDTH, dtype=np.int32),
            layout.OUTER_LIKELY: np.full((layout.LIKELY_COUNT, layout.LIKELY_INTS), -1, dtype=np.int32),
            layout.INNER_LIKELY: np.full((layout.LIKELY_COUNT, layout.LIKELY_INTS), -1, dtype=np.int32),
            layout.NOTE: np.zeros(WIDTH, dtype=np.float32),
            layout.WATCH: np.zeros(int(bounds.header[layout.BOUND_BLOCKS]) * WIDTH, dtype=np.float32),
            layout.MARKS: whole_lanes(np.zeros(crossing + most(balls, layout.PAIR_COUNT), dtype=np.int32)),
        }
    )


def probe_table(primitives: tuple[Table, ...]) -> Table:
    """Memory for measuring distances against any of these tables of primitives."""
    listed = max(int(t.header[layout.PADDED_COUNT]) for t in primitives)
    return table(
        {
            layout.BEST: np.zeros(WIDTH, dtype=np.float32),
            layout.WHICH: np.zeros(WIDTH, dtype=np.int32),
            layout.GAPS: np.zeros((listed, WIDTH), dtype=np.float32),
        }
    )
