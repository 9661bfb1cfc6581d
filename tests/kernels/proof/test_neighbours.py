"""Neighbours of an arm: what a table of cells says of two links is what coal says of them at each configuration."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.kernels.layout import CELLS, CELLS_APART, COLLIDING, FREE, UNDECIDED
from rrtik_ompl.kernels.proof.neighbours import joints_between
from rrtik_ompl.kernels.tables.packing import MOST_LOOKED_UP
from rrtik_ompl.world import arm_cache
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels
STEP = 2.0 * np.pi / CELLS
ARMS = ("ur5", "ur10", "puma560", "titan4", "panda")
LOOKS = 25


@pytest.fixture(autouse=True)
def every_pair_of_neighbours(monkeypatch):
    """Tables also for links whose covers tell enough."""
    monkeypatch.setattr(arm_cache, "OFTEN", -1.0)


def tables(name):
    """A world of an arm that nobody else has a table of, and its tables, by the numbers of the links."""
    world = World(replace(load_robot(name), name=f"{name} of neighbours"))
    return world, arm_cache.arm_cache(world.robot).cells(world.bodies, world.pairs)


def distances(robot, pair, values):
    """Of two links by coal, at rows of joint values."""
    links = link_bodies(robot)
    free = replace(robot.chain, gain=np.eye(len(robot.chain.parent)), offset=np.zeros(len(robot.chain.parent)))
    bodies = [links[k] for k in pair]
    return [next(measured(bodies, [(0, 1)], frames, near_only=False)).distance for frames in free.joint_frames(values)]


@pytest.mark.parametrize("name", ARMS)
def test_links_are_apart_by_coal_in_each_cell_that_says_so(name):
    world, known = tables(name)
    assert known
    rng = np.random.default_rng(4)
    for pair, cells in known.items():
        assert set(cells.joints) == set(joints_between(world.robot.chain, *(link_bodies(world.robot)[k] for k in pair)))
        there = np.argwhere(cells.apart)
        chosen = there[rng.integers(len(there), size=LOOKS)]
        place = np.where(rng.random((LOOKS, 2)) < 0.5, rng.random((LOOKS, 2)), rng.integers(2, size=(LOOKS, 2)))
        turns = rng.integers(-2, 3, size=(LOOKS, 2))
        values = rng.uniform(-3.0, 3.0, (LOOKS, len(world.robot.chain.parent)))
        values[:, cells.joints] = (chosen + place + CELLS * turns) * STEP
        assert min(distances(world.robot, pair, values)) >= CELLS_APART - 1e-9


def test_cells_are_few_where_links_touch():
    world, known = tables("ur5")
    rng = np.random.default_rng(5)
    for pair, cells in known.items():
        values = rng.uniform(-np.pi, np.pi, (150, len(world.robot.chain.parent)))
        touching = np.array(distances(world.robot, pair, values)) < CELLS_APART
        row, column = (np.floor(values[:, cells.joints] / STEP).astype(int) % CELLS).T
        assert touching.any()
        assert not cells.apart[row, column][touching].any()
        assert cells.apart[row, column][~touching].mean() > 0.9


def test_the_words_of_kernels_are_the_cells_and_those_with_all_around_them():
    _, known = tables("ur5")
    cells = next(iter(known.values()))
    words = cells.words
    bits = (words[:, None] >> np.arange(CELLS)) & 1
    np.testing.assert_array_equal(bits[:CELLS], cells.apart)
    rows, columns = np.nonzero(bits[CELLS:])
    for row, column in zip(rows, columns, strict=True):
        around = np.ix_(*((np.arange(k - 1, k + 2) % CELLS) for k in (row, column)))
        assert cells.apart[around].all()
    assert 0 < len(rows) < cells.apart.sum()


@pytest.fixture(params=["ur5", "panda"])
def worlds(request, monkeypatch):
    """A world whose neighbours are looked up, of the Panda its hand as one body, and the same one without cells."""
    world, known = tables(request.param)
    count = len({id(cells) for cells in known.values()})
    assert world.fast.table.neighbours.count == count > 0
    assert (world.prover.table(0.0).looked_up >= 0).sum() >= count
    monkeypatch.setattr(arm_cache.ArmCache, "cells", lambda self, bodies, pairs: {})
    other = World(replace(world.robot, name="without cells"))
    assert other.fast.table.neighbours.count == 0
    assert (other.prover.table(0.0).looked_up < 0).all()
    return world, other


def motions(robot, count):
    """Random ones of 1 rad, and the numbers of steps that they are checked in."""
    rng = np.random.default_rng(6)
    lower, upper = robot.finite_range()
    A = rng.uniform(lower, upper, (count, robot.dof))
    way = rng.normal(size=A.shape)
    B = np.clip(A + way / np.linalg.norm(way, axis=1)[:, None], lower, upper)
    return A, B, np.full(count, 40)


def test_answers_of_checks_with_and_without_cells_agree(worlds):
    A, B, steps = motions(worlds[0].robot, 400)
    for ask in (
        lambda fast, **how: fast.classify(A, **how),
        lambda fast, **how: fast.classify_edges(A, B, steps, **how),
    ):
        by_cells, by_balls = (ask(world.fast) for world in worlds)
        assert (by_balls[by_cells != by_balls] == UNDECIDED).all()
        quick = ask(worlds[0].fast, resolve=False)
        assert not ((quick == FREE) & (by_balls == COLLIDING)).any()
        assert (quick == FREE).any()
    np.testing.assert_array_equal(*(world.motion_valid_batch(A, B) for world in worlds))


def test_motions_that_cells_prove_are_free_and_have_certificates(worlds):
    world, other = worlds
    A, B, _ = motions(world.robot, 200)
    proven = world.motions_proven(A, B)
    assert proven[other.motions_proven(A, B)].all()
    assert other.motion_valid_batch(A[proven], B[proven]).all()
    assert proven.any()
    for k in np.flatnonzero(proven)[:5]:
        assert world.prover.certificate(np.stack([A[k], B[k]]), 0.0) is not None


@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_cells_count_only_where_links_keep_no_more_than_they_prove(margin):
    world = World(replace(load_robot("ur5"), name="ur5 of neighbours"), self_margin=margin)
    looked_up = world.fast.table.neighbours.count
    assert looked_up == (0 if margin > CELLS_APART else 2)
    rows = np.random.default_rng(8).uniform(-np.pi, np.pi, (100, world.robot.dof))
    free = world.valid_batch(rows)
    for k in np.flatnonzero(world.motions_proven(rows, rows)):
        assert free[k]


def test_a_copy_for_another_thread_keeps_the_cells_that_it_reads_and_takes_over_no_log():
    world, _ = tables("ur5")
    packed = world.prover._packed_for(0.0, 0.0)
    packed.table.log_room = 8
    cells = weakref.ref(packed.table.neighbours)
    own = packed.for_thread()
    assert packed.table.neighbours.count > 0
    del world, packed
    gc.collect()
    assert own.table.neighbours is cells() is not None
    assert own.table.log_room == 0


LINK = """<link name="l{0}"><collision><origin xyz="0.1 0 0"/><geometry><box size="0.16 0.02 0.02"/></geometry>
</collision></link><joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/><origin xyz="0.2 0 0"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""


def test_more_neighbours_than_a_set_of_bits_holds_are_compared_like_all_others():
    count = MOST_LOOKED_UP + 8
    links = "".join(LINK.format(k + 1, k) for k in range(count))
    world = World(robot_from_urdf_text(f'<robot name="snake"><link name="l0"/>{links}</robot>'))
    assert world.fast.table.neighbours.count == MOST_LOOKED_UP
    folds = np.array(
        [np.where((np.arange(count) == k) | (np.arange(count) == k + 1), 2.6, 0.0) for k in range(1, count - 1)]
    )
    assert (world.fast.classify(folds) == COLLIDING).all()
    assert (world.fast.classify_edges(np.zeros_like(folds), folds, np.full(len(folds), 40)) != FREE).all()
    assert world.fast.classify(np.zeros((1, count))) == FREE
