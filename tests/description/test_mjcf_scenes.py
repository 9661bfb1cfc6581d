"""The scene of an MJCF file: obstacles where MuJoCo has the geoms, beside the robot of the same file."""

import numpy as np
import pytest

from rrtik_ompl.base.colors import hexadecimal
from rrtik_ompl.base.errors import DescriptionWarning, InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.mjcf.elements import field_mesh
from rrtik_ompl.model.shapes import Box, HalfSpace, Mesh
from rrtik_ompl.problem_files.scene import load_scene
from rrtik_ompl.world.world import World

SCENE = """<mujoco><asset>
<hfield name="h" nrow="3" ncol="4" size="1 .8 .3 .1" elevation="0 1 2 3 1 1 1 1 5 0 0 2"/></asset>
<worldbody><geom name="floor" type="plane" size="1 1 1" pos="0 0 -.3"/>
<geom name="drawn" size=".1" contype="0" conaffinity="0"/>
<geom name="hill" type="hfield" hfield="h" pos="2 0 0" euler="0 0 20"/>
<body name="table" pos=".35 0 .1" euler="0 0 30"><geom type="box" size=".1 .2 .05"/>
 <body name="post" pos="0 0 .1"><geom name="post" type="cylinder" size=".02 .1" pos="0 0 .2" euler="10 0 0"/></body>
 <geom name="ghost" type="capsule" fromto="0 0 0 0 0 .2" size=".01" contype="2" conaffinity="2"/></body>
<body name="cube" pos=".5 .5 .3"><freejoint/><geom size=".02"/><geom name="lid" size=".01" pos="0 0 .02"/></body>
{extra}<body name="base"><geom size=".05"/>
 <body name="l1" pos="0 0 .2"><joint name="j1" axis="0 1 0" range="-100 100"/>
  <geom type="capsule" size=".02" fromto="0 0 0 0 0 .3"/>
  <body name="l2" pos="0 0 .3"><joint name="j2" axis="1 0 0" range="-120 120"/>
   <geom name="hand" type="capsule" size=".02" fromto="0 0 0.05 0 0 .3"/></body></body></body>
</worldbody></mujoco>"""
FRAME = '<frame pos="1 0 0"><geom name="ball" size=".1"/></frame>'  # which only MuJoCo's compiler reads


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "room.xml"
    path.write_text(SCENE.format(extra=""))
    return path


def test_the_robot_has_what_moves_and_the_scene_has_the_rest(file):
    with pytest.warns(DescriptionWarning, match="of the scene .load_scene.file. has it.: plane 'floor', hfield 'hill'"):
        robot = load_robot(file)
    assert robot.link_names == ("world", "base", "j1/link", "l1", "j2/link", "l2")
    scene = load_scene(file)
    assert set(scene.names) == {"floor", "hill", "table", "post", "ghost", "cube", "lid"}
    assert isinstance(scene.obstacle("floor").shape, HalfSpace)
    assert scene.obstacle("table").shape.size == pytest.approx([0.2, 0.4, 0.1])
    assert {frozenset(pair) for pair in scene.allowed_collisions} == {
        frozenset(("ghost", link)) for link in ("base", "l1", "l2")
    }
    held = scene.attaching("cube", "l2", pose=[0.0, 0.0, 0.35])
    assert [each.name for each in held.attached] == ["cube"]


@pytest.mark.parametrize("extra", ["", FRAME], ids=["ours", "compiled"])
def test_obstacles_stand_where_mujoco_has_the_geoms(file, extra):
    mujoco = pytest.importorskip("mujoco")
    file.write_text(SCENE.format(extra=extra))
    scene = load_scene(file)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name in ("floor", "post", "lid", "hill", "ghost", *(["ball"] if extra else [])):
        place = scene.obstacle(name).pose
        assert place.translation == pytest.approx(data.geom(name).xpos, abs=1e-9)
        along = place.rotation[:, 2] @ data.geom(name).xmat.reshape(3, 3)[:, 2]
        assert (abs(along) if name == "ghost" else along) == pytest.approx(1.0, abs=1e-9)  # a capsule has two ends


def test_the_arm_touches_obstacles_where_it_does_in_mujoco(file):
    mujoco = pytest.importorskip("mujoco")
    with pytest.warns(DescriptionWarning):
        robot = load_robot(file)
    world = World(robot, load_scene(file))
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    rows = np.random.default_rng(1).uniform(robot.lower, robot.upper, (300, 2))
    places = [model.joint(name).qposadr[0] for name in robot.joint_names]
    arm = {model.geom(name).id for name in ("hand",)} | {
        k for k in range(model.ngeom) if model.body(model.geom_bodyid[k]).name in ("base", "l1", "l2")
    }
    touching = []
    for q in rows:
        data.qpos[places] = q
        mujoco.mj_forward(model, data)
        touching.append(any(c.dist < 0.0 and arm & {c.geom1, c.geom2} for c in data.contact))
    assert 5 < sum(touching) < 290
    assert (~world.valid_batch(rows) == touching).all()


def test_a_height_field_is_as_high_as_in_mujoco(file):
    mujoco = pytest.importorskip("mujoco")
    hill = load_scene(file).obstacle("hill")
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert isinstance(hill.shape, Mesh)
    assert hill.shape.closed
    corners = hill.shape.vertices[hill.shape.triangles]
    hit = np.zeros(1, dtype=np.int32)
    for x, y in np.random.default_rng(3).uniform([-0.95, -0.75], [0.95, 0.75], (40, 2)):
        start = hill.pose.act(np.array([x, y, 1.0]))
        down = -hill.pose.rotation[:, 2]
        fallen = mujoco.mj_ray(model, data, start, down, None, 1, -1, hit)
        assert model.geom(hit[0]).name == "hill"
        assert 1.0 - fallen == pytest.approx(height(corners, x, y), abs=1e-6)


def height(corners, x, y):
    """Of the highest of some triangles over a place."""
    found = []
    for a, b, c in corners:
        sides = np.column_stack([b[:2] - a[:2], c[:2] - a[:2]])
        if abs(np.linalg.det(sides)) > 1e-12:
            u, v = np.linalg.solve(sides, [x - a[0], y - a[1]])
            if min(u, v, 1.0 - u - v) >= -1e-9:
                found.append(a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))
    return max(found)


def test_a_field_of_heights_is_a_closed_solid_that_faces_outward():
    mesh = field_mesh(np.array([[0.0, 1.0], [0.5, 0.2], [1.0, 1.0]]), [1.0, 2.0, 0.5, 0.25])
    assert mesh.closed
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    assert np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0 > 2.0 * 4.0 * 0.25


def test_a_height_field_in_a_file_needs_mujoco(file, monkeypatch):
    monkeypatch.setattr("rrtik_ompl.description.mjcf.read.compiled", lambda path: None)
    file.write_text(SCENE.format(extra="").replace('elevation="0 1 2 3 1 1 1 1 5 0 0 2"', 'file="h.png"'))
    with pytest.raises(InputError, match=r"room.xml: .*height field 'h' is in a file; with the package mujoco"):
        load_scene(file)
    with pytest.warns(DescriptionWarning, match="height field .h. is in a file"):
        load_robot(file)


@pytest.mark.parametrize("extra", ["", FRAME], ids=["plain", "compiled"])
def test_obstacles_and_links_have_the_colours_that_mujoco_draws(tmp_path, extra):
    mujoco = pytest.importorskip("mujoco")
    red, own = 'material="red"', 'material="red" rgba="0 0 1 1"'
    text = SCENE.format(extra=extra).replace("<asset>", '<asset><material name="red" rgba="1 0.2 0 1"/>')
    text = text.replace('<geom type="box"', f'<geom {red} type="box"').replace(
        'name="post" type', f'{own} name="post" type'
    )
    text = text.replace('<geom name="hand"', f'<geom {red} name="hand"')
    path = tmp_path / "room.xml"
    path.write_text(text)

    model = mujoco.MjModel.from_xml_path(str(path))
    drawn = {"post": model.geom("post").rgba[:3]}
    drawn["table"] = drawn["hand"] = model.mat_rgba[model.geom("hand").matid[0]][:3]

    scene = load_scene(path)
    for name in ("table", "post"):
        assert scene.obstacle(name).color == hexadecimal(drawn[name])
    assert scene.obstacle("lid").color is None  # MuJoCo's grey of what states none
    with pytest.warns(DescriptionWarning):
        robot = load_robot(path)
    painted = [body for body in robot.visual.geometryObjects if body.overrideMaterial]
    assert [body.meshColor[:3] for body in painted] == [pytest.approx(drawn["hand"])]


def test_a_scene_without_a_robot_is_read(tmp_path):
    path = tmp_path / "boxes.mjcf"
    path.write_text(
        '<mujoco><worldbody><geom type="box" size="1 1 1"/><geom type="box" size="2 1 1"/></worldbody></mujoco>'
    )
    scene = load_scene(path)
    assert scene.names == ("box", "box_2")
    assert all(isinstance(obstacle.shape, Box) for obstacle in scene.obstacles)
    assert [o.shape.size[0] for o in scene.obstacles] == [2.0, 4.0]
