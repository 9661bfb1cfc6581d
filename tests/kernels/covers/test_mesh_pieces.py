"""Convex pieces of a mesh contain it, and none of them lies in its hollow."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import bvh, inside_mesh, mesh_arrays
from rrtik_ompl.kernels.covers.mesh_pieces import convex_pieces
from rrtik_tests.bent_meshes import KINDS


def holding(pieces, points):
    """Which points, shape (n, 3), lie in one of some pieces."""
    planes = [ConvexHull(piece, qhull_options="QJ").equations for piece in pieces]  # pieces may be flat
    found = [(points @ p[:, :3].T + p[:, 3] <= 1e-7).all(axis=1) for p in planes]
    return np.any(found, axis=0) if found else np.zeros(len(points), dtype=bool)


@pytest.mark.parametrize("kind", KINDS)
def test_pieces_of_a_mesh_contain_it_and_those_inside_are_inside(bent_meshes, kind):
    vertices, triangles = mesh_arrays(bent_meshes[kind])
    rng = np.random.default_rng(0)
    around, inside, points = convex_pieces(bent_meshes[kind])
    weights = rng.dirichlet(np.ones(3), 4000)
    surface = np.einsum("nk,nkj->nj", weights, vertices[triangles[rng.integers(len(triangles), size=4000)]])
    assert holding(around, surface).all()
    assert holding(around, np.concatenate(points)).all()
    cloud = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (1500, 3))
    if kind == "open":
        enclosed = np.array([enclosure(bent_meshes[kind]).holds(p[None]) for p in cloud])
        assert holding(around, cloud[enclosed]).all()
        assert inside == []
        return
    held = np.array([inside_mesh(vertices, triangles, p) for p in cloud])
    assert holding(around, cloud[held]).all()
    assert not holding(inside, cloud[~held]).any()
    if kind in ("angle", "two shells"):
        assert len(around) > 1
        assert holding(inside, cloud[held]).mean() > 0.95


def test_no_point_of_a_mesh_lies_in_its_hollow(dented_cube):
    """Cells that a ragged shell is cut into have corners in the middle, where the hollow is."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(30, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    faces = ConvexHull(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", a, np.cross(b, c)) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    hollow = dented_cube(0.2, 0.2)
    vertices = np.vstack([points * rng.uniform(0.4, 1.0, (30, 1)), hollow.vertices])
    triangles = np.vstack([faces, np.array(hollow.triangles)[:, ::-1] + 30])
    _, _, found = convex_pieces(bvh(vertices, triangles))
    assert len(found) > 4
    assert (np.abs(np.concatenate(found)).max(axis=1) > 0.2 - 1e-9).all()
