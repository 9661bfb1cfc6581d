"""The batched checks never contradict a slow, obvious computation in float64, whatever the arm and the surroundings."""

import os
import subprocess
import sys
import warnings
from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from rrtik_ompl import fast
from rrtik_ompl.catalog import load_robot
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.solids import bvh, hull
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast import COLLIDING, FREE, UNDECIDED, FastWorld
from rrtik_ompl.fast.checks import check_kernels as kernels
from rrtik_ompl.fast.simd.processor import WIDTH
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables import robot_tables as tables

SLIDER = """
<robot name="slider"><link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="a"/><origin xyz="0 0.1 0.2" rpy="0.3 0 0"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-0.5" upper="0.5" velocity="1" effort="1"/></joint>
  <joint name="swing" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0" rpy="0 0.4 1"/>
    <axis xyz="1 2 -2"/></joint>
  <joint name="left" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.3 0.1 0"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.2" velocity="1" effort="1"/></joint>
  <joint name="right" type="prismatic"><parent link="b"/><child link="d"/><origin xyz="0.3 -0.1 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.2" velocity="1" effort="1"/><mimic joint="left"/></joint>
  <joint name="nod" type="revolute"><parent link="b"/><child link="e"/><origin xyz="0 0 0.3"/><axis xyz="0 0 -1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/><mimic joint="swing" multiplier="-0.5" offset="0.2"/></joint>
</robot>"""
FREE_POINT = "".join(
    f"""<joint name="{a}" type="prismatic"><parent link="{p}"/><child link="{c}"/><axis xyz="{x}"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/></joint><link name="{c}"/>"""
    for a, p, c, x in (("x", "o", "p", "1 0 0"), ("y", "p", "q", "0 1 0"), ("z", "q", "r", "0 0 1"))
)
DESCRIBED = {"slider": SLIDER, "free point": f'<robot name="point"><link name="o"/>{FREE_POINT}</robot>'}
ARMS = ("titan4", "panda", "kinova", "puma560", "planar10", "slider")


@cache
def arm(name):
    return robot_from_urdf_text(DESCRIBED[name]) if name in DESCRIBED else load_robot(name)


def configurations(robot, count, rng):
    return rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (count, robot.dof))


def joint_values(robot, Q):
    return Q @ robot.chain.gain.T + robot.chain.offset


def random_pose(rng, reach):
    return pin.SE3(pin.Quaternion(*rng.normal(size=4)).normalized().matrix(), rng.uniform(-reach, reach, 3))


def random_solid(kind, rng, size):
    a, b, c = rng.uniform(0.1, 0.5, 3) * size
    if kind == "half-space":
        normal = rng.normal(size=3)
        return coal.Halfspace(normal / np.linalg.norm(normal), -0.5 * size)
    if kind in ("convex", "round convex"):
        points = rng.normal(size=(12 if kind == "convex" else 150, 3))
        return hull(points / np.linalg.norm(points, axis=1)[:, None] * (a, b, c))
    if kind == "mesh":
        return bvh(rng.normal(size=(6, 3)) * size * 0.2, np.array([[0, 1, 2], [2, 3, 4], [3, 4, 5]]))
    return {
        "ball": lambda: coal.Sphere(a),
        "capsule": lambda: coal.Capsule(0.5 * a, b),
        "box": lambda: coal.Box(a, b, c),
        "cylinder": lambda: coal.Cylinder(a, b),
    }[kind]()


KINDS = ("ball", "capsule", "box", "cylinder", "half-space", "convex", "round convex", "mesh")


def random_spheres(rng, count, size):
    """Outer spheres of random places and sizes, and inner ones inside them."""
    outer = np.column_stack([rng.normal(size=(count, 3)) * 0.1 * size, rng.uniform(0.02, 0.1, count) * size])
    return outer, outer[: rng.integers(0, count + 1)] * (1.0, 1.0, 1.0, 0.6)


def inscribed(solid):
    """A ball inside a convex solid, shape (1, 4)."""
    centre = np.mean(solid.points(), axis=0)
    return np.array([[*centre, -0.9 * float(distance(solid, centre))]])


class Case:
    """An arm with random balls on its joints among random solids, some pairs left out."""

    def __init__(self, name, seed, *, kinds=KINDS, size=None, most_balls=20):
        rng = np.random.default_rng(seed)
        self.robot = arm(name)
        joints = len(self.robot.chain.parent)
        tip = np.linalg.norm(self.robot.fk_batch(configurations(self.robot, 50, rng))[:, :3, 3], axis=1).max()
        self.size = size or 0.6 * float(tip)
        self.bodies, self.outer, self.inner = [], [], []
        for kind in kinds:
            pose = random_pose(rng, 1.5 * self.size)
            solid = random_solid(kind, rng, self.size)
            spheres = random_spheres(rng, 5, 2.0 * self.size) if kind == "mesh" else ([], [])
            spheres = ([], inscribed(solid)) if isinstance(solid, coal.ConvexBase) else spheres
            self._add(Body(kind, 0, pose, solid, "obstacle"), spheres)
        for joint in [*range(1, joints + 1), *rng.integers(1, joints + 1, 2)]:
            count = int(rng.integers(1, most_balls + 1))
            body = Body(f"link{joint}", int(joint), random_pose(rng, 0.1), coal.Sphere(0.1), "link")
            self._add(body, random_spheres(rng, count, 0.5 * self.size))
        order = rng.permutation(len(self.bodies))
        self.bodies, self.outer, self.inner = ([c[k] for k in order] for c in (self.bodies, self.outer, self.inner))
        count = len(self.bodies)
        every = [(i, j) for i in range(count) for j in range(i + 1, count)]
        self.pairs = [p for p in every if rng.random() < 0.6 and self.bodies[p[0]].joint != self.bodies[p[1]].joint]
        self.world = FastWorld(self.robot.chain, self.bodies, self.pairs, outer=self.outer, inner=self.inner)
        self.rng = rng

    def _add(self, body, spheres):
        body.geometry.computeLocalAABB()
        self.bodies.append(body)
        self.outer.append(np.array(spheres[0]).reshape(-1, 4))
        self.inner.append(np.array(spheres[1]).reshape(-1, 4))

    def sample(self, count):
        return configurations(self.robot, count, self.rng)

    def meetings(self, Q, covers, *, inner, grow=0.0):
        """For each pair: which configurations have overlapping balls, those of moving bodies grown. (m, pairs)."""
        frames = self.robot.joint_frames(Q)
        placed = {}
        for k, body in enumerate(self.bodies):
            if body.joint:
                local = covers[k][:, :3] @ body.placement.rotation.T + body.placement.translation
                pose = frames[:, body.joint]
                placed[k] = local @ pose[:, :3, :3].transpose(0, 2, 1) + pose[:, None, :3, 3], covers[k][:, 3] + grow
        found = np.zeros((len(Q), len(self.pairs)), dtype=bool)
        for number, pair in enumerate(self.pairs):
            carried = [k for k in pair if k in placed]
            if len(carried) == 2:
                (points, radii), (others, reaches) = placed[pair[0]], placed[pair[1]]
                for point, radius in zip(points.transpose(1, 0, 2), radii, strict=True):
                    gaps = np.linalg.norm(others - point[:, None], axis=2)
                    found[:, number] |= (gaps < radius + reaches).any(axis=1)
            elif carried:
                still = pair[0] + pair[1] - carried[0]
                points, radii = placed[carried[0]]
                found[:, number] = overlaps(self.bodies[still], covers[still], points, radii, inner).any(axis=1)
        return found


def overlaps(body, spheres, points, radii, inner):
    """Which balls meet a body that stands still. Shape of ``points`` without its last axis."""
    local = (points - body.placement.translation) @ body.placement.rotation
    solid = body.geometry
    met = np.zeros(points.shape[:-1], dtype=bool)
    if not isinstance(solid, coal.BVHModelBase):
        gap = distance(solid, local)
        if isinstance(solid, coal.ConvexBase):  # its upright bounding box counts as six more faces
            corners = solid.points() @ body.placement.rotation.T + body.placement.translation
            beside = np.maximum(corners.min(axis=0) - points, points - corners.max(axis=0))
            gap = np.maximum(gap, beside.max(axis=-1))
        met = gap < 0.0 if inner and isinstance(solid, coal.ConvexBase) else gap < radii
    if isinstance(solid, coal.BVHModelBase) or (inner and isinstance(solid, coal.ConvexBase)):
        for x, y, z, r in spheres:
            met |= np.linalg.norm(local - (x, y, z), axis=-1) < radii + r
    return met


def distance(solid, points):
    """Distance from a solid, 0 inside; of a convex solid and a half-space the largest height over a face."""
    if isinstance(solid, coal.Halfspace):
        return points @ solid.n - solid.d
    if isinstance(solid, coal.ConvexBase):
        faces = ConvexHull(np.array(solid.points())).equations
        return np.max([points @ face[:3] + face[3] for face in faces], axis=0)
    if isinstance(solid, coal.Box):
        return np.linalg.norm(np.maximum(np.abs(points) - solid.halfSide, 0.0), axis=-1)
    if isinstance(solid, coal.Sphere):
        return np.maximum(np.linalg.norm(points, axis=-1) - solid.radius, 0.0)
    across, beyond = np.linalg.norm(points[..., :2], axis=-1), np.abs(points[..., 2]) - solid.halfLength
    if isinstance(solid, coal.Capsule):
        return np.maximum(np.hypot(across, np.maximum(beyond, 0.0)) - solid.radius, 0.0)
    return np.hypot(np.maximum(across - solid.radius, 0.0), np.maximum(beyond, 0.0))


def kernel_frames(robot, V):
    """Joint frames that the kernels compute, shape (m, joints + 1, 4, 4)."""
    body = Body("end", len(robot.chain.parent), pin.SE3.Identity(), coal.Sphere(0.1), "link")
    wall = Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.1), "obstacle")
    spheres = [np.array([[0.0, 0.0, 0.0, 0.1]])] * 2
    world = FastWorld(robot.chain, [body, wall], [(0, 1)], outer=spheres, inner=spheres)
    turns = tables.axis_turns(robot.chain)
    found = np.tile(np.eye(4), (len(V), len(turns) + 1, 1, 1))
    for start in range(0, len(V), WIDTH):
        block = V[start : start + WIDTH]
        values = np.zeros((len(turns) + 1, WIDTH))
        values[:-1, : len(block)] = block.T
        world._scratch[layout.VALUES][:] = values.ravel()
        kernels.forward_kinematics(world._arm.arm.address, world._scratch.address)
        frames = world._scratch[layout.FRAMES].reshape(-1, 12, WIDTH).transpose(2, 0, 1)[: len(block)]
        found[start : start + WIDTH, :, :3, :3] = frames[..., :9].reshape(len(block), -1, 3, 3)
        found[start : start + WIDTH, :, :3, 3] = frames[..., 9:]
    found[:, 1:, :3, :3] = found[:, 1:, :3, :3] @ turns.transpose(0, 2, 1)
    return found


@pytest.mark.parametrize("name", ARMS)
def test_joint_frames_are_the_robots_own_far_within_the_margin(name):
    robot = arm(name)
    Q = configurations(robot, 1000, np.random.default_rng(0))
    error = np.abs(kernel_frames(robot, joint_values(robot, Q)) - robot.joint_frames(Q))
    assert error.max() < 0.25 * tables.SMALLEST_MARGIN
    assert error[..., :3, :3].max() < 5e-6


@pytest.mark.parametrize("name", ARMS)
def test_a_free_or_colliding_answer_never_contradicts_the_slow_computation(name):
    for seed in range(8):
        case = Case(name, seed, most_balls=8)
        Q = case.sample(4200)
        answers = case.world.classify(joint_values(case.robot, Q))
        touching = case.meetings(Q, case.outer, inner=False).any(axis=1)
        proven = case.meetings(Q, case.inner, inner=True).any(axis=1)
        assert not (touching & (answers == FREE)).any()
        assert not (~proven & (answers == COLLIDING)).any()
        assert {FREE, COLLIDING} & set(answers.tolist())


@pytest.mark.parametrize("name", ARMS)
def test_rounding_never_decides_at_the_very_contact(name):
    at_contact = 0
    for seed in range(4):
        case = Case(name, seed, most_balls=8)
        for covers, inner, wrong in ((case.outer, False, FREE), (case.inner, True, COLLIDING)):
            A, B = case.sample(200), case.sample(200)
            first = case.meetings(A, covers, inner=inner).any(axis=1)
            crossing = first != case.meetings(B, covers, inner=inner).any(axis=1)
            clear, touching = (np.where(first[:, None] == flag, A, B)[crossing] for flag in (False, True))
            for _ in range(50 if crossing.any() else 0):
                middle = 0.5 * (clear + touching)
                met = case.meetings(middle, covers, inner=inner).any(axis=1)[:, None]
                clear, touching = np.where(met, clear, middle), np.where(met, middle, touching)
            for Q in (clear, touching):
                assert (case.world.classify(joint_values(case.robot, Q)) != wrong).all()
            at_contact += len(clear)
    assert at_contact > 100


@pytest.mark.parametrize("away", [0.0, 100.0, 1e4])
def test_the_margin_covers_the_rounding_of_frames_far_from_the_origin(away):
    base = pin.SE3(np.eye(3), np.array([away, -away, 0.3]))
    robot = robot_from_urdf_text(SLIDER, base_pose=base)
    Q = configurations(robot, 500, np.random.default_rng(0))
    body = Body("hand", 5, pin.SE3.Identity(), coal.Sphere(0.1), "link")
    wall = Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.1), "obstacle")
    spheres = [np.array([[0.0, 0.0, 0.0, 0.1]])] * 2
    margin = FastWorld(robot.chain, [body, wall], [(0, 1)], outer=spheres, inner=spheres).margin
    error = kernel_frames(robot, joint_values(robot, Q)) - robot.joint_frames(Q)
    assert np.linalg.norm(error[..., :3, 3], axis=-1).max() < 0.25 * margin


@pytest.mark.parametrize("name", ["titan4", "slider"])
def test_only_a_band_of_a_few_margins_is_left_undecided(name):
    for seed in range(6):
        case = Case(name, seed, kinds=[k for k in KINDS if k != "round convex"])  # that one has planes left out
        Q = case.sample(4000)
        answers = case.world.classify(joint_values(case.robot, Q))
        band = 3.0 * case.world.margin + 1e-4
        clear = ~case.meetings(Q, case.outer, inner=False, grow=band).any(axis=1)
        hit = case.meetings(Q, case.inner, inner=True, grow=-band).any(axis=1)
        assert (answers[clear] == FREE).all()
        assert (answers[hit] != FREE).all()
        assert (answers[hit] == COLLIDING).all()


def apart(solid, pose, point, radius):
    """Whether coal finds a gap between a solid and a ball."""
    ends = (coal.Transform3s(pose.rotation, pose.translation), coal.Transform3s(np.eye(3), point))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return coal.distance(solid, ends[0], coal.Sphere(radius), ends[1], request, result) > 0.0


def single_answer(world, values):
    return world.classify(values[None])[0]


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "mesh"])
def test_the_distance_from_every_kind_of_solid_is_exact(kind):
    robot = arm("free point")
    for seed in range(8):
        rng = np.random.default_rng(seed)
        pose, solid, radius = random_pose(rng, 0.5), random_solid(kind, rng, 1.0), rng.uniform(0.01, 0.3)
        solid.computeLocalAABB()
        body = Body("ball", 3, pin.SE3.Identity(), coal.Sphere(radius), "link")
        spheres = np.array([[0.0, 0.0, 0.0, radius]])
        wall = Body("wall", 0, pose, solid, "obstacle")
        none = np.zeros((0, 4))
        world = FastWorld(robot.chain, [body, wall], [(0, 1)], outer=[spheres, none], inner=[spheres, none])
        points = pose.translation + rng.uniform(-1.0, 1.0, (20000, 3))
        answers = world.classify(points)
        gap = distance(solid, (points - pose.translation) @ pose.rotation)
        band = 4.0 * world.margin + 2e-5
        assert all(apart(solid, pose, p, radius) for p in points[(gap < radius) & (answers == FREE)])  # off a corner
        if kind != "round convex":
            assert (answers[gap > radius + band] == FREE).all()
        for k in np.flatnonzero(np.abs(gap - radius) < 0.02)[:300]:  # alone, so that no other lane widens the search
            alone = single_answer(world, points[k])
            assert alone == answers[k] or (alone == FREE and apart(solid, pose, points[k], radius))
        reach = 0.0 if isinstance(solid, coal.ConvexBase) else radius
        assert (answers[gap > reach] != COLLIDING).all()
        assert (answers[gap < reach - band] == COLLIDING).all()
        assert (answers == FREE).any()
        assert (answers == COLLIDING).any()


@pytest.mark.parametrize("name", ["panda", "slider"])
def test_a_motion_is_judged_by_its_configurations(name):
    seen = set()
    for seed in range(4):
        case = Case(name, seed, kinds=KINDS[:4], most_balls=3)
        A, B = case.sample(100), case.sample(100)
        VA, VB = joint_values(case.robot, A), joint_values(case.robot, A + 0.3 * (B - A))
        counts = case.rng.integers(1, 70, 100)
        answers = case.world.classify_edges(VA, VB, counts)
        for answer, a, b, count in zip(answers, VA, VB, counts, strict=True):
            share = (np.arange(count + 1) / count)[:, None]
            assert answer == case.world.classify((1.0 - share) * a + share * b).max()
        cautious = case.world.classify_edges(VA, VB, counts, narrow_phase=False)
        np.testing.assert_array_equal(cautious, np.minimum(answers, UNDECIDED))
        seen |= set(answers.tolist())
    assert seen == {FREE, UNDECIDED, COLLIDING}


def test_every_step_of_a_motion_and_both_its_ends_are_checked():
    robot = arm("free point")
    spheres = np.array([[0.0, 0.0, 0.0, 0.01]])
    ball = Body("ball", 3, pin.SE3.Identity(), coal.Sphere(0.01), "link")
    wall = Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.01), "obstacle")
    world = FastWorld(robot.chain, [ball, wall], [(0, 1)], outer=[spheres] * 2, inner=[spheres] * 2)
    counts, steps = np.array([(count, k) for count in range(1, 70) for k in range(count + 1)]).T
    pitch = 0.05 * np.array([[0.6, 0.0, 0.8]])
    starts, ends = -steps[:, None] * pitch, (counts - steps)[:, None] * pitch
    assert (world.classify_edges(starts, ends, counts) == COLLIDING).all()
    aside = np.array([0.0, 0.0201, 0.0])
    assert (world.classify_edges(starts + aside, ends + aside, counts) == FREE).all()
    between = 0.5 * pitch
    assert (world.classify_edges(starts + between, ends + between, counts) == FREE).all()


def test_long_motions_of_continuous_joints_lose_no_precision():
    case = Case("slider", 3)
    a = case.sample(1)
    b = a + np.array([[0.0, 40.0, 0.0]])
    V = joint_values(case.robot, np.concatenate([a, b]))
    share = (np.arange(2001) / 2000)[:, None]
    samples = (1.0 - share) * a + share * b
    samples[:, 1] = np.remainder(samples[:, 1], 4.0 * np.pi)  # the joint that follows it turns half as far
    turned = joint_values(case.robot, samples)
    expected = case.world.classify(turned)
    assert case.world.classify_edges(V[:1], V[1:], [2000]) == expected.max()
    np.testing.assert_array_equal(case.world.classify((1.0 - share) * V[0] + share * V[1]), expected)


@pytest.mark.parametrize("name", ["titan4", "panda", "slider"])
def test_undecided_pairs_are_all_those_whose_outer_spheres_touch(name):
    for seed in range(4):
        case = Case(name, seed, kinds=[k for k in KINDS if k != "round convex"])
        Q = case.sample(100)
        touching = case.meetings(Q, case.outer, inner=False)
        nearly = case.meetings(Q, case.outer, inner=False, grow=3.0 * case.world.margin + 1e-4)
        for q, sure, perhaps in zip(joint_values(case.robot, Q), touching, nearly, strict=True):
            found = case.world.undecided_pairs(q[None])[0]
            assert {case.pairs[k] for k in np.flatnonzero(sure)} <= set(found)
            assert set(found) <= {case.pairs[k] for k in np.flatnonzero(perhaps)}
            assert len(found) == len(set(found))


@pytest.mark.parametrize("name", ["titan4", "slider"])
def test_plain_numpy_gives_the_same_answers(name):
    case = Case(name, 5)
    plain = FastWorld(case.robot.chain, case.bodies, case.pairs, outer=case.outer, inner=case.inner, compiled=False)
    Q = case.sample(400)
    V = joint_values(case.robot, Q)
    ours, theirs = case.world.classify(V), plain.classify(V)
    assert ((ours == theirs) | (ours == UNDECIDED) | (theirs == UNDECIDED)).all()
    assert (ours == theirs).mean() > 0.99
    edges = case.world.classify_edges(V[:20], V[20:40], [9] * 20)
    others = plain.classify_edges(V[:20], V[20:40], [9] * 20)
    assert ((edges == others) | (edges == UNDECIDED) | (others == UNDECIDED)).all()
    for v in V[:50]:
        assert set(case.world.undecided_pairs(v[None])[0]) == set(plain.undecided_pairs(v[None])[0])


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 15, 16, 17, 1000])
def test_any_number_of_rows_is_judged_row_by_row(count):
    case = Case("titan4", 2)
    V = joint_values(case.robot, case.sample(count))
    answers = case.world.classify(V)
    assert answers.shape == (count,)
    assert answers.dtype == np.int8
    np.testing.assert_array_equal(answers, [case.world.classify(v[None])[0] for v in V])
    edges = case.world.classify_edges(V, V[::-1], np.full(count, 5))
    alone = [case.world.classify_edges(a[None], b[None], [5])[0] for a, b in zip(V, V[::-1], strict=True)]
    np.testing.assert_array_equal(edges, alone)


def test_the_layout_of_the_array_does_not_matter():
    case = Case("titan4", 2)
    V = joint_values(case.robot, case.sample(100)).astype(np.float32).astype(np.float64)
    expected = case.world.classify(V)
    fixed = V.copy()
    fixed.setflags(write=False)
    for same in (fixed, np.asfortranarray(V), np.repeat(V, 2, axis=0)[::2], V[::-1][::-1], V.astype(np.float32)):
        np.testing.assert_array_equal(case.world.classify(same), expected)
    np.testing.assert_array_equal(case.world.classify(V.tolist()), expected)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(bad):
    case = Case("titan4", 2)
    V = np.zeros((20, 6))
    V[13, 2] = bad
    for ask in (
        lambda: case.world.classify(V),
        lambda: case.world.classify_edges(np.zeros((20, 6)), V, np.ones(20)),
        lambda: case.world.undecided_pairs(V[13:15]),
    ):
        with pytest.raises(InputError, match="finite"):
            ask()


def test_arrays_of_the_wrong_shape_are_refused():
    case = Case("titan4", 2)
    for V in (np.zeros((3, 5)), np.zeros(6), np.zeros((1, 2, 6)), [["a"] * 6]):
        with pytest.raises(InputError):
            case.world.classify(V)
    with pytest.raises(InputError, match="as many starts as ends"):
        case.world.classify_edges(np.zeros((2, 6)), np.zeros((3, 6)), [1, 1])
    for counts in ([0, 1], [1.5, 2], [1], [-1, 1], [2**40, 1]):
        with pytest.raises(InputError, match="steps"):
            case.world.classify_edges(np.zeros((2, 6)), np.zeros((2, 6)), counts)


def test_values_beyond_what_the_margin_covers_are_undecided():
    case = Case("slider", 2)
    V = joint_values(case.robot, case.sample(20))
    V[4, 0], V[7, 1] = 5.0, 1e9
    answers = case.world.classify(V)
    assert answers[4] == answers[7] == UNDECIDED
    np.testing.assert_array_equal(np.delete(answers, [4, 7]), case.world.classify(np.delete(V, [4, 7], axis=0)))
    assert case.world.classify_edges(V[3:5], V[4:6], [3, 3]).tolist() == [UNDECIDED, UNDECIDED]
    assert set(case.world.undecided_pairs(V[4:5])[0]) == set(case.pairs) - set(standing_pairs(case))


@pytest.mark.parametrize("strokes", [np.nan, -1.0, [1.0, 2.0]])
def test_strokes_that_are_no_lengths_are_refused(strokes):
    with pytest.raises(InputError, match="strokes"):
        FastWorld(arm("slider").chain, [], [], outer=[], inner=[], strokes=strokes)


def test_obstacles_of_any_size_and_place_are_right():
    chain = arm("titan4").chain
    ball = Body("link", 6, pin.SE3.Identity(), coal.Sphere(0.1), "link")
    spheres = np.array([[0.0, 0.0, 0.0, 0.1]])
    cases = [(1e-9, 2.0, {FREE}), (1e5, 0.0, {COLLIDING}), (1e5, 1.5e5, {FREE}), (1e14, 0.0, {UNDECIDED})]
    for size, away, allowed in cases:
        for solid in (coal.Box(size, size, size), coal.Cylinder(size, size), coal.Capsule(size, size)):
            solid.computeLocalAABB()
            wall = Body("wall", 0, pin.SE3(np.eye(3), np.array([3.0 * away, 0.0, 0.0])), solid, "obstacle")
            none = np.zeros((0, 4))
            world = FastWorld(chain, [ball, wall], [(0, 1)], outer=[spheres, none], inner=[spheres, none])
            assert set(world.classify(np.zeros((1, 6))).tolist()) <= allowed, solid


def standing_pairs(case):
    return [p for p in case.pairs if all(case.bodies[k].joint == 0 for k in p)]


def test_large_worlds_get_a_larger_margin_and_stay_right():
    for seed in range(3):
        case = Case("slider", seed, size=40.0)
        Q = case.sample(3000)
        answers = case.world.classify(joint_values(case.robot, Q))
        assert case.world.margin > tables.SMALLEST_MARGIN
        assert not (case.meetings(Q, case.outer, inner=False).any(axis=1) & (answers == FREE)).any()
        assert not (~case.meetings(Q, case.inner, inner=True).any(axis=1) & (answers == COLLIDING)).any()


def test_a_new_scene_keeps_the_tables_of_the_arm():
    case = Case("titan4", 2)
    again = [Body(b.name, b.joint, pin.SE3(b.placement), b.geometry, b.kind) for b in case.bodies]
    fewer = [p for p in case.pairs if all(case.bodies[k].name != "box" for k in p)]
    covers = {"outer": case.outer, "inner": case.inner}
    world = FastWorld(case.robot.chain, again, fewer, **covers, like=case.world)
    assert world._arm is case.world._arm
    V = joint_values(case.robot, case.sample(500))
    np.testing.assert_array_equal(world.classify(V), FastWorld(case.robot.chain, again, fewer, **covers).classify(V))
    assert FastWorld(case.robot.chain, again, fewer[:-3], **covers, like=case.world)._arm is not None


def test_the_same_kernels_serve_every_arm_and_scene():
    assert Case("titan4", 2).world._kernels is Case("slider", 2).world._kernels is not None


def test_a_body_without_a_cover_is_its_bounding_ball_and_an_endless_one_is_never_free():
    chain = arm("titan4").chain
    ball = Body("wall", 0, pin.SE3(np.eye(3), np.array([50.0, 0, 0])), coal.Sphere(0.1), "obstacle")
    for solid, expected in ((coal.Box(0.1, 0.1, 0.1), FREE), (coal.Halfspace(np.array([0, 0, 1.0]), 0.0), UNDECIDED)):
        solid.computeLocalAABB()
        body = Body("thing", 3, pin.SE3.Identity(), solid, "attached")
        none = [np.zeros((0, 4))] * 2
        world = FastWorld(chain, [body, ball], [(0, 1)], outer=none, inner=none)
        assert world.classify(np.zeros((1, 6))).tolist() == [expected]


def test_a_world_without_pairs_is_free():
    world = FastWorld(arm("titan4").chain, [], [], outer=[], inner=[])
    assert world.classify(np.ones((20, 6))).tolist() == [FREE] * 20
    assert world.classify_edges(np.ones((2, 6)), np.zeros((2, 6)), [3, 40]).tolist() == [FREE] * 2
    assert world.undecided_pairs(np.zeros((1, 6))) == [[]]


def test_solids_with_a_formula_need_no_covers():
    for kind, expected in (("box", (False, False)), ("convex", (False, True)), ("mesh", (True, True))):
        solid = random_solid(kind, np.random.default_rng(0), 1.0)
        solid.computeLocalAABB()
        assert fast.needs_covers(Body("x", 0, pin.SE3.Identity(), solid, "obstacle")) == expected
        assert fast.needs_covers(Body("x", 1, pin.SE3.Identity(), solid, "link")) == (True, True)


def test_every_number_in_the_tables_points_into_them():
    case = Case("panda", 4)
    for balls in case.world._arm.balls:
        clusters, count = balls[layout.CLUSTERS].reshape(-1, 4), len(balls[layout.BALLS]) // 4
        assert clusters[0, 2] == 0
        assert clusters[-1, 3] == count
        assert (clusters[1:, 2] == clusters[:-1, 3]).all()
        assert len(clusters) == balls.header[layout.CLUSTER_COUNT]
        assert balls[layout.GROUPS].reshape(-1, 3)[-1, 2] == len(clusters)
        assert balls[layout.PAIRS].max() < balls.header[layout.BODY_COUNT]
        assert balls[layout.PAIR_GROUPS].reshape(-1, 4)[-1, 3] == balls.header[layout.PAIR_COUNT]
    for rows in case.world._primitives:
        numbers = rows[layout.NUMBERS].reshape(-1, 4)
        assert numbers[:, 1].max() < rows.header[layout.STANDING_COUNT]
        assert numbers[:, 3].max() <= len(rows[layout.PLANES]) // 4
        assert rows.header[layout.PADDED_COUNT] % WIDTH == 0


def test_balls_around_balls_contain_them():
    rng = np.random.default_rng(0)
    for count in (1, 2, 3, 8, 50):
        spheres = np.column_stack([rng.normal(size=(count, 3)), rng.uniform(0.1, 1.0, count)])
        ball = tables.enclosing_ball(spheres)
        depth = np.linalg.norm(spheres[:, :3] - ball[:3], axis=1) + spheres[:, 3]
        assert depth.max() <= ball[3]
        assert ball[3] < 1.2 * 0.5 * (np.ptp(spheres[:, :3], axis=0).max() + 2.0 * spheres[:, 3].max()) * np.sqrt(3)


def run(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **environment}, check=False
    )


SMALL = """
import warnings; warnings.simplefilter("always")
import coal, numpy as np, pinocchio as pin
from rrtik_ompl.catalog import load_robot
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.fast import FastWorld
bodies = [Body("b", j, pin.SE3.Identity(), coal.Sphere(0.1), "link") for j in (0, 6)]
spheres = [np.array([[0.0, 0.0, 0.0, 0.1]])] * 2
chain = load_robot("titan4").chain
worlds = [FastWorld(chain, bodies, [(0, 1)], outer=spheres, inner=spheres) for _ in range(2)]
print([w.classify(np.zeros((3, 6))).tolist() for w in worlds])
"""
ANSWER = "[[0, 0, 0], [0, 0, 0]]"


def test_without_numba_numpy_answers_after_one_warning(tmp_path):
    done = run("import sys; sys.modules['numba'] = None\n" + SMALL, RRTIK_CACHE=str(tmp_path))
    assert done.stdout.strip() == ANSWER, done.stderr
    assert done.stderr.count("RuntimeWarning") == 1
    assert "install numba" in done.stderr


def test_the_compiled_world_gives_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Case("titan4", 1)
