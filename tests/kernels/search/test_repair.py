"""A path's look and repair in kernels: as in Python where both do the same, free all along, the ends kept."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.budget import no_stop
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.kernels.search.repair import PathRepair
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.replanning.connecting import PythonConnect, TreeOptions
from rrtik_ompl.replanning.drrt_con import DrrtCon, KernelDrrtCon
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels

LOW, HIGH = np.zeros(2), np.full(2, 20.0)


def repairing(world, max_edge=1.0, iterations=4000, tries=24):
    low, high = world.robot.finite_range()
    return PathRepair(
        world.motions, low, high, max_edge=max_edge, iterations=iterations, tries=tries, patience=tries
    )  # fmt: skip


def wall(y, high):
    return Obstacle("wall", Box([2.0, high, 1.0]), pin.SE3(np.eye(3), np.array([10.0, y, 0.0])))


def plane(high):
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, 20], [0, 20]]})
    return MovingWorld(World(robot, Scene((wall(10.0, high),)), motion_resolution=0.05))


def walled():
    """A plane with a wall, and a straight path through it."""
    world = plane(12.0)
    return world, np.array([[1.0, 10.0], [4.0, 10.0], [19.0, 10.0]])


def free(world, path):
    return world.motion_valid_batch(path[:-1], path[1:]).all()


@pytest.mark.parametrize("name", ["ur5", "titan4"])
def test_a_look_finds_what_python_finds_and_asks_for_as_many_configurations(name):
    robot, rng = load_robot(name), np.random.default_rng(3)
    ball = Obstacle("ball", Sphere(0.4), robot.fk(np.full(robot.dof, 0.3)))
    world = MovingWorld(World(robot, Scene((ball,))))
    low, high = robot.finite_range()
    answers = []
    for _ in range(20):
        path = 0.4 * rng.uniform(low, high, (3, robot.dof))
        plain = DrrtCon(PythonConnect(TreeOptions(low, high, 1.0, 0)), 1.0)
        kernel = KernelDrrtCon(world, TreeOptions(low, high, 1.0, 0))
        plain.path = kernel.path = path
        before = world.checked
        answers.append(plain.check_path(world))
        between = world.checked
        assert kernel.check_path(world) == answers[-1]
        assert world.checked - between == between - before
    assert 0 < sum(answers) < len(answers)


def test_a_repair_keeps_both_ends_and_the_free_pieces_next_to_them():
    world, path = walled()
    repair = repairing(world)
    assert not repair.check(path)
    for seed in range(20):
        found = repair.repair(seed, no_stop)
        repair.check(path)
        assert free(world, found)
        assert (found[[0, -1]] == path[[0, -1]]).all()
        assert np.linalg.norm(np.diff(found, axis=0), axis=1).sum() < 40.0


def test_the_same_seed_gives_the_same_repair():
    world, path = walled()
    found = []
    for repair in (repairing(world), repairing(world)):
        repair.check(path)
        found.append(repair.repair(5, no_stop))
    assert (found[0] == found[1]).all()


def test_from_scratch_none_of_the_path_is_kept():
    world, path = walled()
    bent = np.vstack([path[:1], [[4.0, 2.0]], path[1:]])
    repair = repairing(world)
    repair.check(bent)
    assert (repair.repair(1, no_stop) == bent[1]).all(axis=1).any()
    repair.check(bent)
    assert not (repair.repair(1, no_stop, forgetting=True) == bent[1]).all(axis=1).any()


@pytest.mark.parametrize("end", [0, -1])
def test_a_blocked_end_has_no_repair(end):
    world, path = walled()
    path[end] = [10.0, 10.0]
    repair = repairing(world)
    assert not repair.check(path)
    assert repair.repair(0, no_stop) is None


def test_a_search_gives_up_when_told_to_and_when_its_samples_are_spent():
    world = plane(20.0)
    path = np.array([[1.0, 10.0], [19.0, 10.0]])
    told, spent = repairing(world, iterations=10**9), repairing(world, iterations=300)
    for repair, stop in ((told, lambda: True), (spent, no_stop)):
        assert not repair.check(path)
        assert repair.repair(0, stop) is None


def test_memory_grows_with_what_a_path_needs():
    world, path = walled()
    repair = repairing(world, max_edge=0.02, iterations=10**6, tries=0)
    assert not repair.check(path)
    found = repair.repair(2, no_stop)
    assert len(found) > 256
    assert free(world, found)
    assert repair.check(found)


def test_a_path_of_one_configuration_can_be_looked_at():
    world, path = walled()
    repair = repairing(world)
    assert repair.check(path[:1])
    assert not repair.check(np.array([[10.0, 10.0]]))


def test_points_at_which_a_path_goes_straight_on_fall_away():
    world, path = walled()
    repair = repairing(world)
    repair.check(path)
    found = repair.repair(3, no_stop)
    ways = np.diff(found, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    assert lengths.min() > 0.0
    assert np.linalg.norm(np.diff(ways / lengths[:, None], axis=0), axis=1).min() > 1e-9


def test_what_has_moved_is_seen_by_the_next_look():
    world, path = walled()
    repair = repairing(world)
    assert not repair.check(path)
    world.move(Scene((wall(40.0, 12.0),)))
    assert repair.check(path)


def test_a_world_without_kernels_is_refused(monkeypatch):
    world = plane(1.0)
    monkeypatch.setattr(MovingWorld, "fast", None)
    with pytest.raises(InputError, match="install numba"):
        KernelDrrtCon(world, TreeOptions(LOW, HIGH, 1.0, 0))
