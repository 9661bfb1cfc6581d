"""From markers to objects in the frame of a base that is seen or known."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.scene_from_view import (
    NoBaseError,
    base_from_camera,
    grasp_problem,
    objects_in_base,
    place_in_base,
    scene_from_image,
)
from rrtik_ompl.sensing.sight import detect_objects
from rrtik_tests import pilot_session
from rrtik_tests.marker_views import BOX, CAMERA, SIDE, STAND, T_BOX_MARKERS, facing, picture_of


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
    assert np.std(spread[2], axis=0)[0] < 0.6 * np.std(spread[1], axis=0)[0] < 5e-4


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


def test_a_mounted_camera_needs_no_base_and_leaves_no_doubt_about_it():
    mount = pose([0.3, 0.0, 0.5])
    T, spread = base_from_camera(MarkerMap("4x4_50", (BOX,), mount), ())
    assert np.array_equal(T.homogeneous, mount.homogeneous)
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
        ((STAND, MarkedObject("box", "target", (MountedMarker(0, SIDE),))), "marker 0 is twice in"),
        ((STAND, MarkedObject("stand", "target", (MountedMarker(1, SIDE),))), "object stand is twice in"),
        ((BOX,), "nothing says where the base is"),
    ],
)
def test_a_map_that_contradicts_itself_is_refused(objects, message):
    with pytest.raises(InputError, match=message):
        MarkerMap("4x4_50", objects)


def test_the_task_of_a_pilots_problem_is_planned_as_the_problem_is():
    assert pilot_session.PROBLEM.planner == "bicrdt"
    seen = pilot_session.seen_at(pilot_session.PLACE)
    assert grasp_problem(pilot_session.PROBLEM, [seen], "valve", "front", 1).planner == "bicrdt"
