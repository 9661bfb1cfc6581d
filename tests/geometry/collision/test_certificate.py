"""The second opinion: nothing that touches is passed over, however rows and pairs are looked at together."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.bodies import kept_apart, request
from rrtik_ompl.geometry.collision.certificate import FEW, RUNS, Boxes, Certificate
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Sphere
from rrtik_ompl.model.transitions import subdivided
from rrtik_ompl.world.world import World
from rrtik_tests.by_coal import free_by_coal


def crowded(name, count, seed):
    rng = np.random.default_rng(seed)
    kinds = (Box([0.12, 0.08, 0.1]), Sphere(0.05), Cylinder(0.04, 0.15), Capsule(0.03, 0.1))
    ways = rng.normal(size=(count, 3))
    places = rng.uniform(0.3, 0.9, (count, 1)) * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    poses = (pin.SE3(pin.exp3(rng.normal(size=3)), place) for place in places)
    margins = rng.choice([0.0, 0.02], count)
    found = [Obstacle(f"o{k}", kinds[k % 4], pose, margin=margins[k]) for k, pose in enumerate(poses)]
    ground = Obstacle("ground", HalfSpace([0.1, 0.0, 1.0], -0.3), pin.SE3(pin.exp3(np.array([0.1, 0, 0])), np.zeros(3)))
    return World(load_robot(name), Scene([*found, ground]))


def path_rows(robot, seed, count):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(*robot.finite_range(), (4, robot.dof))
    return subdivided(corners, np.full(3, count / 3.0))[0]


def touching(world, Q):
    """For each row the numbers of the pairs that coal says do not keep their margin, each pair asked."""
    bodies, found = world.bodies, []
    for frames in world.robot.joint_frames(Q):
        poses = [pin.SE3(frames[b.joint]) * b.placement for b in bodies]
        ends = [(b.geometry, coal.Transform3s(p.rotation, p.translation)) for b, p in zip(bodies, poses, strict=True)]
        found.append({
            pair for pair in world.pairs
            if coal.collide(*ends[pair[0]], *ends[pair[1]], request(kept_apart(bodies[pair[0]], bodies[pair[1]])),
                            coal.CollisionResult())
        })  # fmt: skip
    return found


@pytest.mark.parametrize(("name", "seed"), [("panda_primitives", 1), ("ur5", 2)])
def test_no_pair_in_contact_is_passed_over(name, seed):
    world = crowded(name, 30, seed)
    Q = path_rows(world.robot, seed, RUNS[0] + 12)
    truth = touching(world, Q)
    assert sum(map(bool, truth)) > 5
    named = Certificate(world.robot, world.bodies, world.pairs).first_pairs(Q)
    for pairs, names in zip(truth, named, strict=True):
        assert names is not None or not pairs
    assert [names is None for names in named] == world.valid_batch(Q).tolist()  # what a hollow link holds touches too


def test_boxes_of_what_touches_overlap_and_those_of_what_stands_still_are_held_once():
    world = crowded("panda_primitives", 30, 1)
    Q = path_rows(world.robot, 3, 40)
    placed = Boxes(world.bodies).placed(world.robot.joint_frames(Q))
    moving = sum(b.joint > 0 for b in world.bodies)
    assert len(placed.centres) == moving * len(Q) + len(world.bodies) - moving
    met = 0
    for row, pairs in enumerate(touching(world, Q)):
        for i, j in pairs:
            a, b = placed.rows(np.array([row, row]), np.array([i, j]))
            apart = np.abs(placed.centres[a] - placed.centres[b]) - placed.halves[a] - placed.halves[b]
            assert apart.max() <= kept_apart(world.bodies[i], world.bodies[j])
            met += 1
    assert met > 10


def test_no_rows_no_pairs_and_one_row_are_answered_too():
    world = crowded("panda_primitives", 5, 1)
    q = path_rows(world.robot, 3, 6)
    assert world.certify(np.zeros((0, world.robot.dof))).shape == (0,)
    assert Certificate(world.robot, world.bodies, ()).free(q).all()
    assert [world.certify(row[None])[0] for row in q] == world.certify(q).tolist()


@pytest.mark.parametrize(("name", "seed"), [("panda_primitives", 4), ("ur5", 5), ("titan4", 6)])
def test_the_second_opinion_with_proofs_first_is_that_of_coal(name, seed):
    world = crowded(name, 20, seed)
    Q = np.vstack([path_rows(world.robot, seed, 300), world.robot.upper + 0.1])
    judged = free_by_coal(world, Q)
    assert 0.05 < judged.mean() < 0.98
    assert (world.certify(Q) == judged).all()
    few = Q[:: len(Q) // 30]
    assert len(few) > FEW
    for rows in (few, few[:FEW], few[-FEW:]):
        assert (world.certify(rows) == free_by_coal(world, rows)).all()
        bare = World(world.robot, world.scene)
        assert (bare.certify(rows) == free_by_coal(world, rows)).all(), "without a table of proofs"
