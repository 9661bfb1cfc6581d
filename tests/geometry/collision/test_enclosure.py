"""What an open mesh encloses."""

import numpy as np
import pytest

from rrtik_ompl.geometry.collision.enclosure import CELLS, Enclosure
from rrtik_tests.bent_meshes import slotted_cube


@pytest.mark.parametrize(("width", "holds"), [(0.0, True), (0.5 / CELLS, True), (8.0 / CELLS, False), (1.0, False)])
def test_a_narrow_slot_is_closed_and_a_wide_one_lets_everything_out(cube, width, holds):
    found = Enclosure(*slotted_cube(cube, width))
    assert found.holds(np.array([[0.0, 0.0, 0.0]])) == holds
    assert found.holds(np.array([[0.8, -0.7, 0.6]])) == holds
    for outside in ([0.0, 0.0, 1.2], [5.0, 0.0, 0.0], [-1.1, 0.0, 0.0]):
        assert not found.holds(np.array([outside]))


def test_one_of_several_points_is_enough(cube):
    found = Enclosure(*slotted_cube(cube, 0.0))
    assert found.holds(np.array([[3.0, 0.0, 0.0], [0.2, 0.1, 0.0]]))


def test_slivers_and_large_faces_leave_no_gap(cube):
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    needle = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0 - 1e-9]])
    vertices = np.vstack([cube.vertices, needle]) @ turn.T
    faces = np.vstack([cube.triangles, [[8, 9, 10]]])
    found = Enclosure(vertices, faces)
    inside = rng.uniform(-0.85, 0.85, (200, 3))
    away = np.linalg.norm(np.cross(inside, np.ones(3) / np.sqrt(3.0)), axis=1) > 0.25
    assert all(found.holds(p[None]) for p in inside[away] @ turn.T)
