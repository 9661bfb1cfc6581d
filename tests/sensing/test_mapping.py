"""Maps of markers from photographs: planted places, an independent least-squares fit, coverage, and bad input."""

import cv2
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing import map_markers
from rrtik_ompl.sensing.adjustment import Sight, Unknowns, adjusted
from rrtik_ompl.sensing.calibration_fit import stepped
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers.corner_pose import square_corners
from rrtik_ompl.sensing.markers.detection import find_markers
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import as_gray, sighting
from rrtik_tests.command_line import rrtik
from rrtik_tests.flat_pictures import warped_picture

SIDE = 0.08
CAMERA = Camera([[700.0, 0.0, 320.0], [0.0, 700.0, 240.0], [0.0, 0.0, 1.0]], 640, 480)
PLACES = {
    0: pin.SE3.Identity(),
    1: pin.SE3(pin.exp3(np.array([0.1, -0.3, 0.05])), np.array([0.15, 0.0, 0.02])),
    2: pin.SE3(pin.exp3(np.array([-0.2, 0.25, 0.4])), np.array([-0.14, 0.02, -0.02])),
    3: pin.SE3(pin.exp3(np.array([0.3, 0.0, -0.2])), np.array([0.01, 0.14, 0.01])),
}


def looking_at(middle, place):
    """T_reference_camera of a camera at a place that looks at another one."""
    z = (np.asarray(middle) - place) / np.linalg.norm(np.asarray(middle) - place)
    x = np.cross(z, [0.1, 1.0, 0.2])
    x /= np.linalg.norm(x)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), np.asarray(place, dtype=float))


VIEWS = [
    looking_at([0.0, 0.03, 0.0], np.array([0.7 * np.cos(a) * s, 0.7 * np.sin(a) * s, 0.75]))
    for a, s in zip(np.arange(7) * 2.0 * np.pi / 7.0, (0.8, 0.5, 0.9, 0.3, 0.7, 0.6, 0.9), strict=True)
]


def taken(views=VIEWS, places=PLACES, sides=None, seed=0):
    rng = np.random.default_rng(seed)
    sides = sides or {}
    return [
        Picture(
            warped_picture(
                CAMERA, [("4x4_50", k, sides.get(k, SIDE), C.inverse() * T) for k, T in places.items()], rng
            ),
            f"view_{n}.png",
            float(n),
        )
        for n, C in enumerate(views)
    ]


@pytest.fixture(scope="module")
def pictures():
    return taken()


def normalised(truth, found, covariance):
    """The squared error of a pose, normalised by its covariance, and the distance [m]."""
    error = np.r_[truth.translation - found.translation, pin.log3(truth.rotation @ found.rotation.T)]
    return error @ np.linalg.solve(covariance, error), np.linalg.norm(error[:3])


def test_a_map_is_that_of_the_pictures(pictures):
    found = map_markers(pictures, CAMERA, "4x4_50", side=SIDE)
    assert [marker.number for marker in found.markers] == [0, 1, 2, 3]
    assert (found.reference, found.unused) == (0, ())
    assert found.error < 0.1
    for marker in found.markers[1:]:
        square, distance = normalised(PLACES[marker.number], marker.T_object_marker, marker.covariance)
        assert square < chi2.ppf(0.9999, 6)
        assert distance < 1e-4
        # The scale is as uncertain as the sides, which were measured independently of each other.
        assert 1e-4 < marker.side_sigma < 3e-4
    for picture, truth in zip(found.pictures, VIEWS, strict=True):
        square, distance = normalised(truth, picture.T_reference_camera, picture.covariance)
        assert square < chi2.ppf(0.9999, 6)
        assert distance < 5e-4

    length, sigma = found.distance(1, 2)
    truth = np.linalg.norm(PLACES[1].translation - PLACES[2].translation)
    assert length == pytest.approx(truth, abs=1e-4)
    assert 1e-5 < sigma < 1e-3


def planted(rng, noise, sigmas=None, side_sigma=0.0):
    """Sights of markers with planted errors, the truth, and where a fit may start."""
    sigmas = np.zeros(9) if sigmas is None else np.asarray(sigmas)
    off = sigmas * rng.standard_normal(9)
    shift = np.array([[off[0], 0.0, off[2]], [0.0, off[1], off[3]], [0.0, 0.0, 0.0]])
    true = Camera(CAMERA.matrix + shift, 640, 480, off[4:])
    told = Camera(CAMERA.matrix, 640, 480, sigmas=sigmas)
    sides = SIDE + side_sigma * rng.standard_normal(len(PLACES))

    sights = []
    for a, C in enumerate(VIEWS):
        for b, T in enumerate(PLACES.values()):
            at = C.inverse() * T
            pixels = true.project(square_corners(sides[b]) @ at.rotation.T + at.translation)
            noisy = pixels + noise * rng.standard_normal((4, 2))
            sights.append(Sight(a, b, square_corners(SIDE), noisy, 0.05**2 * np.eye(8), pin.SE3.Identity()))

    cameras = tuple(stepped(C, 0.01 * rng.standard_normal(6)) for C in VIEWS)
    targets = tuple(T if b == 0 else stepped(T, 0.01 * rng.standard_normal(6)) for b, T in enumerate(PLACES.values()))
    return sights, Unknowns(told, cameras, targets, np.zeros(len(PLACES)))


def test_a_fit_is_the_one_of_another_solver():
    sights, start = planted(np.random.default_rng(5), 0.05)
    fit = adjusted(sights, start, np.zeros(4), 0)

    def off(x):
        cameras = [stepped(T, x[6 * k : 6 * k + 6]) for k, T in enumerate(start.cameras)]
        rest = x[6 * len(cameras) :]
        targets = [start.targets[0], *(stepped(T, rest[6 * k : 6 * k + 6]) for k, T in enumerate(start.targets[1:]))]
        rows = []
        for sight in sights:
            at = cameras[sight.camera].inverse() * targets[sight.target]
            seen, _ = cv2.projectPoints(sight.points, pin.log3(at.rotation), at.translation, CAMERA.matrix, None)
            rows.append((sight.pixels - seen[:, 0]).ravel())
        return np.concatenate(rows)

    other = least_squares(off, np.zeros(6 * 10), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    for k, T in enumerate(start.targets[1:]):
        expected = stepped(T, other.x[6 * (7 + k) : 6 * (8 + k)])
        assert pin.log6(expected.actInv(fit.found.targets[k + 1])).vector == pytest.approx(np.zeros(6), abs=1e-6)

    # The covariance is the inverse of the normal matrix about the solution, of which scipy's slopes are an estimate.
    around = least_squares(off, other.x, max_nfev=1)
    expected = 0.05**2 * np.linalg.inv(around.jac.T @ around.jac)[42:48, 42:48]
    scale = max(1.0, 1.0 + (fit.unexplained / 0.05) ** 2)
    found = fit.of_targets[7:13, 7:13] / scale
    assert found == pytest.approx(expected, rel=0.02, abs=0.02 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("noise", "sigmas", "side_sigma"),
    [
        (0.05, None, 0.0),
        (0.3, None, 0.0),  # six times what is stated
        (0.05, (1.0, 1.0, 1.0, 1.0, 2e-3, 2e-3, 1e-4, 1e-4, 0.0), 3e-4),
    ],
)
def test_covariances_cover(noise, sigmas, side_sigma):
    squares = []
    for seed in range(30):
        sights, start = planted(np.random.default_rng(seed), noise, sigmas, side_sigma)
        fit = adjusted(sights, start, np.full(4, side_sigma / SIDE), 0)
        for b, T in list(enumerate(PLACES.values()))[1:]:
            at = slice(7 * b, 7 * b + 6)
            squares.append(normalised(T, fit.found.targets[b], fit.of_targets[at, at])[0])
        for a, C in enumerate(VIEWS):
            squares.append(normalised(C, fit.found.cameras[a], fit.of_cameras[a])[0])
    assert 4.0 < np.median(squares) < 7.0  # 5.3 is honest
    assert np.mean(np.array(squares) < chi2.ppf(0.99, 6)) > 0.97


def test_another_side_is_seen(pictures):
    with pytest.raises(InputError, match=r"marker 2: a side of 80\.0 mm is stated, but .* like 60\.0 mm"):
        map_markers(taken(sides={2: 0.06}), CAMERA, "4x4_50", side=SIDE)
    found = map_markers(taken(sides={2: 0.06}), CAMERA, "4x4_50", side=SIDE, sides={2: 0.06})
    assert found.markers[2].T_object_marker.translation == pytest.approx(PLACES[2].translation, abs=2e-4)


def test_a_marker_that_moved_is_named():
    moved = PLACES | {3: PLACES[3] * pin.SE3(np.eye(3), np.array([0.02, 0.0, 0.0]))}
    both = [*taken(VIEWS[:4]), *taken(VIEWS[4:], moved)]
    with pytest.raises(InputError, match=r"marker 3 is elsewhere in view_"):
        map_markers(both, CAMERA, "4x4_50", side=SIDE)

    # In one picture it is left out.
    found = map_markers([*taken(VIEWS[:6]), *taken(VIEWS[6:], moved)], CAMERA, "4x4_50", side=SIDE)
    assert found.unused == ("view_0.png: marker 3 is not where the other pictures have it",)
    assert found.markers[3].T_object_marker.translation == pytest.approx(PLACES[3].translation, abs=2e-4)


def test_a_wrong_camera_is_seen(pictures):
    other = Camera(CAMERA.matrix * [[1.03, 1, 1], [1, 1.03, 1], [1, 1, 1]], 640, 480, sigmas=[2.0] * 4 + [1e-4] * 5)
    with pytest.raises(InputError, match=r"contradict the camera's file by .* standard deviations"):
        map_markers(pictures, other, "4x4_50", side=SIDE, side_sigma=0.0)


def test_bad_input_is_one_line(pictures):
    small = Picture(pictures[0].pixels[:400], "small.png", 0.0)
    for given, options, message in (
        ([*pictures, small], {}, "small.png: 640 x 400 pixels"),
        (pictures[:1], {}, "at least two must show two"),
        (pictures, {"reference": 9}, "marker 9 is seen in no picture, but 0, 1, 2 and 1 more"),
        (pictures, {"dictionary": "apriltag_36h11"}, "no marker of apriltag_36h11"),
        (pictures, {"side": -1.0}, "side must be between"),
        (pictures, {"side_sigma": -1.0}, "side_sigma"),
        (taken(places={0: PLACES[0]}), {}, "at least two must show two"),
        ([1], {}, "picture"),
    ):
        told = {"dictionary": "4x4_50", "side": SIDE} | options
        with pytest.raises(InputError) as refused:
            map_markers(given, CAMERA, told.pop("dictionary"), **told)
        assert message in str(refused.value)
        assert "\n" not in str(refused.value)


def test_uncertain_places_are_part_of_a_pose():
    """An object's pose from one marker, and from two, has the covariance of maps drawn at random."""
    turned = pin.exp3(np.array([0.4, -0.2, 0.1]))
    places = (pin.SE3(turned, np.array([0.05, 0.02, 0.1])), pin.SE3(turned, np.array([0.2, -0.03, 0.1])))
    root = np.diag([2e-3, 1e-3, 3e-3, 0.01, 0.02, 0.005]) @ np.eye(6)
    covariance = root @ root.T
    shot = warped_picture(
        CAMERA,
        [("4x4_50", k, SIDE, VIEWS[1].inverse() * PLACES[0] * places[0].inverse() * T) for k, T in enumerate(places)],
        np.random.default_rng(0),
    )
    seen = find_markers(as_gray(shot), "4x4_50", wanted=(0, 1), camera=CAMERA)

    rng = np.random.default_rng(1)
    for count in (1, 2):

        def sighted(at, given, count=count):
            mounted = tuple(MountedMarker(k, SIDE, T, 0.0, given) for k, T in enumerate(at[:count]))
            return sighting(CAMERA, MarkedObject("box", "base", mounted), seen).pose

        stated = sighted(places, covariance)
        alone = sighted(places, None)
        middle = stated.T_camera_object
        off = []
        for _ in range(300):
            moved = [stepped(T, root @ rng.standard_normal(6)) for T in places]
            pose = sighted(moved, None).T_camera_object
            off.append(np.r_[pose.translation - middle.translation, pin.log3(pose.rotation @ middle.rotation.T)])
        sampled = np.sqrt(np.diag(np.cov(np.array(off).T)))
        told = np.sqrt(np.diag(stated.covariance) - np.diag(alone.covariance))
        assert told == pytest.approx(sampled, rel=0.25)


def test_the_command_writes_a_map_that_is_sensed(tmp_path, capsys, pictures):
    folder = tmp_path / "photographs"
    folder.mkdir()
    for picture in pictures:
        cv2.imwrite(str(folder / picture.name), picture.pixels)
    camera = tmp_path / "camera.yaml"
    CAMERA.save(camera)
    out = tmp_path / "map.yaml"

    given = ("markers", "map", folder, "--camera-file", camera, "--out", out, "--dictionary", "4x4_50")
    code, text, err = rrtik(capsys, *given, "--known", "0-1:151.33")
    assert (code, err) == (0, "")
    assert "0 to 1: 151.3" in text
    assert "+- 0." in text
    read = MarkerMap.load(out).objects[0]
    assert read.markers[1].T_object_marker.translation == pytest.approx(PLACES[1].translation, abs=1e-4)
    assert read.markers[0].covariance is None
    assert np.linalg.eigvalsh(read.markers[1].covariance)[0] > 0.0

    code, text, _ = rrtik(
        capsys, "markers", "sense", folder / "view_0.png", "--camera-file", camera, "--map", out, "--json"
    )
    assert code == 0
    assert '"markers": [0, 1, 2, 3]' in text

    # Into a map in which the object's frame is elsewhere.
    old = tmp_path / "old.yaml"
    old.write_text(
        "version: 1\ndictionary: 4x4_50\ncamera_pose: {xyz: [0, 0, 1]}\nobjects:\n"
        "  - {name: panel, role: target, markers: [{id: 1, side: 0.08, pose: {xyz: [0, 0, 0.5]}}],"
        " solids: [{name: body, box: [0.1, 0.1, 0.1]}]}\n"
    )
    code, text, err = rrtik(capsys, *given, "--into", old, "--object", "panel", "--json")
    assert (code, err) == (0, "")
    assert text.count('"frame": "reference"') == len(pictures)
    panel = MarkerMap.load(out).named("panel")
    assert [solid.name for solid in panel.solids] == ["body"]
    expected = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5])) * PLACES[1].inverse() * PLACES[2]
    assert panel.markers[2].T_object_marker.translation == pytest.approx(expected.translation, abs=2e-4)

    for more, message in (
        (("--into", old, "--object", "pane"), "did you mean 'panel'"),
        (("--known", "0:1"), "is no number of a marker"),
        (("--sides-mm", "a:b"), "cannot read 'a:b'"),
        (("--known", "0-9:100"), "no marker '9'"),
    ):
        code, _, err = rrtik(capsys, *given, *more)
        assert (code, err.count("\n")) == (2, 1)
        assert message in err


def test_covariances_of_markers_are_checked():
    with pytest.raises(InputError, match="marker 3: covariance must be symmetric"):
        MountedMarker(3, 0.08, covariance=-np.eye(6))
    with pytest.raises(InputError, match="marker 3: covariance"):
        MountedMarker(3, 0.08, covariance=np.eye(5))
