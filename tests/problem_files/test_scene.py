"""The scene section: every key of the format is read as it is meant, written back, and refused when it is wrong."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import find_problem, list_problems
from rrtik_ompl.files.strict_yaml import read_yaml
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, PointCloud, Prism, Sphere, same_shape
from rrtik_ompl.problem_files.problem_values import ProblemFile, load_unchecked
from rrtik_ompl.problem_files.scene import SceneFile, load_scene

EVERY_KEY = """version: 1
scene:
  obstacles:
    - {name: panel, box: [0.8, 0.05, 0.6], pose: {xyz: [1.2, 0, 0.4], quat_xyzw: [0, 0, 0.6, 0.8]}}
    - {name: pipe, cylinder: {radius: 0.05, length: 1.0}, pose: {xyz: [0.9, 0.4, 0], rpy_deg: [0, 90, 0]}}
    - {name: hose, capsule: {radius: 0.02, length: 0.5}, pose: {xyz: [1, 0, 0]}}
    - {name: buoy, sphere: 0.15, pose: {xyz: [1, 1, 0]}, motion: {velocity: [0.1, 0, 0]}}
    - {name: door, box: [0.1, 1, 1], motion: {waypoints: [{time: 0, pose: {xyz: [2, 0, 0]}},
                                                          {time: 4, pose: {xyz: [2, 1, 0], rpy_deg: [0, 0, 30]}}]}}
    - {name: seabed, half_space: {normal: [0, 0, 2], offset: -2.0}}
    - {name: prism, polygon: [[0, 0], [1, 0], [0, 1]], height: 0.5}
    - {name: flat, polygon: [[0, 0], [1, 0], [0, 1]]}
    - {name: frame, mesh: parts/frame.obj, scale: 0.001, pose: {xyz: [1, 0, 0]}}
  attached:
    - {name: tool, link: gripper, cylinder: {radius: 0.02, length: 0.2}, pose: {xyz: [0, 0, 0.1]}, allow: [gripper]}
  allowed_collisions: [[base, seabed]]
"""
TETRAHEDRON = "v 0 0 0\nv 1000 0 0\nv 0 1000 0\nv 0 0 1000\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def file(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "frame.obj").write_text(TETRAHEDRON)
    (tmp_path / "scene.yaml").write_text(EVERY_KEY)
    return tmp_path / "scene.yaml"


def same_pose(a, b):
    return np.array_equal(a.translation, b.translation) and np.allclose(a.rotation, b.rotation, atol=1e-15)


def test_every_shape_of_the_format_is_read(file):
    scene = load_scene(file)
    shapes = {o.name: o.shape for o in scene.obstacles}
    assert shapes["panel"].size.tolist() == [0.8, 0.05, 0.6]
    assert shapes["pipe"] == Cylinder(0.05, 1.0)
    assert shapes["hose"] == Capsule(0.02, 0.5)
    assert shapes["buoy"] == Sphere(0.15)
    assert (shapes["seabed"].normal.tolist(), shapes["seabed"].offset) == ([0, 0, 1], -1.0)
    assert (shapes["prism"].polygon.tolist(), shapes["prism"].height) == ([[0, 0], [1, 0], [0, 1]], 0.5)
    assert shapes["flat"].height == 1.0
    assert shapes["frame"].vertices.max() == pytest.approx(1.0)


def test_poses_are_read_from_quaternions_and_degrees(file):
    panel, pipe = load_scene(file).obstacles[:2]
    turn = np.arctan2(0.6, 0.8) * 2.0
    np.testing.assert_allclose(panel.pose.rotation, pin.rpy.rpyToMatrix(0, 0, turn), atol=1e-15)
    assert panel.pose.translation.tolist() == [1.2, 0, 0.4]
    np.testing.assert_allclose(pipe.pose.rotation @ [0, 0, 1], [1, 0, 0], atol=1e-15)


def test_motions_are_read(file):
    scene = load_scene(file)
    np.testing.assert_allclose(scene.at(2.0).obstacle("buoy").pose.translation, [1.2, 1, 0])
    np.testing.assert_allclose(scene.at(2.0).obstacle("door").pose.translation, [2, 0.5, 0])
    turned = scene.at(9.0).obstacle("door").pose.rotation
    np.testing.assert_allclose(turned, pin.rpy.rpyToMatrix(0, 0, np.radians(30)), atol=1e-15)


def test_an_obstacle_with_waypoints_stands_where_it_is_at_time_0(file):
    assert load_scene(file).obstacle("door").pose.translation.tolist() == [2, 0, 0]


def test_attached_objects_and_allowed_collisions_are_read(file):
    scene = load_scene(file)
    (tool,) = scene.attached
    assert (tool.link, tool.shape, tool.allow) == ("gripper", Cylinder(0.02, 0.2), ("gripper",))
    assert tool.pose.translation.tolist() == [0, 0, 0.1]
    assert scene.allowed_collisions == (("base", "seabed"),)


def shape_numbers(shape):
    if isinstance(shape, Mesh):
        return shape.vertices.tolist(), shape.triangles.tolist(), shape.source, shape.scale
    if isinstance(shape, Box):
        return shape.size.tolist()
    if isinstance(shape, HalfSpace):
        return shape.normal.tolist(), shape.offset
    return (shape.polygon.tolist(), shape.height) if isinstance(shape, Prism) else shape


def motion_numbers(motion):
    if isinstance(motion, ConstantVelocity):
        return motion.velocity.tolist()
    return None if motion is None else (motion.times.tolist(), [p.translation.tolist() for p in motion.poses])


def test_a_scene_survives_writing_and_reading(file, tmp_path):
    scene = load_scene(file)
    (tmp_path / "elsewhere").mkdir()
    scene.save(tmp_path / "elsewhere" / "copy.yaml")
    copy = load_scene(tmp_path / "elsewhere" / "copy.yaml")
    assert copy.names == scene.names
    assert copy.allowed_collisions == scene.allowed_collisions
    for one, two in zip(scene.obstacles + scene.attached, copy.obstacles + copy.attached, strict=True):
        assert type(one.shape) is type(two.shape)
        assert shape_numbers(one.shape) == shape_numbers(two.shape)
        assert same_pose(one.pose, two.pose)
    for one, two in zip(scene.obstacles, copy.obstacles, strict=True):
        assert motion_numbers(one.motion) == motion_numbers(two.motion)
    assert copy.attached[0].allow == scene.attached[0].allow


def test_numbers_survive_bit_for_bit(tmp_path):
    rng = np.random.default_rng(1)
    shapes = [Box(rng.uniform(1e-5, 1, 3)), Sphere(0.1 + 0.2), Cylinder(1 / 3, 1e-5), Prism(rng.normal(size=(3, 2)))]
    poses = [pin.SE3(pin.SE3.Random().rotation, rng.normal(size=3)) for _ in shapes]
    moves = [ConstantVelocity([0.1, 1e-9, 3]), TimedPoses([0.1, 0.3], poses[:2]), None, None]
    rows = zip("abcd", shapes, poses, moves, strict=True)
    scene = Scene(tuple(Obstacle(*row) for row in rows), (AttachedObject("e", "hand", Box([1, 2, 3])),))
    scene.save(tmp_path / "scene.yaml")
    for one, two in zip(scene.obstacles, load_scene(tmp_path / "scene.yaml").obstacles, strict=True):
        assert shape_numbers(one.shape) == shape_numbers(two.shape)
        assert same_pose(one.pose, two.pose)
        assert motion_numbers(one.motion) == motion_numbers(two.motion)


def test_colours_are_read_in_both_forms_and_survive(tmp_path):
    text = """version: 1
scene:
  obstacles:
    - {name: a, sphere: 1, color: "#C0392B"}
    - {name: b, sphere: 1, color: [1, 0.5, 0]}
    - {name: c, sphere: 1}
  attached: [{name: d, link: hand, sphere: 1, color: [0, 0, 1]}]
"""
    (tmp_path / "scene.yaml").write_text(text)
    load_scene(tmp_path / "scene.yaml").save(tmp_path / "again.yaml")
    for name in ("scene.yaml", "again.yaml"):
        scene = load_scene(tmp_path / name)
        colors = [each.color for each in (*scene.obstacles, *scene.attached)]
        assert colors == ["#c0392b", "#ff8000", None, "#0000ff"]


def test_a_colour_that_begins_a_comment_is_told(tmp_path):
    (tmp_path / "scene.yaml").write_text(
        "version: 1\nscene:\n  obstacles:\n    - name: a\n      sphere: 1\n      color: #c0392b\n"
    )
    with pytest.raises(InputError, match=r"scene\.yaml:6: .*color: nothing stands after the colon.* in quotes"):
        load_scene(tmp_path / "scene.yaml")


def test_an_empty_scene_survives(tmp_path):
    Scene().save(tmp_path / "scene.yaml")
    assert load_scene(tmp_path / "scene.yaml").names == ()


def test_the_scene_of_a_whole_problem_file_can_be_read(tmp_path):
    text = "version: 1\nrobot: titan4\nscene: {obstacles: [{name: a, sphere: 1}]}\nstart: {}\ngoal: {}\n"
    (tmp_path / "problem.yaml").write_text(text)
    assert load_scene(tmp_path / "problem.yaml").names == ("a",)


def test_a_mesh_is_named_relative_to_the_file_that_names_it(file, tmp_path):
    load_scene(file).save(tmp_path / "parts" / "copy.yaml")
    names = [o["mesh"] for o in read_yaml(tmp_path / "parts" / "copy.yaml").data["scene"]["obstacles"] if "mesh" in o]
    assert names == ["frame.obj"]


def test_a_mesh_made_in_memory_cannot_be_written(tmp_path):
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(InputError, match=r"'a'.*made in memory"):
        Scene((Obstacle("a", mesh),)).save(tmp_path / "scene.yaml")
    assert not (tmp_path / "scene.yaml").exists()


BAD = {
    "no shape": ("{name: a}", "'a' needs exactly one of box, sphere, .*; found none"),
    "two shapes": ("{name: a, sphere: 1, box: [1, 1, 1]}", "found box and sphere"),
    "no name": ("{sphere: 1}", r"obstacles\[0\]\.name: missing"),
    "empty name": ("{name: '', sphere: 1}", "name: must not be empty"),
    "name is a number": ("{name: 7, sphere: 1}", "name: must be text, found 7; put it in quotes"),
    "unknown key": ("{name: a, spere: 1}", "spere: unknown key 'spere'; did you mean 'sphere'"),
    "half a box": ("{name: a, box: [1, 2]}", r"box: needs at least 3 entries, found a list of 2"),
    "flat box": ("{name: a, box: [1, 0, 1]}", r"box\[1\]: must be 1e-06 or more, found 0"),
    "negative radius": ("{name: a, sphere: -1}", "sphere: must be 1e-06 or more, found -1"),
    "text radius": ("{name: a, sphere: '1'}", "must be a number, found text '1'; write it without quotes"),
    "unit in the value": ("{name: a, sphere: 10 cm}", "must be a number, found text '10 cm'"),
    "not a number": ("{name: a, sphere: .nan}", "sphere: must be a finite number, found nan"),
    "infinite": ("{name: a, sphere: .inf}", "must be a finite number, found inf"),
    "overflow": ("{name: a, sphere: 1e999}", "must be a finite number"),
    "kilometres": ("{name: a, box: [1, 1, 1e7]}", r"box\[2\]: must be 1e\+06 or less"),
    "true": ("{name: a, sphere: true}", "must be a number, found true"),
    "colour of another kind": ("{name: a, sphere: 1, color: brown}", "color: must be a colour, '#rrggbb' in quotes"),
    "short colour": ("{name: a, sphere: 1, color: '#fff'}", "color: must be a colour.* found text '#fff'"),
    "colour of two": ("{name: a, sphere: 1, color: [0, 1]}", "color: must be a colour.* found a list of 2"),
    "colour in 255ths": ("{name: a, sphere: 1, color: [255, 0, 0]}", r"\[red, green, blue\] from 0 to 1"),
    "nothing": ("{name: a, sphere: }", "nothing stands after the colon"),
    "cylinder without length": ("{name: a, cylinder: {radius: 1}}", "cylinder.length: missing"),
    "cylinder as list": ("{name: a, cylinder: [1, 2]}", "cylinder: must be a group of keys, found a list of 2"),
    "zero normal": ("{name: a, half_space: {normal: [0, 0, 0]}}", "normal must not be the zero vector"),
    "polygon of two": ("{name: a, polygon: [[0, 0], [1, 1]]}", "polygon: needs at least 3 entries"),
    "polygon on a line": ("{name: a, polygon: [[0, 0], [1, 1], [2, 2]]}", "polygon has no area"),
    "polygon crosses itself": ("{name: a, polygon: [[0, 0], [2, 2], [3, 0], [0, 1]]}", "polygon crosses itself"),
    "bow tie": ("{name: a, polygon: [[0, 0], [1, 1], [1, 0], [0, 1]]}", "polygon crosses itself"),
    "polygon in 3-D": ("{name: a, polygon: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}", r"polygon\[0\]: takes at most 2"),
    "height of a box": ("{name: a, box: [1, 1, 1], height: 2}", "'height' belongs to a polygon, but 'a' is a box"),
    "scale of a box": ("{name: a, box: [1, 1, 1], scale: 2}", "'scale' belongs to a mesh"),
    "mesh missing": ("{name: a, mesh: no.stl}", r"obstacles\[0\]: .*no\.stl: no such file"),
    "two orientations": (
        "{name: a, sphere: 1, pose: {xyz: [0, 0, 0], quat_xyzw: [0, 0, 0, 1], rpy_deg: [0, 0, 0]}}",
        "pose: give one of quat_xyzw, quat_wxyz and rpy_deg",
    ),
    "long quaternion": ("{name: a, sphere: 1, pose: {xyz: [0, 0, 0], quat_xyzw: [0, 0, 1, 1]}}", "must have length 1"),
    "pose without place": ("{name: a, sphere: 1, pose: {rpy_deg: [0, 0, 0]}}", "pose.xyz: missing"),
    "pose as list": ("{name: a, sphere: 1, pose: [0, 0, 0]}", "pose: must be a group of keys"),
    "two orders of a quaternion": (
        "{name: a, sphere: 1, pose: {xyz: [0, 0, 0], quat_wxyz: [1, 0, 0, 0], quat_xyzw: [0, 0, 0, 1]}}",
        "pose: give one of quat_xyzw, quat_wxyz and rpy_deg",
    ),
    "quaternion of another name": (
        "{name: a, sphere: 1, pose: {xyz: [0, 0, 0], quat: [1, 0, 0, 0]}}",
        "unknown key 'quat'",
    ),
    "empty motion": ("{name: a, sphere: 1, motion: {}}", "a motion needs exactly one of velocity, waypoints"),
    "times backwards": (
        "{name: a, sphere: 1, motion: {waypoints: [{time: 1, pose: {xyz: [0, 0, 0]}}, "
        "{time: 0, pose: {xyz: [0, 0, 0]}}]}}",
        "motion times must increase",
    ),
    "link of an obstacle": ("{name: a, sphere: 1, link: hand}", "unknown key 'link'"),
}


@pytest.mark.parametrize(("entry", "message"), BAD.values(), ids=BAD)
def test_a_wrong_obstacle_is_one_line_with_its_line_number(tmp_path, entry, message):
    (tmp_path / "bad.yaml").write_text(f"version: 1\nscene:\n  obstacles:\n    - {entry}\n")
    with pytest.raises(InputError, match=message) as caught:
        load_scene(tmp_path / "bad.yaml")
    assert "bad.yaml:4: scene.obstacles[0]" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scene: {}", "version: missing"),
        ("version: 2\nscene: {}", "version: must be 1, found 2"),
        ("version: 1", "scene: missing"),
        ("version: 1\nscene: []", "scene: must be a group of keys, found a list of 0"),
        ("version: 1\nscene: {obstacle: []}", "did you mean 'obstacles'"),
        ("version: 1\nscene: {obstacles: {a: 1}}", "obstacles: must be a list in square brackets"),
        ("version: 1\nscene: {allowed_collisions: [[a]]}", r"allowed_collisions\[0\]: needs at least 2"),
        ("version: 1\nscene: {attached: [{name: a, sphere: 1}]}", r"attached\[0\].link: missing"),
        ("version: 1\nscene: {attached: [{name: a, link: b, half_space: {normal: [0, 0, 1]}}]}", "cannot be attached"),
        ("version: 1\nscene:\n  obstacles: [{name: a, sphere: 1}, {name: a, sphere: 2}]", "'a' is used 2 times"),
    ],
)
def test_a_wrong_scene_is_one_line(tmp_path, text, message):
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        load_scene(tmp_path / "bad.yaml")


@pytest.mark.parametrize("name", list_problems())
def test_the_scene_of_a_shipped_problem_is_read_from_its_file(name):
    settings, _, _ = load_unchecked(name)
    scene = load_scene(find_problem(name))
    assert [each.name for each in scene.obstacles] == [each.name for each in settings.scene.obstacles]
    assert [each.name for each in scene.attached] == [each.name for each in settings.scene.attached]


def test_a_scene_is_read_from_a_file_with_every_key_of_a_problem(tmp_path):
    assert ProblemFile.keys.keys() <= SceneFile.keys.keys()
    keys = "planner: rrt\npath_constraints: [{}]\nrun: {}\nstart: {}\ngoal: {}\nrobot: 5\n"
    (tmp_path / "whole.yaml").write_text(f"version: 1\nscene: {{obstacles: [{{name: a, sphere: 1}}]}}\n{keys}")
    assert [each.name for each in load_scene(tmp_path / "whole.yaml").obstacles] == ["a"]


@pytest.mark.parametrize(("faces", "kind"), [(4, Mesh), (0, PointCloud)])
def test_a_ply_with_faces_is_a_mesh_and_not_its_corners(faces, kind, tmp_path):
    corners = "0 0 0\n0.1 0 0\n0 0.1 0\n0 0 0.1\n"
    triangles = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n" if faces else ""
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "part.ply").write_text(head + corners + triangles)
    (obstacle,) = load_scene(tmp_path / "part.ply").obstacles
    assert type(obstacle.shape) is kind


@pytest.mark.parametrize("name", ["scan.ply", "scan.npz", "part.obj", "map.bt"])
def test_a_solid_in_a_file_of_its_own_is_a_scene(name, tmp_path):
    file = tmp_path / name
    if name == "scan.ply":
        PointCloud(np.eye(3)).save(file)
    elif name == "scan.npz":
        np.savez(file, points=np.eye(3))
    elif name == "part.obj":
        file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    else:
        file.write_bytes(b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.1\ndata\n" + bytes([0, 0b10000000]))
    (obstacle,) = load_scene(file).obstacles
    assert obstacle.name == file.stem
    (again,) = Scene.load(file).obstacles
    assert same_shape(again.shape, obstacle.shape)
