"""The motion table of a world: one rule of steps for Python and kernels, one table for all searches in the world."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.kernels import COLLIDING, FREE, UNDECIDED
from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.motions.motion_kernels import step_count
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions, step_counts
from rrtik_ompl.kernels.search.motions.row_kernels import row_at
from rrtik_ompl.kernels.simd.compiled import entry
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels

MOTIONS = 1_000_000


@entry
def write_steps(motions: MotionTable, starts: Configuration, ends: Configuration, count: int, sink: Ints) -> int:
    for k in range(count):
        sink[k] = step_count(motions, row_at(starts, motions.dof, k), row_at(ends, motions.dof, k))
    return count


def steps_in_kernels(motions: FastMotions, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    found = np.zeros(len(starts), dtype=np.int32)
    rows = starts.view(Configuration), ends.view(Configuration)
    write_steps(motions.table, *rows, len(starts), found.view(Ints))
    return found


def answers_in_kernels(motions: FastMotions, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """FREE, UNDECIDED or COLLIDING for motions between free ends: a search without samples joins, asks or gives up."""
    low, high = (side.min(axis=0) for side in (np.minimum(starts, ends), -np.maximum(starts, ends)))
    search, asked = ConnectSearch(motions, low, -high), []

    def ask(A: np.ndarray, B: np.ndarray) -> np.ndarray:
        asked.append((A, B))
        return np.zeros(len(A), dtype=bool)

    answers = []
    for start, end in zip(starts, ends, strict=True):
        asked.clear()
        path = search.solve(start[None], end[None], 1, ask=ask if motions.resolve else None, max_iterations=0)
        answers.append(UNDECIDED if asked else COLLIDING if path is None else FREE)
    return np.array(answers)


def ball(x: float) -> Obstacle:
    return Obstacle("ball", Sphere(0.2), pin.SE3(np.eye(3), np.array([x, 0.3, 0.5])))


def arm_world(name: str = "ur5", **options: float | str) -> World:
    return World(load_robot(name), Scene((ball(0.5),)), **options)


def motions_within(world: World, count: int, share: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng, (low, high) = np.random.default_rng(seed), world.robot.finite_range()
    starts = rng.uniform(low, high, (count, len(low)))
    return starts, starts + share * rng.uniform(0.0, 1.0, (count, 1)) * (rng.uniform(low, high, starts.shape) - starts)


def between_free_ends(
    world: World | MovingWorld, starts: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    free = world.valid_batch(starts) & world.valid_batch(ends)
    return starts[free], ends[free]


def test_python_and_kernels_divide_a_million_motions_alike() -> None:
    each = MOTIONS // 4
    for name, share in (("ur5", 0.5), ("titan4", 1e-3), ("planar3", 1.0), ("puma560", 0.05)):
        world = arm_world(name, motion_resolution=0.013)
        starts, ends = motions_within(world, each, share)
        expected = step_counts(starts, ends, world.weights, world.motion_resolution)
        np.testing.assert_array_equal(steps_in_kernels(world.motions, starts, ends), expected)
        assert expected.max() > expected.min() == 1
        for k in range(0, each, each // 10):
            assert world.steps(starts[k], ends[k]) == world.steps(ends[k], starts[k]) == expected[k]


def test_a_motion_of_a_whole_number_of_steps_takes_that_number_wherever_it_is() -> None:
    world = arm_world("ur5")
    rng, counts = np.random.default_rng(1), np.arange(1, 2001)
    starts = rng.uniform(-3.0, 3.0, (len(counts), 6))
    ends = starts.copy()
    ends[:, 0] += counts * world.motion_resolution / world.weights[0]
    np.testing.assert_array_equal(step_counts(starts, ends, world.weights, world.motion_resolution), counts)
    np.testing.assert_array_equal(steps_in_kernels(world.motions, starts, ends), counts)


def test_steps_by_length_are_taken_where_they_are_more() -> None:
    world = arm_world("ur5")
    chain, starts, ends = world.robot.chain, *motions_within(world, 1000, 0.3)
    rule = {"weights": world.weights, "resolution": world.motion_resolution}
    motions = FastMotions(world.fast, chain.gain, chain.offset, **rule, steps_per_unit=100.0)
    by_length = np.ceil(100.0 * np.linalg.norm(ends - starts, axis=1) - 1e-9)
    expected = np.maximum(step_counts(starts, ends, **rule), by_length)
    np.testing.assert_array_equal(steps_in_kernels(motions, starts, ends), expected)


@pytest.mark.parametrize("accuracy", ["exact", "conservative"])
def test_a_motion_is_checked_in_kernels_as_by_the_world(accuracy: str) -> None:
    wall = Obstacle("wall", Box([0.1, 1.0, 1.0]), pin.SE3(np.eye(3), np.array([1.2, 0.0, 0.5])))
    world = World(load_robot("titan4"), Scene((wall,))).with_accuracy(accuracy)
    starts, ends = between_free_ends(world, *motions_within(world, 800, 1.0))
    for a, b in ((starts, ends), (ends, starts)):
        sides = world.robot.joint_values(a), world.robot.joint_values(b)
        steps = step_counts(a, b, world.weights, world.motion_resolution)
        forward = np.array([tuple(p) <= tuple(q) for p, q in zip(a, b, strict=True)])
        first, second = (np.where(forward[:, None], *pair) for pair in (sides, sides[::-1]))
        found = answers_in_kernels(world.motions, a, b)
        np.testing.assert_array_equal(found, world.fast.classify_edges(first, second, steps))
    assert 0 < (found == FREE).sum() < len(found)
    assert world.motions.resolve


def test_a_configuration_is_proven_free_in_kernels_as_by_the_world() -> None:
    world = arm_world("titan4")
    rows, _ = motions_within(world, 500, 0.0)
    search = ConnectSearch(world.motions, *world.robot.finite_range())
    answers = world.fast.classify(world.robot.joint_values(rows), resolve=False)
    assert [search.proven_free(row[None]) for row in rows] == (answers == FREE).tolist()


def test_a_world_keeps_its_motion_table_and_makes_another_for_other_rules() -> None:
    world = arm_world()
    motions = world.motions
    assert world.motions is motions
    careful = world.with_accuracy("conservative")
    assert careful.motions is motions  # it differs in what is asked of coal alone
    finer = world.with_resolution(0.5 * world.motion_resolution)
    assert finer.motions.resolution == 0.5 * motions.resolution
    assert finer.motions.fast is motions.fast


def test_the_motion_table_of_a_moving_world_stays_when_obstacles_move() -> None:
    world = MovingWorld(arm_world())
    motions, drawn = world.motions, motions_within(arm_world(), 400, 0.2)
    asked = []
    for x in (0.5, -0.4):
        world.move(Scene((ball(x),)))
        assert world.motions is motions
        assert not motions.resolve
        starts, ends = between_free_ends(world, *drawn)
        free = answers_in_kernels(motions, starts, ends) == FREE
        np.testing.assert_array_equal(free, world.motion_valid_batch(starts, ends))
        assert 0 < free.sum() < len(free)
        asked.append(starts)
    assert len(asked[0]) != len(asked[1])


def test_a_world_in_which_nothing_is_free_has_no_motion_table() -> None:
    around_the_base = Obstacle("block", Box([1.0, 1.0, 1.0]))
    assert World(load_robot("ur5"), Scene((around_the_base,))).motions is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"resolution": 0.0}, "resolution"),
        ({"weights": np.ones(5)}, "weights"),
        ({"gain": np.eye(6)[:5], "offset": np.zeros(5)}, "gain"),
        ({"offset": np.zeros(5)}, "offset"),
    ],
)
def test_a_rule_that_makes_no_sense_is_refused(wrong: dict[str, object], words: str) -> None:
    world = arm_world()
    chain = world.robot.chain
    rule = {"gain": chain.gain, "offset": chain.offset, "weights": world.weights, "resolution": 0.01}
    with pytest.raises(InputError, match=words):
        FastMotions(world.fast, **{**rule, **wrong})
