"""The published variants of MB-RRT [3]: how a sample is drawn and which node it is joined to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.ik.mb_rrt.links import Links, directions

Draw = Callable[[Links, Vector, int, int, np.random.Generator], Matrix]
Rule = Callable[[Matrix, float], Matrix]


@dataclass(frozen=True, slots=True)
class Variant:
    """One configuration of the method.

    Attributes:
        name: By which it is chosen.
        title: As [3] calls it.
        draw: Samples for the joint of an index, from (links, goal, index, count, rng), shape (count, dimension).
        rule: What the parent must have least of, from squared distances to the sample and the link's length.
    """

    name: str
    title: str
    draw: Draw
    rule: Rule


def square(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """Uniform in the square, or cube, around the base that holds the whole reach."""
    return rng.uniform(-links.reach, links.reach, (count, links.dimension))


def square_then_goal(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """As `square`, and the goal itself for the last index: the "*" option."""
    if index < links.count:
        return square(links, goal, index, count, rng)
    return np.broadcast_to(goal, (count, links.dimension))


def surface(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """On the circle, or sphere, around the goal whose radius is the length still to come."""
    circle: Matrix = goal + links.max_span[index] * directions(count, links.dimension, rng)
    return circle


def projected(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """As `square`, then moved straight to or from the goal onto the circle of `surface` [3, section 4.3]."""
    from_goal = square(links, goal, index, count, rng) - goal
    distance = np.linalg.norm(from_goal, axis=1, keepdims=True)
    on_circle: Matrix = goal + links.max_span[index] * from_goal / np.maximum(distance, np.finfo(float).tiny)
    return on_circle


def nearest(squared: Matrix, length: float) -> Matrix:
    """Rule A: the nearest node."""
    return squared


def one_link_away(squared: Matrix, length: float) -> Matrix:
    """Rule B: the node whose distance from the sample is closest to the link's length."""
    off = np.sqrt(squared, out=squared)
    off -= length
    return np.abs(off, out=off)


VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {
        each.name: each
        for each in (
            Variant("uniform-a", "RRT Uniforme A", square, nearest),
            Variant("uniform-b", "RRT Uniforme B", square, one_link_away),
            Variant("uniform-a-star", "RRT Uniforme A*", square_then_goal, nearest),
            Variant("uniform-b-star", "RRT Uniforme B*", square_then_goal, one_link_away),
            Variant("projected-a", "RRT, projected samples, A", projected, nearest),
            Variant("projected-b", "RRT, projected samples, B", projected, one_link_away),
            Variant("surface-a", "RRT Superficie A", surface, nearest),
            Variant("surface-b", "RRT Superficie B (MB-RRT)", surface, one_link_away),
        )
    }
)


def variant(name: str) -> Variant:
    """The variant of a name.

    Raises:
        UnknownNameError: If there is none.
    """
    if name not in VARIANTS:
        raise UnknownNameError("variant of MB-RRT", name, VARIANTS)
    return VARIANTS[name]
