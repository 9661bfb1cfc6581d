"""No solid is thinner than it is said to be."""

import itertools

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.geometry.collision.thickness import least_width

WEDGE = rrtik.Prism([[-0.03, -0.03], [0.03, -0.03], [0.03, 0.03]], 0.1)


def box_faces():
    return [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]


def box_mesh(sides, faces):
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * sides
    return rrtik.Mesh(corners, faces)


def shell(outer, wall):
    """A closed box with a closed hole inside: a hollow mesh."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    faces = np.array(box_faces())
    points = np.vstack([corners * outer, corners * (np.array(outer) - 2.0 * wall)])
    return rrtik.Mesh(points, np.vstack([faces, faces[:, ::-1] + 8]))


@pytest.mark.parametrize(
    ("shape", "width"),
    [
        (rrtik.Box([0.3, 0.2, 0.001]), 0.001),
        (rrtik.Sphere(0.05), 0.1),
        (rrtik.Cylinder(0.03, 0.1), 0.06),
        (rrtik.Cylinder(0.03, 0.01), 0.01),
        (rrtik.Capsule(0.02, 0.06), 0.04),
        (box_mesh([0.3, 0.2, 0.02], box_faces()), 0.02),
        (rrtik.PointCloud([[0, 0, 0], [1, 1, 1]], radius=0.005), 0.01),
        (rrtik.HalfSpace([0.0, 0.0, 1.0], 0.0), np.inf),
        (rrtik.Octree([[0, 0, 0], [1, 0, 0]], [0.1, 0.2]), 0.1),
        (box_mesh([0.3, 0.2, 0.02], box_faces()[:-1]), 0.0),  # open: a surface without an inside
        (shell([0.1, 0.1, 0.1], 0.002), 0.001),  # rays count half
    ],
)
def test_the_least_width_of_a_solid_is_known(shape, width):
    assert min(least_width(piece.geometry) for piece in pieces(shape)) == pytest.approx(width)


def test_no_convex_solid_is_thinner_than_its_least_width():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for count in (4, 5, 8, 20):
        points = rng.normal(size=(count, 3)) * [0.1, 0.1, 0.02]
        (piece,) = pieces(rrtik.Mesh(points, hull_faces(points)))
        least = np.ptp(np.array(piece.geometry.points()) @ directions.T, axis=0).min()
        assert 0.0 < least_width(piece.geometry) <= least
    (piece,) = pieces(WEDGE)
    assert 0.02 < least_width(piece.geometry) <= 0.06 / np.sqrt(2.0)


def hull_faces(points):
    """Triangles of a convex hull, turned outwards."""
    found = ConvexHull(points)
    faces = found.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0.0
    faces[turned] = faces[turned, ::-1]
    return faces
