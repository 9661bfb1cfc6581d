"""Links that are thicker than their geometry, judged by coal's distances."""

import pickle
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.variants import padded
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Sphere
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.certificate_check import certificate_fault
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.by_coal import free_by_coal

NEARLY = 1e-5  # [m]; what coal's distances and the kernels' rounding may differ by
THICK = {
    "planar6": {"link1": 0.05, "link4": 0.11, "link6": 0.02},
    "panda": {"panda_link0": 0.03, "panda_hand": 0.12, "panda_link5": 0.05},
    "ur5": {"base_link": 0.02, "forearm_link": 0.03, "wrist_3_link": 0.05},
}
SOLIDS = (Box([0.3, 0.2, 0.1]), Sphere(0.12), Cylinder(0.08, 0.3), Capsule(0.05, 0.3))
HELD = AttachedObject("rod", "panda_hand", Capsule(0.02, 0.3), [0.1, 0.0, 0.2], ("panda_link7",), padding=0.0)


def arm_of(name):
    return (
        replace(load_robot("planar6", parameters={"radius": 0.03}), self_collision=True)
        if name == "planar6"
        else load_robot(name)
    )


def crowd(name):
    rng, far = np.random.default_rng(5), 4.0 if name == "planar6" else 0.8
    places = [far * rng.uniform(0.6, 1.0) * way / np.linalg.norm(way) for way in rng.normal(size=(4, 3))]
    if name == "planar6":
        places = [place * [1.0, 1.0, 0.0] for place in places]
    solids = enumerate(zip(SOLIDS, places, strict=True))
    obstacles = [Obstacle(f"o{k}", solid, place, margin=0.01 * k) for k, (solid, place) in solids]
    return Scene(obstacles, (HELD,) if name == "panda" else ())


def rooms(world, Q, padding):
    """Coal's distances less margins and paddings, the least over all pairs of which one moves, shape (m,)."""
    room = np.full(len(Q), np.inf)
    pairs = [(world.bodies[i], world.bodies[j]) for i, j in world.pairs]
    for k, frames in enumerate(world.robot.joint_frames(Q)):
        for a, b in (pair for pair in pairs if pair[0].joint or pair[1].joint):
            poses = [pin.SE3(frames[body.joint]) * body.placement for body in (a, b)]
            ends = [coal.Transform3s(p.rotation, p.translation) for p in poses]
            asked = (a.geometry, ends[0], b.geometry, ends[1], coal.DistanceRequest())
            margins = [world.scene.obstacle(x.name).margin for x in (a, b) if x.kind == "obstacle"]
            kept = sum(margins) if margins else world.self_margin
            thick = padding.get(a.name, 0.0) + padding.get(b.name, 0.0)
            room[k] = min(room[k], coal.distance(*asked, coal.DistanceResult()) - kept - thick)
    return room


@pytest.fixture(scope="module", params=["planar6", "panda", "ur5"])
def judged(request):
    """An arm, a scene, configurations that are free without padding, and their room with it."""
    name = request.param
    robot, scene = arm_of(name), crowd(name)
    bare = World(robot, scene, self_margin=0.004)
    Q = np.random.default_rng(3).uniform(*robot.finite_range(), (400, robot.dof))
    Q = Q[bare.valid_batch(Q)][:150]
    return World(padded(robot, THICK[name]), scene, self_margin=0.004), Q, rooms(bare, Q, THICK[name])


def test_what_is_valid_keeps_the_padding_and_what_keeps_it_is_valid(judged):
    world, Q, room = judged
    valid, careful = world.valid_batch(Q), world.with_accuracy("conservative").valid_batch(Q)
    assert 0.1 < valid.mean() < 0.95
    assert (room[valid] > -NEARLY).all()
    assert valid[room > NEARLY].all()
    assert (room[careful] > -1e-6).all()
    assert (free_by_coal(world, Q) == valid).all()
    assert (world.certify(Q) == valid).all()
    proven = world.motions_proven(Q, Q)
    assert (proven <= valid).all()
    assert proven[room > 0.01].mean() > 0.8


def test_moved_obstacles_keep_it_too(judged):
    world, Q, _ = judged
    moving = MovingWorld(world)
    change = pin.SE3(np.eye(3), np.array([0.05, -0.03, 0.0]))
    shifted = Scene([replace(o, pose=change * o.pose) for o in world.scene.obstacles], world.scene.attached)
    moving.move(shifted)
    room = rooms(World(world.robot, shifted, self_margin=world.self_margin), Q, world.robot.padding)
    valid = moving.valid_batch(Q)
    assert 0.1 < valid.mean() < 0.95
    assert (room[valid] > -1e-6).all()
    assert valid[room > 0.02].mean() > 0.8


def test_the_kernels_agree_with_numpy_and_say_how_much_room_there_is(judged):
    world, Q, room = judged
    fast, values = world.checks.checker.fast, world.robot.joint_values(Q[:60])
    spheres, answers = fast._reference.classify(values, resolve=True), fast.classify(values)
    assert (answers[spheres != 1] == spheres[spheres != 1]).all(), "solids decide what spheres leave open, no more"
    found = fast.clearance(values, upper=True)
    assert (found.lower <= room[:60] + NEARLY).all()
    assert fast.intact()


def test_the_nearest_pair_is_named_with_all_that_it_has_to_keep(judged):
    world, Q, room = judged
    for k in np.flatnonzero((room < -1e-4) & (room > -0.03))[:5]:
        assert world.clearance(Q[k]) == pytest.approx(room[k], abs=NEARLY)
        assert "within the margin" in world.explain(Q[k])
        with pytest.raises(ProblemError, match=r"start is too near.*the padding.*allow"):
            Problem(world, Q[k], Q[k])


def test_what_is_held_may_be_padded_too():
    robot, scene = load_robot("panda"), crowd("panda")
    bare = World(robot, scene, self_margin=0.004)
    world = World(robot, replace(scene, attached=(replace(HELD, padding=0.06),)), self_margin=0.004)
    Q = np.random.default_rng(3).uniform(robot.lower, robot.upper, (400, 7))
    Q = Q[bare.valid_batch(Q)][:100]
    room, valid = rooms(bare, Q, {"rod": 0.06}), world.valid_batch(Q)
    assert 0.1 < valid.mean() < 0.95
    assert (room[valid] > -NEARLY).all()
    assert valid[room > NEARLY].all()
    assert (world.certify(Q) == valid).all()
    proven = world.motions_proven(Q, Q)
    assert (proven <= valid).all()
    assert proven[room > 0.01].mean() > 0.8
    assert world.prove(Q[valid][:1]).digest != bare.prove(Q[valid][:1]).digest


def test_a_file_keeps_the_padding_of_what_is_held(tmp_path):
    scene = Scene([Obstacle("cup", Sphere(0.03))]).attaching("cup", "panda_hand", pose=[0.0, 0.0, 0.2], padding=0.01)
    assert scene.attached[0].padding == 0.01
    Problem(World(load_robot("panda"), scene), "ready", "ready").save(tmp_path / "p.yaml")
    assert load_problem(tmp_path / "p.yaml").world.scene.attached[0].padding == 0.01
    for value, said in ((-1.0, "0 metres or more"), (float("nan"), "padding of 'cup'"), ("wide", "padding of 'cup'")):
        with pytest.raises(InputError, match=said):
            AttachedObject("cup", "panda_hand", Sphere(0.03), padding=value)


def test_what_a_padded_link_holds_is_as_thick_as_the_link_unless_told_otherwise():
    robot, scene = load_robot("panda"), crowd("panda")
    thick = padded(robot, {"panda_hand": 0.06})
    Q = np.random.default_rng(3).uniform(robot.lower, robot.upper, (400, 7))
    wide, bare = (World(robot, replace(scene, attached=(replace(HELD, padding=own),))) for own in (0.06, 0.0))
    valid, free = wide.valid_batch(Q), bare.valid_batch(Q)
    assert (valid < free).any()
    hand = World(thick, scene).valid_batch(Q)
    held = World(thick, replace(scene, attached=(replace(HELD, padding=None),))).valid_batch(Q)
    assert (held == (hand & valid)).all()
    told = World(thick, replace(scene, attached=(HELD,))).valid_batch(Q)
    assert (told == (hand & free)).all()
    assert (told > held).any()


def test_what_is_carried_keeps_its_margin_and_comes_back_with_it(tmp_path):
    robot = load_robot("panda")
    cup = Obstacle("cup", Sphere(0.03), margin=0.05)
    scene = Scene([cup, Obstacle("post", Sphere(0.02), [0.4, 0.5, 0.5])])
    held = scene.attaching("cup", "panda_hand", pose=[0.0, 0.0, 0.2])
    assert held.detaching("cup", [0.3, 0.0, 0.5]).obstacle("cup").margin == 0.05
    Q = np.random.default_rng(5).uniform(robot.lower, robot.upper, (2000, 7))
    as_padding = replace(held, attached=(replace(held.attached[0], margin=0.0, padding=0.05),))
    valid = World(robot, held).valid_batch(Q)
    assert (valid == World(robot, as_padding).valid_batch(Q)).all()
    assert (valid < World(robot, scene.without("cup")).valid_batch(Q)).any()
    Problem(World(robot, held), "ready", "ready").save(tmp_path / "p.yaml")
    assert load_problem(tmp_path / "p.yaml").world.scene.attached[0].margin == 0.05


def test_paths_and_certificates_keep_it():
    wall = Obstacle("wall", Box([0.4, 0.4, 0.4]), [3.0, 2.2, 0.0])
    robot = padded(load_robot("planar6"), {"link6": 0.3})
    problem = Problem(World(robot, Scene([wall])), [0.0] * 6, [1.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = plan(problem, seconds=10.0, seed=1)
    assert found.proven
    assert rooms(problem.world, found.path.resample(0.02).waypoints, {"link6": 0.3}).min() >= -1e-9
    certificate = problem.world.certificate(found.path)
    assert certificate_fault(certificate, problem.world, found.path.waypoints) == ""
    for other in ({}, {"link6": 0.31}, {"link5": 0.3}):
        assert certificate_fault(certificate, World(padded(robot, other), Scene([wall])), found.path.waypoints) != ""


def test_no_padding_is_as_before():
    robot = load_robot("panda")
    q = robot.posture("ready")
    for padding in ({}, {"panda_hand": 0.0}, 0.0):
        other = padded(robot, padding)
        assert World(other).prove(q[None]).digest == World(robot).prove(q[None]).digest
    assert World(padded(robot, {"panda_hand": 1e-3})).prove(q[None]).digest != World(robot).prove(q[None]).digest


def test_what_stands_still_beside_a_padded_base_needs_no_room():
    robot = load_robot("ur5")
    table = Obstacle("table", Box([0.2, 0.2, 0.1]), [0.0, 0.0, -0.056])
    assert World(padded(robot, {"base_link": 0.01}), Scene([table])).valid(robot.posture("up"))


@pytest.mark.parametrize("padding", [{"panda_hand": 0.02}, 0.004])
def test_files_options_and_copies_keep_it(padding, tmp_path):
    robot = load_robot("panda", padding=padding)
    assert robot is load_robot("panda", padding=padding)
    assert robot.padding["panda_hand"] == (padding["panda_hand"] if isinstance(padding, dict) else padding)
    assert pickle.loads(pickle.dumps(robot)).padding == robot.padding
    problem = Problem(World(robot), "ready", "ready")
    problem.save(tmp_path / "problem.yaml")
    assert load_problem(tmp_path / "problem.yaml").robot is robot
    by_hand = padded(load_robot("panda"), padding)
    Problem(World(by_hand), "ready", "ready").save(tmp_path / "by_hand.yaml")
    assert load_problem(tmp_path / "by_hand.yaml").robot.padding == robot.padding


def test_a_planar_arm_in_a_file_may_be_padded(tmp_path):
    text = "version: 1\nrobot: {planar: {lengths: [1, 1]}, padding: {link2: 0.1}}\n"
    (tmp_path / "p.yaml").write_text(text + "start: {joints: [0, 1]}\ngoal: {joints: [0, 0]}\n")
    problem = load_problem(tmp_path / "p.yaml")
    assert dict(problem.robot.padding) == {"link2": 0.1}
    problem.save(tmp_path / "q.yaml")
    assert load_problem(tmp_path / "q.yaml").robot is problem.robot


@pytest.mark.parametrize("value", [-1e-3, float("nan"), float("inf"), "wide", None, [0.1], 1e9])
def test_a_padding_that_makes_no_sense_is_refused(value):
    with pytest.raises(InputError, match="padding of robot 'panda'"):
        padded(load_robot("panda"), {"panda_hand": value})


def test_a_link_that_does_not_exist_is_refused():
    with pytest.raises(UnknownNameError, match="panda_hand"):
        load_robot("panda", padding={"panda_hnad": 0.1})
