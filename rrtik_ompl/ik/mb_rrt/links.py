"""A chain of links with free joints, as MB-RRT [3] models an arm, and where its joints can usefully be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import wrapped

ROUNDING = 1e-12  # of the reach: a goal this far outside counts as reachable


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """Links from the origin on, joined so that each may point anywhere in the plane or in space.

    After the joint of index i, i = 0..n, the links still to come span every distance from ``min_span[i]`` to
    ``max_span[i]`` and no other, in the plane and in space: joint i of any solution lies in that ring or
    shell about the goal [3].

    Attributes:
        lengths: Base first, shape (n,); one unit of length for all numbers.
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
        """How far goals, shape (m, dimension), lie beyond the reach or inside the hole around the base; (m,)."""
        distance = np.linalg.norm(finite_array(goals, (None, self.dimension), "goals"), axis=1)
        outside = np.maximum(distance - self.max_span[0], self.min_span[0] - distance)
        short: Vector = np.where(outside > ROUNDING * self.reach, outside, 0.0)
        return short

    def reachable(self, goal: ArrayLike) -> Vector:
        """The goal as an array, shape (dimension,).

        Raises:
            InputError: If the chain cannot reach it; says by how much.
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
    """max(0, 2 max d_j - sum d_j) over the links after each index, shape (n + 1,): the longest must be folded back."""
    longest = np.append(np.maximum.accumulate(lengths[::-1])[::-1], 0.0)
    spans: Vector = np.maximum(0.0, 2.0 * longest - max_span)
    return spans


def directions(count: int, dimension: int, rng: np.random.Generator) -> Matrix:
    """Unit vectors, uniform on the circle or the sphere, shape (count, dimension)."""
    vectors = rng.normal(size=(count, dimension))
    units: Matrix = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return units


def sunflower(links: Links, count: int) -> Matrix:
    """Goals spread evenly over the disc or the ball that the chain reaches, the same at every call.

    Radii L ((k + 1/2) / N)^(1/dimension) at golden angles, in space around heights that are spread
    evenly too. Shape (count, dimension).
    """
    k = np.arange(count)
    radius = links.reach * ((k + 0.5) / count) ** (1.0 / links.dimension)
    angle = k * (3.0 - np.sqrt(5.0)) * np.pi
    flat = np.column_stack([np.cos(angle), np.sin(angle)])

    if links.dimension == 2:
        disc: Matrix = radius[:, None] * flat
        return disc

    height = 2.0 * ((k * 0.7548776662466927 + 0.5) % 1.0) - 1.0  # the plastic number keeps it apart from the angle
    sphere = np.column_stack([np.sqrt(1.0 - height**2)[:, None] * flat, height])
    spread: Matrix = radius[:, None] * sphere
    return spread


def headings_to_joints(chains: Matrix) -> Matrix:
    """Joint angles of planar chains of nodes, shape (..., n + 1, 2): each link against the last, in [-pi, pi)."""
    edges = np.diff(chains, axis=-2)
    heading = np.arctan2(edges[..., 1], edges[..., 0])
    turns = np.diff(heading, axis=-1, prepend=0.0)
    relative: Matrix = wrapped(turns)
    return relative


def joints_to_chain(lengths: Vector, joints: Matrix) -> Matrix:
    """Nodes of planar arms, base first, for joint angles of shape (..., n); shape (..., n + 1, 2)."""
    heading = np.cumsum(joints, axis=-1)
    edges = lengths[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    chain: Matrix = np.concatenate([np.zeros_like(edges[..., :1, :]), np.cumsum(edges, axis=-2)], axis=-2)
    return chain
