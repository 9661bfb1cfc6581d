"""One solid of every kind of shape, some decimetres wide: what answers for each of them is compared with."""

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.shapes import HeightField, Mesh, Octree, Prism

DENTED = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.4, 0], [0.12, 0.12, 0.4], [0.12, 0.12, 0.06]])
DENTED_FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 0, 4], [0, 1, 3], [1, 2, 3], [2, 0, 3]])  # a dent in its bottom
ELL = [[0, 0], [0.4, 0], [0.4, 0.15], [0.15, 0.15], [0.15, 0.4], [0, 0.4]]


def one_of_each_shape(rng):
    """Shapes by what a person calls them."""
    hull = Mesh(DENTED[:4], [*DENTED_FACES[3:].tolist(), [0, 2, 1]])
    return {
        "box": rrtik.Box([0.3, 0.2, 0.4]),
        "ball": rrtik.Sphere(0.2),
        "capsule": rrtik.Capsule(0.08, 0.4),
        "cylinder": rrtik.Cylinder(0.12, 0.3),
        "half-space": rrtik.HalfSpace([0, 0, 1], 0.0),
        "prism": Prism(ELL, 0.3),
        "convex mesh": hull,
        "dented mesh": Mesh(DENTED, DENTED_FACES),
        "open mesh": Mesh(DENTED, DENTED_FACES[1:]),
        "cloud": rrtik.PointCloud(rng.uniform(-0.2, 0.2, (200, 3)), 0.02),
        "height field": HeightField(rng.uniform(0.05, 0.3, (4, 4)), cell=0.1, floor=-0.05),
        "octree": Octree(rng.integers(-2, 3, (20, 3)) * 0.1, np.full(20, 0.1)),
    }
