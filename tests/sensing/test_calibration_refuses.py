"""A calibration that says nothing, or takes the wrong lens, is refused in one line with the remedy."""

import cv2
import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.calibration import calibrate, calibrate_by_corners, seen_boards
from rrtik_ompl.sensing.markers.chessboard import Chessboard

BOARD = Chessboard(10, 7, 0.03)
FOCAL, MIDDLE = 612.0, (320.0, 240.0)
BLANK = np.full((480, 640), 128, dtype=np.uint8)


def pinhole(points, focal=FOCAL):
    """Pixels of a pinhole with the distortion of a usual web camera."""
    matrix = np.array([[focal, 0.0, MIDDLE[0]], [0.0, focal, MIDDLE[1]], [0.0, 0.0, 1.0]])
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array([-0.3, 0.1, 5e-4, -7e-4]))[0][:, 0]


def equidistant(points, focal=240.0):
    """Pixels of an equidistant fisheye: the distance from the middle is the angle times the focal length."""
    across = np.hypot(points[:, 0], points[:, 1])
    angle = np.arctan2(across, points[:, 2])
    return focal * (angle / across)[:, None] * points[:, :2] + MIDDLE


def views(lens, turns, places, noise, seed=0):
    """Corners of the board at poses: rotation vectors and places of its middle."""
    rng = np.random.default_rng(seed)
    board = BOARD.points - BOARD.points.mean(axis=0)
    for turn, place in zip(turns, places, strict=True):
        pixels = lens(board @ cv2.Rodrigues(np.asarray(turn))[0].T + place)
        yield BOARD.points, pixels + rng.normal(0.0, noise, pixels.shape)


def tilted(count, seed=1, far=(0.4, 0.7), wide=0.12):
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-0.7, 0.7, (count, 3)) * [1.0, 1.0, 0.3]
    return turns, np.c_[rng.uniform(-wide, wide, (count, 2)), rng.uniform(*far, count)]


def calibrated(seen):
    seen = list(seen)
    return calibrate_by_corners([BLANK] * len(seen), seen, BOARD)


@pytest.mark.parametrize("seed", range(3))
def test_a_usual_lens_under_many_angles_is_calibrated_without_advice(seed):
    found = calibrated(views(pinhole, *tilted(12, seed), noise=0.15, seed=seed))
    assert abs(found.camera.matrix[0, 0] - FOCAL) < 4.0 * found.sigmas[0]
    assert found.advice == ""


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("aside", [1.0, 0.0], ids=["frontal", "from one place"])
def test_photographs_that_are_too_much_alike_are_refused(seed, aside):
    turns, places = tilted(10, seed)
    alike = 0.01 * turns + (1.0 - aside) * np.array([0.2, 0.1, 0.0])
    with pytest.raises(InputError, match=r"do not say the focal length.*tilt the board"):
        calibrated(views(pinhole, alike, places * [aside, aside, 0] + [0, 0, 0.5], noise=0.3, seed=seed))


def test_a_doubtful_calibration_says_what_would_make_it_better():
    turns, places = tilted(6)
    found = calibrated(views(pinhole, 0.35 * turns, places, noise=0.2))
    assert 0.005 < found.sigmas[0] / found.camera.matrix[0, 0] < 0.05
    assert "tilt the board" in found.advice


@pytest.mark.parametrize("seed", range(3))
def test_a_fisheye_is_not_calibrated_as_a_usual_lens(seed):
    turns, places = tilted(12, seed, far=(0.15, 0.3), wide=0.25)
    with pytest.raises(InputError, match="the lens is a fisheye"):
        calibrated(views(equidistant, turns, places, noise=0.15, seed=seed))


def test_the_photograph_of_another_size_is_named():
    names = ["a.png", "b.png", "odd.png", "c.png"]
    taken = [BLANK, BLANK, BLANK[:240], BLANK]
    with pytest.raises(InputError, match=r"odd\.png: 640 x 240 pixels, but others have 640 x 480"):
        seen_boards(taken, BOARD, names)
    with pytest.raises(InputError, match="photograph 3"):
        calibrate(taken, BOARD)
