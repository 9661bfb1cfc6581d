"""Shapes as coal solids."""

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.collision.certificate import overlap
from rrtik_ompl.collision.solids import convex_parts, hull, inside_mesh, pieces
from rrtik_ompl.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Sphere

LETTER_E = [
    (8, 4),
    (18, 4),
    (18, 7),
    (11, 7),
    (11, 11),
    (18, 11),
    (18, 14),
    (11, 14),
    (11, 18),
    (18, 18),
    (18, 21),
    (8, 21),
]
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]


def area(polygon):
    x, y = np.asarray(polygon, dtype=float).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def touches(shape, point):
    pose = np.eye(4)
    pose[:3, 3] = point
    return any(overlap(p.geometry, p.placement.homogeneous, coal.Sphere(1e-6), pose) for p in pieces(shape))


@pytest.mark.parametrize(
    ("shape", "inside", "outside"),
    [
        (Box([2, 4, 6]), (0.99, 1.99, 2.99), (1.01, 0, 0)),
        (Sphere(0.5), (0.28, 0.28, 0.28), (0.3, 0.3, 0.3)),
        (Cylinder(0.5, 2.0), (0.0, 0.49, 0.99), (0.0, 0.0, 1.01)),
        (Capsule(0.5, 2.0), (0.0, 0.0, 1.49), (0.0, 0.0, 1.51)),
        (HalfSpace([0, 0, 2], -2.0), (5.0, 5.0, -1.01), (5.0, 5.0, -0.99)),
        (Prism(LETTER_E, 1.0), (9.5, 12.5, 0.49), (15.0, 9.0, 0.0)),
        (Mesh(CUBE, FACES), (0.5, 0.5, 0.5), (0.5, 0.5, 1.01)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_shape_is_where_its_definition_says(shape, inside, outside):
    assert touches(shape, inside)
    assert not touches(shape, outside)


@given(st.lists(st.floats(0.3, 2.0), min_size=3, max_size=12))
def test_convex_parts_tile_a_star_shaped_polygon(radii):
    angles = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    polygon = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    parts = convex_parts(polygon)
    assert sum(area(p) for p in parts) == pytest.approx(area(polygon), rel=1e-9)
    for part in parts:
        a, b, c = part, np.roll(part, -1, axis=0), np.roll(part, -2, axis=0)
        turns = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        assert (turns >= -1e-12).all()


def test_the_sense_of_a_polygon_does_not_matter():
    assert len(convex_parts(np.array(LETTER_E, dtype=float))) == len(
        convex_parts(np.array(LETTER_E[::-1], dtype=float))
    )


def test_a_convex_mesh_becomes_a_solid_and_a_hollow_one_stays_a_mesh():
    bent = np.vstack([CUBE, [[0.5, 0.5, 0.2]]])  # a dent in the top: not convex
    dented = [f for f in FACES if f not in ((1, 5, 7), (1, 7, 3))] + [(1, 5, 8), (5, 7, 8), (7, 3, 8), (3, 1, 8)]
    assert isinstance(pieces(Mesh(CUBE, FACES))[0].geometry, coal.ConvexBase)
    assert isinstance(pieces(Mesh(bent, dented))[0].geometry, coal.BVHModelBase)


@given(st.tuples(*[st.floats(-0.5, 1.5)] * 3))
def test_inside_mesh_agrees_with_the_cube(point):
    if min(abs(c - e) for c in point for e in (0.0, 1.0)) > 1e-6:
        assert inside_mesh(CUBE, np.array(FACES), np.array(point)) == all(0.0 < c < 1.0 for c in point)


def test_hull_of_a_cube_has_its_volume():
    assert hull(CUBE).computeVolume() == pytest.approx(1.0)
