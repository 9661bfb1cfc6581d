"""Lens models: rational lenses and fisheyes agree with OpenCV's own code and with formulas written out here."""

from dataclasses import replace

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.calibration import calibrate_by_corners
from rrtik_ompl.sensing.calibration_fit import fit_camera
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.lenses import LENSES
from rrtik_ompl.sensing.markers.chessboard import Chessboard
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import detect_objects

MATRIX = np.array([[240.0, 0.0, 321.0], [0.0, 242.0, 238.5], [0.0, 0.0, 1.0]])
COEFFICIENTS = {
    "brown": (-0.3, 0.1, 5e-4, -7e-4, -0.01),
    "rational": (0.9, 0.15, -4e-4, 3e-4, 0.01, 1.2, 0.4, 0.03),
    "fisheye": (0.02, -0.01, 0.004, -0.0008),
}
FITTED = {**COEFFICIENTS, "brown": (-0.3, 0.1, 5e-4, -7e-4, 0.0)}  # a calibration leaves k3 at 0
FISHEYE = Camera(MATRIX, 640, 480, COEFFICIENTS["fisheye"], lens="fisheye")
BOARD = Chessboard(10, 7, 0.03)
BLANK = np.full((480, 640), 128, dtype=np.uint8)


def camera_with(lens):
    return Camera(MATRIX, 640, 480, COEFFICIENTS[lens], lens=lens)


def points_before(count=40, wide=1.0):
    return np.random.default_rng(0).uniform([-wide, -wide, 0.6], [wide, wide, 1.5], (count, 3))


def places_by_hand(lens, points, coefficients=COEFFICIENTS):
    """Where the plane z = 1 of a pinhole has points, by the formulas as they are published."""
    k = coefficients[lens]
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r = np.hypot(x, y)
    if lens == "fisheye":
        t = np.arctan(r)
        factor = (t + k[0] * t**3 + k[1] * t**5 + k[2] * t**7 + k[3] * t**9) / r
        return np.column_stack([factor * x, factor * y])
    k1, k2, p1, p2, k3 = k[:5]
    factor = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    if lens == "rational":
        factor /= 1 + k[5] * r**2 + k[6] * r**4 + k[7] * r**6
    return np.column_stack([
        factor * x + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2),
        factor * y + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y,
    ])  # fmt: skip


@pytest.mark.parametrize("lens", LENSES)
def test_pixels_are_those_of_the_published_formulas(lens):
    points = points_before()
    expected = places_by_hand(lens, points) * [240.0, 242.0] + [321.0, 238.5]
    assert camera_with(lens).project(points) == pytest.approx(expected, abs=1e-9)


def test_a_fisheye_has_the_pixels_of_opencv():
    points = np.vstack([points_before(), [[0.0, 0.0, 1.0], [1e-9, 0.0, 2.0]]])
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), MATRIX, np.array(COEFFICIENTS["fisheye"])
    )
    assert FISHEYE.project(points) == pytest.approx(expected[:, 0], abs=1e-9)


def test_a_fisheye_sees_behind_its_right_angle():
    camera = Camera(np.diag([100.0, 100.0, 1.0]), 640, 480, lens="fisheye")
    angles = np.array([0.5, 1.5, 1.7, 3.0])
    points = np.column_stack([np.sin(angles), 0.0 * angles, np.cos(angles)])
    pixels = camera.project(points)
    assert pixels[:, 0] == pytest.approx(100.0 * angles)
    assert camera.directions(pixels) == pytest.approx(points)
    assert np.isnan(camera.rays(pixels)[:, 0]).tolist() == [False, False, True, True]


@pytest.mark.parametrize("lens", LENSES)
def test_rays_of_projected_points_go_through_them(lens):
    points = points_before(wide=0.6 if lens == "brown" else 2.0)
    found = camera_with(lens).rays(camera_with(lens).project(points))
    assert found == pytest.approx(points[:, :2] / points[:, 2:], rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_no_ray_reaches_what_lies_beyond_the_fold(lens):
    folding = {
        "brown": (-0.3, 0.0, 0.0, 0.0, 0.0),
        "rational": (0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0),
        "fisheye": (-0.2, 0.0, 0.0, 0.0),
    }
    camera = Camera(MATRIX, 640, 480, folding[lens], lens=lens)
    across = np.tan(np.linspace(0.01, 1.5, 200))
    seen = camera.project(np.column_stack([across, 0.0 * across, np.ones(200)]))[:, 0]
    last = int(seen.argmax())
    assert 20 < last < 199
    inside, beyond = [seen[last] - 5.0, 238.5], [seen[last] + 1.0, 238.5]
    rays = camera.rays([inside, beyond])
    assert 0.0 < rays[0, 0] < across[last]
    assert np.isnan(rays[1]).all()


@pytest.mark.parametrize("lens", LENSES)
def test_derivatives_agree_with_differences(lens):
    camera, h = camera_with(lens), 1e-6
    T = pin.SE3(pin.exp3(np.array([0.4, -0.3, 0.2])), np.array([0.3, 0.15, 0.9]))
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (6, 3)) @ T.rotation.T
    slopes = camera.jacobian(points, T.translation)
    for k in range(6):
        step = np.zeros(6)
        step[k] = h
        moved = [points @ pin.exp3(s * step[3:]).T + T.translation + s * step[:3] for s in (1.0, -1.0)]
        difference = (camera.project(moved[0]) - camera.project(moved[1])) / (2.0 * h)
        assert slopes[:, k] == pytest.approx(difference.ravel(), rel=1e-5, abs=1e-4)

    at = points + T.translation
    own = camera.own_slopes(at)
    numbers = np.concatenate([MATRIX[[0, 1, 0, 1], [0, 1, 2, 2]], camera.distortion])
    for k in range(len(numbers)):
        moved = []
        for s in (h, -h):
            fx, fy, cx, cy, *coefficients = numbers + s * (np.arange(len(numbers)) == k)
            matrix = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
            moved.append(Camera(matrix, 640, 480, coefficients, lens=lens).project(at))
        difference = (moved[0] - moved[1]) / (2.0 * h)
        assert own[:, k] == pytest.approx(difference.ravel(), rel=1e-5, abs=1e-5)


def views(lens, count, seed, noise=0.15, far=(0.15, 0.35), wide=0.25):
    """Corners of the board before a camera with a lens."""
    rng = np.random.default_rng(seed)
    board = BOARD.points - BOARD.points.mean(axis=0)
    for _ in range(count):
        turned = cv2.Rodrigues(rng.uniform(-0.7, 0.7, 3) * [1.0, 1.0, 0.3])[0]
        at = np.array([*rng.uniform(-wide, wide, 2), rng.uniform(*far)])
        pixels = places_by_hand(lens, board @ turned.T + at, FITTED) * [240.0, 242.0] + [321.0, 238.5]
        yield BOARD.points, pixels + rng.normal(0.0, noise, pixels.shape)


def calibrated(seen, lens):
    seen = list(seen)
    return calibrate_by_corners([BLANK] * len(seen), seen, BOARD, lens)


def test_a_fisheye_is_calibrated_as_opencv_does_it():
    seen = list(views("fisheye", 12, seed=3))
    found = calibrated(seen, "fisheye")
    points, pixels = ([np.ascontiguousarray(each[k])[None] for each in seen] for k in (0, 1))
    home = cv2 if hasattr(cv2, "CALIB_FIX_SKEW") else cv2.fisheye
    flags = home.CALIB_RECOMPUTE_EXTRINSIC | home.CALIB_FIX_SKEW
    error, matrix, coefficients, *_ = cv2.fisheye.calibrate(points, pixels, (640, 480), None, None, flags=flags)
    assert found.error == pytest.approx(error, rel=1e-4)
    assert found.camera.matrix == pytest.approx(matrix, abs=0.02)
    assert found.camera.distortion == pytest.approx(np.ravel(coefficients), abs=5e-4)
    assert found.advice == ""


@pytest.mark.parametrize("lens", LENSES)
def test_pixels_are_as_uncertain_as_a_calibration_says(lens):
    """The error of the calibrated camera at points all over the picture, by its covariance: two numbers a point."""
    usual = {"far": (0.4, 0.7), "wide": 0.2} if lens == "brown" else {}
    squares = []
    for seed in range(8):
        camera = fit_camera(list(views(lens, 10, seed, **usual)), (480, 640), lens).with_doubts(10 * len(BOARD.points))
        rays = camera.rays([[x, y] for x in (120.0, 320.0, 520.0) for y in (100.0, 240.0, 380.0)])
        points = np.column_stack([rays, np.ones(len(rays))])
        off = camera.project(points) - (places_by_hand(lens, points, FITTED) * [240.0, 242.0] + [321.0, 238.5])
        # A turn of the camera moves all pixels, and no photograph of a board says it.
        turns = camera.jacobian(points, np.zeros(3))[:, 3:]
        doubt = camera.doubt(points)
        off = off.ravel() - turns @ np.linalg.lstsq(turns, off.ravel(), rcond=None)[0]
        rest = np.eye(len(off)) - turns @ np.linalg.pinv(turns)
        values, ways = np.linalg.eigh(rest @ doubt @ rest)
        certain = values > 1e-6 * values[-1]
        squares.append(np.mean((ways.T @ off)[certain] ** 2 / values[certain]))
    assert 0.4 < np.mean(squares) < 2.0


@pytest.mark.parametrize(("true", "believed"), [("fisheye", "brown"), ("rational", "brown")])
def test_a_wrong_lens_model_is_refused_and_the_better_one_named(true, believed):
    with pytest.raises(InputError, match=r"--model (fisheye|rational|brown)") as refused:
        calibrated(views(true, 12, seed=2), believed)
    assert f"--model {believed}" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_picture_that_is_covered_in_part_is_told():
    advice = calibrated(views("fisheye", 12, seed=1, far=(0.25, 0.35), wide=0.03), "fisheye").advice
    assert "parts of the picture" in advice


@pytest.mark.parametrize("lens", LENSES)
def test_a_calibration_is_read_as_it_was_written(lens, tmp_path):
    usual = {"far": (0.4, 0.7), "wide": 0.2} if lens == "brown" else {}
    found = calibrated(views(lens, 12, seed=4, **usual), lens)
    found.save(tmp_path / "c.yaml")
    read = Camera.load(tmp_path / "c.yaml")
    for name in ("matrix", "distortion", "sigmas", "correlation"):
        assert np.array_equal(getattr(read, name), getattr(found.camera, name)), name
    assert read.lens == lens
    assert np.abs(read.correlation - np.eye(len(read.sigmas))).max() > 0.1


OPENCV_FISHEYE = """%YAML:1.0
---
image_width: 640
image_height: 480
fisheye_model: 1
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [240., 0., 321., 0., 242., 238.5, 0., 0., 1.]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [0.02, -0.01, 0.004, -0.0008]
"""
ROS_FISHEYE = """image_width: 640
image_height: 480
camera_name: wide
camera_matrix: {rows: 3, cols: 3, data: [240.0, 0.0, 321.0, 0.0, 242.0, 238.5, 0.0, 0.0, 1.0]}
distortion_model: equidistant
distortion_coefficients: {rows: 1, cols: 4, data: [0.02, -0.01, 0.004, -0.0008]}
"""
KALIBR_FISHEYE = """cam0:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [0.02, -0.01, 0.004, -0.0008]
  intrinsics: [240.0, 242.0, 321.0, 238.5]
  resolution: [640, 480]
"""


@pytest.mark.parametrize("text", [OPENCV_FISHEYE, ROS_FISHEYE, KALIBR_FISHEYE], ids=["OpenCV", "ROS", "kalibr"])
def test_fisheyes_of_other_tools_are_read(text, tmp_path):
    (tmp_path / "c.yaml").write_text(text)
    read = Camera.load(tmp_path / "c.yaml")
    assert (read.lens, read.width, read.height) == ("fisheye", 640, 480)
    assert np.array_equal(read.matrix, MATRIX)
    assert np.array_equal(read.distortion, COEFFICIENTS["fisheye"])


def test_a_rational_lens_of_ros_is_read(tmp_path):
    numbers = ", ".join(map(str, COEFFICIENTS["rational"]))
    text = ROS_FISHEYE.replace("equidistant", "rational_polynomial").replace("cols: 4", "cols: 8")
    (tmp_path / "c.yaml").write_text(text.replace("0.02, -0.01, 0.004, -0.0008", numbers))
    read = Camera.load(tmp_path / "c.yaml")
    assert read.lens == "rational"
    assert np.array_equal(read.distortion, COEFFICIENTS["rational"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"lens": "sphere"}, "no lens model 'sphere'"),
        ({"lens": "fisheye", "distortion": np.zeros(5)}, r"shape \(4,\)"),
        ({"correlation": 2.0 * np.eye(9)}, "1 on its diagonal"),
        ({"correlation": np.eye(8)}, r"shape \(9, 9\)"),
    ],
)
def test_what_is_no_lens_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        replace(Camera(MATRIX, 640, 480), **change)


def seen_by_fisheye(T, cells, side, rng, rays=4):
    """A picture of a marker through an equidistant lens of 240 pixels, by one exact ray for each sample."""
    within = (np.arange(rays) + 0.5) / rays - 0.5
    u, v = np.meshgrid((np.arange(640)[:, None] + within).ravel(), (np.arange(480)[:, None] + within).ravel())
    x, y = (u - 319.5) / 240.0, (v - 239.5) / 240.0
    angle = np.hypot(x, y)
    shrunk = np.sin(angle) / angle
    ray = T.rotation.T @ np.stack([x * shrunk, y * shrunk, np.cos(angle)]).reshape(3, -1)
    eye = -T.rotation.T @ T.translation
    along = -eye[2] / ray[2]

    framed = np.pad(cells, 1, constant_values=255)
    cell = side / len(cells)
    column = np.floor((eye[0] + along * ray[0]) / cell + 0.5 * len(framed)).astype(int)
    row = np.floor(0.5 * len(framed) - (eye[1] + along * ray[1]) / cell).astype(int)
    hit = (along > 0) & (column >= 0) & (column < len(framed)) & (row >= 0) & (row < len(framed))
    light = np.full(len(along), 0.35)
    light[hit] = np.where(framed[row[hit], column[hit]] > 0, 0.8, 0.05)
    seen = cv2.GaussianBlur(light.reshape(480, rays, 640, rays).mean(axis=(1, 3)), (0, 0), 0.6)
    return np.clip(255.0 * (seen + rng.normal(0.0, 0.008, seen.shape)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("aside", [0.0, 45.0, 60.0])
def test_a_marker_aside_of_a_fisheye_is_placed_to_three_millimetres(aside):
    side, dictionary = 0.08, "apriltag_36h11"
    camera = Camera([[240.0, 0.0, 319.5], [0.0, 240.0, 239.5], [0.0, 0.0, 1.0]], 640, 480, lens="fisheye")
    marker_map = MarkerMap(dictionary, [MarkedObject("tag", "base", (MountedMarker(3, side),))])
    for seed in range(3):
        rng = np.random.default_rng(seed)
        angle = np.deg2rad(aside)
        way = np.array([np.sin(angle), 0.3 * np.sin(angle) * rng.uniform(-1.0, 1.0), np.cos(angle)])
        facing = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), -way).matrix()
        T = pin.SE3(pin.exp3(rng.uniform(-0.4, 0.4, 3)) @ facing, rng.uniform(0.28, 0.4) * way)
        picture = seen_by_fisheye(T, marker_cells(dictionary, 3), side, rng)
        (found,) = detect_objects(picture, camera, marker_map)
        assert found.refused == ""
        assert np.linalg.norm(found.pose.T_camera_object.translation - T.translation) < 3e-3
