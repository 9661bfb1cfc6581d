"""Bodies that are compared as one: what is proven of motions is what is proven of each pair for itself."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.kernels.proof import layout, packing
from rrtik_ompl.world.arm_cache import ArmCache
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels


@pytest.fixture(autouse=True)
def forgotten(monkeypatch):
    monkeypatch.setattr(ArmCache, "proof_table", lambda *_: None)  # tables are packed, not copied
    yield
    packing._listed.cache_clear()


def without_groups(monkeypatch):
    monkeypatch.setattr(packing, "compared_as_one", lambda *_: [])
    packing._listed.cache_clear()


def test_pairs_that_are_listed_once_are_those_of_another_scene_with_as_many_things():
    robot = load_robot("panda")
    scenes = [
        rrtik.Scene([rrtik.Obstacle("thing", rrtik.Box(size, 0.1, 0.1), [0.6, 0.3, height])])
        for size, height in ((0.1, 0.2), (0.3, 0.5))
    ]
    World(robot, scenes[0]).prover._packed_for(0.0, 0.0)
    hits = packing._listed.cache_info().hits
    known = World(robot, scenes[1]).prover._packed_for(0.0, 0.0)
    assert packing._listed.cache_info().hits > hits
    packing._listed.cache_clear()
    anew = World(robot, rrtik.Scene(scenes[1].obstacles)).prover._packed_for(0.0, 0.0)
    assert known is not anew
    for name in ("pairs", "sizes", "solids", "sweeps", "reaches", "top_pairs"):
        np.testing.assert_array_equal(getattr(known.table, name), getattr(anew.table, name))


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
    without_groups(monkeypatch)
    alone = World(robot)
    assert not alone.prover._packed_for(0.0, 0.0).groups
    np.testing.assert_array_equal(proven, alone.motions_proven(starts, ends))
    assert 0.05 < proven.mean() < 0.95


def beside_a_base():
    """Small boxes near the base link, which begins their block, and as many far away."""
    rng = np.random.default_rng(1)
    near = rng.uniform([0.2, 0.05, 0.1], [0.35, 0.3, 0.3], (15, 3))
    places = [*near, *rng.uniform(3.0, 4.0, (25, 3))]
    return rrtik.Scene([rrtik.Obstacle(f"box{k}", rrtik.Box((0.02, 0.02, 0.02)), at) for k, at in enumerate(places)])


def beside_what_is_touched():
    """A held rod that may touch the first box of a block."""
    rng = np.random.default_rng(1)
    near = np.vstack([[0.4, -0.1, 0.0], rng.uniform([0.4, -0.1, 0.05], [0.6, 0.1, 0.2], (15, 3))])
    places = [*near, *rng.uniform(3.0, 4.0, (25, 3))]
    boxes = [rrtik.Obstacle(f"box{k}", rrtik.Box((0.02, 0.02, 0.02)), at) for k, at in enumerate(places)]
    rod = rrtik.AttachedObject("rod", "panda_hand", rrtik.Box((0.01, 0.01, 0.1)), (0.0, 0.0, 0.2), padding=0.001)
    return rrtik.Scene(boxes, [rod], contacts=[rrtik.Touching("rod", "box0", -0.001)])


@pytest.mark.parametrize("scene", [beside_a_base, beside_what_is_touched])
def test_a_block_of_which_one_body_needs_no_clearance_keeps_that_of_the_others(scene, monkeypatch):
    robot = load_robot("panda")
    rows = np.random.default_rng(1).uniform(*robot.finite_range(), (3000, robot.dof))
    together = World(robot, scene())
    proven = together.motions_proven(rows, rows, clearance=0.08)
    without_groups(monkeypatch)
    alone = World(robot, scene())
    assert not alone.prover._packed_for(0.0, 0.0).groups
    np.testing.assert_array_equal(proven, alone.motions_proven(rows, rows, clearance=0.08))
    assert proven.any()
