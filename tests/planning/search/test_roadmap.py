"""Roadmaps: shortest paths beside an independent search, worlds that change, files, and the planner."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PlannerError, ProblemError
from rrtik_ompl.kernels.search import sample_kernels
from rrtik_ompl.kernels.search.roadmap.graph import KernelGraph
from rrtik_ompl.kernels.search.roadmap.layout import BLOCKED, SURE
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.search.roadmap import NEAR
from rrtik_ompl.planning.search.roadmap_in_python import BOX_TOLERANCE, PythonGraph

pytestmark = pytest.mark.kernels

NEVER = bool  # makes False: it is not time to stop


@cache
def problem():
    return rrtik.load_problem("titan4_prisms")


@cache
def roadmap():
    return rrtik.Roadmap(problem().world, vertices=300, seed=1)


def free_rows(world, count, seed):
    rows = np.random.default_rng(seed).uniform(world.robot.lower, world.robot.upper, (4 * count, world.robot.dof))
    return rows[world.valid_batch(rows)][:count]


def in_numpy(rows, edges, states, starts, goals, motions_free, near):
    """Length of the shortest path from a start to a goal: every edge checked, Dijkstra by scipy."""
    count = len(rows)
    pairs = [edge for edge, state in zip(edges.tolist(), states.tolist(), strict=True) if state != BLOCKED]
    ends = np.concatenate([starts, goals])
    for k, end in enumerate(ends):
        nearest = np.argsort(np.linalg.norm(rows - end, axis=1))[:near]
        others = [*nearest.tolist(), *(range(count, count + len(starts)) if k >= len(starts) else ())]
        pairs += [(count + k, other) for other in others]
    every, pairs = np.concatenate([rows, ends]), np.array(pairs)
    pairs = pairs[motions_free(every[pairs[:, 0]], every[pairs[:, 1]])]
    lengths = np.linalg.norm(every[pairs[:, 0]] - every[pairs[:, 1]], axis=1)
    graph = coo_array((lengths, pairs.T), shape=(len(every),) * 2).tocsr()
    reached = dijkstra(graph, directed=False, indices=range(count, count + len(starts)))
    return reached[:, count + len(starts) :].min()


@pytest.mark.parametrize("ends", [(1, 1), (3, 5)])
def test_paths_are_the_shortest_ones_of_an_independent_search(ends):
    world, graph = problem().world, roadmap().graph
    rows = free_rows(world, 20 * sum(ends), 5)
    for k in range(0, len(rows), sum(ends)):
        starts, goals = rows[k : k + ends[0]], rows[k + ends[0] : k + sum(ends)]
        path = graph.route(starts, goals, NEVER)
        known = graph.rows, graph.edges, graph.states
        shortest = in_numpy(*known, starts, goals, world.motion_valid_batch, NEAR)
        assert route_length(path) == pytest.approx(shortest)
        assert (path[0] == starts).all(axis=1).any()
        assert (path[-1] == goals).all(axis=1).any()
        assert world.motion_valid_batch(path[:-1], path[1:]).all()
    assert graph.intact()


def test_python_and_kernels_find_the_same_paths_on_the_same_roadmap():
    world, made = problem().world, roadmap()
    box = np.array(world.robot.lower), np.array(world.robot.upper)
    twin = PythonGraph(*box, near=made.near, seed=0, valid=world.valid, motion_free=world.motion_valid)
    twin.restore(made.graph.rows, made.graph.edges, made.graph.states)
    for one, other in free_rows(world, 40, 6).reshape(20, 2, -1):
        here, there = (each.route(one[None], other[None], NEVER) for each in (made.graph, twin))
        assert route_length(here) == pytest.approx(route_length(there))
    assert np.array_equal(made.graph.edges, twin.edges)


def test_a_query_leaves_the_roadmap_as_it_was():
    made = rrtik.Roadmap(problem().world, vertices=100, seed=2)
    before = made.vertices, made.graph.edges
    rows = free_rows(problem().world, 60, 7)
    for k in range(30):
        made.graph.route(rows[:k], rows[k:], NEVER) if k else None
    assert np.array_equal(before[0], made.vertices)
    assert np.array_equal(before[1], made.graph.edges)


def test_the_same_seed_gives_the_same_roadmap_and_it_grows_further():
    one, two = (rrtik.Roadmap(problem().world, vertices=200, seed=4) for _ in range(2))
    assert np.array_equal(one.vertices, two.vertices)
    assert one.grow(100) == 100
    assert np.array_equal(one.vertices[:200], two.vertices)
    assert problem().world.valid_batch(one.vertices).all()
    assert not np.array_equal(rrtik.Roadmap(problem().world, vertices=200, seed=5).vertices, two.vertices)


def test_every_edge_that_is_known_to_be_free_is_free():
    world, graph = problem().world, roadmap().graph
    rows, edges, states = graph.rows, graph.edges, graph.states
    free = world.motion_valid_batch(rows[edges[:, 0]], rows[edges[:, 1]])
    assert free[states == SURE].all()
    assert not free[states == BLOCKED].any()
    assert (states == BLOCKED).any()


def wall(x):
    """A plane arm's workspace with a ball at the height of its middle."""
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.25), rrtik.pose([x, 0.9, 0.0]))
    return rrtik.World(rrtik.load_robot("planar3", parameters={"radius": 0.02}), rrtik.Scene([ball]))


def test_after_an_obstacle_has_moved_no_path_runs_through_it_and_the_old_roadmap_is_as_it_was():
    here, there = wall(0.5), wall(1.8)
    made = rrtik.Roadmap(here, vertices=300)
    known = made.graph.states
    moved = made.moved_to(there)
    rows = free_rows(there, 80, 8)
    found = [moved.route(a[None], b[None], NEVER) for a, b in zip(rows[::2], rows[1::2], strict=True)]
    found = [path for path in found if path is not None]
    assert len(found) > 30
    assert all(there.motion_valid_batch(path[:-1], path[1:]).all() for path in found)
    assert not all(here.motion_valid_batch(path[:-1], path[1:]).all() for path in found)
    assert np.array_equal(made.graph.states, known)
    assert np.array_equal(moved.vertices, made.vertices)


def test_a_roadmap_is_saved_and_read_with_all_that_it_knows(tmp_path):
    made = roadmap()
    made.save(tmp_path / "cell.npz")
    read = rrtik.Roadmap.load(tmp_path / "cell.npz", problem().world)
    assert np.array_equal(read.vertices, made.vertices)
    assert np.array_equal(read.graph.edges, made.graph.edges)
    assert np.array_equal(read.graph.states, made.graph.states)
    a, b = free_rows(problem().world, 2, 9)
    assert read.path(a, b).length == pytest.approx(made.path(a, b).length)
    assert read.grow(50) == 50
    assert len(np.unique(read.vertices, axis=0)) == 350  # no sample twice


def test_a_world_with_path_constraints_is_refused_for_a_roadmap_keeps_none(tmp_path):
    free = problem().world
    held = rrtik.Problem(
        free, problem().start, problem().goal.q, constraints=[rrtik.constraints.inside(np.eye(4), [9.0] * 3)]
    ).world
    made = rrtik.Roadmap(free, vertices=20)
    made.save(tmp_path / "free.npz")
    for use in (rrtik.Roadmap, made.moved_to, lambda world: rrtik.Roadmap.load(tmp_path / "free.npz", world)):
        with pytest.raises(InputError, match=r"roadmap.*path constraints"):
            use(held)


def test_a_roadmap_of_another_world_is_refused_in_one_line(tmp_path):
    file = tmp_path / "wall.npz"
    rrtik.Roadmap(wall(0.5), vertices=50).save(file)
    with pytest.raises(InputError, match=r"wall\.npz.*moved=True"):
        rrtik.Roadmap.load(file, wall(1.8))
    assert len(rrtik.Roadmap.load(file, wall(1.8), moved=True).vertices) == 50
    with pytest.raises(InputError, match="roadmap"):
        rrtik.Roadmap.load(file, problem().world)
    other = rrtik.World(replace(wall(0.5).robot, name="other"), wall(0.5).scene)
    told = r"wall\.npz: is no roadmap of robot 'other': it is of robot 'planar3'$"
    with pytest.raises(InputError, match=told):
        rrtik.Roadmap.load(file, other, moved=True)
    with pytest.raises(InputError, match="another robot"):
        roadmap().moved_to(wall(0.5))
    with pytest.raises(InputError, match=r"roadmap\.moved_to"):
        rrtik.plan(problem(), "roadmap", parameters={"roadmap": rrtik.Roadmap(wall(0.5), vertices=10)})


@pytest.mark.parametrize("spoil", [lambda data: data[: len(data) // 2], lambda data: b"no file", lambda data: b""])
def test_spoilt_files_are_refused_in_one_line(tmp_path, spoil):
    file = tmp_path / "cell.npz"
    roadmap().save(file)
    file.write_bytes(spoil(file.read_bytes()))
    with pytest.raises(InputError, match=r"cell\.npz") as caught:
        rrtik.Roadmap.load(file, problem().world)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("bad", "named"),
    [({"vertices": -1}, "vertices"), ({"near": 0}, "near"), ({"seed": -1}, "seed"), ({"vertices": 10**9}, "vertices")],
)
def test_numbers_that_make_no_sense_are_named(bad, named):
    with pytest.raises(InputError, match=named):
        rrtik.Roadmap(problem().world, **bad)


def test_a_start_in_collision_is_named():
    world = wall(0.5)
    with pytest.raises(ProblemError, match="start is in collision"):
        rrtik.Roadmap(world, vertices=10).path([np.pi / 3, 0.0, 0.0], [0.0, 0.0, 0.0])


def test_plans_on_a_roadmap_are_proven_and_what_it_lacks_it_learns():
    near = problem()
    sparse = rrtik.Roadmap(near.world, vertices=0)
    far = free_rows(near.world, 40, 10)
    for a, b in zip(far[::2], far[1::2], strict=True):
        found = rrtik.plan(rrtik.Problem(near.world, a, b), "roadmap", seed=1, parameters={"roadmap": sparse})
        assert found.found, found.reason
        assert found.proven
    assert len(sparse.vertices) > 0
    learnt = len(sparse.vertices)
    again = rrtik.plan(rrtik.Problem(near.world, a, b), "roadmap", seed=2, parameters={"roadmap": sparse})
    assert again.found
    assert len(sparse.vertices) == learnt


def test_the_planner_takes_the_file_of_a_roadmap(tmp_path):
    roadmap().save(tmp_path / "cell.npz")
    found = rrtik.plan(problem(), "roadmap", parameters={"roadmap": str(tmp_path / "cell.npz")})
    assert found.found
    with pytest.raises((InputError, PlannerError), match="missing"):
        rrtik.plan(problem(), "roadmap", parameters={"roadmap": str(tmp_path / "missing.npz")})


def test_joints_without_limits_are_turned_by_whole_turns():
    robot = rrtik.load_robot("planar3", parameters={"radius": 0.02})
    endless = robot.continuous.any()
    world = wall(0.5) if endless else rrtik.World(rrtik.load_robot("titan4"))
    made = rrtik.Roadmap(world, vertices=200)
    turn = np.where(world.robot.continuous, 2.0 * np.pi, 0.0)
    a, b = free_rows_of(world)
    path = made.route((a + 3 * turn)[None], (b + 3 * turn)[None], NEVER)
    assert (path[0] == a + 3 * turn).all()
    assert (path[-1] == b + 3 * turn).all()
    assert world.motion_valid_batch(path[:-1], path[1:]).all()


def free_rows_of(world):
    lower = np.where(np.isfinite(world.robot.lower), world.robot.lower, -3.0)
    upper = np.where(np.isfinite(world.robot.upper), world.robot.upper, 3.0)
    rows = np.random.default_rng(3).uniform(lower, upper, (100, world.robot.dof))
    return rows[world.valid_batch(rows)][:2]


def test_rows_outside_the_box_are_refused():
    world = problem().world
    graph = KernelGraph(world.motions, world.robot.lower, world.robot.upper, near=3, seed=0, ask=None)
    far = world.robot.upper + 1.0
    with pytest.raises(InputError, match="start 0 is not in the box"):
        graph.route(far[None], problem().start[None], NEVER)
    with pytest.raises(InputError, match="goal 0 is not in the box"):
        graph.route(problem().start[None], far[None], NEVER)


def graph_of(kind, *, near=3):
    """An empty graph in the box of the world."""
    world = problem().world
    box = np.array(world.robot.lower), np.array(world.robot.upper)
    if kind is KernelGraph:
        return KernelGraph(world.motions, *box, near=near, seed=0, ask=None)
    return PythonGraph(*box, near=near, seed=0, valid=world.valid, motion_free=world.motion_valid)


def test_python_and_kernels_tolerate_the_same():
    assert BOX_TOLERANCE == sample_kernels.BOX_TOLERANCE


@pytest.mark.parametrize("kind", [KernelGraph, PythonGraph])
@pytest.mark.parametrize("beyond", [0, 2])
def test_a_path_is_learnt_up_to_the_first_row_outside_the_box(kind, beyond):
    graph, rows = graph_of(kind), free_rows(problem().world, 5, 11)
    rows[beyond] = problem().world.robot.upper + 1e-3
    assert graph.learn(rows) == beyond
    assert np.array_equal(graph.rows, rows[:beyond])
    rows[beyond] = problem().world.robot.upper + 1e-7
    assert graph_of(kind).learn(rows) == 5


@pytest.mark.parametrize("kind", [KernelGraph, PythonGraph])
def test_vertices_outside_the_box_are_refused_and_nothing_of_them_stays(kind):
    graph, rows = graph_of(kind), free_rows(problem().world, 5, 12)
    edges, states = np.array([[0, 4]], dtype=np.int32), np.array([SURE], dtype=np.int32)
    spoilt = rows.copy()
    spoilt[3, 1] = problem().world.robot.upper[1] + 1e-3
    with pytest.raises(InputError, match="roadmap: vertex 3 is not in the box of configurations"):
        graph.restore(spoilt, edges, states)
    assert graph.size == 0
    graph.restore(rows, edges, states)
    assert np.array_equal(graph.rows, rows)
    assert np.array_equal(graph.edges, edges)


def test_a_file_with_a_vertex_outside_the_box_is_named(tmp_path):
    file = tmp_path / "cell.npz"
    roadmap().save(file)
    with np.load(file) as data:
        stored = dict(data)
    stored["rows"][7] = problem().world.robot.upper + 1e-3
    np.savez_compressed(file, **stored)
    for moved in (False, True):
        with pytest.raises(InputError, match=r"cell\.npz: roadmap: vertex 7 is not in the box of configurations$"):
            rrtik.Roadmap.load(file, problem().world, moved=moved)
