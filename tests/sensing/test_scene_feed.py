"""A film is a feed of scenes that replanning follows."""

import cv2
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.scene_feed import scenes_of_pictures
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.marker_views import BOX, CAMERA, T_BOX_MARKERS, facing, picture_of


def film(places):
    """Pictures of the box's markers where they are seen at 30 Hz; None is an empty view."""
    for k, place in enumerate(places):
        markers = [] if place is None else [(10 + j, place * T) for j, T in enumerate(T_BOX_MARKERS)]
        yield Picture(cv2.cvtColor(picture_of(markers, k), cv2.COLOR_GRAY2BGR), f"picture {k}", 5.0 + k / 30.0)


def test_a_film_is_a_feed_in_which_what_is_out_of_view_stays_where_it_was_seen_last():
    marker_map = MarkerMap("4x4_50", (BOX,), pin.SE3.Identity())
    places = [None, *(facing([0.4, -0.3, 0.1], [0.05 + 0.01 * k, 0.0, 1.0]) for k in range(3)), None]
    post = Obstacle("post", Box([0.1, 0.1, 0.1]), pose([3.0, 0.0, 0.0]))
    feed = list(scenes_of_pictures(film(places), Sensor(CAMERA, marker_map, smooth=False), Scene((post,))))
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
    feed = scenes_of_pictures(film(places), Sensor(CAMERA, marker_map, smooth=False))
    run = replan(problem, feed, step=0.02, rate=30.0, seconds=0.1, repair_budget=9.0)
    gone = [float(tick.poses["box"][0]) for tick in run.ticks if "box" in tick.poses]
    assert len(gone) == 3
    assert np.diff(gone) == pytest.approx([0.01, 0.01], abs=4e-3)


def test_a_film_in_which_an_object_never_appears_says_which():
    marker_map = MarkerMap("4x4_50", (BOX,), pin.SE3.Identity())
    with pytest.raises(InputError, match="seen: box; show every"):
        next(scenes_of_pictures(film([None]), Sensor(CAMERA, marker_map)))
