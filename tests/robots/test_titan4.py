"""TITAN 4: three independent forms of its forward kinematics agree; limits, postures and shipped files are right."""

from importlib.resources import files

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.world import World
from rrtik_robots.titan4 import JOINTS, TitanGeometry, titan4_urdf

G = TitanGeometry()


@pytest.fixture(scope="module")
def Q():
    return np.random.default_rng(4).uniform(-np.pi, np.pi, (10_000, 6))


def matrices(count):
    T = np.zeros((count, 4, 4))
    T[:, [0, 1, 2, 3], [0, 1, 2, 3]] = 1.0
    return T


def closed_form(Q):
    """Published closed form: P, w, u, v = w x u, E = P + d6 w."""
    t1, t2, t3, t4, t5, t6 = Q.T
    psi, zero = t2 + t3 + t4, np.zeros(len(Q))
    r = G.a1 + G.a2 * np.cos(t2) + G.a3 * np.cos(t2 + t3) + G.a4 * np.cos(psi)
    z = G.a2 * np.sin(t2) + G.a3 * np.sin(t2 + t3) + G.a4 * np.sin(psi)
    s5, c5, s6, c6, sp, cp = np.sin(t5), np.cos(t5), np.sin(t6), np.cos(t6), np.sin(psi), np.cos(psi)
    turn = np.array([[np.cos(t1), -np.sin(t1), zero], [np.sin(t1), np.cos(t1), zero], [zero, zero, zero + 1]])
    w = np.einsum("ijk,jk->ki", turn, np.array([c5 * cp, s5, c5 * sp]))
    u = np.einsum("ijk,jk->ki", turn, np.array([s5 * s6 * cp - c6 * sp, -c5 * s6, s5 * s6 * sp + c6 * cp]))
    T = matrices(len(Q))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = u, np.cross(w, u), w
    T[:, :3, 3] = np.stack([r * np.cos(t1), r * np.sin(t1), z], axis=1) + G.d6 * w
    return T


def dh_chain(Q):
    """Standard DH table with theta5 + pi/2 and theta6 + pi/2."""
    h = np.pi / 2
    rows = [(G.a1, h, 0, 0), (G.a2, 0, 0, 0), (G.a3, 0, 0, 0), (G.a4, -h, 0, 0), (0, h, 0, h), (0, 0, G.d6, h)]
    T = matrices(len(Q))
    for k, (a, alpha, d, offset) in enumerate(rows):
        c, s, ca, sa = np.cos(Q[:, k] + offset), np.sin(Q[:, k] + offset), np.cos(alpha), np.sin(alpha)
        A = matrices(len(Q))
        A[:, 0] = np.stack([c, -s * ca, s * sa, a * c], axis=1)
        A[:, 1] = np.stack([s, c * ca, -c * sa, a * s], axis=1)
        A[:, 2] = [0, sa, ca, d]
        T = T @ A
    return T


def screws(Q):
    """Product of the six screw displacements about the axes at zero, times the reference pose."""
    along = np.cumsum([0, G.a1, G.a2, G.a3, G.a4])
    axes = [(0, 0, 1), (0, -1, 0), (0, -1, 0), (0, -1, 0), (0, 0, 1), (1, 0, 0)]
    points = [(0, 0, 0), *((x, 0, 0) for x in along[1:]), (0, 0, 0)]
    reference = np.array([[0, 0, 1, along[-1] + G.d6], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
    out = []
    for q in Q:
        T = pin.SE3.Identity()
        for axis, point, angle in zip(axes, points, q, strict=True):
            R = pin.exp3(angle * np.array(axis, dtype=float))
            T = T * pin.SE3(R, np.array(point) - R @ point)
        out.append(T.homogeneous @ reference)
    return np.array(out)


@pytest.mark.parametrize("reference", [closed_form, dh_chain, screws])
def test_forward_kinematics_agrees_with_three_independent_forms(titan, Q, reference):
    np.testing.assert_allclose(titan.fk_batch(Q), reference(Q), atol=1e-12)


def test_at_zero_the_tip_is_at_full_reach_with_the_published_axes(titan):
    expected = [[0, 0, 1, 1.922], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(titan.fk(np.zeros(6)).homogeneous, expected, atol=1e-12)
    assert G.reach == pytest.approx(1.922, abs=1e-12)


def test_the_limit_sets_differ_in_the_shoulder_alone():
    planning, envelope = load_robot("titan4"), load_robot("titan4", parameters={"limits": "envelope"})
    others = [0, 2, 3, 4, 5]
    for robot, shoulder in ((planning, (-34.19, 85.81)), (envelope, (-42, 78))):
        np.testing.assert_allclose(np.degrees([robot.lower[1], robot.upper[1]]), shoulder)
        np.testing.assert_allclose(np.degrees(robot.lower[others]), [-120, -164, -90, -90, -120])
        np.testing.assert_allclose(np.degrees(robot.upper[others]), [120, 106, 90, 90, 120])


def test_the_assumed_rates_are_loaded(titan):
    np.testing.assert_allclose(np.degrees(titan.velocity), [20] * 5 + [60], rtol=1e-6)
    np.testing.assert_allclose(titan.acceleration, 4 * titan.velocity, rtol=1e-6)
    np.testing.assert_allclose(titan.jerk, 20 * titan.velocity, rtol=1e-6)


def test_the_shipped_urdf_is_what_the_generator_writes():
    assert (files("rrtik_robots.titan4") / "titan4.urdf").read_text() == titan4_urdf()


def test_another_geometry_moves_the_tip():
    assert load_robot("titan4", parameters={"lengths": {"d6": 0.333}}).fk(np.zeros(6)).translation[0] == pytest.approx(
        1.916
    )


def test_the_joints_and_the_tip_speak_the_arms_vocabulary(titan):
    assert titan.joint_names == JOINTS
    assert (titan.tip, titan.link_names[0]) == ("grip_point", "base")


def test_named_postures_are_within_both_limit_sets_and_free_of_self_collision(titan):
    world, envelope = World(titan, Scene()), load_robot("titan4", parameters={"limits": "envelope"})
    for name, q in titan.postures.items():
        assert world.valid(q), name
        assert envelope.within_limits(q)[0], name


def test_the_sdu_postures_are_the_published_ones(titan):
    np.testing.assert_allclose(titan.fk(titan.posture("sdu_start")).translation, [1.46, 0.68, -0.18], atol=5e-3)
    np.testing.assert_allclose(titan.fk(titan.posture("sdu_goal")).translation, [1.29, 0.17, 0.07], atol=5e-3)


def test_stowed_the_arm_is_as_small_as_in_the_vendors_drawing(titan):
    """1101 x 500 mm upright: height above the mounting face, and depth from the rear edge of the base."""
    frames = titan.joint_frames(titan.posture("stowed")[None])[0]
    points = []
    for item in titan.collision.geometryObjects:
        placement, solid = pin.SE3(frames[item.parentJoint]) * item.placement, item.geometry
        points += [placement.act(np.array([0, 0, s * solid.halfLength])) + k * solid.radius * np.eye(3)
                   for s in (-1, 1) for k in (-1, 1)]  # fmt: skip
    high, front = np.max([p.diagonal() for p in points], axis=0)[[2, 0]]
    assert high + G.shoulder_height == pytest.approx(1.101, abs=0.03)
    assert front + G.base_rear == pytest.approx(0.500, abs=0.03)
