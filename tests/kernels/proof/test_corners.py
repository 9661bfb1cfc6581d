"""Corners of solids in blocks: each solid has its own blocks, which hold its corners and nothing else."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.kernels.proof.placed import corner_blocks
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.solid_tables import block_count


@given(st.lists(st.integers(0, 3 * WIDTH), max_size=6))
def test_blocks_hold_the_corners_of_each_solid_in_order(counts: list[int]) -> None:
    rng = np.random.default_rng(len(counts))
    solids = [rng.normal(size=(count, 3)) for count in counts]
    blocks = corner_blocks(solids)
    assert blocks.shape == (sum(map(block_count, solids)), 3, WIDTH)
    first = 0
    for corners in solids:
        held = blocks[first : first + block_count(corners)].transpose(0, 2, 1).reshape(-1, 3)
        assert (held[: len(corners)] == corners).all()
        assert (held[len(corners) :] == corners[-1:]).all()
        first += block_count(corners)
