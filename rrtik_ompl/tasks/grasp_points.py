"""Sample pairs of points on the surface of a shape whose line lies in the friction cones of both [79], as in [80]."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.model.shapes import Capsule, Cylinder, Shape, Sphere

SAME = 1e-6  # [m] difference of two places that counts as none


def pairs(shape: Shape, cone: float, widest: float, tries: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Sample pairs of points on the surface of a shape that two fingers can press together.

    On balls, cylinders and capsules the normals of both points are along their line: there flat fingers touch them.

    Args:
        shape: The shape.
        cone: Cosine of half the angle of the friction cone.
        widest: Largest distance of the two points [m].
        tries: How many pairs are tried.
        rng: The source of random numbers.

    Returns:
        The pairs, in the frame of the shape, shape (k, 2, 3) [m].
    """
    if isinstance(shape, Sphere):
        ways = rng.normal(size=(tries, 3))
        half = shape.radius * ways / np.linalg.norm(ways, axis=1)[:, None]
        found = np.stack([half, -half], axis=1)
    elif isinstance(shape, Cylinder | Capsule):
        found = _pairs_of_cylinder(shape, tries, rng)
    else:
        surface = shape.surface()
        found = np.array([*_pairs_of_triangles(surface.vertices[surface.faces], cone, tries, rng)]).reshape(-1, 2, 3)
    narrow: NDArray[np.bool_] = np.linalg.norm(found[:, 1] - found[:, 0], axis=1) <= widest
    return found[narrow]


def _pairs_of_cylinder(shape: Cylinder | Capsule, tries: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Sample pairs of opposite points of a cylinder: across it or, unless its ends are round, from end to end."""
    turns = rng.uniform(0.0, TAU, tries)
    circle = np.stack([np.cos(turns), np.sin(turns), np.zeros(tries)], axis=1)
    along = shape.length * rng.uniform(-0.5, 0.5, tries)[:, None] * [0.0, 0.0, 1.0]
    pairs = np.stack([along + shape.radius * circle, along - shape.radius * circle], axis=1)

    if isinstance(shape, Cylinder):
        across = rng.random(tries) < shape.length / (shape.length + shape.radius)  # in proportion to the areas
        inside = shape.radius * np.sqrt(rng.random(tries))[:, None] * circle
        end = np.array([0.0, 0.0, 0.5 * shape.length])
        pairs = np.where(across[:, None, None], pairs, np.stack([inside + end, inside - end], axis=1))
    return pairs


def _pairs_of_triangles(
    corners: NDArray[np.float64], cone: float, tries: int, rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Yield pairs of points, shape (2, 3): one on a face, and the one behind it, where a line leaves.

    Every other line is along the face's normal, and the others are anywhere in its friction cone: two sides that slope
    towards each other, as those of a cone do, are pressed by a line along neither normal.

    Args:
        corners: Triangles, their corners anticlockwise from outside, shape (m, 3, 3).
        cone: Cosine of half the angle of the friction cone, in which the other point's normal is.
        tries: How many lines are tried.
        rng: The source of random numbers.
    """
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    solid = areas > 0.0
    first = corners[solid, 0]
    sides = sides[solid]
    areas = areas[solid]
    normals = normals[solid] / areas[:, None]

    for number, face in enumerate(rng.choice(len(normals), tries, p=areas / areas.sum())):
        shares = rng.random(2)
        if shares.sum() >= 1.0:
            shares = 1.0 - shares  # the other half of a parallelogram
        point = first[face] + shares @ sides[face]
        inward = -normals[face]
        if number % 2:
            inward = _within(inward, cone, rng)

        # Where the line meets the triangles, after Moeller and Trumbore.
        across = np.cross(inward, sides[:, 1])
        offset = point - first
        other = np.cross(offset, sides[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / np.einsum("ij,ij->i", sides[:, 0], across)
            a = scale * np.einsum("ij,ij->i", offset, across)
            b = scale * (other @ inward)
            far = scale * np.einsum("ij,ij->i", sides[:, 1], other)
            hits = np.flatnonzero((a >= 0.0) & (b >= 0.0) & (a + b <= 1.0) & (far > SAME))
        if len(hits):
            last = hits[far[hits].argmax()]
            if normals[last] @ inward >= cone:
                yield np.stack([point, point + far[last] * inward])


def _within(axis: NDArray[np.float64], cone: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw a direction within a cone about an axis, given the cosine of half its angle, evenly by solid angle."""
    along = rng.uniform(cone, 1.0)
    side = np.cross(axis, rng.normal(size=3))
    side /= np.linalg.norm(side)
    return np.asarray(along * axis + np.sqrt(max(1.0 - along**2, 0.0)) * side)
