"""Meshes for drawing keep their surface: areas, volumes, boxes and edges."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from rrtik_ompl.base.errors import PictureWarning
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Shape, Sphere
from rrtik_ompl.model.shapes.surfaces import extruded
from rrtik_ompl.viewer.drawing.meshes import (
    MAX_OBSTACLE_TRIANGLES,
    half_space_plate,
    look_of_coal,
    look_of_shape,
    thickened,
)
from rrtik_ompl.viewer.drawing.nodes import SphereGeometry
from rrtik_ompl.viewer.drawing.triangles import split_creases, thin_out, tube
from rrtik_ompl.viewer.page import page

L_SHAPE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


def test_a_prism_over_a_polygon_that_is_not_convex_is_closed_and_has_its_volume() -> None:
    vertices, faces = extruded(L_SHAPE, 0.5)
    assert volume(vertices, faces) == pytest.approx(4.0 * 0.5)
    assert Mesh(vertices, faces).closed


def test_a_prism_does_not_depend_on_the_sense_of_its_polygon() -> None:
    assert volume(*extruded(L_SHAPE[::-1], 0.5)) == pytest.approx(volume(*extruded(L_SHAPE, 0.5)))


def test_sharp_edges_are_split_and_smooth_ones_are_not() -> None:
    box = extruded(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), 1.0)
    pipe = tube(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), 0.5, sides=24)
    assert len(split_creases(*box)[0]) == 24  # each of the 6 sides has its own 4 corners
    assert len(split_creases(*pipe)[0]) == 48


def test_splitting_moves_no_corner_of_any_triangle() -> None:
    vertices, faces = extruded(L_SHAPE, 0.5)
    split, corners = split_creases(vertices, faces)
    assert np.array_equal(split[corners], vertices[faces])


def test_a_thinned_mesh_keeps_to_the_limit_and_nearly_to_its_box() -> None:
    vertices, faces = Capsule(0.3, 1.0).surface(segments=160)
    thin_vertices, thin_faces = thin_out(vertices, faces, 2000)
    assert 500 < len(thin_faces) <= 2000 < len(faces)
    assert np.allclose(np.ptp(thin_vertices, axis=0), [0.6, 0.6, 1.6], atol=0.1)
    assert volume(thin_vertices, thin_faces) == pytest.approx(volume(vertices, faces), rel=0.1)


def test_a_scene_that_is_drawn_coarser_says_so_in_the_page_and_by_a_warning() -> None:
    fine = Mesh(*Capsule(0.3, 1.0).surface(segments=400))
    rough = Mesh(*extruded(L_SHAPE, 0.5))
    assert len(fine.surface()[1]) > MAX_OBSTACLE_TRIANGLES
    assert page_text(Scene([Obstacle("rough", rough)]), "coarser") == ""
    with pytest.warns(PictureWarning, match=f"'fine' with at most 30,000 of its {len(fine.surface()[1]):,} triangles"):
        said = page_text(Scene([Obstacle("fine", fine), Obstacle("rough", rough)]), "coarser")
    assert "'fine'" in said
    assert "rough" not in said


def page_text(scene: Scene, name: str) -> str:
    story = re.search(r'<script id="story" type="application/json">\n(.*)\n</script>', page(scene))
    assert story is not None
    return str(json.loads(story[1])[name])


def test_a_mesh_below_the_limit_is_not_touched() -> None:
    vertices, faces = extruded(L_SHAPE, 0.5)
    same_vertices, same_faces = thin_out(vertices, faces, 1000)
    assert same_vertices is vertices
    assert same_faces is faces


def test_a_tube_stays_at_its_radius_around_a_line_with_a_corner() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])
    vertices, _ = tube(points, 0.1)
    rings = vertices.reshape(4, -1, 3)
    assert np.allclose(np.linalg.norm(rings - points[:, None], axis=2), 0.1)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        (Box([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]),
        (Sphere(0.5), [1.0, 1.0, 1.0]),
        (Cylinder(0.5, 3.0), [1.0, 1.0, 3.0]),
        (Capsule(0.5, 3.0), [1.0, 1.0, 4.0]),
        (Prism(L_SHAPE, 0.5), [2.0, 3.0, 0.5]),
        (Mesh([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]), [1, 2, 3]),
    ],
    ids=lambda value: type(value).__name__,
)
def test_every_bounded_shape_is_drawn_with_its_own_box(shape: Shape, size: list[float]) -> None:
    assert np.allclose(np.ptp(look_of_shape(shape).corners, axis=0), size, atol=1e-9)


@pytest.mark.parametrize("shape", [Box([1.0, 2.0, 3.0]), Sphere(0.5), Cylinder(0.5, 3.0), Capsule(0.5, 3.0)])
def test_a_robot_geometry_of_coal_is_drawn_like_the_shape_it_is(shape: Shape) -> None:
    look = look_of_coal(pieces(shape)[0].geometry)
    assert look is not None
    assert np.allclose(look.corners, look_of_shape(shape).corners)


def test_the_plate_of_a_half_space_has_its_upper_side_in_the_plane() -> None:
    plane = HalfSpace([1.0, 2.0, 2.0], 3.0)
    look, pose = half_space_plate(plane, [5.0, 0.0, 0.0], 2.0)
    corners = look.corners @ pose[:3, :3].T + pose[:3, 3]
    heights = corners @ plane.normal - plane.offset
    assert heights.max() == pytest.approx(0.0, abs=1e-12)
    assert np.isclose(heights, 0.0).sum() == 4


def test_what_is_too_thin_to_be_seen_is_drawn_as_a_rod_or_a_bead() -> None:
    rod = thickened(look_of_shape(Capsule(1e-4, 2.0)), 0.05)
    assert np.allclose(np.ptp(rod.corners, axis=0), [0.05, 0.05, 2.0], atol=1e-2)
    bead = thickened(look_of_shape(Cylinder(1e-4, 1e-4)), 0.05)
    assert isinstance(bead.geometry, SphereGeometry)
    assert 0.025 <= bead.geometry.radius <= 0.05


def test_what_can_be_seen_is_drawn_as_it_is() -> None:
    plate = look_of_shape(Box([1.0, 1.0, 1e-3]))
    assert thickened(plate, 0.05) is plate
