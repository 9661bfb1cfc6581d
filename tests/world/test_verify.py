"""Certificates of proven paths are accepted; one that is tampered with in any way is refused."""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import islice

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from bench.proofs.cases import random_cases, random_scene
from bench.proofs.certificates import main
from bench.proofs.tampering import TAMPERINGS, with_model_of
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.elements import compared_pairs, named_bodies
from rrtik_ompl.kernels.proof import log
from rrtik_ompl.model.certificate import MotionEntries, Route, from_document
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.world import certificate_making
from rrtik_ompl.world.certificate_check import Motions, certificate_fault
from rrtik_ompl.world.certificate_course import Course
from rrtik_ompl.world.certificate_parts import Parts
from rrtik_ompl.world.coal_proof import CoalProof
from rrtik_ompl.world.world import World
from rrtik_tests.turning_slider import slider

ARMS = ("planar3", "titan4", "panda", "ur5_gripper", "point2d", "slider")
pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """Some paths of each arm with their certificates."""
    kept = {}

    def of(name):
        if name not in kept:
            robot = slider(tmp_path_factory.mktemp("slider")) if name == "slider" else rrtik.load_robot(name)
            kept[name] = list(islice(random_cases(robot, seed=len(name)), 6))
        return kept[name]

    return of


@pytest.mark.parametrize("name", ARMS)
def test_a_certificate_of_a_proven_path_holds_also_when_read_again(name, cases):
    for world, path, certificate in ((case.world, case.path, case.certificate) for case in cases(name)):
        again = from_document(json.loads(json.dumps(certificate.document())))
        assert certificate_fault(certificate, world, path.waypoints) == ""
        assert certificate_fault(again, world, path.waypoints, clearance=0.001) == ""
        assert again.entries == certificate.entries
        assert (again.waypoints == path.waypoints).all()
        assert world.prover.tables.packed.table.intact()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", TAMPERINGS)
@pytest.mark.parametrize("name", ["planar3", "titan4", "panda"])
def test_what_is_tampered_with_is_refused(name, kind, seed, cases):
    case, rng = cases(name)[seed], np.random.default_rng(seed)
    falsified = TAMPERINGS[kind](case, rng)
    if falsified is None:
        pytest.skip("there is nothing to tamper with")
    fault = certificate_fault(*falsified)
    assert fault
    assert "\n" not in fault


def test_a_gap_of_an_obstacle_less_than_a_millimetre_away_is_looked_at_closely():
    robot = rrtik.load_robot("planar3", parameters={"radius": 0.02})
    a, b = np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.0, 0.0])
    ball = Obstacle("ball", Sphere(0.01), rrtik.pose([3.2, 0.0, 0.0]))
    beyond = World(robot, Scene([ball])).clearance(np.zeros(3))
    near = World(robot, Scene([replace(ball, pose=rrtik.pose([3.2 - beyond + 1e-5, 0.0, 0.0]))]))
    path = JointPath.of(robot, [a, b])
    certificate = near.certificate(path)
    assert certificate_fault(certificate, near, path.waypoints) == ""
    assert "not shown apart" in certificate_fault(replace(certificate, clearance=2e-5), near, path.waypoints)


def test_what_an_arm_holds_and_what_it_may_touch_are_part_of_the_scene():
    robot = rrtik.load_robot("ur5")
    tool = AttachedObject("tool", "tool0", Box([0.05, 0.05, 0.2]), rrtik.pose([0.0, 0.0, 0.12]))
    post = Obstacle("post", Box([0.1, 0.1, 1.0]), rrtik.pose([0.7, 0.4, 0.5]))
    world = World(robot, Scene([post], attached=[tool]))
    start = np.array([0.0, -1.2, 1.0, -1.0, -1.5, 0.0])
    path = JointPath.of(robot, [start, start + np.array([-0.6, 0.2, 0.1, 0.3, 0.0, 1.0])])
    certificate = world.certificate(path)
    assert certificate_fault(certificate, world, path.waypoints) == ""
    for other in (Scene([post]), Scene([post], attached=[replace(tool, allow=("forearm_link",))])):
        fault = certificate_fault(certificate, World(robot, other), path.waypoints)
        assert fault.startswith("it is for another scene")


def test_a_path_that_is_not_proven_has_no_certificate():
    robot = rrtik.load_robot("planar3", parameters={"radius": 0.02})
    world = World(robot, Scene([Obstacle("ball", Sphere(0.1), rrtik.pose([2.5, 0.0, 0.0]))]))
    path = JointPath.of(robot, [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    assert world.certificate(path) is None
    assert world.certificate(JointPath.of(robot, [[9.0, 0.0, 0.0], [9.1, 0.0, 0.0]])) is None
    with pytest.raises(InputError, match="another robot"):
        world.certificate(JointPath([[0.0, 1.0]]))


def test_a_path_that_stands_still_has_a_certificate():
    robot = rrtik.load_robot("panda")
    world, q = World(robot, random_scene(robot, np.random.default_rng(4))), robot.posture("default")
    for rows in ([q], [q, q], [q, q, q + 0.01]):
        path = JointPath.of(robot, rows)
        certificate = world.certificate(path)
        assert certificate_fault(certificate, world, path.waypoints) == ""
        assert len(certificate.motions) == max(1, len(rows) - 1)


def test_a_base_that_touches_an_obstacle_has_none_and_a_forged_one_is_refused(cases):
    case = cases("panda")[0]
    floor = Obstacle("slab", Box([1.0, 1.0, 0.1]), rrtik.pose([0.0, 0.0, 0.0]))
    world = World(case.world.robot, Scene([floor]))
    assert world.certificate(case.path) is None
    fault = certificate_fault(with_model_of(case.certificate, world), world, case.path.waypoints)
    assert "touch and never move" in fault


def test_entries_of_no_pair_part_or_interval_are_refused(cases):
    case = next(case for case in cases("panda") if len(case.certificate.motions[0].solids))
    first, *others = case.certificate.motions
    for solid, interval in (([0, 0, 0, 0], [0, 0]), ([0, 99, 1, 0], [0, 0]), (first.solids[0], [60, 0])):
        changed = replace(first, solids=first.solids.copy(), intervals=first.intervals.copy())
        changed.solids[0], changed.intervals[0] = solid, interval
        fault = certificate_fault(
            replace(case.certificate, motions=(changed, *others)), case.world, case.path.waypoints
        )
        assert fault.startswith("motion 1: no parts")


def test_a_larger_clearance_than_the_certificate_has_is_not_shown_by_it(cases):
    case = cases("titan4")[0]
    assert "clearance" in certificate_fault(case.certificate, case.world, case.path.waypoints, clearance=0.002)


def test_links_that_coal_proves_apart_are_in_the_certificate_and_measured_again(monkeypatch):
    monkeypatch.setattr(certificate_making, "MOST_PARTS", certificate_making.FIRST_PARTS)
    world = World(rrtik.load_robot("ur5"))
    low, high = world.robot.finite_range()
    drawn = np.random.default_rng(3).uniform(low, high, (6000, world.robot.dof))
    drawn = drawn[world.motions_proven(drawn, drawn)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CoalProof, "settle", lambda *_: None)
        starts = drawn[[gap.motion for gap in world.prover.still_gaps(drawn, clearance=0.0)]][:3]
    assert len(starts) == 3
    for a, b in zip(starts, starts + np.array([1e-3, -1e-3, 1e-3, 1e-3, -1e-3, 0.1]), strict=True):
        certificate = from_document(json.loads(json.dumps(world.certificate([a, b]).document())))
        (motion,) = certificate.motions
        measured = np.flatnonzero(motion.solids[:, 1] < 0)
        assert len(measured) > 0
        assert certificate_fault(certificate, world, [a, b]) == ""
        kept = np.arange(len(motion.solids)) != measured[-1]
        missing = MotionEntries(motion.solids[kept], motion.intervals[kept], motion.normals[kept])
        other = replace(motion, solids=np.where(motion.solids < 0, 0, motion.solids))
        for falsified in (missing, other):
            assert certificate_fault(replace(certificate, motions=(falsified,)), world, [a, b])


def motions_of(world, certificate):
    """What the verifier makes of a certificate."""
    named = named_bodies(world.bodies)
    trees = [Parts(each.elements, body.cuts) for each, body in zip(named, certificate.bodies, strict=True)]
    course = Course(world.robot.chain, Route(certificate.waypoints, certificate.times, certificate.rates))
    return Motions(world.robot.chain, named, trees, compared_pairs(named, world.pairs), course, certificate.clearance)


def test_links_that_touch_are_not_measured_apart_whatever_a_certificate_says():
    world = World(rrtik.load_robot("ur5"))
    q = np.zeros(world.robot.dof)
    q[2] = np.pi  # the forearm in the upper arm
    honest = world.certificate([np.zeros(6), np.zeros(6)])
    solids = np.array([[i, -1, j, -1] for i, j in motions_of(world, honest).pairs])
    entries = MotionEntries(solids, np.zeros((len(solids), 2), dtype=np.int64), np.zeros((len(solids), 3)))
    forged = replace(honest, waypoints=np.array([q, q]), motions=(entries,))
    assert "not shown apart" in certificate_fault(forged, world, [q, q])


@pytest.mark.parametrize("name", ["panda", "slider"])
def test_the_verifier_computes_the_frames_that_pinocchio_does_and_bounds_all_accelerations(name, cases):
    case = cases(name)[0]
    robot, rows = case.world.robot, case.path.waypoints
    motions = motions_of(case.world, case.certificate)
    shares = np.linspace(0.0, 1.0, 50)
    frames = motions._course.frames(np.zeros(50, dtype=np.int64), shares)
    turns, origins = frames[:, :, :3, :3], frames[:, :, :3, 3]
    dense = rows[0] + shares[:, None] * (rows[1] - rows[0])
    for k, full in enumerate(robot.pinocchio_configuration(dense)):
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, full)
        for joint in range(robot.model.njoints):
            assert np.allclose(turns[k, joint], data.oMi[joint].rotation, atol=1e-12)
            assert np.allclose(origins[k, joint], data.oMi[joint].translation, atol=1e-12)
    for number, body in enumerate(each.body for each in motions.named):
        if body.joint == 0:
            continue
        corners = motions.trees[number].elements.points.reshape(-1, 3) @ body.placement.rotation.T
        corners = corners + body.placement.translation
        points = np.einsum("nij,kj->nki", turns[:, body.joint], corners) + origins[:, body.joint][:, None]
        chords = points[0] + shares[:, None, None] * (points[-1] - points[0])
        velocity, bend, _ = motions._bounds(number)[0][:, 0]
        assert np.linalg.norm(points - chords, axis=2).max() <= bend / 8.0 + 1e-12
        assert np.linalg.norm(np.diff(points, axis=0), axis=2).max() <= velocity / 49.0 + 1e-12


def test_the_log_grows_where_it_is_too_small_and_costs_nothing_afterwards(cases, monkeypatch):
    case = cases("panda")[0]
    packed = case.world.prover.tables.packed
    monkeypatch.setattr(log.logged, "__defaults__", (1,))
    again = case.world.certificate(case.path, 0.001)
    assert certificate_fault(again, case.world, case.path.waypoints) == ""
    assert again.entries == case.certificate.entries
    assert packed.table.intact()
    assert packed.table.log_room == 0


def test_a_verifier_needs_neither_kernels_nor_planners():
    code = "import sys, rrtik_ompl.world.certificate_check"
    code += "; print([m for m in sys.modules if m.split('.')[0] in ('numba', 'ompl', 'scipy', 'rrtik_planners')"
    code += " or m.startswith(('rrtik_ompl.kernels.proof', 'rrtik_ompl.kernels.checks', 'rrtik_ompl.world.world'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_measurement_finds_nothing_wrong(capsys):
    assert main(paths=6, seed=3) == 0
    out = capsys.readouterr().out
    assert "6  accepted" in out
    assert "WRONG" not in out
