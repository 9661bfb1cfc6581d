"""Trees along path constraints: kernels agree with numpy, and what is found keeps the regions."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.constraints.residuals import projected_rows
from rrtik_ompl.ik.held_tables import held_tables
from rrtik_ompl.kernels.search.constrained.search import ConstrainedSearch
from rrtik_ompl.model.scene import Scene

pytestmark = pytest.mark.kernels

ROBOTS = ("ur5_limited", "panda", "titan4")


def cases(name):
    """A robot, a configuration, and sets of regions around it."""
    robot = rrtik.load_robot(name)
    q = np.random.default_rng(11).uniform(*robot.finite_range())
    T = robot.fk(q)
    sets = [
        [rrtik.constraints.upright(robot, "x")],
        [rrtik.constraints.orientation_of(T, 3.0)],
        [rrtik.constraints.orientation_of(T, [5.0, 10.0, 20.0])],
        [rrtik.constraints.on_plane(T.translation, [0.0, 0.6, 0.8])],
        [rrtik.constraints.on_line(T.translation, [1.0, 0.0, 0.0])],
        [rrtik.constraints.inside(T, [0.1, 0.2, 0.3])],
        [rrtik.constraints.upright(robot), rrtik.constraints.on_plane(T.translation, [0.0, 0.0, 1.0])],
    ]
    return robot, q, [held_regions(robot, Scene(), regions, q) for regions in sets]


@pytest.mark.parametrize("name", ROBOTS)
def test_projection_in_kernels_is_that_of_numpy(name):
    robot, q, sets = cases(name)
    Q = robot.clamp(q + np.random.default_rng(12).normal(0.0, 0.2, (40, robot.dof)))
    for held in sets:
        tables = held_tables(robot, held)
        rows, there = tables.project(Q)
        expected, reached = projected_rows(robot, held, Q)
        np.testing.assert_array_equal(there, reached)
        np.testing.assert_allclose(rows[there], expected[there], atol=1e-9)
        assert held.held(rows[there]).all()
        assert tables.intact()


@pytest.mark.parametrize("name", ROBOTS)
def test_paths_of_the_trees_keep_the_regions_and_are_free(name):
    robot, q, sets = cases(name)
    world = rrtik.World(robot)
    for number, held in enumerate(sets):
        tables = held_tables(robot, held)
        rows, there = tables.project(robot.clamp(q + np.random.default_rng(13).normal(0.0, 0.3, (40, robot.dof))))
        ends = rows[there & world.valid_batch(rows)]
        search = ConstrainedSearch(world.motions, tables.held, *robot.finite_range())
        path = search.solve(ends[:1], ends[1:], number, ask=world.motion_valid_batch, max_iterations=2000)
        assert search.intact()
        if path is None:
            continue
        assert held.motions_held(path[:-1], path[1:]).all()
        assert world.motion_valid_batch(path[:-1], path[1:]).all()
        again = search.solve(ends[:1], ends[1:], number, ask=world.motion_valid_batch, max_iterations=2000)
        np.testing.assert_array_equal(again, path)
        way = search.connect(path[0], path[min(3, len(path) - 1)], ask=world.motion_valid_batch)
        assert way is None or held.motions_held(way[:-1], way[1:]).all()


def test_undecided_motions_go_to_the_world_and_are_cut_off_where_it_says_no():
    robot, q, sets = cases("ur5_limited")
    world, held = rrtik.World(robot), sets[0]
    tables = held_tables(robot, held)
    rows, there = tables.project(robot.clamp(q + np.random.default_rng(14).normal(0.0, 0.3, (30, robot.dof))))
    ends = rows[there & world.valid_batch(rows)]
    search = ConstrainedSearch(world.motions, tables.held, *robot.finite_range())
    asked = []

    def refuse(A, B):
        asked.append(len(A))
        return np.zeros(len(A), dtype=bool)

    path = search.solve(ends[:1], ends[1:2], 1, ask=refuse, max_iterations=50)
    assert (path is not None) == (sum(asked) == 0) or path is None
    assert search.statistics()["questions"] == sum(asked)
    assert search.intact()
