"""A rolling shutter takes each row at its own time; two things that are seen have a relative pose with a covariance."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import pose_of_points
from rrtik_ompl.sensing.markers.detection import SeenMarker
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.scene_from_view import relative_pose
from rrtik_ompl.sensing.sight import sighting
from rrtik_tests.marker_views import CAMERA, SIDE, facing

ROLLING = replace(CAMERA, readout=0.03)
NOISE = 0.02  # [pixels]
THING = MarkedObject("thing", "target", (MountedMarker(3, SIDE),), speed=0.2)


def seen_by_rolling(T, velocity, marker, rng):
    """Corners of a marker, each where it is when its row is taken: row and time by a fixed point."""
    points = marker.corners @ T.rotation.T + T.translation
    time = np.zeros(4)
    for _ in range(50):
        pixels = ROLLING.project(points + time[:, None] * velocity)
        time = 0.03 * ((pixels[:, 1] + 0.5) / 480 - 0.5)
    spread = NOISE**2 * np.eye(8)
    return SeenMarker("4x4_50", marker.number, pixels + NOISE * rng.standard_normal((4, 2)), 1.0, spread)


def off(T, truth):
    return np.concatenate([T.translation - truth.translation, pin.log3(T.rotation @ truth.rotation.T)])


def squares(thing, count=150):
    rng = np.random.default_rng(3)
    found = []
    for _ in range(count):
        T = facing(rng.uniform(-0.7, 0.7, 3), [*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.5, 1.2)])
        way = rng.standard_normal(3)
        seen = seen_by_rolling(T, 0.2 * way / np.linalg.norm(way), thing.markers[0], rng)
        pose = sighting(ROLLING, thing, [seen]).pose
        poses = [pose.T_camera_object, *([pose.other] if pose.ambiguous else [])]
        found.append(min(a @ np.linalg.solve(pose.covariance, a) for a in (off(each, T) for each in poses)))
    return np.array(found)


def test_a_motion_that_is_stated_is_in_the_pose_of_a_rolling_shutter():
    stated = squares(THING)
    assert np.mean(stated <= 16.8) >= 0.95  # 99 % of honest ones
    assert 3.0 < np.median(stated) < 9.0
    assert np.mean(squares(replace(THING, speed=0.0)) <= 16.8) < 0.3


def test_what_is_at_rest_is_where_a_global_shutter_sees_it():
    T = facing([0.4, 0.3, 0.1], [0.05, -0.1, 0.7])
    seen = seen_by_rolling(T, np.zeros(3), THING.markers[0], np.random.default_rng(0))
    still = replace(THING, speed=0.0)
    poses = [sighting(camera, still, [seen]).pose for camera in (CAMERA, ROLLING)]
    assert poses[0].T_camera_object == poses[1].T_camera_object
    assert np.array_equal(poses[0].covariance, poses[1].covariance)


def test_readout_and_speed_are_read_as_they_are_written(tmp_path):
    ROLLING.save(tmp_path / "c.yaml")
    assert Camera.load(tmp_path / "c.yaml").readout == 0.03
    text = "version: 1\ndictionary: 4x4_50\ncamera_pose: {xyz: [0, 0, 0]}\nobjects:\n- name: a\n  role: target\n"
    (tmp_path / "map.yaml").write_text(text + "  speed: 0.2\n  markers:\n  - {id: 1, side: 0.08}\n")
    assert MarkerMap.load(tmp_path / "map.yaml").objects[0].speed == 0.2
    with pytest.raises(InputError, match="readout"):
        replace(CAMERA, readout=-0.01)
    with pytest.raises(InputError, match="object 'thing': speed"):
        replace(THING, speed=-1.0)


def test_the_relative_pose_of_two_objects_is_as_uncertain_as_it_says():
    rng = np.random.default_rng(7)
    things = [MarkedObject(name, "target", (MountedMarker(k, SIDE),)) for k, name in enumerate(("socket", "part"))]
    places = facing([0.5, 0.3, 0.1], [-0.1, 0.05, 0.7]), facing([-0.4, 0.5, 0.6], [0.12, -0.05, 0.9])
    truth = places[0].inverse() * places[1]
    found = []
    for _ in range(200):
        sights = [
            sighting(CAMERA, thing, [seen_by_rolling(T, np.zeros(3), thing.markers[0], rng)])
            for thing, T in zip(things, places, strict=True)
        ]
        pose, covariance = relative_pose(*sights)
        error = off(pose, truth)
        found.append(error @ np.linalg.solve(covariance, error))
    assert np.mean(found) == pytest.approx(6.0, rel=0.15)
    with pytest.raises(InputError, match="socket"):
        relative_pose(replace(sights[0], refused="covered"), sights[1])


@pytest.mark.parametrize("seed", range(20))
def test_points_in_any_plane_of_an_object_give_its_pose(seed):
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.uniform(-0.1, 0.1, (8, 2)), np.zeros(8)])
    plane = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.1, 3))
    points = flat @ plane.rotation.T + plane.translation
    T = pin.SE3(pin.exp3(rng.normal(0.0, 0.5, 3)), np.array([*rng.uniform(-0.1, 0.1, 2), 1.0]))
    pixels = CAMERA.project(points @ T.rotation.T + T.translation)

    found = pose_of_points(CAMERA, pixels, points)
    assert found.error < 1e-6
    assert pin.log6(found.T_camera_object.actInv(T)).vector == pytest.approx(np.zeros(6), abs=1e-7)
