"""Bodies that are compared as one: what is proven of motions is what is proven of each pair for itself."""

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.kernels.proof import layout, packing
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("name", ["panda", "ur5_gripper"])
def test_a_gripper_that_is_compared_as_one_is_apart_from_links_where_its_parts_are(name, monkeypatch):
    robot = load_robot(name)
    rng = np.random.default_rng(7)
    starts = rng.uniform(*robot.finite_range(), (400, robot.dof))
    ends = starts + rng.normal(size=starts.shape) * 0.3
    together = World(robot)
    table = together.prover._packed_for(0.0, 0.0)
    pairs = table.table.pairs.reshape(-1, layout.PAIR_SIZE)
    several = pairs[:, layout.PAIR_ONE] >= table.firsts[-1]  # their solids come last
    assert (pairs[several, layout.PAIR_BASE] > 0).any()
    proven = together.motions_proven(starts, ends)
    monkeypatch.setattr(packing, "compared_as_one", lambda *_, **__: [])
    alone = World(robot)
    assert not alone.prover._packed_for(0.0, 0.0).groups
    np.testing.assert_array_equal(proven, alone.motions_proven(starts, ends))
    assert 0.05 < proven.mean() < 0.95
