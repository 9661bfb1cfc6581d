"""Height fields and octrees in files: as others write them, in scenes, and what is wrong with a file in one line."""

import contextlib
import io
import struct
import warnings

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import CloudWarning, InputError
from rrtik_ompl.description.shapes import octree as octree_files
from rrtik_ompl.files import notice
from rrtik_ompl.model.shapes import octree, same_shape
from rrtik_tests.grey_pictures import grey_png

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
    field = rrtik.HeightField.load(file, 0.5, scale=0.001 if name.endswith("png") else 1.0)
    np.testing.assert_allclose(field.heights, HEIGHTS, atol=1e-12)
    assert field.source == str(file)


def test_a_map_has_its_occupied_cells_where_the_tree_puts_them(tmp_path):
    tree = rrtik.Octree.load(saved(tmp_path, "map.bt", HEAD + BODY))
    half = 0.1 * 2**15  # the root reaches so far along each axis
    found = dict(zip(tree.sides.tolist(), tree.centres.tolist(), strict=True))
    assert found == {half: pytest.approx([0.5 * half] * 3), 0.5 * half: pytest.approx([-0.25 * half] * 3)}


def full_map(cells, *, colours=False):
    """A full map of OctoMap (.ot) of the given cells: their places among the finest, and their log-odds."""

    def node(members, level):
        if level == 16:
            ((_, value),) = members
            return struct.pack("<f", value) + bytes(3 * colours) + bytes(1)
        parts = [[], [], [], [], [], [], [], []]
        for place, value in members:
            parts[sum((place[axis] >> (15 - level) & 1) << axis for axis in range(3))].append((place, value))
        mask = sum(1 << k for k, part in enumerate(parts) if part)
        head = struct.pack("<f", 0.5) + bytes(3 * colours) + bytes([mask])
        return head + b"".join(node(part, level + 1) for part in parts if part)

    kind = b"ColorOcTree" if colours else b"OcTree"
    head = b"# Octomap OcTree file\nid %s\nsize 9\nres 0.1\ndata\n" % kind
    return head + node(cells, 0)


@pytest.mark.parametrize("colours", [False, True])
def test_a_full_map_has_the_cells_that_are_probably_occupied(colours, tmp_path):
    low = 2**15
    cells = [((low + x, low + y, low - 3), value) for x, y, value in ((0, 0, 0.8), (1, 0, -0.4), (5, 40, 0.0))]
    tree = rrtik.Octree.load(saved(tmp_path, "map.ot", full_map(cells, colours=colours)))
    assert np.sort(tree.centres, axis=0) == pytest.approx(np.array([[0.05, 0.05, -0.25], [0.55, 4.05, -0.25]]))
    assert tree.sides == pytest.approx([0.1, 0.1])
    assert len(rrtik.PointCloud.load(tmp_path / "map.ot").points) == 2


def test_a_cloud_of_a_map_has_a_point_for_each_finest_cell(tmp_path):
    path = b""  # down the last children to a cell two levels above the finest, then one finest cell
    for _ in range(13):
        path += bytes([0, 0b11000000])
    path += bytes([2, 0b11000000]) + bytes([0, 0b11000000]) + bytes([0b10, 0])
    file = saved(tmp_path, "map.bt", HEAD + path)
    cloud, tree = rrtik.PointCloud.load(file, 0.09), rrtik.Octree.load(file)
    assert len(cloud.points) == 4**3 + 1
    assert np.sort(tree.sides) == pytest.approx([0.1, 0.4])
    away = np.abs(cloud.points[:, None] - tree.centres).max(axis=2) + 0.05 - 0.5 * tree.sides
    assert (away.min(axis=1) < 1e-3).all()  # [m] in single precision, 3 km from the origin


def test_a_scene_with_ground_and_a_map_comes_back(tmp_path):
    field = rrtik.HeightField.load(saved(tmp_path, "ground.npy", npy(HEIGHTS)), 0.5, -1.0, scale=0.5)
    tree = rrtik.Octree.load(saved(tmp_path, "map.bt", HEAD + BODY), scale=0.5)
    scene = rrtik.Scene((rrtik.Obstacle("ground", field), rrtik.Obstacle("map", tree, rrtik.pose([1.0, 0.0, 0.0]))))
    scene.save(tmp_path / "scene.yaml")
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
        ("a.bt", HEAD + BODY[:3], "the tree ends too early"),
        ("a.bt", HEAD + bytes([0, 0b11000000]) * 16 + bytes(2), "the tree is too deep"),
        ("a.bt", HEAD.replace(b"res 0.1", b"res"), "needs a line 'res'"),
        ("a.bt", HEAD.replace(b"res 0.1", b"res -1"), "res: must be greater than 0"),
        ("a.bt", HEAD.replace(b"OcTree\nsize", b"CountTree\nsize"), "a tree of type 'CountTree' is unknown"),
        ("a.bt", HEAD + BODY + BODY[:2], "it ends after 2 of 3 nodes"),
        ("a.bt", HEAD + BODY + b"x", "within a node of 2 bytes"),
        ("a.bt", HEAD, "none of its cells is occupied"),
    ],
)
def test_broken_files_are_one_line_with_the_file(name, data, message, tmp_path):
    if name == "a.png":
        pytest.importorskip("cv2")
    file = saved(tmp_path, name, data)
    with pytest.raises(InputError, match=message) as told:
        rrtik.Octree.load(file) if name == "a.bt" else rrtik.HeightField.load(file, 0.1)
    assert str(file) in str(told.value)
    assert "\n" not in str(told.value)


def test_a_cloud_of_a_map_with_too_many_cells_is_refused(tmp_path):
    with pytest.raises(InputError, match="take it as an octree instead"):
        rrtik.PointCloud.load(saved(tmp_path, "map.bt", HEAD + BODY), 0.1)


def test_ground_made_in_memory_cannot_be_written(tmp_path):
    scene = rrtik.Scene((rrtik.Obstacle("ground", rrtik.HeightField(HEIGHTS, 0.5)),))
    with pytest.raises(InputError, match=r"ground.*load.*file"):
        scene.save(tmp_path / "scene.yaml")


def tiff(rows, *tags, bits=32, photometric=1, order="<"):
    """A TIFF of floats (or of 8 bits), with text tags (number, text) beside what it needs."""
    body = rows.astype(f"{order}f4" if bits == 32 else "u1").tobytes()
    texts = [(number, text.encode() + b"\0") for number, text in tags]
    entries = {256: (3, rows.shape[1]), 257: (3, rows.shape[0]), 258: (3, bits), 259: (3, 1), 262: (3, photometric)}
    entries |= {
        273: (4, 8),
        277: (3, 1),
        278: (3, rows.shape[0]),
        279: (4, len(body)),
        339: (3, 3 if bits == 32 else 1),
    }
    count = len(entries) + len(texts)
    start = 8 + len(body)
    free, rest = start + 2 + 12 * count + 4, b""
    table = []
    for number, (kind, value) in entries.items():
        value = struct.pack(f"{order}HH", value, 0) if kind == 3 else struct.pack(f"{order}I", value)
        table.append((number, struct.pack(f"{order}HHI", number, kind, 1) + value))
    for number, text in texts:
        place = struct.pack(f"{order}I", free + len(rest)) if len(text) > 4 else text.ljust(4, b"\0")
        table.append((number, struct.pack(f"{order}HHI", number, 2, len(text)) + place))
        rest += text if len(text) > 4 else b""
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", start)
    listed = b"".join(entry for _, entry in sorted(table))
    return head + body + struct.pack(f"{order}H", count) + listed + struct.pack(f"{order}I", 0) + rest


def assert_comes_back(field, folder):
    """From a scene that was written and read again."""
    rrtik.Scene([rrtik.Obstacle("ground", field)]).save(folder / "scene.yaml")
    again = rrtik.load_scene(folder / "scene.yaml").obstacle("ground").shape
    np.testing.assert_array_equal(again.heights, field.heights)
    assert (again.cell, again.floor, again.nodata) == (field.cell, field.floor, field.nodata)


def holed(value, shape=(5, 5)):
    """A flat grid of zeros, of which the height in row 1, column 3 is another."""
    rows = np.zeros(shape)
    rows[1, 3] = value
    return rows


def written(rows):
    return "\n".join(",".join(map(repr, row)) for row in rows.tolist()).encode()


@pytest.mark.parametrize("value", [-9999.0, -99999.0, -32768.0, np.nan, -np.inf])
@pytest.mark.parametrize("kind", ["npy", "csv", "tif"])
def test_cells_without_data_are_refused_with_their_place_and_left_out_on_a_word(kind, value, tmp_path):
    if kind == "tif":
        pytest.importorskip("cv2")
    data = {"npy": npy, "csv": written, "tif": tiff}[kind](holed(value))
    file = saved(tmp_path, f"a.{kind}", data)
    with pytest.raises(InputError, match=r"1 of 25.*row 1, column 3.*invalid='drop'") as told:
        rrtik.HeightField.load(file, 0.5)
    assert str(file) in str(told.value)
    stated = {"nodata": value} if np.isfinite(value) else {}
    if stated:
        with pytest.raises(InputError, match=rf"{value:g}.*no data.*nodata="):
            rrtik.HeightField.load(file, 0.5, invalid="drop")
    field = rrtik.HeightField.load(file, 0.5, -1.0, invalid="drop", **stated)
    assert np.isnan(field.heights).sum() == 1
    assert np.isnan(field.heights[3 if kind == "tif" else 1, 3])  # a picture lies as seen from above
    assert_comes_back(field, tmp_path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_number_that_a_tiff_names_stands_for_no_data(order, tmp_path):
    pytest.importorskip("cv2")
    file = saved(tmp_path, "a.tif", tiff(holed(7.5), (42113, "7.5"), order=order))
    with pytest.raises(InputError, match=r"7\.5.*row 1, column 3"):
        rrtik.HeightField.load(file, 0.5)
    field = rrtik.HeightField.load(file, 0.5, invalid="drop")
    assert np.isnan(field.heights).sum() == 1
    assert_comes_back(field, tmp_path)
    other = rrtik.HeightField.load(file, 0.5, nodata=-1.0)  # whoever states another one means it
    assert other.heights.max() == 7.5


def test_heights_among_the_others_are_heights_whatever_their_number(tmp_path):
    file = saved(tmp_path, "a.npy", npy(np.array([[-12000.0, -9999.0], [-5000.0, 0.0]])))
    assert rrtik.HeightField.load(file, 1000.0, scale=0.001).heights.min() == -12.0


@pytest.mark.parametrize("value", [-500.0, 800.0])
def test_a_height_far_beyond_the_rest_is_warned_of_with_its_place(value, tmp_path):
    file = saved(tmp_path, "a.npy", npy(holed(value)))
    with pytest.warns(CloudWarning, match=rf"1 height.*: {value:g} m in row 1, column 3"):
        rrtik.HeightField.load(file, 0.5)
    rng = np.random.default_rng(1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rrtik.HeightField(holed(3.0), 0.5)
        rrtik.HeightField(rng.normal(size=(20, 20)), 0.5)
        rrtik.HeightField(np.cumsum(rng.exponential(1.0, (6, 6)), axis=1), 0.5)


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_grey_pictures_of_few_bits_have_the_heights_of_their_numbers(bits, tmp_path):
    pytest.importorskip("cv2")
    rows = np.arange(16).reshape(4, 4) % 2**bits
    field = rrtik.HeightField.load(saved(tmp_path, "a.png", grey_png(rows.tolist(), bits)), 0.5)
    np.testing.assert_array_equal(field.heights, rows[::-1])


def test_grey_maps_in_text_have_the_heights_of_their_numbers(tmp_path):
    pytest.importorskip("cv2")
    rows = np.arange(16).reshape(4, 4)
    text = "P2 # a comment\n4 4\n15\n" + " ".join(map(str, rows.ravel())) + "\n"
    np.testing.assert_array_equal(
        rrtik.HeightField.load(saved(tmp_path, "a.pgm", text.encode()), 0.5).heights, rows[::-1]
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P1\n2 1\n0 1\n", "a bitmap of black and white holds no heights"),
        (tiff(np.zeros((8, 8)), bits=1), "1 bits a height are stretched"),
        (tiff(np.ones((2, 2)), bits=8, photometric=0), "white is 0"),
        (tiff(np.ones((2, 2)), (42112, '<Item name="SCALE" sample="0" role="scale">0.1</Item>')), "a scale of 0.1"),
    ],
)
def test_pictures_whose_numbers_are_no_heights_are_refused(data, message, tmp_path):
    file = saved(tmp_path, "a.pgm" if data.startswith(b"P") else "a.tif", data)
    with pytest.raises(InputError, match=message) as told:
        rrtik.HeightField.load(file, 0.5)
    assert str(file) in str(told.value)


def test_a_damaged_tiff_is_read_or_refused_wherever_it_is_cut(tmp_path):
    pytest.importorskip("cv2")
    whole = tiff(holed(1.0), (42113, "-9999"))
    for size in range(0, len(whole), 7):
        with contextlib.suppress(InputError):
            rrtik.HeightField.load(saved(tmp_path, "a.tif", whole[:size]), 0.5)


def test_the_balls_of_a_map_cover_its_cells_unless_a_radius_is_given(tmp_path):
    path = b"".join(bytes([0, 0b11000000]) for _ in range(14)) + bytes([0b10, 0b10000000]) + bytes([0b10, 0])
    file = saved(tmp_path, "map.bt", HEAD + path[:-2])
    cloud, tree = rrtik.PointCloud.load(file), rrtik.Octree.load(file)
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
    for centre, side in zip(tree.centres, tree.sides, strict=True):
        for corner in centre + side * corners:
            assert np.linalg.norm(cloud.points.astype(np.float64) - corner, axis=1).min() <= cloud.radius
    assert cloud.radius == pytest.approx(0.05 * np.sqrt(3.0), rel=0.01)
    half = rrtik.PointCloud.load(file, scale=0.5)
    assert half.radius == pytest.approx(0.5 * cloud.radius)
    assert rrtik.PointCloud.load(file, 0.02).radius == 0.02
    scene = {"obstacles": [{"name": "map", "cloud": {"file": "map.bt"}}]}
    (tmp_path / "scene.yaml").write_text(str({"version": 1, "scene": scene}).replace("'", ""))
    assert rrtik.load_scene(tmp_path / "scene.yaml").obstacle("map").shape.radius == cloud.radius


def test_who_reads_a_large_map_is_told_beforehand_what_it_takes_and_one_too_large_is_refused(tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(notice, "listener", told.append)
    monkeypatch.setattr(notice, "_told", set())
    monkeypatch.setattr(octree, "MANY_CELLS", 8)
    inner = b"\xff\xff" + 8 * b"\xaa\xaa"  # eight nodes, of which all eight children are occupied
    file = tmp_path / "map.bt"
    file.write_bytes(HEAD + inner)
    assert len(rrtik.Octree.load(file).sides) == 64
    assert told == ["an octree of 0.0 million cells: about 0 s and 0.0 GB; a coarser one takes less"]

    monkeypatch.setattr(octree_files, "MOST_CELLS", 20)
    with pytest.raises(InputError, match=r"map.bt: cells.*64.*coarser resolution"):
        rrtik.Octree.load(file)
    file.write_bytes(HEAD + 3 * inner)
    with pytest.raises(InputError, match=r"map.bt: nodes.*27.*coarser resolution"):
        rrtik.Octree.load(file)
