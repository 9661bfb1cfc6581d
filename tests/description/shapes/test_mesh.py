"""Mesh files: every format and its scale, closed or open, and that a broken one is one line and never a crash."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError, MeshWarning
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.shapes import mesh as mesh_files
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.files import notice
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Mesh
from rrtik_ompl.world.world import World

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter="UNIT"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def stl_text(faces=FACES):
    facets = (
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS[face])
        + "endloop\nendfacet\n"
        for face in faces
    )
    return ("solid part\n" + "".join(facets) + "endsolid part\n").encode()


def stl_binary(faces=FACES, header=b"made by a test"):
    body = b"".join(np.r_[np.zeros(3), CORNERS[f].ravel()].astype("<f4").tobytes() + b"\0\0" for f in faces)
    return header.ljust(80, b" ") + len(faces).to_bytes(4, "little") + body


def obj(faces=FACES):
    rows = [f"v {x} {y} {z}" for x, y, z in CORNERS] + ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    return ("\n".join(rows) + "\n").encode()


def dae(unit="1"):
    return COLLADA.replace("UNIT", unit).encode()


def volume(mesh):
    return float(np.linalg.det(mesh.vertices[mesh.triangles]).sum() / 6.0)


GOOD = {
    "text.stl": stl_text(),
    "binary.stl": stl_binary(),
    "binary_that_begins_with_solid.stl": stl_binary(header=b"solid part"),
    "part.obj": obj(),
    "part.OBJ": obj(),
    "part.dae": dae(),
}


@pytest.mark.parametrize("name", GOOD)
def test_every_format_gives_the_same_solid(tmp_path, name):
    (tmp_path / name).write_bytes(GOOD[name])
    mesh = Mesh.load(tmp_path / name)
    assert mesh.closed
    assert mesh.vertices.shape == (4, 3)
    assert mesh.triangles.shape == (4, 3)
    assert volume(mesh) == pytest.approx(1.0)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [1, 2, 3])


@pytest.mark.parametrize("name", GOOD)
def test_scale_applies_to_every_format(tmp_path, name):
    (tmp_path / name).write_bytes(GOOD[name])
    mesh = Mesh.load(tmp_path / name, scale=0.001)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.001, 0.002, 0.003])
    assert mesh.scale == 0.001
    assert mesh.source == str(tmp_path / name)


def test_the_unit_of_a_collada_file_is_honoured(tmp_path):
    (tmp_path / "part.dae").write_bytes(dae("0.01"))
    np.testing.assert_allclose(Mesh.load(tmp_path / "part.dae", 2.0).vertices.max(axis=0), [0.02, 0.04, 0.06])


LINK_WITH_A_MESH = """<robot name="arm"><link name="base"/>
<link name="link"><collision>{mesh}</collision><visual>{mesh}</visual></link>
<joint name="joint" type="revolute"><parent link="base"/><child link="link"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


@pytest.mark.parametrize("name", GOOD)
@pytest.mark.parametrize("unit", ["1", "0.001", "0.0254", "2"])
def test_a_mesh_has_the_same_size_as_an_obstacle_as_a_solid_of_a_link_and_as_what_is_drawn(tmp_path, name, unit):
    data = dae(unit) if name.endswith(".dae") else GOOD[name]
    (tmp_path / name).write_bytes(data)
    expected = 2.0 * np.array(CORNERS, dtype=float).max(axis=0) * (float(unit) if name.endswith(".dae") else 1.0)
    mesh = f'<geometry><mesh filename="{name}" scale="2 2 2"/></geometry>'
    robot = robot_from_urdf_text(LINK_WITH_A_MESH.format(mesh=mesh), folder=tmp_path)
    found = [Mesh.load(tmp_path / name, 2.0).vertices]
    found += [geometry.geometryObjects[0].geometry.vertices() for geometry in (robot.collision, robot.visual)]
    for vertices in found:
        np.testing.assert_allclose(vertices.max(axis=0), expected, rtol=1e-6)
        np.testing.assert_allclose(vertices.min(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize(("name", "data"), [("part.stl", stl_text(FACES[:, ::-1])), ("part.obj", obj(FACES[:, ::-1]))])
def test_an_inside_out_solid_is_turned(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    assert volume(Mesh.load(tmp_path / name)) == pytest.approx(1.0)


def test_an_open_surface_is_loaded_with_a_warning_that_counts_its_edges(tmp_path):
    (tmp_path / "open.stl").write_bytes(stl_binary(FACES[:3]))
    with pytest.warns(MeshWarning, match=r"open\.stl: 6 open edges.*surface"):
        mesh = Mesh.load(tmp_path / "open.stl")
    assert not mesh.closed


def test_a_solid_whose_seam_differs_by_rounding_is_closed_and_holds_what_is_inside_it():
    around, up = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 41), np.linspace(0.0, np.pi, 21))  # first and last meet
    radius = 4.0 * (1.0 + 0.15 * np.sin(5.0 * around) * np.sin(up) ** 2 + 0.1 * np.cos(6.0 * up))
    way = [np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)]
    k = np.arange(20 * 41).reshape(20, 41)[:, :-1].ravel()
    sides = np.stack([k, k + 41, k + 1], axis=1)[40:], np.stack([k + 1, k + 41, k + 42], axis=1)[:-40]
    faces = np.concatenate(sides)  # where two corners of a triangle meet there is none
    solid = Mesh(np.stack([radius * x for x in way], axis=-1).reshape(-1, 3), faces)
    assert solid.closed
    world = World(load_robot("xarm7"), Scene([Obstacle("solid", solid)]))
    assert not world.valid([0.2, -0.5, 0.1, 0.8, 0.0, 1.2, 0.0])


def test_a_world_warns_of_a_mesh_of_the_memory_that_is_open():
    leaf = Obstacle("leaf", Mesh(CORNERS, FACES[:3]), [3.0, 0.0, 0.0])
    with pytest.warns(MeshWarning, match="'leaf'.*6 open edges.*surface"):
        World(load_robot("xarm7"), Scene([leaf]))


def test_a_mesh_with_a_triangle_of_the_wrong_sense_is_not_a_solid(tmp_path):
    (tmp_path / "bent.obj").write_bytes(obj([FACES[0][::-1], *FACES[1:]]))
    with pytest.warns(MeshWarning):
        assert not Mesh.load(tmp_path / "bent.obj").closed


def test_polygons_are_cut_into_triangles(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
    (tmp_path / "pyramid.obj").write_text(text)
    mesh = Mesh.load(tmp_path / "pyramid.obj")
    assert len(mesh.triangles) == 6
    assert volume(mesh) == pytest.approx(1.0 / 3.0)


NAN = stl_text().replace(b"vertex 1.0", b"vertex nan", 1)
BROKEN = {
    "empty.stl": (b"", "empty"),
    "words.stl": (b"this is not a mesh, only text\n" * 10, "not a usable mesh"),
    "short.stl": (stl_binary()[:-30], "not a usable mesh"),
    "count.stl": (b"x" * 80 + (2**32 - 1).to_bytes(4, "little") + b"\0" * 50, "not a usable mesh"),
    "cut.stl": (stl_text()[:70], "not a usable mesh"),
    "flat.stl": (b"x" * 80 + (2).to_bytes(4, "little") + bytes(100), "no triangles"),
    "nan.stl": (NAN, "finite"),
    "picture.stl": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "not a usable mesh"),
    "index.obj": (obj() + b"f 1 2 99\n", "not a usable mesh"),
    "points.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
    "lines.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\n", "no triangles"),
    "huge.obj": (obj().replace(b"v 1.0", b"v 1e999"), "finite"),
    "words.obj": (b"this is not a mesh\n" * 10, "not a usable mesh"),
    "cut.dae": (dae()[:600], "not a usable mesh"),
    "unit.dae": (dae("0"), "unit must be greater than 0"),
    "units.dae": (dae("centimetre"), "not a usable mesh"),
    "page.dae": (b"<html><body>404</body></html>", "not a usable mesh"),
    "part.ply": (b"ply\n", "a point cloud, not a mesh"),
    "part": (obj(), "unknown kind of mesh"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_mesh_is_one_line_and_silent(tmp_path, capfd, name):
    data, message = BROKEN[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=message) as caught:
        Mesh.load(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Mesh.load(tmp_path / "missing.stl")
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(InputError, match="this is a folder"):
        Mesh.load(tmp_path / "folder.stl")


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), "x", [1, 1, 1]])
def test_a_scale_that_makes_no_sense_is_refused(tmp_path, scale):
    (tmp_path / "part.obj").write_bytes(obj())
    with pytest.raises(InputError, match="scale"):
        Mesh.load(tmp_path / "part.obj", scale)


@pytest.mark.filterwarnings("ignore::rrtik_ompl.base.errors.MeshWarning")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.sampled_from(sorted(GOOD)),
    st.lists(st.tuples(st.floats(0, 1), st.binary(max_size=4), st.integers(0, 20)), min_size=1, max_size=5),
)
def test_a_damaged_file_gives_a_mesh_or_one_line(tmp_path, name, wounds):
    data = bytearray(GOOD[name])
    for share, filling, cut in wounds:
        place = int(share * len(data))
        data[place : place + cut] = filling
    (tmp_path / name).write_bytes(data)
    message = ""
    try:
        mesh = Mesh.load(tmp_path / name)
    except InputError as error:
        message = str(error)
    assert name in message if message else np.isfinite(mesh.vertices).all()


@pytest.mark.parametrize("number", ["nan", "-inf", "1e999", "1.5E+0308", "1e39", "9" * 60])
def test_numbers_that_are_not_finite_are_refused_before_c_sees_them(tmp_path, capfd, number):
    file = tmp_path / "a.stl"
    file.write_bytes(stl_text().replace(b"vertex 1.0 0.0 0.0", f"vertex {number} 0 0".encode()))
    urdf = f"""<robot name="arm"><link name="a"><collision><geometry><mesh filename="{file}"/></geometry></collision>
        </link><link name="b"/><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""
    for load in (lambda: Mesh.load(file), lambda: robot_from_urdf_text(urdf)):
        with pytest.raises(InputError, match="not finite"):
            load()
    assert capfd.readouterr().err == ""


def test_normals_of_a_binary_file_may_be_no_numbers(tmp_path, capfd):
    """Programs divide by the area of triangles that have none."""
    data = bytearray(stl_binary())
    data[84:96] = np.full(3, np.nan, dtype="<f4").tobytes()
    (tmp_path / "a.stl").write_bytes(data)
    assert volume(Mesh.load(tmp_path / "a.stl")) > 0.0
    assert capfd.readouterr().err == ""


def test_a_mesh_beyond_the_world_is_refused(tmp_path):
    file = tmp_path / "a.stl"
    file.write_bytes(stl_text().replace(b"vertex 1.0 0.0 0.0", b"vertex 1e30 0 0"))
    with pytest.raises(InputError, match="check units"):
        Mesh.load(file)


def test_threads_that_read_meshes_leave_standard_error_alone(tmp_path):
    (tmp_path / "a.stl").write_bytes(stl_text())
    before = os.fstat(2)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: Mesh.load(tmp_path / "a.stl"), range(200)))
    assert os.path.samestat(before, os.fstat(2))


def test_who_reads_a_large_mesh_is_told_that_it_takes_long(tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(notice, "listener", told.append)
    monkeypatch.setattr(mesh_files, "LONG_BYTES", 10)
    file = tmp_path / "part.stl"
    file.write_bytes(stl_binary())
    Mesh.load(file)
    assert told == [f"reading {file}, 0 MB: about ten seconds for a million triangles"]
