"""Markers seen by a synthetic camera whose truth is known: corners, poses, objects, frames, tracking."""

import itertools

import cv2
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.poses import pose
from rrtik_ompl.problem import Problem
from rrtik_ompl.replanning import replan
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.cameras.synthetic_camera import clean_picture, marker_print, photograph, published_camera
from rrtik_ompl.sensing.frames import NoBaseError, base_from_camera, place_in_base
from rrtik_ompl.sensing.markers.corner_pose import (
    CornerPose,
    pose_of_points,
    pose_of_square,
    square_corners,
    turn_between,
)
from rrtik_ompl.sensing.markers.detection import DICTIONARIES, dictionaries_seen, find_markers, marker_cells
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.scene_feed import scene_feed
from rrtik_ompl.sensing.scene_from_view import SeenObject, objects_in_base, scene_from_image
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.sensing.sight import detect_objects
from rrtik_ompl.sensing.tracker import MAX_OUTLIERS, PoseTracker
from rrtik_ompl.shapes import Box, HalfSpace
from rrtik_ompl.world import World

CAMERA = published_camera((0.05, -0.12, 0.0005, -0.0007, 0.03))
SIDE = 0.08


def facing(turn, place):
    """T_camera_marker of a marker that looks at the camera, turned by a rotation vector."""
    return pin.SE3(pin.exp3(np.array(turn, dtype=float)) @ np.diag([1.0, -1.0, -1.0]), np.array(place, dtype=float))


def picture_of(markers, seed=0, **how):
    prints = [(T, marker_print(marker_cells("4x4_50", number), SIDE)) for number, T in markers]
    return photograph(clean_picture(CAMERA, prints, rays=6), np.random.default_rng(seed), **how)


def test_rays_of_projected_points_go_through_them():
    points = np.random.default_rng(0).uniform([-0.3, -0.2, 0.5], [0.3, 0.2, 2.0], (50, 3))
    assert CAMERA.rays(CAMERA.project(points)) == pytest.approx(points[:, :2] / points[:, 2:], abs=1e-9)


def test_the_jacobian_of_pixels_agrees_with_differences():
    T, h = facing([0.4, -0.3, 0.2], [0.1, 0.05, 0.9]), 1e-6
    points = square_corners(SIDE) @ T.rotation.T
    slopes = CAMERA.jacobian(points, T.translation)
    for k in range(6):
        step = np.zeros(6)
        step[k] = h
        moved = [points @ pin.exp3(s * step[3:]).T + T.translation + s * step[:3] for s in (1.0, -1.0)]
        difference = (CAMERA.project(moved[0]) - CAMERA.project(moved[1])) / (2.0 * h)
        assert slopes[:, k] == pytest.approx(difference.ravel(), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("matrix", [np.eye(3) * 2, np.zeros((3, 3)), [[800, 0.2, 320], [0, 800, 240], [0, 0, 1]]])
def test_what_is_no_pinhole_is_refused(matrix):
    with pytest.raises(InputError, match="camera matrix"):
        Camera(matrix, 640, 480)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.2, 2.5), st.floats(0.0, np.radians(70.0)), st.floats(0.0, 2 * np.pi), st.floats(-0.2, 0.2))
def test_without_noise_a_pose_is_exact(distance, tilt, direction, aside):
    T = facing([tilt * np.cos(direction), tilt * np.sin(direction), 0.0], [aside * distance, 0.0, distance])
    pixels = published_camera().project(square_corners(SIDE) @ T.rotation.T + T.translation)
    found = pose_of_square(published_camera(), pixels, SIDE)
    assert np.linalg.norm(found.T_camera_object.translation - T.translation) < 1e-9  # 1e-6 mm
    assert np.linalg.norm(pin.log3(found.T_camera_object.rotation.T @ T.rotation)) < 1e-8


def test_alignment_removes_the_inward_pull_of_blur():
    T = facing([0.4, 0.2, 0.1], [0.1, -0.05, 1.2])
    errors = {align: [] for align in (True, False)}
    for seed in range(8):
        gray = picture_of([(7, T)], seed)
        for align, list_of_errors in errors.items():
            (marker,) = find_markers(gray, "4x4_50", align=align)
            found = pose_of_square(CAMERA, marker.corners, SIDE)
            list_of_errors.append(found.T_camera_object.translation[2] - T.translation[2])
    assert abs(np.mean(errors[True])) < 0.6e-3
    assert abs(np.mean(errors[False])) > 3e-3
    assert np.std(errors[True]) < 0.4 * np.std(errors[False])


@pytest.mark.parametrize("blur", [0.4, 1.1])
def test_alignment_finds_out_how_blurred_a_picture_is(blur):
    T = facing([0.5, 0.4, 0.2], [0.1, -0.05, 1.7])
    away = []
    for seed in range(10):
        (marker,) = find_markers(picture_of([(7, T)], seed, blur=blur), "4x4_50")
        away.append(pose_of_square(CAMERA, marker.corners, SIDE).T_camera_object.translation[2] - T.translation[2])
    assert abs(np.mean(away)) < 0.6e-3


def test_the_stated_uncertainty_is_neither_boast_nor_panic():
    T = facing([0.5, 0.2, 0.1], [0.05, -0.05, 1.0])
    truth, away, sigma = T.translation, [], []
    for seed in range(12):
        (marker,) = find_markers(picture_of([(7, T)], seed), "4x4_50")
        found = pose_of_square(CAMERA, marker.corners, SIDE)
        away.append(np.linalg.norm(found.T_camera_object.translation - truth))
        sigma.append(found.position_sigma)
    assert 0.3 < np.sqrt(np.mean(np.square(away))) / np.mean(sigma) < 3.0


def test_a_marker_seen_from_the_front_is_ambiguous_and_a_tilted_one_is_not():
    for tilt, doubt in ((0.03, True), (0.6, False)):
        T = facing([tilt, 0.0, 0.0], [0.0, 0.0, 1.8])
        (marker,) = find_markers(picture_of([(3, T)]), "4x4_50")
        assert pose_of_square(CAMERA, marker.corners, SIDE).ambiguous is doubt


def test_a_covered_corner_shows_in_the_likeness():
    T = facing([0.3, 0.2, 0.0], [0.0, 0.0, 0.7])
    gray = picture_of([(3, T)])
    (whole,) = find_markers(gray, "4x4_50")
    x, y = np.rint(whole.corners[0]).astype(int)
    gray[y - 6 : y + 14, x - 6 : x + 14] = 128
    covered = find_markers(gray, "4x4_50")
    assert whole.likeness > 0.99
    assert all(each.likeness < whole.likeness - 0.005 for each in covered)


def test_a_marker_of_another_dictionary_is_named():
    prints = [(facing([0.3, 0, 0], [0, 0, 0.6]), marker_print(marker_cells("6x6_50", 5), SIDE))]
    gray = photograph(clean_picture(CAMERA, prints, rays=4), np.random.default_rng(0))
    assert find_markers(gray, "apriltag_36h11") == ()
    assert "6x6_50" in dictionaries_seen(gray)


def test_unknown_dictionaries_and_numbers_are_refused():
    with pytest.raises(UnknownNameError, match="4x4_50"):
        marker_cells("4x4_5", 0)
    with pytest.raises(InputError, match="0 to 49"):
        marker_cells("4x4_50", 50)


@pytest.mark.parametrize("dictionary", sorted(DICTIONARIES))
def test_every_dictionary_can_be_drawn(dictionary):
    assert set(np.unique(marker_cells(dictionary, 3))) == {0, 255}


# --- objects and frames ------------------------------------------------------------------------------------------

T_BOX_MARKERS = [pose([0.0, 0.0, 0.05]), pose([0.15, 0.0, 0.05])]
BOX = MarkedObject(
    "box",
    "target",
    tuple(MountedMarker(10 + k, SIDE, T) for k, T in enumerate(T_BOX_MARKERS)),
    (Obstacle("body", Box([0.3, 0.1, 0.1])),),
    (GraspType("top", [pose([0.0, 0.0, 0.1]), pose([0.05, 0.0, 0.1])]),),
)
STAND = MarkedObject("stand", "base", (MountedMarker(0, SIDE),))


def test_two_markers_of_an_object_give_a_steadier_rotation_than_one():
    T = facing([0.25, -0.2, 0.1], [-0.05, 0.0, 1.3])
    spread = {1: [], 2: []}
    for seed in range(8):
        shown = [(10 + k, T * T_BOX_MARKERS[k]) for k in range(2)]
        for count in (1, 2):
            gray = picture_of(shown[:count], seed)
            (sight,) = detect_objects(gray, CAMERA, MarkerMap("4x4_50", (BOX,), pin.SE3.Identity()))
            assert len(sight.markers) == count
            spread[count].append(pin.log3(sight.pose.T_camera_object.rotation @ T.rotation.T))
    assert np.std(spread[2], axis=0)[0] < 0.5 * np.std(spread[1], axis=0)[0]


def test_both_ways_to_the_tip_agree():
    T_camera_mount, T_mount_base, T_base_tip, T_camera_target = (pin.SE3.Random() for _ in range(4))
    T_base_camera = (T_camera_mount * T_mount_base).inverse()
    T_camera_tip = T_camera_mount * T_mount_base * T_base_tip
    back = T_base_camera * T_camera_target
    assert (T_base_camera * T_camera_tip).homogeneous == pytest.approx(T_base_tip.homogeneous, abs=1e-12)
    assert (T_base_camera.inverse() * back).homogeneous == pytest.approx(T_camera_target.homogeneous, abs=1e-12)


def test_an_object_is_placed_in_the_frame_of_a_base_that_is_seen():
    T_camera_base = facing([0.5, 0.1, 0.0], [-0.25, 0.1, 1.1])
    T_camera_box = facing([0.4, -0.3, 0.1], [0.12, 0.0, 1.0])
    gray = picture_of(
        [(0, T_camera_base), (10, T_camera_box * T_BOX_MARKERS[0]), (11, T_camera_box * T_BOX_MARKERS[1])]
    )
    marker_map = MarkerMap("4x4_50", (STAND, BOX))
    (placed,) = objects_in_base(detect_objects(gray, CAMERA, marker_map), marker_map)
    truth = T_camera_base.inverse() * T_camera_box
    away = np.linalg.norm(placed.T_base_object.translation - truth.translation)
    assert away < 2.5e-3
    assert away < 6.0 * placed.position_sigma
    (solid,) = scene_from_image(gray, CAMERA, marker_map).obstacles
    assert solid.name == "box"
    assert solid.pose.homogeneous == pytest.approx(placed.T_base_object.homogeneous)
    assert solid.margin == pytest.approx(placed.margin(BOX.solids[0]))
    assert scene_from_image(gray, CAMERA, marker_map, sigmas=0.0).obstacles[0].margin == 0.0
    tip = placed.grasp_pose("top", 1)
    assert (placed.T_base_object.inverse() * tip).translation == pytest.approx([0.05, 0.0, 0.1])


def film(places):
    """Pictures of the box's markers where they are seen at 30 Hz; None is an empty view."""
    for k, place in enumerate(places):
        markers = [] if place is None else [(10 + j, place * T) for j, T in enumerate(T_BOX_MARKERS)]
        yield Picture(cv2.cvtColor(picture_of(markers, k), cv2.COLOR_GRAY2BGR), f"picture {k}", 5.0 + k / 30.0)


def test_a_film_is_a_feed_in_which_what_is_out_of_view_stays_where_it_was_seen_last():
    marker_map = MarkerMap("4x4_50", (BOX,), pin.SE3.Identity())
    places = [None, *(facing([0.4, -0.3, 0.1], [0.05 + 0.01 * k, 0.0, 1.0]) for k in range(3)), None]
    post = Obstacle("post", Box([0.1, 0.1, 0.1]), pose([3.0, 0.0, 0.0]))
    feed = list(scene_feed(film(places), Sensor(CAMERA, marker_map, smooth=False), Scene((post,))))
    assert [time for time, _ in feed] == pytest.approx([0.0, 1 / 30, 2 / 30, 0.1])  # nothing was known at first
    for (_, scene), place in zip(feed, places[1:4], strict=False):
        assert [obstacle.name for obstacle in scene.obstacles] == ["post", "box"]
        assert scene.obstacle("box").pose.translation == pytest.approx(place.translation, abs=4e-3)
    assert (feed[3][1].obstacle("box").pose.homogeneous == feed[2][1].obstacle("box").pose.homogeneous).all()


def test_replanning_follows_what_a_camera_sees():
    marker_map = MarkerMap("4x4_50", (BOX,), pose([0.4, 0.3, 0.0]))
    places = [facing([0.4, -0.3, 0.1], [0.05 + 0.01 * k, 0.0, 1.0]) for k in range(4)]
    start = np.array([0.0, -1.6, 1.2, -1.2, 1.6, 0.0])
    problem = Problem(World(load_robot("ur5"), Scene(())), start, start + 0.3)
    feed = scene_feed(film(places), Sensor(CAMERA, marker_map, smooth=False))
    run = replan(problem, feed, step=0.02, rate=30.0, seconds=0.1, repair_budget=9.0)
    gone = [float(tick.poses["box"][0]) for tick in run.ticks if "box" in tick.poses]
    assert len(gone) == 3
    assert np.diff(gone) == pytest.approx([0.01, 0.01], abs=4e-3)


def test_a_film_in_which_an_object_never_appears_says_which():
    marker_map = MarkerMap("4x4_50", (BOX,), pin.SE3.Identity())
    with pytest.raises(InputError, match="seen: box; show every"):
        next(scene_feed(film([None]), Sensor(CAMERA, marker_map)))


@given(st.integers(0, 2**32 - 1))
def test_no_point_of_a_solid_deviates_by_more_than_its_margin_says(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6)) * np.repeat(rng.uniform(1e-4, 1e-2, 2), 3)[:, None]
    place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-1.0, 1.0, 3))
    size = rng.uniform(0.05, 0.5, 3)
    thing = MarkedObject("it", "obstacle", STAND.markers, (Obstacle("box", Box(size), place),))
    seen = SeenObject(thing, pin.SE3.Identity(), root @ root.T, None, sigmas=2.0)
    (solid,) = seen.solids()
    worst = 0.0
    for corner in itertools.product((-0.5, 0.5), repeat=3):
        lever = np.hstack([np.eye(3), -pin.skew(place.act(size * np.array(corner)))])
        worst = max(worst, float(np.linalg.norm(lever @ root, 2)))
    assert 2.0 * worst <= solid.margin * (1.0 + 1e-9)
    assert solid.margin <= 2.0 * (seen.position_sigma + (1.8 + 0.5) * seen.rotation_sigma)


def test_a_ground_that_is_seen_has_a_margin_that_ends():
    ground = Obstacle("ground", HalfSpace([0, 0, 1], -0.2), pose([0.0, 3.0, -0.1]), margin=0.01)
    thing = MarkedObject("it", "obstacle", STAND.markers, (ground,))
    spread = np.diag([1e-6, 0.0, 0.0, 4e-6, 0.0, 0.0])
    (solid,) = SeenObject(thing, pin.SE3.Identity(), spread, None).solids()
    assert solid.margin == pytest.approx(0.01 + 3.0 * (1e-3 + 0.3 * 2e-3))


@pytest.mark.parametrize("sigmas", [-1.0, float("nan"), float("inf"), "many"])
def test_sigmas_that_make_no_sense_are_refused_before_anything_is_seen(sigmas):
    with pytest.raises(InputError, match="sigmas"):
        Sensor(CAMERA, MarkerMap("4x4_50", (STAND, BOX)), sigmas=sigmas)


def test_a_mounted_camera_needs_no_base_and_leaves_no_doubt_about_it():
    mount = pose([0.3, 0.0, 0.5])
    T, spread = base_from_camera(MarkerMap("4x4_50", (BOX,), mount), ())
    assert T is mount
    assert not spread.any()


def test_a_base_out_of_view_is_said():
    with pytest.raises(NoBaseError, match="stand"):
        base_from_camera(MarkerMap("4x4_50", (STAND, BOX)), ())


def test_the_error_of_the_base_grows_with_its_lever_arm():
    T_camera_base, turned = facing([0.5, 0.1, 0.0], [0.0, 0.0, 1.0]), np.zeros((6, 6))
    turned[3:, 3:] = 1e-6 * np.eye(3)
    spreads = []
    for distance in (0.2, 0.8):
        T = facing([0.4, 0.0, 0.0], [distance, 0.0, 1.0])
        pixels = CAMERA.project(square_corners(SIDE) @ T.rotation.T + T.translation)
        found = pose_of_square(CAMERA, pixels, SIDE, sigma=1e-9)
        sight = type("Sight", (), {"pose": found})()
        _, covariance = place_in_base(T_camera_base.inverse(), turned, sight)
        spreads.append(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    assert spreads[0] == pytest.approx(0.2e-3, rel=1e-3)
    assert spreads[1] == pytest.approx(0.8e-3, rel=1e-3)


def test_a_marker_that_is_too_small_is_refused_with_its_size():
    gray = picture_of([(10, facing([0.4, 0.0, 0.0], [0.0, 0.0, 6.5]))], noise=0.002, blur=0.3)
    sightings = detect_objects(gray, CAMERA, MarkerMap("4x4_50", (BOX,), pin.SE3.Identity()))
    assert all("pixels a side" in sight.refused and sight.quality == 0.0 for sight in sightings)


def test_a_wrong_side_in_the_map_is_noticed_where_two_markers_contradict_each_other():
    wrong = MarkedObject(
        "box", "target", (MountedMarker(10, SIDE, pose([0, 0, 0])), MountedMarker(11, SIDE, pose([0.3, 0, 0])))
    )
    T = facing([0.3, 0.2, 0.0], [-0.05, 0.0, 0.9])
    gray = picture_of([(10, T), (11, T * pose([0.15, 0.0, 0.0]))])
    (sight,) = detect_objects(gray, CAMERA, MarkerMap("4x4_50", (wrong,), pin.SE3.Identity()))
    assert "check the marker map" in sight.refused


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(InputError, match="100 x 50 pixels"):
        detect_objects(np.zeros((50, 100), dtype=np.uint8), CAMERA, MarkerMap("4x4_50", (BOX,), pin.SE3.Identity()))
    with pytest.raises(InputError, match="8 bits"):
        detect_objects(np.zeros((480, 640)), CAMERA, MarkerMap("4x4_50", (BOX,), pin.SE3.Identity()))


@pytest.mark.parametrize(
    ("objects", "message"),
    [
        ((STAND, MarkedObject("other", "base", (MountedMarker(1, SIDE),))), "two objects are the base"),
        ((STAND, MarkedObject("box", "target", (MountedMarker(0, SIDE),))), "marker 0 stands twice"),
        ((STAND, MarkedObject("stand", "target", (MountedMarker(1, SIDE),))), "object stand stands twice"),
        ((BOX,), "nothing says where the base is"),
    ],
)
def test_a_map_that_contradicts_itself_is_refused(objects, message):
    with pytest.raises(InputError, match=message):
        MarkerMap("4x4_50", objects)


# --- over time ---------------------------------------------------------------------------------------------------


def sight_at(T, other=None, errors=(0.02, np.inf)):
    points = np.vstack([square_corners(SIDE), square_corners(0.5 * SIDE)])
    base = pose_of_points(CAMERA, CAMERA.project(points @ T.rotation.T + T.translation), points)
    return type("Sight", (), {"pose": CornerPose(T, other, *errors, base.covariance)})()


def branches(tilt, place=(0.0, 0.0, 1.5)):
    """The right and the wrong pose of a marker that is tilted a little."""
    return facing([tilt, 0.0, 0.0], place), facing([-tilt, 0.0, 0.0], place)


def away(found, T):
    return np.linalg.norm(pin.log3(found.T_camera_object.rotation.T @ T.rotation))


def test_the_branch_of_before_is_kept_where_two_poses_fit():
    right, wrong = branches(0.2)
    tracker = PoseTracker()
    tracker.update(sight_at(right, wrong, (0.02, 1.0)), 0.0)
    found = tracker.update(sight_at(wrong, right, (0.02, 0.022)), 0.033)
    assert found.other_branch
    assert found.sure
    assert away(found, right) < 1e-9


@settings(max_examples=50, deadline=None)
@given(st.floats(0.05, 0.4), st.floats(0.001, 0.3), st.floats(1.0, 5.9), st.floats(0.01, 0.2))
def test_no_single_doubtful_picture_turns_over_what_was_followed_nor_makes_sure(tilt, error, ratio, seconds):
    right, wrong = branches(tilt)
    tracker = PoseTracker()
    first = tracker.update(sight_at(right, wrong, (0.02, 0.02)), 0.0)
    found = tracker.update(sight_at(wrong, right, (error, ratio * error)), seconds)
    assert not first.sure
    assert not found.sure
    assert away(found, right) < 1e-9


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 0.4), st.floats(1.5, 5.0), st.integers(0, 2**32 - 1))
def test_a_wrong_first_guess_is_given_up_when_most_pictures_speak_against_it(tilt, ratio, seed):
    right, wrong = branches(tilt)
    tracker, rng = PoseTracker(), np.random.default_rng(seed)
    tracker.update(sight_at(wrong, right, (0.05, 0.06)), 0.0)
    against = rng.permutation([True] * 12 + [False] * 2).tolist() + [True] * 4
    for k, each in enumerate(against, start=1):
        poses = (right, wrong) if each else (wrong, right)
        found = tracker.update(sight_at(*poses, (0.05, 0.05 * (ratio if each else 1.1))), k / 30)
    assert away(found, right) < 1e-9


@settings(max_examples=30, deadline=None)
@given(st.floats(0.01, 0.4), st.floats(1.0, 5.9), st.floats(0.005, 0.5), st.sampled_from([1 / 30, 0.1, 0.5]))
def test_doubtful_pictures_alone_never_make_sure_for_their_errors_repeat_themselves(tilt, ratio, error, seconds):
    tracker = PoseTracker()
    other_error = min(ratio * error, 0.99 * 6.0 * max(error, 0.015))
    for k in range(40):
        assert not tracker.update(sight_at(*branches(tilt), (error, other_error)), k * seconds).sure


def test_what_was_sure_becomes_doubtful_where_the_two_poses_cannot_be_told_apart_any_more():
    tracker = PoseTracker()
    assert tracker.update(sight_at(*branches(0.3), (0.02, 1.0)), 0.0).sure
    for k in range(1, 4):
        found = tracker.update(sight_at(*branches(0.002), (0.02, 0.02)), k / 30)
    assert not found.sure


def test_near_the_front_the_pose_that_the_closed_form_gives_is_kept_where_only_one_is_a_minimum():
    T = facing([0.12, 0.0, 0.0], [0.0, 0.0, 0.35])
    pixels = CAMERA.project(square_corners(SIDE) @ T.rotation.T + T.translation)
    found = pose_of_square(CAMERA, pixels, SIDE)
    assert turn_between(found.T_camera_object, T) < 1e-8
    assert turn_between(found.other, T) > 0.1
    assert found.other_error > 100.0 * found.error


def test_the_first_sighting_without_doubt_ends_a_wrong_guess_at_once():
    right, wrong = branches(0.4)
    tracker = PoseTracker()
    tracker.update(sight_at(wrong, right, (0.02, 0.022)), 0.0)
    found = tracker.update(sight_at(right, wrong, (0.02, 1.0)), 0.033)
    assert not found.outlier
    assert found.sure
    assert away(found, right) < 1e-9


def test_one_outlier_is_left_out_and_a_new_place_is_believed_in_the_end():
    tracker, here, there = PoseTracker(), facing([0.3, 0, 0], [0, 0, 1.0]), facing([0.3, 0, 0], [0.4, 0, 1.0])
    for k in range(5):
        tracker.update(sight_at(here), k / 30)
    first = tracker.update(sight_at(there), 5 / 30)
    assert first.outlier
    assert first.T_camera_object.translation == pytest.approx(here.translation)
    for k in range(1, MAX_OUTLIERS):
        last = tracker.update(sight_at(there), (5 + k) / 30)
    assert not last.outlier
    assert last.T_camera_object.translation == pytest.approx(there.translation)


def test_smoothing_steadies_what_stands_still_and_follows_what_moves():
    rng, tracker, out = np.random.default_rng(1), PoseTracker(), []
    for k in range(200):
        T = facing([0.3, 0, 0], np.array([0.0, 0.0, 1.0]) + 3e-4 * rng.standard_normal(3))
        out.append(tracker.update(sight_at(T), k / 30).T_camera_object.translation)
    assert np.std(np.array(out)[50:, 2]) < 0.4 * 3e-4
    for k in range(200, 260):
        T = facing([0.3, 0, 0], [0.2 * (k - 199) / 30, 0.0, 1.0])
        last = tracker.update(sight_at(T), k / 30).T_camera_object.translation
    assert abs(last[0] - 0.2 * 60 / 30) < 0.05


def test_times_must_increase():
    tracker = PoseTracker()
    tracker.update(sight_at(facing([0.3, 0, 0], [0, 0, 1])), 1.0)
    with pytest.raises(InputError, match="increase"):
        tracker.update(sight_at(facing([0.3, 0, 0], [0, 0, 1])), 1.0)
