"""Surfaces of shapes that are kept from picture to picture."""

import numpy as np

from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, Cylinder
from rrtik_ompl.pilot.overlay import rasterizer
from rrtik_ompl.pilot.overlay.rasterizer import ShapeSurfaces, obstacle_surfaces


def test_an_obstacle_that_moves_is_made_once_and_drawn_where_it_is(monkeypatch):
    made = []
    kept = ShapeSurfaces()
    plain = rasterizer.surface_of_shape
    monkeypatch.setattr(rasterizer, "surface_of_shape", lambda *given: made.append(given[0]) or plain(*given))
    shapes = Box([0.1, 0.2, 0.3]), Cylinder(0.1, 0.4)
    for k in range(4):
        obstacles = [Obstacle(str(n), each, pose([0.1 * k, 0.0, n])) for n, each in enumerate(shapes)]
        for found, fresh in zip(obstacle_surfaces(obstacles, kept), obstacle_surfaces(obstacles), strict=True):
            assert np.array_equal(found.vertices, fresh.vertices)
            assert np.array_equal(found.normals, fresh.normals)
            assert np.array_equal(found.faces, fresh.faces)
        assert len(made) == 2 * (k + 2)  # two anew each time, and the kept ones once


def test_what_is_kept_has_an_end(monkeypatch):
    monkeypatch.setattr(rasterizer, "MAX_SHAPES", 3)
    kept = ShapeSurfaces()
    for k in range(10):
        (found,) = obstacle_surfaces([Obstacle("box", Box([0.1, 0.1, 0.1 * (k + 1)]))], kept)
        assert np.ptp(found.vertices[:, 2]) == 0.1 * (k + 1)
    assert len(kept._made) <= 3
