"""What is missing is searched for closely, whatever else is clear, and the work is bounded."""

import cv2
import numpy as np
import pytest

from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers import search as searching
from rrtik_ompl.sensing.markers.alignment import MIN_LIKENESS, aligned_corners
from rrtik_ompl.sensing.markers.detection import find_markers
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sensor import Sensor

FAMILY = "apriltag_36h11"
FAINT, CLEAR = (131, 125), (230, 20)  # grey values of white and black


def scene(markers, size=(640, 480), seed=1, noise=0.7, blur=0.8):
    """Upright markers (number, x, y, pixels of a cell, greys) on grey."""
    picture = np.full(size[::-1], 128.0)
    for number, x, y, cell, (white, black) in markers:
        framed = np.pad(marker_cells(FAMILY, number), 1, constant_values=255)
        drawn = np.kron(framed, np.ones((cell, cell))) > 0
        picture[y : y + len(drawn), x : x + len(drawn)] = np.where(drawn, white, black)
    grain = np.random.default_rng(seed).normal(0.0, noise, picture.shape)
    return np.clip(np.round(cv2.GaussianBlur(picture, (0, 0), blur) + grain), 0, 255).astype(np.uint8)


def texture(size, seed=0):
    waves = cv2.GaussianBlur(np.random.default_rng(seed).normal(0.0, 300.0, size[::-1]), (0, 0), 3.0)
    return np.clip(110.0 + waves, 0, 255).astype(np.uint8)


def numbers(found):
    return [marker.number for marker in found]


@pytest.mark.parametrize("size", [(640, 480), (1920, 1080)])
def test_a_clear_marker_hides_no_faint_one(size):
    gray = scene([(9, 60, 180, 8, CLEAR), (5, 380, 180, 8, FAINT)], size)
    assert numbers(find_markers(gray, FAMILY, wanted=[5, 9], align=False)) == [5, 9]
    assert numbers(find_markers(gray, FAMILY, wanted=[9], align=False)) == [9]  # nobody misses the faint one
    (faint, _) = find_markers(gray, FAMILY, wanted=[5, 9])
    corners = 380.0 + 8 * np.array([1, 9, 9, 1]) - 0.5
    assert np.abs(faint.corners[:, 0] - corners).max() < 0.3
    assert faint.likeness > 0.9


@pytest.mark.parametrize(("family", "accepted"), [("4x4_50", False), ("16h5", False), (FAMILY, True)])
def test_a_code_of_few_bits_is_accepted_only_if_every_cell_is_right(family, accepted):
    """A white cell of which 45 % are black still counts as white where bits are read."""
    family = f"apriltag_{family}" if family == "16h5" else family
    cells = np.pad(marker_cells(family, 3), 1, constant_values=255)
    drawn = np.kron(cells, np.ones((20, 20)))
    row, column = np.argwhere(cells[2:-2, 2:-2])[0] + 2
    whole = drawn.copy()
    drawn[20 * row : 20 * row + 9, 20 * column : 20 * column + 20] = 0
    for sheet, fine in ((whole, True), (drawn, accepted)):
        gray = np.full((480, 640), 128.0)
        gray[100 : 100 + len(sheet), 200 : 200 + len(sheet)] = 20 + 0.8 * sheet
        picture = cv2.GaussianBlur(gray, (0, 0), 0.8).round().astype(np.uint8)
        (marker,) = find_markers(picture, family, wanted=[3])
        assert (marker.likeness >= MIN_LIKENESS) == fine
        assert (marker.spread is not None) == fine


@pytest.mark.parametrize("corners", [
    [[100, 100], [300, 100], [300, 100.01], [100, 100.01]],
    [[100, 100], [300, 100], [100, 100], [300, 100]],
    [[100, 100], [300, 300], [200, 200], [150, 150.001]],
    [[100, 100], [101, 100], [101, 101], [100, 101]],
])  # fmt: skip
def test_what_is_no_square_is_not_aligned(corners):
    """Neither an error, nor a blur that reaches across thousands of samples."""
    fit = aligned_corners(texture((640, 480)), np.array(corners, dtype=float), marker_cells(FAMILY, 3))
    assert fit.likeness < MIN_LIKENESS
    assert fit.spread is None


@pytest.fixture
def searched(monkeypatch):
    """Sizes of all pictures that OpenCV's detector is given."""
    sizes = []
    detected = searching._detected

    def counted(gray, *how, **kinds):
        sizes.append(gray.size)
        return detected(gray, *how, **kinds)

    monkeypatch.setattr(searching, "_detected", counted)
    return sizes


@pytest.mark.parametrize("size", [(640, 480), (1920, 1080)])
def test_in_a_picture_of_nothing_but_noise_there_is_no_close_search(searched, size):
    noise = np.clip(np.random.default_rng(0).normal(110.0, 4.0, size[::-1]), 0, 255).astype(np.uint8)
    assert find_markers(noise, FAMILY, wanted=[5]) == ()
    assert len(searched) == 1
    assert searched[0] <= noise.size


@pytest.mark.parametrize(("near", "most"), [(False, searching.BUDGET), (True, searching.FILM_BUDGET)])
@pytest.mark.parametrize("size", [(640, 480), (1920, 1080), (2600, 2000)])
def test_the_work_is_bounded_where_everything_might_be_a_marker(searched, size, near, most):
    for turn in range(2):
        searched.clear()
        assert find_markers(texture(size), FAMILY, wanted=[5], near=near, turn=turn) == ()
        quick = 1 if size[0] * size[1] <= searching._LARGE else 2
        whole = 2 * searching._REDUCED
        # A step is begun while there is budget left: at most one part more, enlarged and tried twice.
        assert sum(searched[quick:]) <= whole + 8 * max(most, searching._TILE**2) + 4 * searching._TILE**2


def test_in_a_film_every_part_of_a_large_picture_has_its_turn():
    gray = scene([(5, 1500, 800, 3, (140, 116))], (1920, 1080))
    gray[:400] = texture((1920, 400))
    seen = [numbers(find_markers(gray, FAMILY, wanted=[5], near=True, turn=k, align=False)) for k in range(60)]
    assert [5] in seen


def test_a_lost_object_is_searched_for_at_its_last_place_first(searched):
    """A marker that becomes faint in a large picture full of texture is kept in every picture of the film."""
    camera = Camera([[900.0, 0.0, 960.0], [0.0, 900.0, 540.0], [0.0, 0.0, 1.0]], 1920, 1080)
    marker_map = MarkerMap(FAMILY, [MarkedObject("thing", "target", (MountedMarker(5, 0.1),))], np.eye(4))
    sensor = Sensor(camera, marker_map)
    for k, greys in enumerate([CLEAR, FAINT, FAINT, FAINT, FAINT]):
        gray = scene([(5, 1500, 700, 8, greys)], (1920, 1080))
        gray[:, :1300] = texture((1300, 1080))
        view = sensor.view(Picture(gray, str(k), 0.1 * k))
        assert [each.object.name for each in view.seen] == ["thing"]
