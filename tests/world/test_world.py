"""Collision checks of a world."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Sphere
from rrtik_ompl.world.world import World


def at(x, y, z):
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))


def clutter(rng, count, reach, shell):
    kinds = [
        lambda: Box(rng.uniform(0.05, 0.3, 3)),
        lambda: Sphere(rng.uniform(0.05, 0.2)),
        lambda: Cylinder(rng.uniform(0.03, 0.1), rng.uniform(0.1, 0.5)),
        lambda: Capsule(rng.uniform(0.03, 0.1), rng.uniform(0.1, 0.5)),
        lambda: Prism([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)], 0.2),
        lambda: shell,
    ]
    poses = (pin.SE3(pin.SE3.Random().rotation, rng.uniform(-reach, reach, 3)) for _ in range(count))
    return [Obstacle(f"o{k}", kinds[k % len(kinds)](), pose) for k, pose in enumerate(poses)]


@pytest.mark.parametrize(("name", "reach"), [("titan4", 1.8), ("panda", 0.8), ("kinova", 0.8), ("ur5", 0.9)])
def test_both_opinions_agree_on_random_configurations(name, reach, dented_cube):
    robot = load_robot(name)
    rng = np.random.default_rng(3)
    pin.seed(3)
    world = World(robot, Scene(clutter(rng, 12, reach, dented_cube(0.1, -0.09))))
    Q = rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (1500, robot.dof))
    first, second = world.valid_batch(Q), world.certify(Q)
    assert 0.02 < first.mean() < 0.98
    # reused collision data miss about 3 overlaps in 100,000 near contacts: at most one here, and never the other way
    assert (first & ~second).sum() <= 1
    assert not (~first & second).any()
    assert [world.valid(q) for q in Q[:200]] == list(first[:200])


def test_a_collision_is_named_with_its_pair_depth_and_points():
    world = World(
        load_robot("point2d", parameters={"radius": 0.5, "bounds": [[0, 10], [0, 10]]}),
        Scene([Obstacle("wall", Box([2, 10, 2]), at(5, 5, 0))]),
    )
    (contact,) = world.contacts([4.2, 5.0])
    assert "wall" in (contact.first, contact.second)
    assert contact.distance == pytest.approx(-0.7, abs=1e-6)
    assert {round(abs(float(p[0])), 3) for p in (contact.point_first, contact.point_second)} == {4.0, 4.7}
    assert world.contacts([2.0, 5.0]) == ()
    assert world.clearance([2.0, 5.0]) == pytest.approx(1.5, abs=1e-6)
    assert world.clearance([4.2, 5.0]) == pytest.approx(-0.7, abs=1e-6)
    assert "wall" in world.explain([4.2, 5.0])
    assert "overlap" in world.explain([4.2, 5.0])
    assert "outside its limits" in world.explain([11.0, 5.0])
    assert world.explain([2.0, 5.0]) == ""


def test_an_empty_world_is_free_everywhere_inside_the_limits():
    world = World(load_robot("planar3"))
    assert world.valid([0.0, 0.0, 0.0])
    assert not world.valid([4.8, 0.0, 0.0])
    assert world.clearance([0.0, 0.0, 0.0]) == np.inf


def test_motions_are_the_same_in_both_directions_and_see_thin_walls():
    scene = Scene(
        [Obstacle("wall", Box([0.01, 4, 2]), at(5, 5, 0)), Obstacle("block", Prism([(1, 1), (3, 1), (2, 4)]))]
    )
    world = World(
        load_robot("point2d", parameters={"radius": 0.01, "bounds": [[0, 10], [0, 10]]}), scene, motion_resolution=0.02
    )
    rng = np.random.default_rng(0)
    A, B = rng.uniform(0, 10, (2, 300, 2))
    forward, backward = world.motion_valid_batch(A, B), world.motion_valid_batch(B, A)
    assert (forward == backward).all()
    assert 0.2 < forward.mean() < 0.9
    assert not world.motion_valid([4.0, 5.0], [6.0, 5.0])
    assert world.motion_valid([4.0, 9.0], [6.0, 9.0])


@pytest.mark.parametrize("name", ["titan4", "panda", "ur5", "kinova"])
def test_no_point_of_the_arm_moves_farther_than_the_bound_says(name):
    robot = load_robot(name)
    world = World(robot)
    rng = np.random.default_rng(1)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    for _ in range(200):
        a = rng.uniform(low, high)
        b = np.clip(a + rng.normal(0, 0.3, robot.dof), low, high)
        moved = np.zeros(1)
        frames = robot.joint_frames(np.stack([a, b]))
        for item in robot.collision.geometryObjects:
            item.geometry.computeLocalAABB()
            centre = np.append(item.placement.act(item.geometry.aabb_center), 1.0)
            points = (frames[:, item.parentJoint] @ centre)[:, :3]
            moved = np.maximum(moved, np.linalg.norm(points[1] - points[0]))
        assert moved <= world.weights @ np.abs(b - a) + 1e-9
        tips = robot.fk_batch(np.stack([a, b]))[:, :3, 3]
        assert np.linalg.norm(tips[1] - tips[0]) <= world.weights @ np.abs(b - a) + 1e-9


def test_the_number_of_steps_follows_the_resolution():
    coarse, fine = (World(load_robot("planar3"), motion_resolution=r) for r in (0.1, 0.01))
    a, b = np.zeros(3), np.array([1.0, 0.0, 0.0])
    assert coarse.steps(a, b) == int(np.ceil(coarse.weights[0] / 0.1))
    assert fine.steps(a, b) == pytest.approx(10 * coarse.steps(a, b), rel=0.05)


def test_a_body_wholly_inside_a_hollow_mesh_is_in_collision(dented_cube):
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-5, 5], [-5, 5]]})
    world = World(robot, Scene([Obstacle("tank", dented_cube(3.0, 2.0))]))
    assert not world.valid([0.0, 0.0])
    assert not world.certify(np.zeros((1, 2)))[0]
    assert "tank" in world.explain([0.0, 0.0])
    assert world.valid([4.0, 0.0])


def test_what_the_gripper_holds_collides_unless_the_pair_is_allowed():
    robot, q = load_robot("titan4"), np.zeros(6)
    box = Obstacle("box", Box([0.2, 0.2, 0.2]), robot.fk(q) * at(0, 0, 0.25))
    assert World(robot, Scene([box])).valid(q)
    held = AttachedObject("tool", "gripper", Box([0.6, 0.05, 0.05]), at(0.4, 0, 0))
    (contact,) = World(robot, Scene([box], [held])).contacts(q)
    assert {contact.first, contact.second} == {"tool", "box"}
    assert World(robot, Scene([box], [held], [("tool", "box")])).valid(q)


def test_what_the_gripper_holds_must_not_touch_the_link_before_the_gripper_either():
    robot, q = load_robot("titan4"), np.zeros(6)

    def holding(*allow):
        bar = AttachedObject("bar", "gripper", Box([0.4, 0.05, 0.05]), at(0.2, 0, 0), allow)
        return World(robot, Scene([], [bar]))

    assert not holding().valid(q)
    assert not holding().certify([q])[0]
    assert {name for c in holding().contacts(q) for name in (c.first, c.second)} == {"bar", "wrist"}
    assert holding("wrist").valid(q)


def test_the_base_must_not_touch_the_floor():
    world = World(load_robot("titan4"), Scene([Obstacle("floor", HalfSpace([0, 0, 1], 0.0))]))
    assert not world.valid(np.zeros(6))
    assert {"base", "floor"} in [{c.first, c.second} for c in world.contacts(np.zeros(6))]


@pytest.mark.parametrize("lift", [0.0, -2.9])  # with the second one the open side lies near the origin of the mesh
def test_a_body_inside_an_open_mesh_is_free(cube, lift):
    basket = Mesh(3.0 * cube.vertices + [0.0, 0.0, lift], cube.triangles[:-2])
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-5, 5], [-5, 5]]})
    world = World(robot, Scene([Obstacle("basket", basket, at(0, 0, -lift))]))
    assert world.valid([0.0, 0.0])
    assert world.certify([[0.0, 0.0]])[0]
    assert not world.valid([3.0, 0.0])


def test_inside_a_hollow_mesh_the_closest_pair_is_the_one_in_collision(dented_cube):
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-5, 5], [-5, 5]]})
    world = World(robot, Scene([Obstacle("tank", dented_cube(3.0, 2.0)), Obstacle("ball", Sphere(0.1), at(1, 0, 0))]))
    assert world.clearance([0.0, 0.0]) <= 0.0
    assert "tank" in (world.closest([0.0, 0.0]).first, world.closest([0.0, 0.0]).second)
    assert world.closest([4.0, 0.0]).distance == pytest.approx(0.95, abs=1e-6)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (Scene([], [], [("nothing", "base")]), "nothing"),
        (Scene([], [AttachedObject("tool", "no_such_link", Sphere(0.1))]), "no_such_link"),
        (Scene([], [AttachedObject("tool", "gripper", Sphere(0.1), allow=("thumb",))]), "thumb"),
    ],
)
def test_unknown_names_are_refused(scene, words):
    with pytest.raises(UnknownNameError, match=words):
        World(load_robot("titan4"), scene)


def test_an_obstacle_must_not_have_the_name_of_a_link():
    robot = load_robot("titan4")
    with pytest.raises(InputError, match="rename"):
        World(robot, Scene([Obstacle(robot.link_names[-1], Sphere(0.1), at(5, 5, 5))]))


@pytest.mark.parametrize("bad", [[0.0] * 5, [0.0] * 7, [0.0] * 5 + [np.nan], [[0.0] * 6], "abcdef", None])
def test_a_bad_configuration_is_refused(bad):
    world = World(load_robot("titan4"))
    with pytest.raises(InputError):
        world.valid(bad)


@pytest.mark.parametrize(
    "bad", [np.zeros((2, 6), dtype=complex), np.full((2, 6), "x"), np.full((2, 6), np.inf), np.zeros((2, 6, 1))]
)
def test_a_bad_batch_is_refused(bad):
    world = World(load_robot("titan4"))
    for ask in (world.valid_batch, world.certify, lambda rows: world.motion_valid_batch(rows, rows)):
        with pytest.raises(InputError, match="titan4"):
            ask(bad)


def test_batches_may_be_empty_of_any_layout_and_any_real_type():
    world = World(load_robot("titan4"))
    Q = np.random.default_rng(0).uniform(-0.5, 0.5, (6, 6))
    expected = world.valid_batch(Q)
    assert world.valid_batch(np.zeros((0, 6))).shape == (0,)
    assert (world.valid_batch(np.asfortranarray(Q)) == expected).all()
    assert (world.valid_batch(Q[::-1])[::-1] == expected).all()
    locked = Q.copy()
    locked.setflags(write=False)
    assert (world.valid_batch(locked) == expected).all()
    assert (world.valid_batch(Q.tolist()) == expected).all()
    with pytest.raises(InputError):
        world.valid_batch(np.full((2, 6), np.inf))
    with pytest.raises(InputError):
        world.motion_valid_batch(Q, Q[:2])


def test_moving_obstacles_stand_where_they_are_at_time_zero():
    from rrtik_ompl.model.scene import ConstantVelocity, TimedPoses

    robot = load_robot("point2d", parameters={"radius": 0.1, "bounds": [[0, 10], [0, 10]]})
    buoy = Obstacle("buoy", Sphere(0.5), at(2, 2, 0), ConstantVelocity([1, 0, 0]))
    door = Obstacle("door", Sphere(0.5), motion=TimedPoses([0, 4], [at(8, 2, 0), at(8, 6, 0)]))
    scene = Scene([buoy, door])
    assert not World(robot, scene).valid([2.0, 2.0])
    assert not World(robot, scene).valid([8.0, 2.0])
    later = World(robot, scene.at(3.0))
    assert later.valid([2.0, 2.0])
    assert not later.valid([5.0, 2.0])
    assert not later.valid([8.0, 5.0])


def test_the_certificate_agrees_with_itself_in_chunks(dented_cube):
    robot = load_robot("titan4")
    world = World(robot, Scene(clutter(np.random.default_rng(5), 6, 1.5, dented_cube(0.1, -0.09))))
    Q = np.random.default_rng(6).uniform(robot.lower, robot.upper, (600, 6))
    whole = world.certify(Q)
    assert (whole == np.concatenate([world.certify(Q[:100]), world.certify(Q[100:])])).all()
    assert isinstance(world.checks.certificate, Certificate)


def test_a_half_space_cannot_be_held():
    with pytest.raises(InputError, match="half-space"):
        AttachedObject("floor", "gripper", HalfSpace([0, 0, 1]))


def test_where_two_meshes_touch_the_depth_and_a_point_of_the_overlap_are_given(dented_cube):
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-5, 5], [-5, 5]]})
    held = AttachedObject("cup", robot.link_names[-1], dented_cube(0.5, -0.4), at(0, 0, 1))
    bowl = Obstacle("bowl", dented_cube(1.0, -0.8), at(0, 0, 1))
    world = World(robot, Scene([bowl], [held], [("disc", "bowl")]))
    (contact,) = world.contacts([1.4, 0.1])
    assert {contact.first, contact.second} == {"cup", "bowl"}
    assert contact.distance == pytest.approx(-0.1, abs=1e-6)
    for point in (contact.point_first, contact.point_second):
        assert (np.abs(point - [0.95, 0.1, 1.0]) <= [0.051, 0.501, 0.501]).all()
