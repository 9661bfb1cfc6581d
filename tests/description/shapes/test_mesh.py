"""Mesh files: every format and its scale, closed or open, and that a broken one is one line and never a crash."""

import os
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError, MeshWarning
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.shapes import mesh as mesh_files
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.files import notice
from rrtik_ompl.files.kinds import load
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.geometry.collision.solids import bvh, closed_if_mended, is_closed, mesh_arrays, robot_solids
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Mesh, Sphere
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


def stl_binary(faces=FACES, header=b"made by a test", corners=CORNERS):
    body = b"".join(np.r_[np.zeros(3), corners[f].ravel()].astype("<f4").tobytes() + b"\0\0" for f in faces)
    return header.ljust(80, b" ") + len(faces).to_bytes(4, "little") + body


def obj(faces=FACES):
    rows = [f"v {x} {y} {z}" for x, y, z in CORNERS] + ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    return ("\n".join(rows) + "\n").encode()


def ply_head(order, faces, count=4):
    points = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat {order} 1.0\nelement vertex {count}\n{points}element face {len(faces)}\n"
    return (head + "property list uchar int vertex_indices\nend_header\n").encode()


def ply(faces=FACES):
    body = b"".join(b"\3" + np.asarray(face, dtype="<i4").tobytes() for face in faces)
    return ply_head("binary_little_endian", faces) + CORNERS.astype("<f4").tobytes() + body


def ply_text(faces=FACES):
    rows = [*CORNERS.tolist(), *([3, *face] for face in np.asarray(faces).tolist())]
    return ply_head("ascii", faces) + "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()


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
    "part.ply": ply(),
    "text.ply": ply_text(),
    "part.glb": trimesh.Trimesh(CORNERS, FACES, process=False).export(file_type="glb"),
}


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_ply_of_bytes_may_have_faces_of_several_numbers_of_corners(tmp_path, order):
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7], [1, 7, 3]]
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = ply_head(kind, quads, 8).replace(b"end_header", b"property float weight\nend_header")
    rows = [
        bytes([len(face)]) + np.array(face, f"{order}i4").tobytes() + np.float32(0.5).astype(f"{order}f4").tobytes()
        for face in quads
    ]
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], f"{order}f4")
    (tmp_path / "box.ply").write_bytes(head + corners.tobytes() + b"".join(rows))
    mesh = Mesh.load(tmp_path / "box.ply")
    assert mesh.closed
    assert len(mesh.triangles) == 12
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles).volume == pytest.approx(6.0)


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
    with pytest.warns(MeshWarning, match=r"open\.stl: 3 open edges.*surface"):
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
    with pytest.warns(MeshWarning, match="'leaf'.*3 open edges.*surface"):
        World(load_robot("xarm7"), Scene([leaf]))


def boxes(change):
    """Three boxes half a metre apart, of which the triangles of the first are changed."""
    side = np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
                     [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]])  # fmt: skip
    corner = np.array([[x, y, z] for z in (0.0, 0.4) for y in (0.0, 0.3) for x in (0.0, 0.2)])
    vertices = np.concatenate([corner + np.array([0.5 * k, 0.0, 0.0]) for k in range(3)])
    faces = [face for k in range(1, 3) for face in (side + 8 * k).tolist()]
    first, extra = change(side.tolist())
    return np.vstack([vertices, *extra]), np.array(first + faces)


def cut_in_a_t(faces):
    """Divide one of two triangles at an edge, so that the other one has a vertex on its side."""
    a, b, c = faces[0]  # the edge from c to a is that from (0.2, 0, 0) to (0, 0, 0)
    return [[a, b, 24], [24, b, c], *faces[1:]], [[[0.1, 0.0, 0.0]]]


REPAIRED = {
    "twice": lambda faces: ([*faces, faces[3]], []),
    "twice and turned": lambda faces: ([*faces, faces[3][::-1]], []),
    "turned": lambda faces: ([faces[0][::-1], *faces[1:]], []),
    "five turned": lambda faces: ([face[::-1] for face in faces[:5]] + faces[5:], []),
    "a T": cut_in_a_t,
}


@pytest.mark.parametrize("case", REPAIRED)
def test_a_bad_triangle_does_not_make_boxes_hollow(case):
    mesh = Mesh(*boxes(REPAIRED[case]))
    assert mesh.closed
    assert abs(volume(mesh)) == pytest.approx(3 * 0.2 * 0.3 * 0.4, rel=1e-12)
    edges = np.sort(np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]]))
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def obj_of(vertices, faces):
    rows = [f"v {x} {y} {z}" for x, y, z in vertices] + ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    return "\n".join(rows)


@pytest.mark.parametrize("case", REPAIRED)
def test_a_bad_triangle_does_not_make_a_link_hollow(tmp_path, case):
    (tmp_path / "link.obj").write_text(obj_of(*boxes(REPAIRED[case])))
    mesh = '<geometry><mesh filename="link.obj"/></geometry>'
    robot = robot_from_urdf_text(LINK_WITH_A_MESH.format(mesh=mesh), folder=tmp_path)
    assert not is_closed(robot.collision.geometryObjects[0].geometry)
    assert is_closed(robot_solids(robot)[0])


def test_a_ball_in_a_link_with_a_bad_triangle_touches_it(tmp_path):
    (tmp_path / "link.obj").write_text(obj_of(*boxes(REPAIRED["a T"])))
    mesh = '<geometry><mesh filename="link.obj"/></geometry>'
    robot = robot_from_urdf_text(LINK_WITH_A_MESH.format(mesh=mesh), folder=tmp_path)
    worlds = [World(robot, Scene([Obstacle("ball", Sphere(0.02), [x, 0.15, 0.2])])) for x in (0.1, 0.35)]
    assert [world.valid([0.0]) for world in worlds] == [False, True]


def test_a_link_that_stays_open_is_left_as_it_is():
    for change in (lambda faces: (faces[1:], []), lambda faces: (faces, [])):
        mesh = bvh(*boxes(change))
        assert closed_if_mended(mesh) is mesh


def test_a_triangle_that_is_missing_opens_its_own_box_alone():
    vertices, faces = boxes(lambda faces: (faces[1:], []))
    mesh = Mesh(vertices, faces)
    assert mesh.open_edges == 3
    assert mesh.in_closed_parts.sum() == 24
    solid, surface = (piece.geometry for piece in pieces(mesh))
    assert is_closed(solid)
    assert not is_closed(surface)
    assert (mesh_arrays(solid)[0][:, 0].min(), mesh_arrays(surface)[0][:, 0].max()) == (0.5, 0.2)


def test_a_ball_is_free_only_in_the_box_that_is_open():
    ball = """<robot name="ball"><link name="base"/><link name="ball"><collision><geometry><sphere radius="0.02"/>
        </geometry></collision></link><joint name="x" type="prismatic"><parent link="base"/><child link="ball"/>
        <origin xyz="0 0.15 0.2"/><limit lower="-1" upper="2" velocity="1" effort="1"/></joint></robot>"""
    places = [[0.1], [0.35], [0.6], [1.1]]
    for change, in_first in ((REPAIRED["twice"], False), (lambda faces: (faces[1:], []), True)):
        scene = Scene([Obstacle("boxes", Mesh(*boxes(change), source="boxes.stl"))])
        world = World(robot_from_urdf_text(ball), scene)
        assert world.valid_batch(places).tolist() == [in_first, True, False, False]


def test_boards_that_share_a_face_are_closed_and_not_said_to_be_open(tmp_path):
    """As most shelves: four triangles meet at an edge, which all agree on what is inside."""
    vertices, faces = boxes(lambda faces: (faces, []))
    vertices[8:16, 0] -= 0.3  # the second box touches the first one
    (tmp_path / "shelf.obj").write_text(obj_of(vertices, faces))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = Mesh.load(tmp_path / "shelf.obj")
    assert mesh.closed == is_closed(pieces(mesh)[0].geometry) == True  # noqa: E712


@pytest.mark.parametrize("place", [1e4, 1e5, 5e5, 9e5])
def test_a_mesh_far_from_its_origin_keeps_its_shape_or_is_refused(tmp_path, place):
    shift = np.array([place + 0.123456, -place, 0.0])
    rows = obj().decode().splitlines()
    moved = ["v " + " ".join(map(repr, (CORNERS[k] * 0.1 + shift).tolist())) for k in range(4)]
    (tmp_path / "far.obj").write_text("\n".join(moved + rows[4:]))
    text = stl_text().decode()
    for corner, row in zip(CORNERS, moved, strict=True):
        text = text.replace("vertex {} {} {}\n".format(*corner), f"vertex {row[2:]}\n")
    (tmp_path / "far.stl").write_text(text)
    for name in ("far.obj", "far.stl"):
        mesh = Mesh.load(tmp_path / name)
        assert mesh.closed
        np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.1, 0.2, 0.3], atol=1e-9)
    (tmp_path / "far.stl").write_bytes(stl_binary(corners=CORNERS * 0.1 + shift))
    with pytest.raises(InputError, match=r"so far from its origin its points lie on a grid of .* mm; move it there"):
        Mesh.load(tmp_path / "far.stl")
    assert Mesh.load(tmp_path / "far.stl", scale=1e-6).closed is not None  # in micrometres it is near


def test_a_large_mesh_is_read_though_its_points_are_coarse(tmp_path):
    """As a terrain of some hundred metres, or a part in millimetres whose scale was forgotten."""
    (tmp_path / "large.stl").write_bytes(stl_binary(corners=CORNERS * 100.0))
    assert volume(Mesh.load(tmp_path / "large.stl")) == pytest.approx(1e6, rel=1e-5)


ODD_STL = {
    "bytes after the last triangle": stl_binary() + b"\r\nthe end",
    "a count of 0": stl_binary()[:80] + bytes(4) + stl_binary()[84:],
    "a count of -1": stl_binary()[:80] + b"\xff" * 4 + stl_binary()[84:],
    "capitals": stl_text().upper(),
    "blank first lines": b"\n \n" + stl_text(),
    "words after solid": stl_text().replace(b"solid part\n", b"solid made by nan inf\n"),
}


@pytest.mark.parametrize("case", ODD_STL)
def test_stl_is_read_as_programs_write_it(tmp_path, case):
    (tmp_path / "part.stl").write_bytes(ODD_STL[case])
    mesh = Mesh.load(tmp_path / "part.stl")
    assert mesh.closed
    assert volume(mesh) == pytest.approx(1.0)


def test_names_and_comments_of_an_obj_may_be_any_words(tmp_path):
    (tmp_path / "part.obj").write_bytes(b"# from inf to nan\no nan\n" + obj())
    assert Mesh.load(tmp_path / "part.obj").closed


@pytest.mark.parametrize("kind", ["ply", "glb", "gltf"])
def test_formats_of_other_programs_are_read(tmp_path, kind):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene(trimesh.Trimesh(CORNERS, FACES, process=False))
    scene.apply_transform(trimesh.transformations.translation_matrix([0.0, 0.0, 5.0]))
    if kind == "gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(scene).items():
            (tmp_path / name.replace("model.", "part.")).write_bytes(data)
    else:
        (scene if kind == "glb" else scene.to_mesh()).export(tmp_path / f"part.{kind}")
    mesh = Mesh.load(tmp_path / f"part.{kind}")
    assert volume(mesh) == pytest.approx(1.0)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [1, 2, 8])


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
    "count.stl": (b"x" * 80 + (2**32 - 1).to_bytes(4, "little") + b"\0" * 50, "zero area"),
    "cut.stl": (stl_text()[:70], "not a usable mesh"),
    "flat.stl": (b"x" * 80 + (2).to_bytes(4, "little") + bytes(100), "no triangles"),
    "nan.stl": (NAN, "finite"),
    "picture.stl": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "not a usable mesh"),
    "index.obj": (obj() + b"f 1 2 99\n", "a triangle names a vertex that is not there"),
    "points.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
    "lines.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\n", "no triangles"),
    "huge.obj": (obj().replace(b"v 1.0", b"v 1e999"), "finite"),
    "words.obj": (b"this is not a mesh\n" * 10, "not a usable mesh"),
    "cut.dae": (dae()[:600], "damaged, cut off, or no DAE file"),
    "unit.dae": (dae("0"), "unit must be greater than 0"),
    "units.dae": (dae("centimetre"), "unit 'centimetre' is no number"),
    "page.dae": (b"<html><body>404</body></html>", "not a usable mesh"),
    "part.ply": (b"ply\n", "a point cloud, not a mesh"),
    "cut.ply": (ply()[:-3], "has room for"),
    "long_face.ply": (ply()[:-13] + b"\x2d" + ply()[-12:], "has room for"),
    "none.ply": (ply(faces=[]), "a point cloud, not a mesh"),
    "index.ply": (ply(faces=[[0, 1, 9]]), "a triangle names a vertex that is not there"),
    "negative.ply": (ply(faces=[[0, 1, -2]]), "a triangle names a vertex that is not there"),
    "index_text.ply": (ply_text(faces=[[0, 1, 9]]), "a triangle names a vertex that is not there"),
    "negative_text.ply": (ply_text(faces=[[0, 1, -2]]), "a triangle names a vertex that is not there"),
    "cut_text.ply": (ply_text()[:-8], "3 of 4 faces are there; is it cut off"),
    "cut.glb": (b"glTF\2\0\0\0", "damaged, cut off, or no GLB file"),
    "cut_off.stl": (stl_text()[:-60], "is it cut off"),
    "words_for_numbers.stl": (stl_text().replace(b"vertex 1.0", b"vertex one", 1), "not of three numbers"),
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


def test_a_ply_with_faces_is_a_mesh_to_whoever_asks(tmp_path):
    (tmp_path / "part.ply").write_bytes(ply())
    assert isinstance(load(tmp_path / "part.ply"), Mesh)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Mesh.load(tmp_path / "missing.stl")
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(InputError, match="this is a folder"):
        Mesh.load(tmp_path / "folder.stl")


def test_a_mesh_that_is_too_large_is_refused_before_it_is_read(tmp_path, monkeypatch):
    (tmp_path / "part.obj").write_bytes(obj())
    monkeypatch.setattr(mesh_files, "MAX_BYTES", 10)
    with pytest.raises(InputError, match=r"part\.obj: a mesh of 0 MiB, more than .*; simplify it"):
        Mesh.load(tmp_path / "part.obj")


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


@pytest.mark.parametrize("wrong", ['0"2', "0 2 x", "0 \xe9 2", "0,2", "1.0"])
@pytest.mark.parametrize("tag", ["p", "vcount", "v", "h"])
def test_an_index_that_is_no_number_is_refused_before_assimp_reads_it_for_ever(tmp_path, tag, wrong):
    primitives = b"<p>0 2 1" if tag == "p" else f"<{tag}>0</{tag}><p>0 2 1".encode()
    damaged = GOOD["part.dae"].replace(b"<p>0 2 1", primitives)
    (tmp_path / "part.dae").write_bytes(damaged.replace(f"<{tag}>0".encode(), f"<{tag}>{wrong}".encode()))
    with pytest.raises(InputError, match=r"part\.dae: .* a list of indices holds what is no number"):
        Mesh.load(tmp_path / "part.dae")


@pytest.mark.parametrize("number", ["nan", "-inf", "1e999", "1.5E+0308", "1e39", "9" * 60])
def test_numbers_that_are_not_finite_are_refused_before_c_sees_them(tmp_path, capfd, number):
    file = tmp_path / "a.stl"
    file.write_bytes(stl_text().replace(b"vertex 1.0 0.0 0.0", f"vertex {number} 0 0".encode()))
    urdf = f"""<robot name="arm"><link name="a"><collision><geometry><mesh filename="{file}"/></geometry></collision>
        </link><link name="b"/><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""
    for read in (lambda: Mesh.load(file), lambda: robot_from_urdf_text(urdf)):
        with pytest.raises(InputError, match=r"not finite|check units"):
            read()
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


@pytest.mark.parametrize("data", [bytes(80), bytes(84)], ids=["80 bytes", "84 bytes"])
def test_a_link_whose_mesh_has_no_triangles_touches_nothing_and_is_said_so(data, tmp_path):
    """Kinova's end effector has such a mesh: the header of an STL alone."""
    (tmp_path / "empty.stl").write_bytes(data)
    mesh = '<geometry><mesh filename="empty.stl"/></geometry>'
    text = f"""<robot name="r"><link name="base"/><link name="a"><collision>{mesh}</collision>
<collision><geometry><sphere radius="0.1"/></geometry></collision><visual>{mesh}</visual></link>
<link name="b"><collision>{mesh}</collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint></robot>"""
    with pytest.warns(MeshWarning, match=r"touches nothing: link 'a': .*empty\.stl: .*no triangles.*link 'b'"):
        robot = robot_from_urdf_text(text, folder=tmp_path)
    assert [body.name for body in robot.collision.geometryObjects] == ["a_1"]
    with pytest.warns(MeshWarning, match="not drawn: link 'a'"):
        assert robot.visual.ngeoms == 1
    with pytest.raises(InputError, match="no triangles"):
        Mesh.load(tmp_path / "empty.stl")
