"""Colours of mesh files: one body per colour, its triangles where they were; what cannot be read is one warning."""

import json
import re
import struct
import warnings

import numpy as np
import pytest
import trimesh

from rrtik_ompl.base.errors import InputError, MeshWarning
from rrtik_ompl.description.shapes.mesh import load_surface
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.geometry.collision.solids import mesh_arrays
from rrtik_ompl.model.shapes import Mesh

RED, BLUE = (0.8, 0.2, 0.0), (0.0, 0.2, 1.0)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
MTL = "".join(f"newmtl m{k}\nKd {' '.join(map(str, colour))}\n" for k, colour in enumerate((RED, BLUE)))
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter="0.01"/></asset><library_effects>{effects}</library_effects>
<library_materials>{materials}</library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">{points}</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{triangles}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"><bind_material><technique_common>
{bound}</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def light(colour):
    """Return values of sRGB as intensities of light."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]


def obj(folder):
    (folder / "arm.mtl").write_text(MTL)
    rows = ["mtllib arm.mtl", *(f"v {x} {y} {z}" for x, y, z in CORNERS)]
    for k, half in enumerate((FACES[:2], FACES[2:])):
        rows += [f"usemtl m{k}", *("f " + " ".join(str(n + 1) for n in face) for face in half)]
    return "\n".join(rows).encode()


def glb(folder):
    del folder
    blob = CORNERS.astype("<f4").tobytes() + FACES.astype("<u2").tobytes()
    views = [(0, 48), (48, 12), (60, 12)]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 2, 3]},
            *({"bufferView": k, "componentType": 5123, "count": 6, "type": "SCALAR"} for k in (1, 2)),
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1 + k, "material": k} for k in range(2)]}
        ],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [*light(c), 1]}} for c in (RED, BLUE)],
    }
    text = json.dumps(document).encode()
    chunks = ((b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", blob + b"\0" * (-len(blob) % 4)))
    body = b"".join(struct.pack("<I", len(data)) + kind + data for kind, data in chunks)
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def dae(folder):
    del folder
    both = range(2)
    effects = (
        f'<effect id="e{k}"><profile_COMMON><technique sid="t"><lambert><diffuse>'
        f"<color>{' '.join(map(str, c))} 1</color></diffuse></lambert></technique></profile_COMMON></effect>"
        for k, c in enumerate((RED, BLUE))
    )
    return COLLADA.format(
        effects="".join(effects),
        materials="".join(f'<material id="i{k}"><instance_effect url="#e{k}"/></material>' for k in both),
        points=" ".join(str(100 * x) for x in CORNERS.ravel()),
        triangles="".join(
            f'<triangles count="2" material="m{k}"><input semantic="VERTEX" source="#v" offset="0"/>'
            f"<p>{' '.join(map(str, FACES[2 * k : 2 * k + 2].ravel()))}</p></triangles>"
            for k in both
        ),
        bound="".join(f'<instance_material symbol="m{k}" target="#i{k}"/>' for k in both),
    ).encode()


def ply(folder):
    del folder
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 4\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n"
    head += "property uchar blue\nend_header\n"
    rows = [" ".join(map(str, corner)) for corner in CORNERS]
    for k, face in enumerate(FACES):
        rows.append(" ".join(map(str, [3, *face, *(round(255 * c) for c in (RED, BLUE)[k // 2])])))
    return (head + "\n".join(rows) + "\n").encode()


KINDS = {"obj": obj, "glb": glb, "dae": dae, "ply": ply}


def robot(file, colour=""):
    material = f'<material name="m"><color rgba="{colour}"/></material>' if colour else ""
    mesh = f'<geometry><mesh filename="{file}" scale="0.1 0.2 0.1"/></geometry>'
    text = f"""<robot name="r"><link name="base"><visual>{mesh}{material}</visual></link><link name="a"/>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
    return robot_from_urdf_text(text, folder=file.parent)


def surfaces(robot):
    """Return the corners of the triangles of each body, sorted, by its colour of whole 255ths."""
    found = {}
    for body in robot.visual.geometryObjects:
        vertices, faces = mesh_arrays(body.geometry)
        colour = tuple(np.round(255 * body.meshColor[:3]).astype(int)) if body.overrideMaterial else None
        found[colour] = sorted(sorted(map(tuple, np.round(vertices[face], 6))) for face in faces)
    return found


def expected(*halves):
    corners = CORNERS * [0.1, 0.2, 0.1]
    return [sorted(sorted(map(tuple, np.round(corners[face], 6))) for face in half) for half in halves]


@pytest.mark.parametrize("kind", KINDS)
def test_a_mesh_of_two_materials_is_two_bodies_in_their_colours(kind, tmp_path):
    file = tmp_path / f"arm.{kind}"
    file.write_bytes(KINDS[kind](tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = surfaces(robot(file, "0 1 0 1"))

    # trimesh keeps whole 255ths of what glTF states as intensities: some 3 of sRGB's where it is dark
    colours = np.array(list(found))
    assert np.abs(colours - np.round(255 * np.array([BLUE, RED]))).max() <= (3 if kind == "glb" else 1)
    assert list(found.values()) == expected(FACES[2:], FACES[:2])


def test_where_a_file_states_no_colour_that_of_the_description_counts(tmp_path):
    file = tmp_path / "arm.obj"
    file.write_bytes(re.sub(rb"(mtllib|usemtl).*\n", b"", obj(tmp_path)))
    assert surfaces(robot(file, "0 1 0 1")) == {(0, 255, 0): expected(FACES)[0]}
    assert surfaces(robot(file)) == {None: expected(FACES)[0]}


@pytest.mark.parametrize("fault", ["no library", "another shape"])
def test_colours_that_cannot_be_read_are_one_warning(fault, tmp_path, monkeypatch):
    file = tmp_path / "arm.obj"
    file.write_bytes(obj(tmp_path))
    if fault == "no library":
        (tmp_path / "arm.mtl").unlink()
    else:
        monkeypatch.setattr(trimesh, "load_scene", lambda *a, **k: trimesh.Scene(trimesh.creation.box()))

    arm = robot(file)
    with pytest.warns(MeshWarning) as said:
        found = surfaces(arm)
    assert found == {None: expected(FACES)[0]}
    assert [str(each.message).count("drawn in one colour") for each in said] == [1]


@pytest.mark.parametrize("kind", KINDS)
def test_all_parts_of_a_mesh_are_read(kind, tmp_path):
    """Coal 3.0 takes the vertices of the first of several parts of a node for those of the others."""
    file = tmp_path / f"arm.{kind}"
    file.write_bytes(KINDS[kind](tmp_path))
    vertices, faces = mesh_arrays(load_surface(file, np.array([0.1, 0.2, 0.1])))
    assert sorted(sorted(map(tuple, np.round(vertices[face], 6))) for face in faces) == expected(FACES)[0]


def test_parts_that_cannot_be_read_are_refused(tmp_path, monkeypatch):
    file = tmp_path / "arm.glb"
    file.write_bytes(glb(tmp_path))

    def fail(*args, **options):
        raise ValueError("no parts")

    monkeypatch.setattr(trimesh, "load_scene", fail)
    with pytest.raises(InputError, match=r"arm\.glb: .* no GLB file that trimesh reads"):
        load_surface(file, np.ones(3))


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_a_ply_may_have_its_faces_before_its_vertices(order, tmp_path):
    head = f"ply\nformat {order} 1.0\nelement face 4\nproperty list uchar int vertex_indices\nelement vertex 4\n"
    head += "property float x\nproperty float y\nproperty float z\nend_header\n"
    if order == "ascii":
        body = (
            "\n".join(" ".join(map(str, row)) for row in [*([3, *face] for face in FACES), *CORNERS]).encode() + b"\n"
        )
    else:
        body = b"".join(b"\3" + face.astype("<i4").tobytes() for face in FACES) + CORNERS.astype("<f4").tobytes()
    (tmp_path / "part.ply").write_bytes(head.encode() + body)

    solid = Mesh.load(tmp_path / "part.ply")
    assert solid.closed
    assert solid.vertices.tolist() == sorted(CORNERS.tolist())
