"""Distances of every shape are judged by coal with pinocchio's forward kinematics, gradients by differences."""

from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import AttachedObject, Obstacle, Scene, World, pose
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.solids import bvh
from rrtik_ompl.kernels.distances import packing, trees
from rrtik_ompl.kernels.distances.layout import AROUND, HULL, NODE_CENTRES, TRIANGLE
from rrtik_ompl.kernels.distances.trees import _blocks_of, tree_of
from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid
from rrtik_ompl.model.shapes import SHAPES
from rrtik_ompl.model.shapes.octree import FEW_CELLS

STEP = 1e-6  # [rad] or [m] of the differences
ACCURATE = 2e-6  # [m]; coal is told to end at 1e-6
GRADIENT = 1e-5

LINK = """<link name="{0}"><collision><origin xyz="{2}" rpy="0.3 0.2 0"/><geometry>{1}</geometry></collision></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}" rpy="0.2 0 0.1"/>
<axis xyz="{5}"/><limit lower="-1.5" upper="1.5" velocity="1" effort="1"/>{6}</joint>"""
ARM = (
    '<robot name="arm"><link name="base"/>'
    + LINK.format("upper", '<box size="0.4 0.1 0.08"/>', "0.25 0 0")
    + LINK.format("slider", '<cylinder radius="0.05" length="0.3"/>', "0.1 0 0.1")
    + LINK.format("wrist", '<sphere radius="0.06"/>', "0.1 0 0")
    + LINK.format("hand", '<box size="0.1 0.1 0.02"/>', "0.1 0 0.05")
    + JOINT.format("turn", "revolute", "base", "upper", "0 0 0", "0 0 1", "")
    + JOINT.format("slide", "prismatic", "upper", "slider", "0.3 0 0", "1 0 0", "")
    + JOINT.format("bend", "revolute", "slider", "wrist", "0.3 0 0", "0 1 0", "")
    + JOINT.format("copy", "revolute", "wrist", "hand", "0.2 0 0", "0 0 1", '<mimic joint="bend" multiplier="-0.5"/>')
    + "</robot>"
)


def notched(size):
    """A block with a step cut out of it: closed, not convex."""
    outline = size * np.array([[-1, -1], [1, -1], [1, 0], [0, 0], [0, 1], [-1, 1.0]])
    low, high = (np.column_stack([outline, np.full(6, z)]) for z in (-0.5 * size, 0.5 * size))
    ends = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    sides = [(k, (k + 1) % 6) for k in range(6)]
    triangles = [t[::-1] for t in ends] + [tuple(k + 6 for k in t) for t in ends]
    triangles += [t for a, b in sides for t in ((a, b, b + 6), (a, b + 6, a + 6))]
    return rrtik.Mesh(np.vstack([low, high]), triangles)


def cells(count):
    rng = np.random.default_rng(5)
    places = np.unique(rng.integers(-12, 12, (3 * count, 3)), axis=0)
    return rrtik.Octree(0.025 * rng.permutation(places)[:count], np.full(count, 0.025))


def slab(*sides):
    """A box as a mesh, which the library takes for a convex solid."""
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij")).reshape(3, -1).T * sides
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return rrtik.Mesh(corners, [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])


CASES: dict[str, list[Any]] = {
    "sphere": [rrtik.Sphere(0.15)],
    "box": [rrtik.Box([0.3, 0.2, 0.1])],
    "cylinder": [rrtik.Cylinder(0.1, 0.3)],
    "capsule": [rrtik.Capsule(0.08, 0.3)],
    "half_space": [rrtik.HalfSpace([0.2, 0.1, 1.0], -0.3)],
    "polygon": [rrtik.Prism([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [0.0, -0.1]], 0.2)],
    "mesh": [slab(0.2, 0.3, 0.1), notched(0.15), rrtik.Mesh([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0.0]], [[0, 1, 2]])],
    "cloud": [rrtik.PointCloud(np.random.default_rng(3).uniform(-0.2, 0.2, (60, 3)), radius=0.01)],
    "heights": [rrtik.HeightField(np.random.default_rng(4).uniform(0.02, 0.2, (6, 7)), 0.05, 0.0)],
    "octree": [cells(30), cells(FEW_CELLS + 1)],
}
SHAPES_OF_CASES = [pytest.param(shape, id=f"{key}-{k}") for key, own in CASES.items() for k, shape in enumerate(own)]


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    file = Path(tmp_path_factory.mktemp("arm")) / "arm.urdf"
    file.write_text(ARM)
    return rrtik.load_robot(str(file), tip="hand")


HELD = AttachedObject("held", "hand", notched(0.05), [0.1, 0.0, 0.12], margin=0.004)


def world_with(arm, shape, **options):
    obstacle = Obstacle("obstacle", shape, pose([0.75, 0.3, 0.1], rpy=[0.1, 0.2, 0.3]), margin=0.01)
    return World(arm, Scene([obstacle], attached=[HELD]), **options)


def parts_of(body, place):
    """Coal's geometries of a body and where they are; coal itself has no clouds."""
    if not isinstance(body.geometry, CloudSolid):
        return [(body.geometry, place)]
    cloud = body.geometry.cloud
    part = coal.Box(*[2.0 * cloud.half] * 3) if cloud.half else coal.Sphere(cloud.radius)
    return [(part, place * pin.SE3(np.eye(3), point.astype(float))) for point in cloud.points]


def by_coal(world, q, names):
    """The least of coal's distances between bodies of two names."""
    robot = world.robot
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.chain.joint_values(q[None])[0])
    placed = [[], []]
    for body in world.bodies:
        if body.name in names:
            placed[names.index(body.name)] += parts_of(body, data.oMi[body.joint] * body.placement)
    least = np.inf
    for one, at in placed[0]:
        for other, where in placed[1]:
            ends = (coal.Transform3s(place.rotation, place.translation) for place in (at, where))
            result = coal.DistanceResult()
            least = min(least, coal.distance(one, next(ends), other, next(ends), coal.DistanceRequest(), result))
    return least


def differences(world, q, **options):
    steps = STEP * np.eye(len(q))
    ahead = world.distances(q + steps, **options)
    back = world.distances(q - steps, **options)
    return ((ahead.values - back.values) / (2.0 * STEP)).T


def postures(arm, count, seed=1):
    return np.random.default_rng(seed).uniform(0.9 * arm.lower, 0.9 * arm.upper, (count, arm.dof))


def test_every_kind_of_shape_has_a_case():
    assert set(CASES) == set(SHAPES)


@pytest.mark.kernels
@pytest.mark.parametrize("shape", SHAPES_OF_CASES)
def test_every_shape_is_measured_as_coal_does_and_its_gradients_are_those_of_differences(arm, shape):
    world = world_with(arm, shape)
    Q = postures(arm, 4)
    found = world.distances(Q)
    assert {name for pair in found.names for name in pair} == {"upper", "slider", "wrist", "hand", "held", "obstacle"}
    for k, q in enumerate(Q):
        single = world.distances(q)
        assert np.array_equal(single.values, found.values[k])
        assert np.array_equal(single.gradients, found.gradients[k])
        expected = np.array([by_coal(world, q, names) for names in found.names])
        apart = expected > 0.0
        assert np.allclose(found.values[k][apart], expected[apart], rtol=0.0, atol=ACCURATE)
        assert (found.values[k][~apart] <= ACCURATE).all()
        lengths = np.linalg.norm(found.points[k, :, 0] - found.points[k, :, 1], axis=1)
        assert np.allclose(lengths, np.abs(found.values[k]), rtol=0.0, atol=1e-9)
    assert world.checks.ruler.rows.table.intact()
    for q in Q[:2]:
        assert np.allclose(world.distances(q).gradients, differences(world, q), rtol=0.0, atol=GRADIENT)


@pytest.mark.kernels
def test_the_nearest_and_those_within_a_range_are_among_all(arm):
    world = world_with(arm, notched(0.15))
    Q = postures(arm, 20)
    every = world.distances(Q)
    order = np.argsort(every.values, axis=1)
    nearest = world.distances(Q, nearest=3)
    assert np.allclose(nearest.values, np.sort(every.values, axis=1)[:, :3], rtol=0.0, atol=1e-9)
    assert (nearest.which == order[:, :3]).mean() > 0.9  # some are equally near
    within = world.distances(Q, within=0.2)
    assert np.allclose(within.values, np.minimum(every.values, 0.2), rtol=0.0, atol=1e-9)
    beyond = every.values > 0.2
    assert beyond.any()
    assert not beyond.all()
    assert not within.gradients[beyond].any()
    assert np.isnan(within.points[beyond]).all()
    assert np.allclose(within.gradients[~beyond], every.gradients[~beyond], atol=1e-6)
    both = world.distances(Q, nearest=3, within=0.2)
    assert np.allclose(both.values, np.minimum(nearest.values, 0.2), rtol=0.0, atol=1e-9)


@pytest.mark.kernels
def test_a_configuration_is_free_where_all_clearances_are_above_zero(arm):
    world = world_with(arm, rrtik.Box([0.3, 0.2, 0.1]), clearance=0.02, self_margin=0.005)
    Q = postures(arm, 200)
    assert np.array_equal((world.distances(Q).clearances > 0.0).all(axis=1), world.valid_batch(Q))


@pytest.mark.kernels
def test_depths_of_convex_solids_are_those_of_coal(arm):
    solids = [rrtik.Sphere(0.3), rrtik.Box([0.5, 0.6, 0.4]), rrtik.Capsule(0.2, 0.5), slab(0.5, 0.6, 0.4)]
    pairs = [(link, "obstacle") for link in ("upper", "wrist", "hand")]
    overlapping = 0
    for solid in solids:
        world = world_with(arm, solid)
        Q = postures(arm, 60)
        found = world.distances(Q, pairs)
        for k, column in zip(*np.nonzero(found.values < -1e-4), strict=True):
            assert found.values[k, column] == pytest.approx(by_coal(world, Q[k], pairs[column]), abs=1e-5)
            overlapping += 1
        deep = np.flatnonzero((found.values < -1e-3).any(axis=1))[:4]
        for k in deep:
            assert np.allclose(found.gradients[k], differences(world, Q[k], pairs=pairs), rtol=0.0, atol=GRADIENT)
    assert overlapping > 20


def by_triangles(world, q, pair, mesh):
    """The least of coal's distances between the bodies of a pair, one triangle of a mesh at a time."""
    one = [body for body in world.bodies if body.name == pair[0]]
    robot = world.robot
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.chain.joint_values(q[None])[0])
    where = data.oMi[one[0].joint] * one[0].placement
    other = next(body.placement for body in world.bodies if body.name == pair[1])
    ends = [coal.Transform3s(place.rotation, place.translation) for place in (where, other)]
    parts = [bvh(mesh.vertices[corners], np.array([[0, 1, 2]])) for corners in mesh.triangles]
    request = coal.DistanceRequest()
    return min(coal.distance(one[0].geometry, ends[0], part, ends[1], request, coal.DistanceResult()) for part in parts)


@pytest.mark.kernels
@pytest.mark.parametrize("kernels", ["0", "1"])
def test_a_mesh_is_overlapped_by_the_depth_of_its_deepest_triangle(arm, kernels, request):
    if kernels == "0":
        request.getfixturevalue("without_kernels")
    shape = notched(0.15)
    pair = ("slider", "obstacle")
    overlapping = 0
    world = world_with(arm, shape)
    Q = postures(arm, 600) * [0.3, 1.0, 0.3] + [0.3, 0.0, 0.0]
    rows = Q[~world.valid_batch(Q)][:80]
    for q, value in zip(rows, world.distances(rows, [pair]).values[:, 0], strict=True):
        expected = by_triangles(world, q, pair, shape)
        if expected < -1e-4:
            overlapping += 1
            assert value == pytest.approx(expected, abs=ACCURATE)
            assert world.closest(q).distance <= value + ACCURATE
    assert overlapping > 10


@pytest.mark.kernels
def test_a_ball_whose_middle_is_in_a_cylinder_is_as_deep_as_a_formula_says(arm):
    """Coal is off by centimetres there."""
    radius = 0.3
    half = 0.4
    ball = 0.06
    world = World(arm, Scene([Obstacle("can", rrtik.Cylinder(radius, 2.0 * half), [0.9, 0.0, 0.0])]))
    Q = postures(arm, 300)
    wrist = next(body for body in world.bodies if body.name == "wrist")
    frames = arm.chain.joint_frames(Q)[:, wrist.joint]
    x, y, z = (frames @ np.append(wrist.placement.translation, 1.0))[:, :3].T - np.array([[0.9], [0.0], [0.0]])
    beside = np.hypot(x, y) - radius
    above = np.abs(z) - half
    inside = np.maximum(beside, above) < 0.0
    assert inside.sum() > 10
    found = world.distances(Q[inside], [("wrist", "can")])
    assert np.allclose(found.values[:, 0], np.maximum(beside, above)[inside] - ball, rtol=0.0, atol=1e-8)


@pytest.mark.kernels
def test_what_lies_inside_a_mesh_is_at_zero_without_a_gradient(arm):
    world = world_with(arm, notched(5.0))
    found = world.distances([0.1, 0.2, 0.3], [("wrist", "obstacle")])
    assert found.values == [0.0]
    assert not found.gradients.any()
    assert np.isnan(found.points).all()


@pytest.mark.kernels
def test_two_surfaces_that_cross_are_at_zero_and_have_no_nearest_points(arm):
    world = World(arm, Scene([Obstacle("obstacle", notched(0.15), [0.8, 0.0, 0.0])], attached=[HELD]))
    found = world.distances(postures(arm, 200), [("held", "obstacle")])
    crossing = found.values[:, 0] == 0.0
    assert crossing.any()
    assert np.array_equal(np.isnan(found.points).all(axis=(1, 2, 3)), crossing)
    assert not found.gradients[crossing].any()


@pytest.mark.kernels
def test_what_was_asked_before_does_not_matter(arm):
    world = world_with(arm, rrtik.Box([0.3, 0.2, 0.1]), clearance=0.02, self_margin=0.005)
    q = postures(arm, 1)[0]
    every = world.distances(q)
    pairs = [every.names[3], every.names[0]]
    for _ in range(2):
        some = world.distances(q, pairs)
        assert some.names == tuple(pairs)
        assert np.array_equal(some.clearances, every.clearances[[3, 0]])
        assert np.array_equal(some.points, every.points[[3, 0]])
        assert np.array_equal(world.distances(q).values, every.values)


def test_links_are_packed_once_for_all_scenes_of_an_arm(arm, monkeypatch):
    boxes = [Obstacle(f"box{k}", rrtik.Box([0.2, 0.2, 0.2]), pose([1.5, 0.2 * k, 0.0])) for k in range(2)]
    World(arm, Scene([boxes[0]])).distances(np.zeros(3))
    packed = []

    def tree_and_note(bodies):
        packed.append(bodies[0].name)
        return tree_of(bodies)

    monkeypatch.setattr(packing, "tree_of", tree_and_note)
    World(arm, Scene([boxes[1]])).distances(np.zeros(3))
    assert packed == ["box1"]


def test_no_leaf_of_a_cloud_reaches_across_a_room():
    """Morton's curve jumps from wall to wall; what is between them would be compared with each point of such a leaf."""
    rng = np.random.default_rng(1)
    walls = rng.uniform([-1.0, -1.0, -1.0], 1.0, (6000, 3))
    walls[:, 0] = np.where(walls[:, 0] < 0.0, -1.0, 1.0)
    cloud = rrtik.PointCloud(walls, radius=0.01)
    trees = _blocks_of(cloud)
    leaves = [tree.solids[tree.nodes[0, NODE_CENTRES]].corners for tree in trees]
    assert max(np.ptp(points, axis=0).max() for points in leaves) < 0.6
    assert np.array_equal(np.unique(np.concatenate(leaves), axis=0), np.unique(cloud.points, axis=0))


@pytest.mark.parametrize("shape", [rrtik.Box([0.3, 0.2, 0.1]), notched(0.15)])
def test_without_kernels_the_answers_are_the_same(arm, shape, without_kernels):
    world = world_with(arm, shape)
    Q = postures(arm, 2)
    found = world.distances(Q, within=1.0)
    for k, q in enumerate(Q):
        expected = np.array([by_coal(world, q, names) for names in found.names])
        apart = (expected > 0.0) & (expected < 1.0)
        assert np.allclose(found.values[k][apart], expected[apart], rtol=0.0, atol=ACCURATE)
    rows = [k for k, q in enumerate(Q) if (found.values[k] > 1e-3).all()] or [0]
    q = Q[rows[0]]
    far = found.values[rows[0]] > 1e-3
    assert np.allclose(
        world.distances(q).gradients[far], differences(world, q)[far], rtol=0.0, atol=1e-3
    )  # coal ends 1e-6 early, which differences of 1e-6 magnify


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"pairs": [("hand", "nothing")]}, "nothing"),
        ({"pairs": [("hand", "hand")]}, "itself"),
        ({"pairs": ["hand"]}, "pairs of names"),
        ({"nearest": 0}, "nearest"),
        ({"within": -1.0}, "within"),
    ],
)
def test_a_wrong_argument_is_told_in_a_line(arm, options, told):
    world = world_with(arm, rrtik.Sphere(0.1))
    with pytest.raises(rrtik.InputError, match=told):
        world.distances(np.zeros(arm.dof), **options)


@pytest.mark.kernels
def test_a_triangle_that_is_nearer_by_less_than_a_nanometre_is_not_left_out():
    """Its nearest point is micrometres away, so the gradient would be off by 4e-5."""
    box = Obstacle("box", rrtik.Box([0.1176, 0.1011, 0.1025]), [0.2393, -0.6892, 0.2644])
    world = World(rrtik.load_robot("ur5"), Scene([box]))
    q = np.array([-5.622532, -2.13688, 1.543254, -5.971369, -5.67198, 1.973021])
    pair = [("wrist_1_link", "box")]
    found = world.distances(q, pair).gradients
    assert np.allclose(found, differences(world, q, pairs=pair), rtol=0.0, atol=GRADIENT)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 50, 333])
def test_levels_of_triangles_halved_at_once_are_those_halved_one_by_one(count):
    random = np.random.default_rng(count)
    vertices = random.normal(size=(count // 2 + 3, 3)).round(2)
    triangles = random.integers(0, len(vertices), (count, 3))

    def around(own):
        corners = trees._hull_of(vertices[np.unique(triangles[own])])
        return ConvexSolid(corners), HULL if len(own) == count else AROUND

    leaves = [trees._leaf(ConvexSolid(corners), TRIANGLE) for corners in vertices[triangles]]
    wanted = trees._above(leaves, vertices[triangles].mean(axis=1), around)
    tree = trees._tree_of_triangles(vertices, triangles)
    assert np.array_equal(tree.nodes, wanted.nodes)
    assert all(np.array_equal(a.corners, b.corners) for a, b in zip(tree.solids, wanted.solids, strict=True))
