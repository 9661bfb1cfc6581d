"""Meshes that are not convex."""

import numpy as np

from rrtik_ompl.geometry.collision.solids import bvh

KINDS = ["angle", "open", "two shells", "dented", "hollow"]


def angle():
    """A closed prism in the form of an L: vertices and triangles."""
    floor = 0.08 * np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float) - 0.08
    vertices = np.vstack([np.column_stack([floor, np.full(6, z)]) for z in (-0.06, 0.06)])
    top = [(6, 6 + k, 7 + k) for k in range(1, 5)]
    bottom = [(0, k + 1, k) for k in range(1, 5)]
    around = [(k, (k + 1) % 6) for k in range(6)]
    sides = [face for a, b in around for face in ((a, b, b + 6), (a, b + 6, a + 6))]
    return vertices, np.array([*top, *bottom, *sides])


def bent_meshes_of(dented_cube):
    """By kind: closed, open, of two shells that overlap, dented, and with a hollow."""
    vertices, triangles = angle()
    cube, hollow = dented_cube(0.12, 0.12), dented_cube(0.04, 0.04)
    corners, faces = np.array(cube.vertices), np.array(cube.triangles)
    turned = np.array(hollow.triangles)[:, ::-1]
    shift, dented = np.array([0.1, 0.05, 0.02]), dented_cube(0.12, -0.06)
    return {
        "angle": bvh(vertices, triangles),
        "open": bvh(vertices, triangles[1:]),
        "two shells": bvh(np.vstack([corners, corners + shift]), np.vstack([faces, faces + len(corners)])),
        "dented": bvh(dented.vertices, dented.triangles),
        "hollow": bvh(np.vstack([corners, hollow.vertices]), np.vstack([faces, turned + len(corners)])),
    }


def slotted_cube(cube, width):
    """The cube between -1 and 1 whose top has a slot of a width along x."""
    bottom_and_sides = [t for t in cube.triangles.tolist() if not (cube.vertices[t][:, 2] > 0).all()]
    y = width / 2
    top = np.array([[sx, sy, 1.0] for sy in (-1.0, -y, y, 1.0) for sx in (-1.0, 1.0)])
    first = len(cube.vertices)
    strips = [(0, 1, 3), (0, 3, 2), (4, 5, 7), (4, 7, 6)]
    faces = bottom_and_sides + [tuple(first + k for k in strip) for strip in strips]
    return np.vstack([cube.vertices, top]), np.array(faces)
