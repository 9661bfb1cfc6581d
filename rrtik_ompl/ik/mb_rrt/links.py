"""A chain of links with free joints, as MB-RRT [3] models an arm, and the regions in which its joints are useful."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import wrapped

ROUNDING = 1e-12  # share of the reach; a goal this far outside counts as reachable


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """A chain of links from the origin on, each of which may point anywhere in the plane or in space.

    The links after the joint of index i, i = 0..n, span exactly the distances from ``min_span[i]`` to ``max_span[i]``,
    in the plane and in space. So joint i of any solution lies in that ring or shell about the goal [3].

    Attributes:
        lengths: Lengths of the links, base first, shape (n,); all numbers share one unit of length.
        dimension: 2 for the plane, 3 for space.
        max_span: Total length of the links after index i, shape (n + 1,).
        min_span: The smallest distance that these links can span, shape (n + 1,).
    """

    lengths: Vector
    dimension: int
    max_span: Vector
    min_span: Vector

    def __init__(self, lengths: ArrayLike, dimension: int = 2) -> None:
        """Make a chain.

        Raises:
            InputError: If there is no link, a length is not above 0, or the dimension is neither 2 nor 3.
        """
        sizes = finite_array(lengths, (None,), "lengths")
        if len(sizes) == 0 or (sizes <= 0.0).any():
            raise InputError(f"lengths must be one or more numbers greater than 0, got {sizes.tolist()}")
        if dimension not in (2, 3):
            raise InputError(f"dimension must be 2 or 3, got {dimension!r}")
        max_span = np.append(np.cumsum(sizes[::-1])[::-1], 0.0)
        object.__setattr__(self, "lengths", frozen(sizes))
        object.__setattr__(self, "dimension", dimension)
        object.__setattr__(self, "max_span", frozen(max_span))
        object.__setattr__(self, "min_span", frozen(smallest_spans(sizes, max_span)))

    @property
    def count(self) -> int:
        """Number of links."""
        return len(self.lengths)

    @property
    def reach(self) -> float:
        """Sum of the lengths."""
        return float(self.max_span[0])

    def shortfall(self, goals: ArrayLike) -> Vector:
        """Return how far goals, shape (m, dimension), lie beyond the reach or inside the hole around the base.

        Shape (m,); 0 for a goal in reach.
        """
        distance = np.linalg.norm(finite_array(goals, (None, self.dimension), "goals"), axis=1)
        outside = np.maximum(distance - self.max_span[0], self.min_span[0] - distance)
        short: Vector = np.where(outside > ROUNDING * self.reach, outside, 0.0)
        return short

    def reachable(self, goal: ArrayLike) -> Vector:
        """Check that a goal is in reach and return it as an array, shape (dimension,).

        Raises:
            InputError: If the chain cannot reach it; the message says by how much.
        """
        point = finite_array(goal, (self.dimension,), "goal")
        short = float(self.shortfall(point[None])[0])
        if short > 0.0:
            raise InputError(
                f"goal: at distance {np.linalg.norm(point):.6g} from the base it is out of reach by {short:.4g}; "
                f"the links reach from {self.min_span[0]:.6g} to {self.reach:.6g}"
            )
        return point.copy()


def smallest_spans(lengths: Vector, max_span: Vector) -> Vector:
    """Return the smallest distance that the links after each index can span, shape (n + 1,).

    It is max(0, 2 max d_j - sum d_j): the longest link, with all others folded back along it.
    """
    longest = np.append(np.maximum.accumulate(lengths[::-1])[::-1], 0.0)
    spans: Vector = np.maximum(0.0, 2.0 * longest - max_span)
    return spans


def directions(count: int, dimension: int, rng: np.random.Generator) -> Matrix:
    """Draw unit vectors, uniform on the circle or the sphere, shape (count, dimension)."""
    vectors = rng.normal(size=(count, dimension))
    units: Matrix = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return units


def sunflower(links: Links, count: int) -> Matrix:
    """Return goals spread evenly over the disc or ball that the chain reaches, the same at every call.

    The radii are L ((k + 1/2) / N)^(1/dimension) at golden angles; in space the heights are spread evenly too. Shape
    (count, dimension).
    """
    k = np.arange(count)
    radius = links.reach * ((k + 0.5) / count) ** (1.0 / links.dimension)
    angle = k * (3.0 - np.sqrt(5.0)) * np.pi
    flat = np.column_stack([np.cos(angle), np.sin(angle)])

    if links.dimension == 2:
        disc: Matrix = radius[:, None] * flat
        return disc

    height = 2.0 * ((k * 0.7548776662466927 + 0.5) % 1.0) - 1.0  # The plastic number makes it independent of the angle.
    sphere = np.column_stack([np.sqrt(1.0 - height**2)[:, None] * flat, height])
    spread: Matrix = radius[:, None] * sphere
    return spread


def headings_to_joints(chains: Matrix) -> Matrix:
    """Return the joint angles of planar chains of nodes, shape (..., n + 1, 2): each link relative to the one before.

    Angles in [-pi, pi), shape (..., n).
    """
    edges = np.diff(chains, axis=-2)
    heading = np.arctan2(edges[..., 1], edges[..., 0])
    turns = np.diff(heading, axis=-1, prepend=0.0)
    relative: Matrix = wrapped(turns)
    return relative


def joints_to_chain(lengths: Vector, joints: Matrix) -> Matrix:
    """Return the nodes of planar arms, base first, for joint angles, shape (..., n); shape (..., n + 1, 2)."""
    heading = np.cumsum(joints, axis=-1)
    edges = lengths[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    chain: Matrix = np.concatenate([np.zeros_like(edges[..., :1, :]), np.cumsum(edges, axis=-2)], axis=-2)
    return chain
