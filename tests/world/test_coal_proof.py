"""Links whose convex pieces stick out of their meshes: proven apart by coal's distances, and never where they touch."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.enclosure import CELLS
from rrtik_ompl.geometry.collision.solids import bvh, is_closed, measured, mesh_arrays
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.world.coal_proof import CoalProof
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.world import World
from rrtik_tests.bent_meshes import slotted_cube
from rrtik_tests.by_coal import free_by_coal

pytestmark = pytest.mark.kernels


def opened(mesh):
    """A mesh without the triangle that lies highest."""
    vertices, triangles = mesh_arrays(mesh)
    highest = int(vertices[triangles][:, :, 2].sum(axis=1).argmax())
    return measured(bvh(vertices, np.delete(triangles, highest, axis=0)))


@pytest.fixture(scope="module")
def world():
    return World(rrtik.load_robot("ur5"))


def by_kernels_alone(monkeypatch):
    monkeypatch.setattr(CoalProof, "settle", lambda *_: None)


@pytest.fixture(scope="module")
def postures(world):
    """Free postures that kernels alone cannot prove."""
    low, high = world.robot.finite_range()
    Q = np.random.default_rng(3).uniform(low, high, (6000, world.robot.dof))
    Q = Q[world.valid_batch(Q)]
    with pytest.MonkeyPatch.context() as patch:
        by_kernels_alone(patch)
        return Q[[gap.motion for gap in world.prover.still_gaps(Q, clearance=0.0)]]


def test_every_free_posture_is_proven_where_kernels_alone_leave_some_open(world, postures):
    assert len(postures) > 3
    assert world.motions_proven(postures, postures).all()
    assert free_by_coal(world, postures).all()


def test_short_motions_that_are_proven_are_free_wherever_coal_looks(world, postures, monkeypatch):
    rng = np.random.default_rng(4)
    starts = np.repeat(postures, 8, axis=0)
    ends = np.clip(starts + rng.normal(0.0, 0.02, starts.shape), world.robot.lower, world.robot.upper)
    proven = world.motions_proven(starts, ends)
    assert (proven == world.motions_proven(ends, starts)).mean() > 0.9
    assert proven.mean() > 0.5
    for a, b in zip(starts[proven], ends[proven], strict=True):
        assert free_by_coal(world, a + np.linspace(0.0, 1.0, 60)[:, None] * (b - a)).all()
    by_kernels_alone(monkeypatch)
    assert not world.motions_proven(starts, ends)[proven].all()


def test_motions_into_contact_are_never_proven(world, postures):
    rng = np.random.default_rng(5)
    starts = np.repeat(postures, 20, axis=0)
    ends = np.clip(starts + rng.normal(0.0, 0.1, starts.shape), world.robot.lower, world.robot.upper)
    touching = ~free_by_coal(world, ends)
    assert touching.sum() > 20
    assert not world.motions_proven(starts, ends)[touching].any()


def test_margins_of_the_arm_to_itself_are_kept(world, postures):
    wide = World(world.robot, self_margin=0.005)
    assert not wide.motions_proven(postures, postures)[~free_by_coal(wide, postures)].any()


def test_the_table_is_as_before_when_links_were_compared(world, postures):
    world.motions_proven(postures, postures)
    q = np.zeros((1, world.robot.dof))
    q[0, 2] = np.pi  # the forearm in the upper arm
    assert not world.motion_proven(q[0], q[0])


def test_a_body_wholly_inside_a_link_is_not_proven_apart_from_it(world):
    """The wrist as a grain within the upper arm: no surface is near another."""
    numbers = {body.name: k for k, body in enumerate(world.bodies)}
    arm, wrist = world.bodies[numbers["upper_arm_link"]], world.bodies[numbers["wrist_1_link"]]
    q = np.zeros(world.robot.dof)
    frames = world.robot.joint_frames(q[None])[0]
    middle = convex_solids(arm.geometry).inside[0].corners.mean(axis=0)
    place = pin.SE3(frames[arm.joint]) * arm.placement * pin.SE3(np.eye(3), middle)
    grain = small_mesh(1e-3)
    assert is_closed(grain)
    inside = replace(wrist, geometry=grain, placement=pin.SE3(frames[wrist.joint]).inverse() * place)
    pair = numbers["upper_arm_link"], numbers["wrist_1_link"]
    bodies = tuple(inside if k == pair[1] else body for k, body in enumerate(world.bodies))
    assert not Prover(world.robot, bodies, (pair,)).proven(q[None], q[None])[0]
    away = replace(inside, placement=pin.SE3(np.eye(3), np.array([0.0, 0.0, 5.0])))
    apart = tuple(away if k == pair[1] else body for k, body in enumerate(world.bodies))
    assert Prover(world.robot, apart, (pair,)).proven(q[None], q[None])[0]


def test_links_of_open_meshes_are_proven_apart_too(world, postures, monkeypatch):
    with pytest.MonkeyPatch.context() as patch:
        by_kernels_alone(patch)
        names = {gap.pair for gap in world.prover.still_gaps(postures, clearance=0.0)}
    pair = next(pair for pair in world.pairs if tuple(world.bodies[k].name for k in pair) in names)
    torn = list(world.bodies)
    for k in pair:
        torn[k] = replace(torn[k], geometry=opened(torn[k].geometry))
        assert not is_closed(torn[k].geometry)

    prover = Prover(world.robot, tuple(torn), (pair,))
    assert prover.proven(postures, postures).all()
    by_kernels_alone(monkeypatch)
    assert not prover.proven(postures, postures).all()


SLIDE = """<robot name="slide"><link name="base"/><link name="grain"/><joint name="z" type="prismatic">
<parent link="base"/><child link="grain"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="1"/>
</joint></robot>"""


@pytest.mark.parametrize("width", [0.0, 0.5 / CELLS])
def test_what_moves_through_a_slot_into_a_link_is_not_proven_apart_from_it(width, cube):
    """The grain passes through the slot, and touches neither side of it."""
    shell, grain = bvh(*slotted_cube(cube, width)), small_mesh(1e-3)
    still = pin.SE3.Identity()
    bodies = Body("base", 0, still, measured(shell), "link"), Body("grain", 1, still, grain, "link")
    prover = Prover(robot_from_urdf_text(SLIDE), bodies, ((0, 1),))
    rows = np.array([[1.9], [1.1], [0.0]])
    assert prover.proven(rows[:1], rows[1:2]).all()
    assert not prover.proven(rows[:1], rows[2:]).any()
    assert not prover.proven(rows[2:], rows[2:]).any()


def small_mesh(half):
    """A closed mesh of a tetrahedron."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(4, 4)
    corners = half * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    mesh.addVertices(corners)
    mesh.addTriangles(np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], dtype=np.int32))
    mesh.endModel()
    mesh.computeLocalAABB()
    return mesh


def resting_on_a_post(rng, robot, q):
    """A world in which a held box just touches a turned post at a configuration."""
    held = rrtik.AttachedObject("thing", robot.tip, rrtik.Box(rng.uniform(0.03, 0.1, 3)), [0.0, 0.0, 0.08])
    shape = rrtik.Box(rng.uniform(0.05, 0.2, 3))
    turn = pin.Quaternion(*unit(rng.normal(size=4))).matrix()
    way = unit(rng.normal(size=3))
    middle = robot.fk(q).act(np.array([0.0, 0.0, 0.08]))

    def at(distance, contacts=()):
        post = rrtik.Obstacle("post", shape, pin.SE3(turn, middle + distance * way))
        return rrtik.World(robot, rrtik.Scene([post], attached=[held], contacts=contacts))

    near = 0.0
    far = 0.4
    for _ in range(12):
        place = 0.5 * (near + far)
        touch = any({c.first, c.second} == {"thing", "post"} for c in at(place).contacts(q))
        near, far = (place, far) if touch else (near, place)
    return at(near, [rrtik.Touching("thing", "post", -0.001)])


def unit(vector):
    return vector / np.linalg.norm(vector)


def test_proofs_of_bodies_in_contact_do_not_depend_on_what_was_proven_before():
    rng = np.random.default_rng(1)
    robot = rrtik.load_robot("panda")
    q = np.array(robot.posture("ready"))
    shares = []
    for _ in range(8):
        world = resting_on_a_post(rng, robot, q)
        starts = q + rng.normal(0.0, 10.0 ** rng.uniform(-4.0, -2.3, (60, 1)), (60, 7))
        ends = starts + rng.normal(0.0, 10.0 ** rng.uniform(-3.5, -1.0, (60, 1)), (60, 7))
        one_by_one = [world.motion_proven(a, b) for a, b in zip(starts, ends, strict=True)]
        in_reverse = [world.motion_proven(a, b) for a, b in zip(starts[::-1], ends[::-1], strict=True)]
        np.testing.assert_array_equal(one_by_one, in_reverse[::-1])
        np.testing.assert_array_equal(one_by_one, world.prover.proven(starts, ends))
        shares.append(np.mean(one_by_one))
    assert 0.2 < np.mean(shares) < 0.8
