"""Clouds in files: each format as others write it, and what is wrong with a file in one line."""

import io

import numpy as np
import pytest

from rrtik_ompl.base.errors import CloudWarning, InputError
from rrtik_ompl.files.point_files import unpacked
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import PointCloud, same_shape
from rrtik_ompl.problem_files.scene import load_scene

POINTS = np.array([[0.5, -1.25, 2.0], [0.0, 0.0, 0.0], [1e-3, 7.0, -3.0]])
PLY = "ply\nformat {} 1.0\ncomment made by hand\nelement vertex 3\n{}end_header\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
PCD = "# .PCD v0.7\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH 3\nHEIGHT 1\n"
PCD += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA {}\n"
PLAIN_PCD = PCD.format("x y z", "4 4 4", "F F F", "1 1 1", "{}")


def text(points=POINTS):
    return "".join(f"{x} {y} {z}\n" for x, y, z in points)


def literal_lzf(data):
    """Compressed bytes that copy nothing."""
    parts = [data[k : k + 32] for k in range(0, len(data), 32)]
    return b"".join(bytes([len(part) - 1]) + part for part in parts)


def compressed(packed, size):
    return len(packed).to_bytes(4, "little") + size.to_bytes(4, "little") + packed


def npy(points, order="C"):
    stream = io.BytesIO()
    np.save(stream, np.asarray(points, order=order))
    return stream.getvalue()


def colored(order):
    kind = np.dtype([("x", f"{order}f8"), ("r", "u1"), ("y", f"{order}f8"), ("z", f"{order}f8"), ("n", f"{order}i2")])
    rows = np.zeros(3, dtype=kind)
    for axis, column in zip("xyz", POINTS.T, strict=True):
        rows[axis] = column
    rows["r"], rows["n"] = 200, -5
    return rows.tobytes()


COLORED = "property double x\nproperty uchar red\nproperty double y\nproperty double z\nproperty short n\n"
SINGLE = POINTS.astype("<f4")
FILES = {
    "a.npy": npy(POINTS),
    "columns.npy": npy(POINTS, "F"),
    "single.npy": npy(SINGLE),
    "a.xyz": text().encode(),
    "comma.xyz": ("# x, y, z, intensity\n" + text().replace(" ", ", ").replace("\n", ", 7\n")).encode(),
    "a.ply": (PLY.format("ascii", XYZ) + text()).encode(),
    "faces.ply": (
        PLY.format("ascii", XYZ + "element face 1\nproperty list uchar int vertex_indices\n") + text() + "3 0 1 2\n"
    ).encode(),
    "little.ply": PLY.format("binary_little_endian", XYZ).encode() + SINGLE.tobytes(),
    "big.ply": PLY.format("binary_big_endian", COLORED).encode() + colored(">"),
    "colored.ply": PLY.format("binary_little_endian", COLORED).encode() + colored("<"),
    "windows.ply": PLY.format("ascii", XYZ).replace("\n", "\r\n").encode() + text().replace("\n", "\r\n").encode(),
    "a.pcd": (PLAIN_PCD.format("ascii") + text()).encode(),
    "binary.pcd": PLAIN_PCD.format("binary").encode() + SINGLE.tobytes(),
    "normals.pcd": PCD.format("x n y z", "8 4 8 8", "F F F F", "1 2 1 1", "binary").encode()
    + np.array(
        [(x, (9, 9), y, z) for x, y, z in POINTS], [("x", "<f8"), ("n", "<f4", 2), ("y", "<f8"), ("z", "<f8")]
    ).tobytes(),
    "packed.pcd": PLAIN_PCD.format("binary_compressed").encode() + compressed(literal_lzf(SINGLE.T.tobytes()), 36),
}


@pytest.mark.parametrize("name", FILES)
def test_every_format_is_read(name, tmp_path):
    (tmp_path / name).write_bytes(FILES[name])
    cloud = PointCloud.load(tmp_path / name, radius=0.02)
    assert np.array_equal(cloud.points, POINTS.astype(np.float32))
    assert cloud.radius == 0.02


def test_compressed_bytes_that_repeat_others_are_read():
    long = bytes([3]) + b"abcd" + bytes([7 << 5, 19, 3]) + bytes([0]) + b"e"  # 7 + 19 + 2 bytes, four back each time
    assert unpacked(long, 33, "f") == b"abcd" * 8 + b"e"
    pattern = bytes([1]) + b"ab" + bytes([(4 << 5), 1]) + bytes([0]) + b"c"  # six more, two back each time
    assert unpacked(pattern, 9, "f") == b"abababab" + b"c"


def npz(**arrays):
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


BAD = {
    "empty.npy": (b"", "not a .npy file"),
    "shape.npy": (npy(np.zeros((3, 2))), r"expected numbers of shape \(any, 3\)"),
    "objects.npy": (npy(np.array([[None] * 3])), "expected numbers"),
    "short.npy": (npy(POINTS)[:-8], "claims 3 points, but the file has room for 2"),
    "huge.npy": (npy(POINTS).replace(b"(3, 3), ", b"(1000000000, 3), ")[:128] + bytes(72), "points|not a .npy file"),
    "huge.ply": (PLY.format("binary_little_endian", XYZ).replace("vertex 3", "vertex 1000000000").encode(), "claims"),
    "more.ply": ((PLY.format("ascii", XYZ).replace("vertex 3", "vertex 1000000000") + text()).encode(), "has 3"),
    "minus.ply": ((PLY.format("ascii", XYZ).replace("vertex 3", "vertex -3") + text()).encode(), "number of points"),
    "headless.ply": (b"solid\n", "not a PLY file"),
    "format.ply": (PLY.format("binary_middle_endian", XYZ).encode(), "unknown"),
    "flat.ply": ((PLY.format("ascii", XYZ[:34]) + text()).encode(), "needs one property 'z'"),
    "list.ply": ((PLY.format("ascii", "property list uchar int x\n" + XYZ) + text()).encode(), "a list"),
    "words.ply": ((PLY.format("ascii", XYZ) + "a b c\n").encode(), "not rows of numbers"),
    "faces.ply": (
        (PLY.format("ascii", XYZ).replace("vertex", "face") + text()).encode(),
        "a mesh, not a point cloud",
    ),
    "huge.pcd": (PLAIN_PCD.format("binary").replace("POINTS 3", "POINTS 1000000000").encode() + bytes(36), "claims"),
    "headless.pcd": (b"x y z\n", "no line DATA"),
    "way.pcd": (PLAIN_PCD.format("base64").encode(), "unknown"),
    "fields.pcd": (PLAIN_PCD.replace("x y z", "x y w").format("ascii").encode(), "needs one 'z'"),
    "types.pcd": (PLAIN_PCD.replace("F F F", "F F Q").format("ascii").encode(), "unknown"),
    "counts.pcd": (PLAIN_PCD.replace("1 1 1", "1 1").format("ascii").encode(), "as many entries"),
    "packed.pcd": (PLAIN_PCD.format("binary_compressed").encode() + compressed(b"\x05abc", 36), "damaged"),
    "size.pcd": (PLAIN_PCD.format("binary_compressed").encode() + compressed(b"\x05abc", 40), "compressed"),
    "empty.xyz": (b"", "no point"),
    "nan.xyz": (b"nan 0 0\nnan 0 0\n", "it has no finite point"),
    "two.npz": (npz(a=POINTS, b=POINTS), "which array has the points"),
    "broken.npz": (b"PK", "not an .npz file"),
    "short.xyz": (b"0 0\n", "not rows of numbers"),
    "one_line.xyz": (b"0 0 1 " * 2_000_000, "a line is longer than 4 MiB"),
    "cloud.las": (b"LASF", "unknown kind of cloud"),
}


@pytest.mark.filterwarnings("ignore:loadtxt")
@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(name, tmp_path):
    data, message = BAD[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=message) as caught:
        PointCloud.load(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_millimetres_can_be_scaled_and_bad_points_dropped(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0\n1000 2000 300000\nnan 0 0\n")
    with pytest.warns(CloudWarning, match="m wide"):
        PointCloud.load(tmp_path / "a.xyz", invalid="drop")
    cloud = PointCloud.load(tmp_path / "a.xyz", scale=1e-3, invalid="drop")
    assert (len(cloud.points), cloud.dropped) == (2, 1)
    assert np.allclose(cloud.points[1], [1.0, 2.0, 300.0])


@pytest.mark.parametrize("name", ["scan.npy", "scan.ply"])
def test_a_scene_with_a_cloud_comes_back_from_its_file(name, tmp_path):
    cloud = PointCloud(POINTS, 0.03)
    kept = cloud.save(tmp_path / name)
    scene = Scene([Obstacle("scan", kept, margin=0.01)])
    scene.save(tmp_path / "scene.yaml")
    again = load_scene(tmp_path / "scene.yaml").obstacles[0]
    assert same_shape(again.shape, kept)
    assert np.array_equal(again.shape.points, cloud.points)
    assert again.margin == 0.01


def test_a_cloud_without_a_file_is_not_written(tmp_path):
    with pytest.raises(InputError, match=r"PointCloud\.save"):
        Scene([Obstacle("scan", PointCloud(POINTS, 0.03))]).save(tmp_path / "scene.yaml")
    with pytest.raises(InputError, match="written as"):
        PointCloud(POINTS, 0.03).save(tmp_path / "scan.pcd")


def test_what_a_scene_says_of_a_cloud(tmp_path):
    (tmp_path / "scan.xyz").write_text("0 0 1000\nnan 0 0\n")
    entry = "version: 1\nscene:\n  obstacles:\n    - name: scan\n      cloud: {{file: scan.xyz, {}}}\n"
    (tmp_path / "scene.yaml").write_text(entry.format("radius: 0.02, scale: 0.001, invalid: drop"))
    cloud = load_scene(tmp_path / "scene.yaml").obstacles[0].shape
    assert np.allclose(cloud.points, [[0.0, 0.0, 1.0]])
    assert cloud.radius == 0.02
    Scene([Obstacle("scan", cloud)]).save(tmp_path / "again.yaml")
    assert same_shape(load_scene(tmp_path / "again.yaml").obstacles[0].shape, cloud)
    (tmp_path / "scene.yaml").write_text(entry.format("radius: -1"))
    with pytest.raises(InputError, match=r"scene.yaml:5"):
        load_scene(tmp_path / "scene.yaml")


def test_points_of_a_camera_that_are_no_numbers_are_left_out_and_counted(tmp_path):
    rows = np.zeros((4, 5, 3), dtype=np.float32)
    rows[..., 2] = np.arange(20).reshape(4, 5)
    rows[1:3, 2] = np.nan
    (tmp_path / "a.npy").write_bytes(npy(rows))
    (tmp_path / "a.npz").write_bytes(npz(depth=np.zeros(3), points=rows))
    (tmp_path / "one.npz").write_bytes(npz(cloud=rows))
    for name in ("a.npy", "a.npz", "one.npz"):
        with pytest.warns(CloudWarning, match=rf"{name}.*: 2 of 20 points are not finite and left out"):
            cloud = PointCloud.load(tmp_path / name)
        assert len(cloud.points) == 18
        assert cloud.dropped == 2
    assert PointCloud.load(tmp_path / "a.npy", invalid="drop").dropped == 2
    with pytest.raises(InputError, match="2 of 20"):
        PointCloud.load(tmp_path / "a.npy", invalid="refuse")


def test_columns_and_elements_beside_the_points_are_passed_over(tmp_path):
    (tmp_path / "a.npy").write_bytes(npy(np.column_stack([POINTS, np.ones(3)])))
    with pytest.warns(CloudWarning, match="first three of its 4 columns"):
        assert (PointCloud.load(tmp_path / "a.npy").points == POINTS.astype(np.float32)).all()
    faces = "element face 2\nproperty list uchar int vertex_indices\n"
    head = PLY.format("ascii", XYZ).replace("element vertex", faces + "element vertex")
    (tmp_path / "a.ply").write_text(head + "3 0 1 2\n3 0 1 2\n" + text())
    assert (PointCloud.load(tmp_path / "a.ply").points == POINTS.astype(np.float32)).all()
