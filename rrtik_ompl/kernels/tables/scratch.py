"""Scratch memory: what kernels compute in."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.memory import packed, whole_lanes


def scratch_table(
    arm: layout.ArmTable,
    balls: tuple[layout.BallTable, layout.BallTable],
    bounds: layout.BoundTable,
    primitives: tuple[layout.PrimitiveTable, layout.PrimitiveTable],
) -> layout.ScratchTable:
    """Memory for one thread that checks with these tables; the frame of the world is in place."""
    outer, inner = balls
    body_count = max(outer.body_count, inner.body_count)
    pair_count = max(outer.pair_count, inner.pair_count)
    frames = np.zeros((arm.joint_count + 1, layout.POSE_NUMBERS, WIDTH), dtype=np.float32)
    frames[0, layout.ROTATION : layout.ROTATION + 9] = np.eye(3).reshape(9, 1)
    ball_count = max(len(outer.balls), len(inner.balls)) // layout.BALL_FLOATS
    numbers = np.zeros(max(each.padded_count for each in primitives), dtype=np.int32)
    crossing = body_count * max(each.standing_count for each in primitives)

    return packed(
        layout.ScratchTable,
        values=np.zeros((len(frames), WIDTH)),
        frames=frames,
        group_centres=np.zeros((max(outer.group_count, inner.group_count), 3, WIDTH), dtype=np.float32),
        centres=np.zeros((ball_count, 3, WIDTH), dtype=np.float32),
        placed=np.zeros(max(outer.cluster_count, inner.cluster_count), dtype=np.int32),
        found=numbers,
        near=numbers,
        met=numbers,
        waiting=np.zeros(WIDTH, dtype=np.int32),
        outer_likely=np.full((layout.LIKELY_COUNT, layout.LIKELY_INTS), -1, dtype=np.int32),
        inner_likely=np.full((layout.LIKELY_COUNT, layout.LIKELY_INTS), -1, dtype=np.int32),
        note=np.zeros(WIDTH, dtype=np.float32),
        watch=np.zeros(bounds.blocks * WIDTH, dtype=np.float32),
        marks=whole_lanes(np.zeros(crossing + pair_count, dtype=np.int32)),
    )


def probe_table(primitives: tuple[layout.PrimitiveTable, layout.PrimitiveTable]) -> layout.ProbeTable:
    """Memory for measuring distances against any of these tables of primitives."""
    listed = max(each.padded_count for each in primitives)
    return packed(
        layout.ProbeTable,
        best=np.zeros(WIDTH, dtype=np.float32),
        which=np.zeros(WIDTH, dtype=np.int32),
        gaps=np.zeros((listed, WIDTH), dtype=np.float32),
    )
