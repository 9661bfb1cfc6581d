"""A world whose obstacles move answers as a new one at their new places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.kernels import FREE
from rrtik_ompl.kernels.proof.packing import COMPUTED
from rrtik_ompl.kernels.search.motions.motion_table import step_counts
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, Touching
from rrtik_ompl.model.shapes import Box, HalfSpace, HeightField, Octree, PointCloud, Prism, Sphere
from rrtik_ompl.world.moving_world import MovingProver, MovingWorld
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import box, plane


def arm_scenes():
    robot = load_robot("titan4")
    shapes = [Sphere(0.1), Box([0.2, 0.1, 0.3]), Prism([(0, 0), (0.3, 0), (0, 0.3)], 0.2), HalfSpace([0, 0, 1], -1.2)]
    rng = np.random.default_rng(4)
    scenes = []
    for _ in range(3):
        places = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-1.5, 1.5, 3)) for _ in shapes[:3]]
        poses = [*places, pin.SE3(np.eye(3), np.array([0.0, 0.0, rng.uniform(-0.2, 0.2)]))]
        scenes.append(Scene([Obstacle(f"o{k}", s, p) for k, (s, p) in enumerate(zip(shapes, poses, strict=True))]))
    return robot, scenes


@pytest.mark.kernels
@pytest.mark.parametrize("self_collision", [True, False])
def test_moving_worlds_of_an_arm_share_its_tables(self_collision):
    robot, scenes = arm_scenes()
    first, second = (MovingWorld(World(robot, scene), self_collision=self_collision)._fast for scene in scenes[:2])
    other = MovingWorld(World(robot, scenes[0]), self_collision=not self_collision)._fast
    assert first.arm is second.arm
    assert first.arm is not other.arm


@pytest.mark.parametrize("margins", [(0.0, 0.03), (0.03, 0.0), (0.03, 0.03, 0.0, 0.02)])
@pytest.mark.parametrize("deepest", [None, 0.0, -0.005])
@pytest.mark.parametrize("inflation", [0.0, 0.01])
def test_another_margin_does_not_change_how_deep_a_contact_may_be(margins, deepest, inflation):
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-1, 1], [-1, 1]]})
    cup = AttachedObject("cup", robot.link_names[-1], Sphere(0.05), [0.12, 0.0, 0.0])
    contacts = [] if deepest is None else [Touching("cup", "table", deepest)]
    starts = np.column_stack([np.linspace(-0.06, 0.08, 57), np.zeros(57)])
    apart = 0.2 - 0.17 - starts[:, 0]  # from the cup to the front of the table

    def scene(margin):
        table = Obstacle("table", Box([0.2, 0.2, 0.1]), [0.3, 0.0, 0.0], margin=margin)
        return Scene([table], [cup], contacts=contacts)

    moving = MovingWorld(World(robot, scene(margins[0])))
    for margin in margins:
        moving.move(scene(margin), inflation={"table": inflation})
        proven = moving.motions_proven(starts, starts)
        kept = inflation + (margin if deepest is None else deepest)
        assert (proven == (apart > kept))[abs(apart - kept) > 1e-4].all()


@pytest.mark.kernels
def test_a_moved_world_answers_as_a_new_one():
    robot, scenes = arm_scenes()
    moving = MovingWorld(World(robot, scenes[0]))
    rng = np.random.default_rng(1)
    rows = rng.uniform(*robot.finite_range(), (1500, robot.dof))
    ends = np.clip(rows + 0.2 * rng.normal(size=rows.shape), robot.lower, robot.upper)
    for scene in scenes[1:]:
        moving.move(scene)
        fresh, values = World(robot, scene), robot.joint_values
        steps = step_counts(rows, ends, fresh.weights, fresh.motion_resolution)
        here = fresh.fast.classify(values(rows), resolve=False) == FREE
        way = fresh.fast.classify_edges(values(rows), values(ends), steps, resolve=False) == FREE
        assert (moving.valid_batch(rows) == here).all()
        assert (moving.motion_valid_batch(rows, ends) == way).all()
        assert not (here & ~fresh.with_accuracy("conservative").valid_batch(rows)).any()
        assert 0.0 < moving.valid_batch(rows).mean() < 1.0


@pytest.mark.kernels
def test_provers_from_one_table_place_their_obstacles_independently():
    robot = load_robot("titan4")
    rng = np.random.default_rng(3)
    shapes = [*arm_scenes()[1][0].obstacles, *(Obstacle(name, shape) for name, shape in odd_shapes().items())]
    world = World(robot, Scene([o if isinstance(o.shape, HalfSpace) else replace(o, pose=far(rng)) for o in shapes]))
    pairs = tuple(pair for pair in world.pairs if any(world.bodies[k].joint for k in pair))
    first = MovingProver(robot, tuple(world.bodies), pairs)
    rows = rng.uniform(*robot.finite_range(), (60, robot.dof))
    ends = np.clip(rows + 0.1 * rng.normal(size=rows.shape), robot.lower, robot.upper)

    placed = []
    for _ in range(3):
        poses = {o.name: far(rng) for o in world.scene.obstacles if o.shape.bounded}
        bodies = [
            replace(body, placement=poses[body.name] * body.within) if body.name in poses else body
            for body in world.bodies
        ]
        prover, fresh = first.elsewhere(), MovingProver(robot, tuple(world.bodies), pairs)
        for each in (prover, fresh):
            each.place(bodies, [0.05] * len(bodies), always_colliding=False)
        placed.append((prover, fresh.proven(rows, ends)))
    for prover, answer in placed:
        assert (prover.proven(rows, ends) == answer).all()
    assert 0.1 < np.mean([answer for _, answer in placed]) < 0.95


@pytest.mark.parametrize("placing", [True, False])
def test_tables_of_two_threads_share_no_memory_in_which_they_compute(placing):
    robot, scenes = arm_scenes()
    world = World(robot, scenes[0])
    first = MovingProver(robot, tuple(world.bodies), tuple(world.pairs))._packed_for(0.0, 0.0)
    own = first.for_thread(placing=placing)
    for name in COMPUTED:
        one, other = getattr(first.table, name), getattr(own.table, name)
        assert one.size == 0 or not np.shares_memory(one, other)


def far(rng):
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-1.3, 1.3, 3))


def odd_shapes():
    rng = np.random.default_rng(5)
    return {
        "cloud": PointCloud(rng.uniform(-0.1, 0.1, (40, 3)), 0.02),
        "octree": Octree(rng.integers(-2, 3, (6, 3)) * 0.1, np.full(6, 0.1)),
        "field": HeightField(rng.uniform(0.1, 0.3, (3, 3)), cell=0.1, floor=0.0),
    }


def test_free_with_room_means_that_far_away():
    robot, scenes = arm_scenes()
    exact, moving = World(robot, scenes[1]), MovingWorld(World(robot, scenes[0]))
    rows = np.random.default_rng(2).uniform(*robot.finite_range(), (150, robot.dof))
    moving.move(scenes[1], inflation={o.name: 0.15 for o in scenes[1].obstacles})
    near = MovingWorld(exact, self_collision=False)
    names = set(moving.names)
    for row in rows[moving.valid_batch(rows)][:40]:
        frames = exact.robot.joint_frames(row[None])[0]
        found = measured(exact.bodies, exact.pairs, frames, near_only=False)
        gaps = [c.distance for c in found if {c.first, c.second} & names]
        assert min(gaps) >= 0.15
    near.move(scenes[1])
    assert (near.clearance(rows[moving.valid_batch(rows)]) >= 0.15 - 1e-4).all()


def test_a_moved_scene_must_have_the_same_obstacles():
    moving = MovingWorld(plane(box("a", 5.0, 10.0)).world)
    moving.move(Scene([box("a", 6.0, 10.0)]), inflation={"a": 0.0})  # made anew, but alike
    with pytest.raises(InputError, match="expected the obstacles a"):
        moving.move(Scene([box("b", 5.0, 10.0)]))
    with pytest.raises(InputError, match="'a' has another shape"):
        moving.move(Scene([Obstacle("a", Sphere(3.0))]))
    with pytest.raises(InputError, match="no obstacle 'c'"):
        moving.move(moving.scene, inflation={"c": 0.1})
    for room in (-0.1, float("nan")):
        with pytest.raises(InputError, match="inflation: that of 'a'"):
            moving.move(moving.scene, inflation={"a": room})


def test_copies_of_an_obstacle_count_as_well():
    problem = plane(box("a", 5.0, 10.0))
    moving = MovingWorld(problem.world, copies=2)
    ahead = Scene([box("a", 12.0, 10.0)])
    moving.move(problem.world.scene, ahead)
    assert not moving.valid(np.array([5.0, 10.0]))
    assert not moving.valid(np.array([12.0, 10.0]))
    moving.move(problem.world.scene)
    assert moving.valid(np.array([12.0, 10.0]))
