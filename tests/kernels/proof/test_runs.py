"""Solids at rest that are compared in lanes: what is proven of motions is what is proven of each pair for itself."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels.proof import layout, packing

pytestmark = pytest.mark.kernels


def boxes(count):
    rng = np.random.default_rng(1)
    radius, turn, height = rng.uniform([[0.4], [-np.pi], [0.0]], [[0.9], [np.pi], [1.0]], (3, count))
    centres = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return [
        rrtik.Obstacle(f"box{k}", rrtik.Box(rng.uniform(0.03, 0.15, 3)), centre) for k, centre in enumerate(centres)
    ]


@pytest.mark.parametrize("count", [20, 60])  # alone, and in blocks
def test_lanes_prove_what_single_pairs_prove(count, monkeypatch):
    robot = rrtik.load_robot("panda")
    rng = np.random.default_rng(7)
    starts = rng.uniform(*robot.finite_range(), (400, robot.dof))
    ends = starts + rng.normal(size=starts.shape) * 0.3
    scene = rrtik.Scene(boxes(count))
    in_lanes = rrtik.World(robot, scene)
    table = in_lanes.prover._packed_for(0.0, 0.0).table
    lengths = table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.RUN_LENGTH]
    assert lengths.max() > 4  # a run is at most as long as a vector of the processor has room for

    proven = in_lanes.motions_proven(starts, ends, clearance=0.01)
    monkeypatch.setattr(packing, "SHORTEST_RUN", count + 1)
    alone = rrtik.World(robot, scene)
    np.testing.assert_array_equal(proven, alone.motions_proven(starts, ends, clearance=0.01))
    assert 0.02 < proven.mean() < 0.98
