"""Kernels compare convex solids, and what they prove is what coal says, close to contact above all."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.certificate import Certificate
from rrtik_ompl.collision.enclosure import enclosure
from rrtik_ompl.collision.solids import bvh, hull, inside_mesh, mesh_arrays
from rrtik_ompl.covers.mesh_pieces import convex_pieces
from rrtik_ompl.fast import COLLIDING, FREE, UNDECIDED, FastWorld
from rrtik_ompl.fast.tables.solid_tables import NO_SOLIDS, convex_solids
from rrtik_ompl.robot import Robot

ROWS = 300  # configurations of a case
NOTHING = np.empty((0, 4))


def measured(geometry):
    geometry.computeLocalAABB()
    return geometry


def convex(rng):
    return hull(rng.normal(size=(30, 3)) * 0.06)


def swept(geometry):
    geometry.setSweptSphereRadius(0.03)
    return geometry


CONVEX = {
    "box": lambda rng: coal.Box(*rng.uniform(0.05, 0.3, 3)),
    "ball": lambda rng: coal.Sphere(rng.uniform(0.05, 0.15)),
    "capsule": lambda rng: coal.Capsule(rng.uniform(0.02, 0.1), rng.uniform(0.05, 0.3)),
    "cylinder": lambda rng: coal.Cylinder(rng.uniform(0.02, 0.1), rng.uniform(0.05, 0.3)),
    "hull": convex,
    "swept box": lambda rng: swept(coal.Box(*rng.uniform(0.05, 0.2, 3))),
}


def angle():
    """A closed prism in the form of an L: vertices and triangles."""
    floor = 0.08 * np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float) - 0.08
    vertices = np.vstack([np.column_stack([floor, np.full(6, z)]) for z in (-0.06, 0.06)])
    top = [(6, 6 + k, 7 + k) for k in range(1, 5)]
    bottom = [(0, k + 1, k) for k in range(1, 5)]
    around = [(k, (k + 1) % 6) for k in range(6)]
    sides = [face for a, b in around for face in ((a, b, b + 6), (a, b + 6, a + 6))]
    return vertices, np.array([*top, *bottom, *sides])


@pytest.fixture(scope="module")
def meshes(dented_cube):
    """Meshes that are not convex: closed, open, of two shells that overlap, dented, and with a hollow."""
    vertices, triangles = angle()
    cube, hollow = dented_cube(0.12, 0.12), dented_cube(0.04, 0.04)
    corners, faces = np.array(cube.vertices), np.array(cube.triangles)
    turned = np.array(hollow.triangles)[:, ::-1]
    shift, dented = np.array([0.1, 0.05, 0.02]), dented_cube(0.12, -0.06)
    return {
        "angle": bvh(vertices, triangles),
        "open": bvh(vertices, triangles[1:]),
        "two shells": bvh(np.vstack([corners, corners + shift]), np.vstack([faces, faces + len(corners)])),
        "dented": bvh(dented.vertices, dented.triangles),
        "hollow": bvh(np.vstack([corners, hollow.vertices]), np.vstack([faces, turned + len(corners)])),
    }


KINDS = ["angle", "open", "two shells", "dented", "hollow"]


def near_contact(robot, moving, other, joint, rng):
    """Bodies ``moving`` (on the last joint) and ``other``, and configurations in which they are close. Three values."""
    lower, upper = robot.finite_range()
    middle = rng.uniform(lower, upper)
    rows = np.clip(middle + rng.normal(size=(ROWS, robot.dof)) * 0.1, lower, upper)
    frames = robot.joint_frames(middle[None])[0]
    place = pin.SE3(frames[joint]).inverse() * pin.SE3(frames[-1])
    away = rng.normal(size=3)
    shift = away / np.linalg.norm(away) * 0.7 * (moving.aabb_radius + other.aabb_radius)
    if isinstance(other, coal.Halfspace):
        shift = np.zeros(3)
    pose = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), place.translation + shift)
    hand = Body("hand", len(frames) - 1, pin.SE3.Identity(), moving, "link")
    return (hand, Body("other", joint, pose, other, "link" if joint else "obstacle")), rows


def compared(robot: Robot, moving, other, joint, rng):
    """Answers of the kernels, coal's, and coal's distances are asked for where the two contradict each other."""
    bodies, rows = near_contact(robot, measured(moving), measured(other), joint, rng)
    solids = [convex_solids(body.geometry) for body in bodies]
    nothing = [NOTHING] * len(bodies)
    world = FastWorld(robot.chain, bodies, [(0, 1)], outer=nothing, inner=nothing, solids=solids)
    answers = world.classify(robot.joint_values(rows))
    free = Certificate(robot, bodies, ((0, 1),)).free(rows)
    assert not (answers[~free] == FREE).any()
    assert not (answers[free] == COLLIDING).any()
    return answers, world, rows


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("moving", CONVEX)
@pytest.mark.parametrize("name", ["panda", "titan4"])
def test_what_is_proven_of_convex_solids_is_what_coal_says(name, moving, joint):
    robot, rng = load_robot(name), np.random.default_rng([joint, *moving.encode()])
    half_space = {"half-space": lambda rng: coal.Halfspace(rng.normal(size=3), 0.0)} if joint == 0 else {}
    seen = []
    for other in {**CONVEX, **half_space}.values():
        for _ in range(2):
            seen.append(compared(robot, CONVEX[moving](rng), other(rng), joint, rng)[0])
    seen = np.concatenate(seen)
    assert set(seen.tolist()) >= {FREE, COLLIDING}
    assert (seen == UNDECIDED).mean() < 0.01


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_proven_of_meshes_is_what_coal_says(meshes, kind, joint):
    robot, rng = load_robot("panda"), np.random.default_rng([7, joint])
    seen = []
    convex = [make for name, make in CONVEX.items() if name != "swept box"]  # which coal does not compare with meshes
    for other in (*convex, lambda rng: meshes["angle"]):
        for _ in range(2):
            seen.append(compared(robot, meshes[kind], other(rng), joint, rng)[0])
    seen = np.concatenate(seen)
    assert (seen == FREE).mean() > 0.1
    assert (seen == UNDECIDED).mean() < {"angle": 0.2, "two shells": 0.2}.get(kind, 0.7)


def test_of_unknown_kinds_nothing_is_proven():
    robot, rng = load_robot("panda"), np.random.default_rng(6)
    floor = swept(coal.Halfspace(np.array([0.0, 0.0, 1.0]), -0.3))
    for other in (coal.Cone(0.1, 0.2), coal.Ellipsoid(0.1, 0.2, 0.05), floor):
        assert (compared(robot, CONVEX["box"](rng), other, 0, rng)[0] == UNDECIDED).any()
        assert convex_solids(other) is NO_SOLIDS


def test_motions_are_judged_as_their_configurations_are():
    robot, rng = load_robot("panda"), np.random.default_rng(2)
    _, world, rows = compared(robot, CONVEX["hull"](rng), CONVEX["cylinder"](rng), 0, rng)
    V = robot.joint_values(rows)
    starts, ends, steps = V[:100], V[100:200], np.full(100, 21)
    shares = (np.arange(22) / 21.0)[:, None]
    each = [world.classify((1.0 - shares) * a + shares * b) for a, b in zip(starts, ends, strict=True)]
    expected = [COLLIDING if (e == COLLIDING).any() else int(e.max()) for e in each]
    assert len(set(expected)) > 1
    np.testing.assert_array_equal(world.classify_edges(starts, ends, steps), expected)
    assert (world.classify_edges(starts, ends, steps, narrow_phase=False) >= np.minimum(expected, UNDECIDED)).all()


def test_pairs_that_are_proven_apart_are_not_handed_on():
    robot, rng = load_robot("panda"), np.random.default_rng(4)
    answers, world, rows = compared(robot, CONVEX["box"](rng), CONVEX["hull"](rng), 0, rng)
    V = robot.joint_values(rows)
    assert all(pairs == [] for pairs in world.undecided_pairs(V[answers == FREE]))
    assert all(pairs == [(0, 1)] for pairs in world.undecided_pairs(V[answers != FREE]))


def test_without_solids_nothing_is_proven_by_them():
    robot, rng = load_robot("panda"), np.random.default_rng(4)
    bodies, rows = near_contact(robot, measured(CONVEX["box"](rng)), measured(CONVEX["hull"](rng)), 0, rng)
    nothing, V = [NOTHING] * 2, robot.joint_values(rows)
    bare = FastWorld(robot.chain, bodies, [(0, 1)], outer=nothing, inner=nothing)
    one = [convex_solids(bodies[0].geometry), NO_SOLIDS]
    half = FastWorld(robot.chain, bodies, [(0, 1)], outer=nothing, inner=nothing, solids=one, like=bare)
    assert (bare.classify(V) == UNDECIDED).any()
    np.testing.assert_array_equal(bare.classify(V), half.classify(V))


def holding(pieces, points):
    """Which points, shape (n, 3), lie in one of some pieces."""
    planes = [ConvexHull(piece, qhull_options="QJ").equations for piece in pieces]  # pieces may be flat
    found = [(points @ p[:, :3].T + p[:, 3] <= 1e-7).all(axis=1) for p in planes]
    return np.any(found, axis=0) if found else np.zeros(len(points), dtype=bool)


@pytest.mark.parametrize("kind", KINDS)
def test_pieces_of_a_mesh_contain_it_and_those_inside_are_inside(meshes, kind):
    vertices, triangles = mesh_arrays(meshes[kind])
    rng = np.random.default_rng(0)
    around, inside, points = convex_pieces(meshes[kind])
    weights = rng.dirichlet(np.ones(3), 4000)
    surface = np.einsum("nk,nkj->nj", weights, vertices[triangles[rng.integers(len(triangles), size=4000)]])
    assert holding(around, surface).all()
    assert holding(around, np.concatenate(points)).all()
    cloud = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (1500, 3))
    if kind == "open":
        enclosed = np.array([enclosure(meshes[kind]).holds(p[None]) for p in cloud])
        assert holding(around, cloud[enclosed]).all()
        assert inside == []
        return
    held = np.array([inside_mesh(vertices, triangles, p) for p in cloud])
    assert holding(around, cloud[held]).all()
    assert not holding(inside, cloud[~held]).any()
    if kind in ("angle", "two shells"):
        assert len(around) > 1
        assert holding(inside, cloud[held]).mean() > 0.95


def test_no_point_of_a_mesh_lies_in_its_hollow(dented_cube):
    """Cells that a ragged shell is cut into have corners in the middle, where the hollow is."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(30, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    faces = ConvexHull(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", a, np.cross(b, c)) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    hollow = dented_cube(0.2, 0.2)
    vertices = np.vstack([points * rng.uniform(0.4, 1.0, (30, 1)), hollow.vertices])
    triangles = np.vstack([faces, np.array(hollow.triangles)[:, ::-1] + 30])
    _, _, found = convex_pieces(bvh(vertices, triangles))
    assert len(found) > 4
    assert (np.abs(np.concatenate(found)).max(axis=1) > 0.2 - 1e-9).all()
