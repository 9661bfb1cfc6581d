"""Height fields and octrees in files: as others write them, in scenes, and what is wrong with a file in one line."""

import io

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.errors import InputError
from rrtik_ompl.shapes import same_shape

HEIGHTS = np.array([[0.0, 0.5, 1.0], [1.5, 2.0, 2.5]])
HEAD = b"# Octomap OcTree binary file\n# a comment\nid OcTree\nsize 3\nres 0.1\ndata\n"
# The root's first child is a node whose last child is occupied, and whose first child is free; its last child is
# occupied as a whole.
BODY = bytes([0b00000011, 0b10000000, 0b00000001, 0b10000000])


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def picture(array):
    cv2 = pytest.importorskip("cv2")
    return cv2.imencode(".png", array)[1].tobytes()


def saved(folder, name, data):
    (folder / name).write_bytes(data)
    return folder / name


@pytest.mark.parametrize("name", ["a.npy", "a.csv", "a.txt", "a.png"])
def test_heights_are_read_as_they_were_written(name, tmp_path):
    text = "\n".join(",".join(map(str, row)) for row in HEIGHTS.tolist())
    grey = (1000 * HEIGHTS).astype(np.uint16)
    data = {"npy": lambda: npy(HEIGHTS), "png": lambda: picture(grey[::-1])}.get(name[-3:], text.encode)()
    file = saved(tmp_path, name, data)
    field = rrtik.load_height_field(file, 0.5, scale=0.001 if name.endswith("png") else 1.0)
    np.testing.assert_allclose(field.heights, HEIGHTS, atol=1e-12)
    assert field.source == str(file)


def test_a_map_has_its_occupied_cells_where_the_tree_puts_them(tmp_path):
    tree = rrtik.load_octree(saved(tmp_path, "map.bt", HEAD + BODY))
    half = 0.1 * 2**15  # the root reaches so far along each axis
    found = dict(zip(tree.sides.tolist(), tree.centres.tolist(), strict=True))
    assert found == {half: pytest.approx([0.5 * half] * 3), 0.5 * half: pytest.approx([-0.25 * half] * 3)}


def test_a_cloud_of_a_map_has_a_point_for_each_finest_cell(tmp_path):
    path = b""  # down the last children to a cell two levels above the finest, then one finest cell
    for _ in range(13):
        path += bytes([0, 0b11000000])
    path += bytes([2, 0b11000000]) + bytes([0, 0b11000000]) + bytes([0b10, 0])
    file = saved(tmp_path, "map.bt", HEAD + path)
    cloud, tree = rrtik.load_cloud(file, 0.09), rrtik.load_octree(file)
    assert len(cloud.points) == 4**3 + 1
    assert np.sort(tree.sides) == pytest.approx([0.1, 0.4])
    away = np.abs(cloud.points[:, None] - tree.centres).max(axis=2) + 0.05 - 0.5 * tree.sides
    assert (away.min(axis=1) < 1e-3).all()  # [m] in single precision, 3 km from the origin


def test_a_scene_with_ground_and_a_map_comes_back(tmp_path):
    field = rrtik.load_height_field(saved(tmp_path, "ground.npy", npy(HEIGHTS)), 0.5, -1.0, scale=0.5)
    tree = rrtik.load_octree(saved(tmp_path, "map.bt", HEAD + BODY), scale=0.5)
    scene = rrtik.Scene((rrtik.Obstacle("ground", field), rrtik.Obstacle("map", tree, rrtik.pose([1.0, 0.0, 0.0]))))
    rrtik.save_scene(scene, tmp_path / "scene.yaml")
    again = rrtik.load_scene(tmp_path / "scene.yaml")
    assert all(same_shape(again.obstacle(o.name).shape, o.shape) for o in scene.obstacles)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.npy", npy(np.zeros(3)), "expected numbers of shape"),
        ("a.npy", npy(HEIGHTS)[:-8], "its header claims"),
        ("a.csv", b"1,2\n3\n", "not rows of numbers"),
        ("a.csv", b"", "expected rows of numbers"),
        ("a.png", b"nothing", "not a picture that can be read"),
        ("a.xls", b"", "unknown kind of heights; have .npy"),
        ("a.bt", b"PK", "not a map of OctoMap"),
        ("a.bt", HEAD + BODY[:3], "the tree ends too early; save it again"),
        ("a.bt", HEAD + bytes([0, 0b11000000]) * 17, "the tree is too deep"),
        ("a.bt", HEAD.replace(b"res 0.1", b"res"), "needs a line 'res'"),
        ("a.bt", HEAD.replace(b"res 0.1", b"res -1"), "res: must be greater than 0"),
        ("a.bt", HEAD.replace(b"OcTree\nsize", b"ColorOcTree\nsize"), "a tree of type 'ColorOcTree' is unknown"),
        ("a.bt", HEAD, "none of its cells is occupied"),
    ],
)
def test_broken_files_are_one_line_with_the_file(name, data, message, tmp_path):
    if name == "a.png":
        pytest.importorskip("cv2")
    file = saved(tmp_path, name, data)
    with pytest.raises(InputError, match=message) as told:
        rrtik.load_octree(file) if name == "a.bt" else rrtik.load_height_field(file, 0.1)
    assert str(file) in str(told.value)
    assert "\n" not in str(told.value)


def test_a_cloud_of_a_map_with_too_many_cells_is_refused(tmp_path):
    with pytest.raises(InputError, match="take it as an octree instead"):
        rrtik.load_cloud(saved(tmp_path, "map.bt", HEAD + BODY), 0.1)


def test_ground_made_in_memory_cannot_be_written(tmp_path):
    scene = rrtik.Scene((rrtik.Obstacle("ground", rrtik.HeightField(HEIGHTS, 0.5)),))
    with pytest.raises(
        InputError, match="'ground': a height field made in memory cannot be written; load it from a file"
    ):
        rrtik.save_scene(scene, tmp_path / "scene.yaml")
