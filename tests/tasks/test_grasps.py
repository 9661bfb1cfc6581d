"""Grasps by two fingers: antipodal by the formulas of the shapes, reached, free, and touching by another world."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.tasks import MoveTo
from rrtik_ompl.tasks.grasp_points import pairs as pairs_on

FRICTION = 0.5
LINES = 256
TABLE = rrtik.Obstacle("table", rrtik.Box(0.7, 1.2, 0.04), [0.55, 0.0, 0.18])
WEDGE = rrtik.Prism(
    [[-0.03, -0.02], [0.03, -0.02], [0.03, 0.02], [-0.03, 0.012]], height=0.1
)  # a side slopes by 7.6 deg
TURN = pin.Quaternion(0.9, 0.3, -0.2, 0.25).normalized().matrix()


def mesh_of(shape):
    return rrtik.Mesh(*shape.surface())


def cone(below, above, height, sides=24):
    """A cone without its point, along z, as a mesh."""
    turns = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    ends = [np.column_stack([r * ring, np.full(sides, z)]) for r, z in ((below, -0.5 * height), (above, 0.5 * height))]
    k = np.arange(sides)
    after = (k + 1) % sides
    walls = np.vstack([np.column_stack([k, after, k + sides]), np.column_stack([after, after + sides, k + sides])])
    fans = np.column_stack([np.zeros(sides - 2, int), np.arange(2, sides), np.arange(1, sides - 1)])
    return rrtik.Mesh(np.vstack(ends), np.vstack([walls, fans, fans[:, [0, 2, 1]] + sides]))


def least_angles_from_mesh(mesh, points):
    """Least angle [rad] between the line of each pair, inwards, and the inward normal of a face at its end, (k, 2)."""
    triangles = mesh.vertices[mesh.triangles]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    beyond = np.einsum("kpfj,fj->kpf", points[:, :, None] - triangles[:, 0], normals)
    assert np.abs(beyond.max(axis=2)).max() < 1e-5, "the points are on the surface of this convex mesh"
    ways = points[:, ::-1] - points
    ways /= np.linalg.norm(ways, axis=2)[:, :, None]
    angles = np.arccos(np.clip(-ways @ normals.T, -1.0, 1.0))
    return np.where(np.abs(beyond) < 1e-5, angles, np.inf).min(axis=2)


SHAPES = {
    "box": rrtik.Box(0.05, 0.06, 0.1),
    "ball": rrtik.Sphere(0.02),
    "can": rrtik.Cylinder(0.03, 0.07),
    "bar": rrtik.Capsule(0.02, 0.1),
    "prism": WEDGE,
    "mesh": mesh_of(rrtik.Box(0.05, 0.04, 0.1)),
    "mesh of a can": mesh_of(rrtik.Cylinder(0.03, 0.1)),
    "cone": cone(0.035, 0.018, 0.1),
    "roof": mesh_of(rrtik.Prism([[-0.035, -0.03], [0.035, -0.03], [0.018, 0.03], [-0.018, 0.03]], height=0.1)),
}


def normals_of_box(points, size):
    """Outward normals at points on a box, shape (k, 3), and how far these are from its surface [m], shape (k,)."""
    beyond = np.abs(points) - 0.5 * np.asarray(size)
    side = np.argmax(beyond, axis=1)
    rows = np.arange(len(points))
    normals = np.zeros_like(points)
    normals[rows, side] = np.sign(points[rows, side])
    return normals, np.abs(beyond[rows, side])


def normals_of_cylinder(points, radius, length):
    """Likewise, of a cylinder along z."""
    around = np.linalg.norm(points[:, :2], axis=1)
    side = around - radius
    end = np.abs(points[:, 2]) - 0.5 * length
    flat = np.column_stack([points[:, :2] / np.maximum(around, 1e-9)[:, None], np.zeros(len(points))])
    caps = np.sign(points[:, 2:]) * [0.0, 0.0, 1.0]
    return np.where((side > end)[:, None], flat, caps), np.abs(np.maximum(side, end))


def normals_of_capsule(points, radius, length):
    """Likewise, of a capsule along z."""
    from_axis = points - np.clip(points[:, 2:], -0.5 * length, 0.5 * length) * [0.0, 0.0, 1.0]
    far = np.linalg.norm(from_axis, axis=1)
    return from_axis / far[:, None], np.abs(far - radius)


def normals_of_prism(points, polygon, height):
    """Likewise, of a convex prism along z whose corners are anticlockwise."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    outwards = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    outwards = np.vstack([np.column_stack([outwards, np.zeros(len(sides))]), [0, 0, 1], [0, 0, -1]])
    offsets = np.append(np.einsum("ij,ij->i", outwards[:-2, :2], polygon), [0.5 * height, 0.5 * height])
    beyond = points @ outwards.T - offsets
    return outwards[beyond.argmax(axis=1)], np.abs(beyond.max(axis=1))


NORMALS = {
    "box": lambda points: normals_of_box(points, [0.05, 0.06, 0.1]),
    "ball": lambda points: normals_of_capsule(points, 0.02, 0.0),
    "can": lambda points: normals_of_cylinder(points, 0.03, 0.07),
    "bar": lambda points: normals_of_capsule(points, 0.02, 0.1),
    "prism": lambda points: normals_of_prism(points, WEDGE.polygon, 0.1),
    "mesh": lambda points: normals_of_box(points, [0.05, 0.04, 0.1]),
}


def angles_from_normals(name, pairs):
    """Angles [rad] between lines, inwards, and the inward normals at both of their ends, shape (k, 2)."""
    points = pairs.reshape(-1, 3)
    normals, off = NORMALS[name](points)
    assert off.max() < 1e-9, "the points are on the surface"
    line = pairs[:, 1] - pairs[:, 0]
    line /= np.linalg.norm(line, axis=1)[:, None]
    inward = np.stack([line, -line], axis=1).reshape(-1, 3)
    return np.arccos(np.clip(np.einsum("ij,ij->i", inward, -normals), -1.0, 1.0)).reshape(-1, 2)


@pytest.mark.parametrize("friction", [0.05, 0.5])
@pytest.mark.parametrize("name", NORMALS)
def test_the_line_of_two_fingers_is_in_the_friction_cones_of_both_points(name, friction):
    pairs = pairs_on(SHAPES[name], np.cos(np.arctan(friction)), 0.08, LINES, np.random.default_rng(2))
    assert len(pairs) > LINES // 5
    assert angles_from_normals(name, pairs).max() <= np.arctan(friction) + 1e-6
    assert np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1).max() <= 0.08


def test_a_slope_is_pressed_only_where_friction_holds_it():
    cones = [np.cos(np.arctan(friction)) for friction in (0.05, 0.5)]
    slippery, rough = (pairs_on(WEDGE, cone, 0.08, LINES, np.random.default_rng(2)) for cone in cones)
    steepest = [angles_from_normals("prism", pairs).max() for pairs in (slippery, rough)]
    slope = np.arctan(8.0 / 60.0)
    assert steepest[0] < slope < steepest[1]


def world_with(shape, height):
    hand = rrtik.load_robot("panda_primitives").gripper
    robot = rrtik.load_robot("panda_primitives", locked=hand.posture("open"))
    return rrtik.World(robot, rrtik.Scene([TABLE, rrtik.Obstacle("thing", shape, [0.5, 0.2, 0.2005 + height])]))


@pytest.mark.kernels
@pytest.mark.parametrize("name", SHAPES)
def test_a_grasp_is_reached_free_and_its_fingers_touch(name):
    shape = SHAPES[name]
    world = world_with(shape, {"ball": 0.02, "can": 0.035, "bar": 0.07}.get(name, 0.05))
    found = rrtik.grasps(world, "thing", count=2, friction=FRICTION, seed=1)
    assert len(found) == 2
    assert [grasp.clearance for grasp in found] == sorted((grasp.clearance for grasp in found), reverse=True)
    place = world.scene.obstacle("thing").pose
    pairs = np.stack([(grasp.points - place.translation) @ place.rotation for grasp in found])
    if name in NORMALS:
        assert angles_from_normals(name, pairs).max() <= np.arctan(FRICTION) + 1e-6
    else:
        assert least_angles_from_mesh(shape, pairs).max() <= np.arctan(FRICTION) + 1e-6

    for grasp in found:
        assert world.valid(grasp.q)
        assert world.clearance(grasp.q) >= 0.002 - 1e-5
        assert np.abs(world.robot.fk(grasp.q).homogeneous - grasp.pose.homogeneous).max() < 1e-3
        # Closed on it, both fingers touch and the palm does not.
        shut = rrtik.load_robot("panda_primitives", locked=world.robot.gripper.at(grasp.opening))
        hand = [(f"panda_{link}", "thing") for link in ("leftfinger", "rightfinger", "hand")]
        left, right, palm = rrtik.World(shut, world.scene).distances(grasp.q, hand).values
        assert -1e-4 < min(left, right) < 1e-4
        assert max(left, right) < 6e-4
        assert palm > 1e-3


@pytest.mark.kernels
def test_any_of_the_grasps_can_be_planned_and_the_thing_lifted():
    world = world_with(SHAPES["can"], 0.035)
    found = rrtik.grasps(world, "thing", count=2, seed=2)
    for grasp in found:
        task = rrtik.Task([*grasp.stages(), rrtik.Straight(by=[0.0, 0.0, 0.08])], world, "ready")
        plan = task.plan(seed=1)
        assert plan.found, plan.reason
        assert plan.proven
        assert not plan.violations()
    again = rrtik.grasps(world, "thing", count=2, seed=2)
    assert [grasp.q.tolist() for grasp in again] == [grasp.q.tolist() for grasp in found]
    assert found[0].q.tolist() not in [grasp.q.tolist() for grasp in rrtik.grasps(world, "thing", count=2, seed=3)]


@pytest.mark.kernels
def test_nothing_too_wide_or_out_of_reach_is_grasped(monkeypatch):
    monkeypatch.setattr("rrtik_ompl.tasks.grasps.TRIES", 256)
    assert rrtik.grasps(world_with(rrtik.Box(0.09, 0.09, 0.09), 0.045), "thing", count=2) == ()
    assert rrtik.grasps(world_with(rrtik.Sphere(0.02), 2.0), "thing", count=2) == ()


@pytest.mark.kernels
def test_a_hand_whose_fingers_are_guided_side_by_side_has_grasps_too():
    bar = rrtik.Obstacle("bar", rrtik.Cylinder(0.012, 0.2), [0.7, 0.4, 0.2])
    world = rrtik.World(rrtik.load_robot("baxter_left"), rrtik.Scene([bar]))
    (grasp,) = rrtik.grasps(world, "bar", count=1, seed=1)
    assert grasp.width == pytest.approx(0.024, abs=1e-6)
    assert rrtik.Task(grasp.stages(), world, np.zeros(7)).plan(seed=1).found


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda world: rrtik.grasps(world.robot, "thing"), InputError, "World"),
        (lambda world: rrtik.grasps(world, "cup"), UnknownNameError, "cup"),
        (lambda world: rrtik.grasps(world, "thing", count=0), InputError, "count of grasps"),
        (lambda world: rrtik.grasps(world, "thing", friction=0.0), InputError, "friction of grasps"),
        (lambda world: rrtik.grasps(world, "thing", clearance=-1.0), InputError, "clearance of grasps"),
        (lambda world: rrtik.grasps(world, "thing", near=[0.0]), InputError, "near"),
        (
            lambda world: rrtik.grasps(world, "thing", near=[0, -45, 0, -135, 0, 90, 45]),
            InputError,
            "near, of grasps: .*outside its limits",
        ),
        (lambda world: rrtik.grasps(world, "thing", opened=1.5), InputError, "opened of grasps"),
        (lambda world: rrtik.grasps(world, "floor"), InputError, "'floor' is not bounded"),
        (
            lambda world: rrtik.grasps(with_robot(world, rrtik.load_robot("planar3")), "thing"),
            InputError,
            "no gripper joints",
        ),
    ],
)
def test_what_cannot_be_grasped_is_said_in_one_line(call, kind, words):
    floor = rrtik.Obstacle("floor", rrtik.HalfSpace([0.0, 0.0, 1.0], -0.1))
    world = world_with(rrtik.Sphere(0.03), 0.03)
    with pytest.raises(kind, match=words) as raised:
        call(world.with_scene(world.scene.with_(floor)))
    assert "\n" not in str(raised.value)


def with_robot(world, robot):
    return rrtik.World(robot, world.scene)


SOLID = "<collision><origin xyz='0 0 0.05'/><geometry><box size='0.02 0.02 0.1'/></geometry></collision>"
JAW = f"""<robot name="jaw">
  <link name="base"/><link name="hand">{SOLID}</link><link name="finger">{SOLID}</link>
  <joint name="pan" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="jaw" type="revolute"><parent link="hand"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" velocity="1" effort="1"/></joint>
</robot>"""


def test_fingers_that_do_not_close_on_each_other_are_refused(tmp_path):
    file = tmp_path / "jaw.urdf"
    file.write_text(JAW)
    robot = rrtik.load_robot(file, tip="hand", gripper={"open": {"jaw": 1.0}, "closed": {"jaw": 0.0}})
    with pytest.raises(InputError, match="'jaw': its fingers do not part where they would hold something"):
        rrtik.grasps(with_robot(world_with(rrtik.Sphere(0.03), 0.03), robot), "thing")


def link_gap(robot, q, link, solid, place):
    """Distance of a link from a solid [m], by pinocchio and coal."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.pinocchio_configuration(q[None])[0])
    gaps = []
    for item in robot.collision.geometryObjects:
        if robot.link_of(item) == link:
            pose = data.oMi[item.parentJoint] * item.placement
            ends = [coal.Transform3s(each.rotation, each.translation) for each in (pose, place)]
            request = coal.DistanceRequest()
            gaps.append(coal.distance(item.geometry, ends[0], solid, ends[1], request, coal.DistanceResult()))
    return min(gaps)


@pytest.mark.kernels
def test_a_jaw_that_turns_closes_on_a_block_and_the_other_one_touches_it_from_the_side():
    task = rrtik.Task.load("so101_pick_place")
    block = task.world.scene.obstacle("block")
    (grasp,) = rrtik.grasps(task.world, "block", count=1, approach=0.03, opened=0.7)
    pairs = (grasp.points - block.pose.translation) @ block.pose.rotation
    normals, off = normals_of_box(pairs, block.shape.size)
    assert off.max() < 1e-5
    line = (pairs[1] - pairs[0]) / np.linalg.norm(pairs[1] - pairs[0])
    assert np.arccos(normals[1] @ line) <= np.arctan(FRICTION)
    assert np.arccos(-normals[0] @ line) <= np.arctan(FRICTION)

    solid = coal.Box(*block.shape.size)
    hand = task.world.robot.gripper
    shut, wide = (rrtik.load_robot("so101", locked=hand.at(share)) for share in (grasp.opening, 0.7))
    jaw, rest = "moving_jaw_so101_v1_link", "gripper_link"
    assert -1e-5 < link_gap(shut, grasp.q, jaw, solid, block.pose) < 6e-4
    assert 0.0 < link_gap(shut, grasp.q, rest, solid, block.pose) < 6e-4
    assert grasp.way.shape == (2, 5)
    for share in np.linspace(0.0, 1.0, 9):  # until the last step, both keep the clearance
        q = (1.0 - share) * grasp.way[0] + share * grasp.way[1]
        assert min(link_gap(wide, q, link, solid, block.pose) for link in (jaw, rest)) >= 0.002 - 1e-6

    up = MoveTo(rrtik.PositionGoal(grasp.pose.translation + np.array([0.0, 0.0, 0.05]), tolerance=0.005))
    plan = rrtik.Task([*grasp.stages(), up], task.world, task.start).plan(seed=1)
    assert plan.found, plan.reason
    assert plan.proven
    assert not plan.violations()


FILE = """\
version: 1
robot: {name: panda}
scene:
  obstacles:
    - {name: table, box: [0.7, 1.2, 0.04], pose: {xyz: [0.55, 0, 0.18]}}
    - {name: can, cylinder: {radius: 0.03, length: 0.12}, pose: {xyz: [0.5, 0.2, 0.26]}}
start: {posture: ready}
task:
  - grasp: {object: can, count: 3, seed: 1}
  - straight: {by: [0, 0, 0.1]}
"""


@pytest.mark.kernels
def test_a_task_file_asks_for_grasps_and_is_written_with_them(tmp_path):
    file = tmp_path / "take.yaml"
    file.write_text(FILE)
    task = rrtik.Task.load(file)
    assert len(task.stages[0].options) == 3
    assert task.plan(seed=1).found
    task.save(tmp_path / "again.yaml")
    poses = [
        [row[1].goal.pose for row in each.stages[0].options]
        for each in (task, rrtik.Task.load(tmp_path / "again.yaml"))
    ]
    assert all(one.isApprox(other) for one, other in zip(*poses, strict=True))


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("object: can", "object: cup", "yaml:9: .*cup"),
        ("radius: 0.03", "radius: 0.05", "yaml:9: .*no grasp of 'can' is found"),
        ("  - straight", "  - grasp: {object: can}\n  - straight", "yaml:10: .*'can' was taken before"),
        (
            "  - straight",
            "  - alternatives: [[{detach: can}, {grasp: {object: can}}]]\n  - straight",
            "yaml:10: .*'can' was taken before",
        ),
        (
            "  - grasp",
            "  - alternatives: [[{attach: {object: can, link: panda_hand}}]]\n  - grasp",
            "yaml:10: .*'can' was taken before",
        ),
    ],
)
def test_grasps_of_a_file_that_there_are_not_are_said_with_their_line(old, new, words, tmp_path):
    file = tmp_path / "take.yaml"
    file.write_text(FILE.replace(old, new))
    with pytest.raises(InputError, match=words):
        rrtik.Task.load(file)
