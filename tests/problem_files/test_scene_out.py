"""Scenes for others: read back they are the same, and MuJoCo measures the distances that coal measures."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import yaml

from rrtik_ompl.base.errors import InputError, SceneWarning
from rrtik_ompl.cli.app import run
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene
from rrtik_ompl.model.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    Octree,
    PointCloud,
    Prism,
    Sphere,
    same_shape,
)
from rrtik_ompl.problem_files.scene import load_scene
from rrtik_ompl.problem_files.scene_out import write_mjcf_scene, write_planning_scene, write_scene_text

WEDGE = Mesh(*Prism([[0.0, 0.0], [0.3, 0.0], [0.0, 0.2]], 0.1).surface())
SHAPES = {
    "box": Box(0.1, 0.2, 0.3),
    "ball": Sphere(0.1),
    "can": Cylinder(0.05, 0.3),
    "hose": Capsule(0.05, 0.3),
    "floor": HalfSpace([0.3, -0.2, 1.0], 0.1),
    "wedge": WEDGE,
    "ell": Prism([[0.0, 0.0], [0.3, 0.0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.3], [0.0, 0.3]], 0.2),
    "ground": HeightField([[0.1, 0.2], [0.1, 0.3]], 0.1),
    "map": Octree([[0.0, 0.0, 0.0], [0.2, 0.0, 0.1]], [0.1, 0.2]),
    "cloud": PointCloud([[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]], 0.02),
}


def scene():
    rng = np.random.default_rng(0)
    places = {name: pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-1.0, 1.0, 3)) for name in SHAPES}
    return Scene([Obstacle(name, shape, places[name]) for name, shape in SHAPES.items()])


def test_mujoco_measures_the_distances_of_the_scene(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    written = scene()
    write_mjcf_scene(written, tmp_path / "room.xml")
    probe = '<body name="probe" mocap="true"><geom name="probe" size=".03"/></body></worldbody>'
    text = (tmp_path / "room.xml").read_text().replace("</worldbody>", probe)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    ball, fromto = coal.Sphere(0.03), np.zeros(6)
    for place in np.random.default_rng(1).uniform(-1.5, 1.5, (15, 3)):
        data.mocap_pos[0] = place
        mujoco.mj_forward(model, data)
        for obstacle in written.obstacles:
            body = model.body(obstacle.name)
            own = range(body.geomadr[0], body.geomadr[0] + body.geomnum[0])
            ours = []
            for piece in pieces(obstacle.shape):
                pose = obstacle.pose * piece.placement
                there = coal.Transform3s(pose.rotation, pose.translation)
                at = coal.Transform3s(np.eye(3), place)
                if not hasattr(piece.geometry, "cloud"):
                    result = coal.DistanceResult()
                    ours.append(coal.distance(ball, at, piece.geometry, there, coal.DistanceRequest(), result))
            if obstacle.name == "cloud":
                points = obstacle.shape.points.astype(float) @ obstacle.pose.rotation.T + obstacle.pose.translation
                ours = [np.linalg.norm(points - place, axis=1).min() - 0.02 - 0.03]
            theirs = min(mujoco.mj_geomDistance(model, data, model.geom("probe").id, g, 10.0, fromto) for g in own)
            if min(ours) > 0.0:
                assert theirs == pytest.approx(min(ours), abs=2e-5), obstacle.name
            else:
                assert theirs < 1e-6, obstacle.name


@pytest.mark.parametrize(
    ("write", "name"),
    [(write_mjcf_scene, "room.xml"), (write_scene_text, "room.scene"), (write_planning_scene, "room.yaml")],
)
def test_a_scene_comes_back(write, name, tmp_path):
    if name == "room.xml":
        pytest.importorskip("mujoco")  # reads meshes that stand in the file
    written = scene()
    write(written, tmp_path / name)
    again = load_scene(tmp_path / name)
    kept = ("box", "ball", "can", "hose") if name == "room.xml" else ("box", "ball", "can", "wedge")
    for each in kept:
        one, other = written.obstacle(each), again.obstacle(each)
        assert same_shape(one.shape, other.shape)
        assert other.pose.isApprox(one.pose, 1e-12)
    plane, floor = again.obstacle("floor"), written.obstacle("floor")
    normal = floor.pose.rotation @ floor.shape.normal
    offset = floor.shape.offset + normal @ floor.pose.translation
    assert plane.pose.rotation @ plane.shape.normal == pytest.approx(normal)
    assert plane.shape.offset + normal @ plane.pose.translation == pytest.approx(offset)
    assert set(SHAPES) <= set(again.names)


def test_a_planning_scene_is_as_ros_writes_messages(tmp_path):
    write_planning_scene(
        Scene([Obstacle("can", Cylinder(0.05, 0.3), pin.SE3(np.eye(3), np.ones(3)))]), tmp_path / "a.yaml"
    )
    (can,) = yaml.safe_load((tmp_path / "a.yaml").read_text())["world"]["collision_objects"]
    assert can["primitives"] == [{"type": 3, "dimensions": [0.3, 0.05]}]  # shape_msgs: CYLINDER, height before radius
    assert can["pose"]["position"] == {"x": 1.0, "y": 1.0, "z": 1.0}
    assert can["primitive_poses"][0]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def test_what_cannot_be_written_is_named(tmp_path):
    hollow = np.array([[0, 0], [1, 0], [1, 1], [0.5, 0.1], [0, 1]])
    boat = Obstacle("boat", Mesh(*Prism(hollow, 0.1).surface()), margin=0.1)
    door = Obstacle("door", Box(1.0, 1.0, 0.1), motion=ConstantVelocity([0.1, 0.0, 0.0]))
    moving = Scene([boat, door], allowed_collisions=[("boat", "door")])
    said = r"not written: to MuJoCo the hulls of boat collide.*motions of 'door'; margins of 'boat'; which pairs"
    with pytest.warns(SceneWarning, match=said):
        write_mjcf_scene(moving, tmp_path / "room.xml")
    many = Scene([Obstacle("map", Octree(np.indices((30, 30, 30)).reshape(3, -1).T, 1.0))])
    with pytest.raises(InputError, match=r"boxes and balls.*coarser"):
        write_scene_text(many, tmp_path / "room.scene")


def test_the_command_converts_scenes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Scene([Obstacle("box", Box(0.1, 0.2, 0.3))]).save("scene.yaml")
    for source, target, *options in (
        ("scene.yaml", "a.xml"),
        ("a.xml", "b.scene"),
        ("b.scene", "c.yaml"),
        ("ur5_table", "d.xml"),
        ("scene.yaml", "e.yaml", "--moveit"),
        ("e.yaml", "f.scene"),
    ):
        assert run(["convert", source, target, *options]) == 0
    assert run(["convert", "scene.yaml", "g.xml", "--moveit"]) == 2
    assert load_scene("f.scene").obstacle("box").shape.size == pytest.approx([0.1, 0.2, 0.3])
    assert load_scene("c.yaml").obstacle("box").shape.size == pytest.approx([0.1, 0.2, 0.3])
    assert load_scene("d.xml").obstacles
