"""Solids that are seen keep a margin as large as their pose is uncertain."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, HalfSpace
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_tests.marker_views import BOX, CAMERA, STAND


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
