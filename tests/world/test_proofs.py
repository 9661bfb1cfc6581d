"""Motions that are proven free for their whole length."""

import pickle
from dataclasses import replace
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Cylinder, HalfSpace, Sphere
from rrtik_ompl.world.coal_proof import CoalProof
from rrtik_ompl.world.world import World
from rrtik_tests.by_coal import free_by_coal
from rrtik_tests.turning_slider import slider

ARMS = ("panda", "ur5", "titan4", "planar10", "ur5_gripper", "puma560")


def arm(name, folder):
    return slider(folder) if name == "slider" else rrtik.load_robot(name)


def random_motions(robot, rng, count, length=1.0):
    """Motions of random free configurations, shapes (count, dof)."""
    low, high = np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0)
    starts = rng.uniform(low, high, (count, robot.dof))
    ends = np.clip(starts + rng.normal(0.0, length / np.sqrt(robot.dof), starts.shape), low, high)
    return starts, ends


def surface_point(robot, q, rng):
    """A point on a moving link at a configuration, by coal's own bounding information of its geometry."""
    bodies = [b for b in link_bodies(robot) if b.joint > 0]
    body = bodies[rng.integers(len(bodies))]
    geometry = body.geometry
    if isinstance(geometry, coal.BVHModelBase):
        points = np.array([geometry.vertex(int(k)) for k in rng.integers(geometry.num_vertices, size=3)])
        local = points[0]
    elif isinstance(geometry, coal.ConvexBase):
        local = np.array(geometry.point(int(rng.integers(geometry.num_points))))
    else:
        local = np.array(geometry.aabb_center)
    frame = pin.SE3(robot.joint_frames(q[None])[0][body.joint])
    return frame.act(body.placement.act(local))


@pytest.mark.kernels
@pytest.mark.parametrize("name", [*ARMS, "slider"])
def test_a_needle_or_plate_in_the_way_is_always_found(name, tmp_path):
    robot, rng = arm(name, tmp_path), np.random.default_rng(5)
    starts, ends = random_motions(robot, rng, 25)
    for a, b in zip(starts, ends, strict=True):
        point = surface_point(robot, a + rng.uniform() * (b - a), rng)
        solid = Box([0.3, 0.3, 1e-4]) if rng.uniform() < 0.5 else Cylinder(2e-4, 0.4)
        place = pin.SE3(pin.exp3(rng.normal(size=3)), point)
        world = World(robot, Scene([Obstacle("thin", solid, place)]))
        assert not world.motion_proven(a, b)
        assert not world.motion_proven(b, a)


@pytest.mark.kernels
@pytest.mark.parametrize("name", [*ARMS, "slider"])
def test_what_is_proven_is_free_wherever_coal_looks(name, tmp_path):
    robot, rng = arm(name, tmp_path), np.random.default_rng(6)
    plate, floor = Box([0.4, 0.4, 1e-4]), HalfSpace([0.1, 0, 1], -1.1)
    solids = (Box([0.2, 0.1, 0.3]), Sphere(0.1), Cylinder(0.05, 0.4), plate, floor)
    reach = 3.0 if name.startswith("planar") else 0.9
    places = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-reach, reach, 3)) for _ in solids]
    places[-1] = pin.SE3.Identity()
    scene = Scene([Obstacle(f"o{k}", s, p) for k, (s, p) in enumerate(zip(solids, places, strict=True))])
    world = World(robot, scene)
    starts, ends = random_motions(robot, rng, 300, length=0.6)
    proven = world.motions_proven(starts, ends)
    for a, b in zip(starts[proven][:40], ends[proven][:40], strict=True):
        rows = a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)
        assert world.valid_batch(rows).all()
    free = world.motion_valid_batch(starts, ends)
    assert proven.sum() >= 0.97 * free.sum()
    assert not (proven & ~free).any()
    if name != "planar10":  # whose links hardly keep clear of all that stands on its plane
        assert proven.any()
    assert world.prover.tables.packed.table.intact()


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["panda", "ur5", "slider", "titan4"])
def test_no_point_leaves_its_chord_by_more_than_the_bound(name, tmp_path, monkeypatch):
    monkeypatch.setattr(CoalProof, "settle", lambda *_: None)  # which proves parts of the motion
    robot, rng = arm(name, tmp_path), np.random.default_rng(7)
    world = World(robot, Scene([Obstacle("far", Sphere(0.1), pin.SE3(np.eye(3), np.array([50.0, 0, 0])))]))
    starts, ends = random_motions(robot, rng, 20, length=1.5)
    for a, b in zip(starts, ends, strict=True):
        world.motion_proven(a, b)
        table = world.prover.tables.packed.table
        bends = table.bends[: table.sweep_count]
        frames = robot.joint_frames(a + np.linspace(0.0, 1.0, 101)[:, None] * (b - a))
        sweeps = table.sweeps.reshape(-1, layout.SWEEP_SIZE)
        for body in [k for k in world.bodies if k.joint > 0]:
            for (frame, base), bend in zip(sweeps, bends, strict=True):
                if frame != body.joint:
                    continue
                poses = np.linalg.inv(frames[:, base]) @ frames[:, frame] @ body.placement.homogeneous
                point = poses[:, :3, :3] @ np.array(body.geometry.aabb_center) + poses[:, :3, 3]
                share = np.linspace(0.0, 1.0, 101)[:, None]
                left = np.linalg.norm(point - (1.0 - share) * point[0] - share * point[-1], axis=1).max()
                # bodies that one joint carries have a sweep each; the largest of them bounds all their points
                same = max(x for (f, s), x in zip(sweeps, bends, strict=True) if (f, s) == (frame, base))
                assert left <= same / 8.0 + 1e-12, bend


@pytest.mark.kernels
def test_a_clearance_is_kept_to_the_micrometre():
    robot = rrtik.load_robot("point2d", parameters={"radius": 0.5, "bounds": [[0.0, 26.0], [0.0, 20.0]]})
    wall = Obstacle("wall", Box([30.0, 1.0, 4.0]), rrtik.pose([13.0, 10.0, 0.0]), margin=0.1)
    world = World(robot, Scene([wall]))
    a, b = np.array([[2.0, 8.895]]), np.array([[20.0, 8.895]])  # 5 mm beyond wall, margin and radius
    assert world.motions_proven(a, b, clearance=0.005 - 1e-6).all()
    assert not world.motions_proven(a, b, clearance=0.005 + 1e-6).any()
    gap = world.prove(np.concatenate([a, b]), clearance=0.006).unproven[0]
    assert {gap.first, gap.second} == {"wall", world.bodies[0].name}


@pytest.mark.kernels
@pytest.mark.parametrize("gap", [1e-4, 2e-6, -2e-6, -1e-4])
@pytest.mark.parametrize("share", [0.5, 0.31])
def test_the_outermost_point_of_an_arc_is_seen_to_the_micrometre(gap, share):
    robot, a, b = (
        rrtik.load_robot("planar3", parameters={"radius": 0.02}),
        np.array([-0.5, 0.0, 0.0]),
        np.array([0.5, 0.0, 0.0]),
    )
    q = a + share * (b - a)
    way = np.array([np.cos(q[0]), np.sin(q[0]), 0.0])

    def world(distance):
        return World(robot, Scene([Obstacle("ball", Sphere(0.01), rrtik.pose(distance * way))]))

    beyond = world(3.2).clearance(q)
    assert world(3.2 - beyond + gap).motion_proven(a, b) == (gap > 0.0)


@pytest.mark.kernels
def test_a_still_motion_and_the_limits():
    robot = rrtik.load_robot("panda")
    world, q = World(robot), robot.posture("default")
    assert world.motion_proven(q, q)
    assert not world.motion_proven(q, robot.upper + 0.1)
    assert world.prove([q]).proven  # it stands still
    colliding = np.array([0.0, 1.7, 0.0, -3.0, 0.0, 0.1, 0.0])
    assert not world.valid(colliding)
    assert not world.prove([colliding]).proven
    assert not rrtik.JointPath.of(robot, [colliding]).proved(world).proven
    assert not world.prove([q, robot.upper + 0.1]).proven


@pytest.mark.kernels
def test_a_long_route_is_proven_motion_by_motion_as_in_single_questions():
    world = rrtik.load_problem("planar3_boxes").world
    rows = np.random.default_rng(1).uniform(*world.robot.finite_range(), (150, world.robot.dof))
    single = [world.motion_proven(a, b) for a, b in pairwise(rows)]
    assert 10 < sum(single) < 139
    assert [gap.motion for gap in world.prove(rows).unproven] == np.flatnonzero(~np.array(single)).tolist()
    assert world.motions_proven(rows[:-1], rows[1:]).tolist() == single


def test_what_a_plan_returns_says_what_is_proven():
    problem = rrtik.load_problem("titan4_prisms")
    plan = rrtik.plan(problem, seed=1)
    assert plan.found
    assert plan.proven
    assert plan.path.proof.motions == len(plan.path.waypoints) - 1
    assert plan.path.with_waypoints(plan.path.waypoints).proof is None


@pytest.mark.usefixtures("nothing_is_proven")
def test_where_nothing_is_proven_plans_are_checked_densely():
    problem = rrtik.load_problem("titan4_prisms")
    plan = rrtik.plan(problem, seed=1)
    assert plan.found
    assert plan.proven is False
    assert plan.path.violations(problem.world) == ()


def test_a_proof_of_bad_numbers_is_refused_by_name():
    world = World(rrtik.load_robot("panda"))
    q = world.robot.posture("default")
    for clearance in (-0.1, np.inf, np.nan):
        with pytest.raises(InputError, match="clearance"):
            world.prove([q, q], clearance=clearance)
    with pytest.raises(InputError):
        world.prove([q, q * np.nan])
    with pytest.raises(InputError, match="waypoints of a proof"):
        world.prove(np.zeros((0, 7)))
    for seconds in (0.0, -1.0, np.nan, "soon"):
        with pytest.raises(InputError, match="seconds"):
            world.prove([q, q], seconds=seconds)


def test_bodies_of_several_parts_are_not_proven_apart_from_a_half_space_that_they_touch():
    robot = replace(rrtik.load_robot("ur5"), self_collision=False)
    world = World(robot, Scene([Obstacle("ground", HalfSpace([0.1, 0.0, 1.0], -0.3))]))
    Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (400, robot.dof))
    free, proven = free_by_coal(world, Q), world.motions_proven(Q, Q)
    assert 20 < free.sum() < len(Q) - 20
    assert not (proven & ~free).any()
    assert proven[free].mean() > 0.8


@pytest.mark.kernels
def test_a_proof_says_the_least_margin_of_the_obstacles_and_how_far_apart_an_open_pair_is():
    robot = rrtik.load_robot("point2d", parameters={"radius": 0.5, "bounds": [[0, 26], [0, 20]]})
    wall = Obstacle("wall", Box([30, 1, 4]), rrtik.pose([13, 10, 0]), margin=0.25)
    post = Obstacle("post", Box([1, 1, 4]), rrtik.pose([1, 1, 0]), margin=0.75)
    world = World(robot, Scene([wall, post]))
    assert World(robot).prove([[5.0, 5.0], [6.0, 5.0]]).margin == 0.0
    proof = world.prove([[5.0, 5.0], [20.0, 5.0], [20.0, 8.8]])
    assert (proof.margin, proof.proven) == (0.25, False)
    (gap,) = proof.unproven
    y = 5.0 + gap.share * 3.8
    assert (gap.motion, "wall" in gap.pair) == (1, True)
    assert gap.distance == pytest.approx(9.5 - y - 0.5, abs=1e-9)
    again = pickle.loads(pickle.dumps(proof))
    assert again == proof
    assert (again.margin, again.unproven[0].distance) == (0.25, gap.distance)


@pytest.mark.kernels
def test_a_gap_that_nobody_looked_at_has_no_distance():
    robot = rrtik.load_robot("planar3")
    beyond = np.array([robot.upper, robot.upper + 1.0])
    (gap,) = World(robot).prove(beyond).unproven
    assert np.isnan(gap.distance)
