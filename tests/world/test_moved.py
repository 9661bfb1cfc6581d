"""Worlds in which an obstacle stands elsewhere answer as worlds made anew do, and leave the others as they are."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.kernels.checks.fast_world import FastWorld
from rrtik_ompl.kernels.tables import moved_rows
from rrtik_ompl.tasks.contact_life import touching_at
from rrtik_tests.sizes import how_many

MOVES = how_many(300, 24)
BENT = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0.1, 0.1, 0.3], [0.1, 0.1, 0.05]])
FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 0, 4], [0, 1, 3], [1, 2, 3], [2, 0, 3]])  # a dent in its bottom


def shapes(rng):
    """One of each kind."""
    return {
        "box": rrtik.Box([0.2, 0.1, 0.3]),
        "ball": rrtik.Sphere(0.1),
        "capsule": rrtik.Capsule(0.05, 0.3),
        "cylinder": rrtik.Cylinder(0.08, 0.2),
        "hull": rrtik.Mesh(BENT[:4], [*FACES[[3, 4, 5]].tolist(), [0, 2, 1]]),
        "bent": rrtik.Mesh(BENT, FACES),
        "floor": rrtik.HalfSpace([0, 0, 1], -0.6),
        "cloud": rrtik.PointCloud(rng.uniform(-0.1, 0.1, (200, 3)), 0.01),
    }


def scene_of(count, seed=0, margin=0.0):
    rng = np.random.default_rng(seed)
    kinds = [rrtik.Obstacle(name, shape, anywhere(rng, name), margin=margin) for name, shape in shapes(rng).items()]
    edges = rng.uniform(0.01, 0.1, (count, 3))
    return rrtik.Scene((*kinds, *(rrtik.Obstacle(f"{k}", rrtik.Box(e), anywhere(rng)) for k, e in enumerate(edges))))


def anywhere(rng, name="", reach=0.9):
    if name == "floor":
        return rrtik.pose([0.0, 0.0, rng.uniform(-0.3, 0.0), *rng.uniform(-0.2, 0.2, 3)])
    away = rng.normal(size=3)
    away *= rng.uniform(0.35, reach) / np.linalg.norm(away)
    return rrtik.pose([*away, *rng.uniform(-3.0, 3.0, 3)])


def asked(world, rows, ends):
    """What a world says, down to which answers are in doubt."""
    values = world.robot.joint_values(rows)
    said = [world.valid_batch(rows), world.motion_valid_batch(rows, ends), world.motions_proven(rows, ends)]
    said += [world.checks.checker.fast.classify(values), world.checks.checker.fast.clearance(values).lower]
    return [*said, world.prove(rows[:4]).proven, world.contacts(rows[0]), world.prover.digest]


def alike(one, other):
    both = zip(one, other, strict=True)
    return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else str(a) == str(b) for a, b in both)


@pytest.fixture(scope="module")
def queries():
    robot, rng = rrtik.load_robot("ur5"), np.random.default_rng(3)
    rows = rng.uniform(*robot.finite_range(), (200, 6))
    return robot, rows, rows + rng.normal(scale=0.1, size=rows.shape)


@pytest.mark.parametrize("count", [0, 90])
@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_after_any_moves_a_world_answers_as_one_made_anew(queries, count, margin):
    robot, rows, ends = queries
    world, rng = rrtik.World(robot, scene_of(count, margin=margin)), np.random.default_rng(1)
    names, some = [obstacle.name for obstacle in world.scene.obstacles], []
    for number in range(MOVES):
        name = names[rng.integers(8)] if number % 2 else names[rng.integers(len(names))]
        world = world.moved(name, anywhere(rng, name))
        if number % 6 == 5:
            found = asked(world, rows, ends)
            assert alike(found, asked(rrtik.World(robot, world.scene), rows, ends))
            some.append([each.any() and not each.all() for each in found[:3]])
    assert np.all(some, axis=1).any()
    assert world.fast is None or world.fast.intact()


@pytest.mark.parametrize("name", ["box", "capsule", "hull", "bent"])
def test_after_a_move_a_scene_with_contacts_answers_as_one_made_anew(queries, name):
    robot, rows, ends = queries
    rng = np.random.default_rng(5)
    first = rrtik.World(robot, scene_of(10))
    contacts = [rrtik.Touching(name, "wrist_3_link", -0.002)]
    differ = []
    for _ in range(3):
        moved = first.moved(name, anywhere(rng, name, reach=0.5))
        found = moved.with_scene(replace(moved.scene, contacts=contacts))
        obstacles = [replace(each) for each in moved.scene.obstacles]
        anew = rrtik.World(robot, replace(moved.scene, obstacles=obstacles, contacts=contacts))
        assert found.checks.solids is not anew.checks.solids
        assert alike(asked(found, rows, ends), asked(anew, rows, ends))
        assert [touching_at(found, q, name) for q in rows] == [touching_at(anew, q, name) for q in rows]
        differ.append((found.valid_batch(rows) != first.valid_batch(rows)).any())
    assert any(differ)


@pytest.mark.kernels
def test_the_rows_of_a_box_are_those_that_packing_makes(queries, monkeypatch):
    world = rrtik.World(queries[0], scene_of(0, margin=0.01))
    poses = [anywhere(np.random.default_rng(seed)) for seed in range(40)]
    quick = [rows_after(world, pose) for pose in poses]
    monkeypatch.setattr(moved_rows, "box_numbers", lambda *_: None)
    for one, other in zip(quick, [rows_after(world, pose) for pose in poses], strict=True):
        for a, b in zip(one, other, strict=True):
            assert np.allclose(a, b, rtol=0.0, atol=1e-15 if a.dtype == np.float64 else 1e-7)


def rows_after(world, pose):
    fresh = world.with_scene(replace(world.scene, obstacles=list(world.scene.obstacles)))
    assert fresh.fast is not world.fast
    table = fresh.moved("box", pose).checks.checker.fast.table
    scene = (table.outer_primitives, table.inner_primitives, table.standing_solids)
    return [array.copy() for each in scene for array in each.memory.arrays.values()]


@pytest.mark.kernels
def test_nothing_is_packed_anew(queries, monkeypatch):
    world = rrtik.World(queries[0], scene_of(20))
    assert world.fast is not None  # the tables are made when they are first needed
    moved = world.moved("3", [0.5, 0.5, 0.5])
    monkeypatch.setattr(FastWorld, "__init__", None)
    for name in shapes(np.random.default_rng(0)):
        moved = moved.moved(name, [0.5, 0.4, 0.05])
    assert moved.scene.obstacle("bent").pose.translation.tolist() == [0.5, 0.4, 0.05]


def test_the_world_that_was_moved_from_is_as_it_was(queries):
    robot, rows, ends = queries
    world = rrtik.World(robot, scene_of(40))
    forms = [world.with_resolution(0.02), world.with_accuracy("conservative"), world.with_clearance(0.01)]
    before = [asked(each, rows, ends) for each in (world, *forms)]
    moved = world.moved("box", [0.4, 0.3, 0.5]).moved("3", [0.3, 0.3, 0.5])
    wide = forms[2].moved("box", [0.4, 0.3, 0.5]).moved("3", [0.3, 0.3, 0.5])
    after = asked(moved, rows, ends)
    assert all(alike(a, asked(each, rows, ends)) for a, each in zip(before, (world, *forms), strict=True))
    assert alike(after, asked(moved, rows, ends))
    assert alike(asked(wide, rows, ends), asked(moved.with_clearance(0.01), rows, ends))


def test_what_other_threads_ask_is_never_changed_beneath_them(queries):
    robot, rows, ends = queries
    world = rrtik.World(robot, scene_of(40))
    with ThreadPoolExecutor(1) as pool:
        tables = pool.submit(lambda: world.fast).result()
        there = pool.submit(asked, world, rows, ends).result()
        moved = world.moved("box", [0.4, 0.3, 0.5])
        assert pool.submit(lambda: world.fast).result() is tables
        assert alike(pool.submit(asked, world, rows, ends).result(), there)
    assert alike(asked(moved, rows, ends), asked(rrtik.World(robot, moved.scene), rows, ends))


@pytest.mark.kernels
def test_a_roadmap_keeps_the_world_that_it_was_made_for(queries):
    world = rrtik.World(queries[0], scene_of(4))
    roadmap = rrtik.Roadmap(world, vertices=50)
    fast = world.fast
    moved = world.moved("box", [0.4, 0.3, 0.5])
    assert world.fast is fast is not moved.fast
    assert roadmap.world is world


def test_an_obstacle_may_touch_the_base_for_a_while(queries):
    robot, rows, _ = queries
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("box", rrtik.Box([0.1] * 3), rrtik.pose([1.0, 0, 0.5]))]))
    free = world.valid_batch(rows)
    inside = world.moved("box", [0.0, 0.0, 0.05])
    assert free.any()
    assert not inside.valid_batch(rows).any()
    assert not inside.motions_proven(rows, rows).any()
    assert (inside.moved("box", [1.0, 0.0, 0.5]).valid_batch(rows) == free).all()


def test_paths_are_planned_as_in_a_world_made_anew(queries):
    robot, rows, _ = queries
    world = rrtik.World(robot, scene_of(40))
    for seed in range(4):
        world = world.moved("box", anywhere(np.random.default_rng(seed)))
        anew = rrtik.World(robot, world.scene)
        ends = rows[anew.valid_batch(rows)][2 * seed : 2 * seed + 2]
        paths = [rrtik.plan(rrtik.Problem(each, *ends), "fastrrtconnect", seed=seed).path for each in (world, anew)]
        assert np.array_equal(*(path.waypoints for path in paths))


def test_constraints_stay(queries):
    robot = queries[0]
    q = np.array([0.0, -1.2, 1.0, 0.2, 0.0, 0.0])
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("box", rrtik.Box([0.1] * 3), rrtik.pose([2.0, 0, 0.5]))]))
    region = rrtik.constraints.inside(robot.fk(q), [0.2, 0.2, 0.2])
    problem = rrtik.Problem(world, q, q, constraints=[region])
    moved = problem.world.moved("box", robot.fk(q).translation)
    assert not moved.valid(q)
    assert problem.world.valid(q)
    assert moved.moved("box", [2.0, 0.0, 0.5]).valid(q)
    assert not moved.moved("box", [2.0, 0.0, 0.5]).valid(q + 0.5)


def test_bad_input_is_refused(queries):
    world = rrtik.World(queries[0], scene_of(2))
    with pytest.raises(UnknownNameError, match="chair"):
        world.moved("chair", [0, 0, 0])
    with pytest.raises(InputError, match="name of an obstacle"):
        world.moved(3, [0, 0, 0])
    with pytest.raises(InputError, match="pose of 'box'"):
        world.moved("box", [np.nan, 0, 0])
