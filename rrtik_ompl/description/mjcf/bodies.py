"""Which bodies of an MJCF may collide with which, as MuJoCo decides it by joints and by the masks of geoms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

WORLD = "world"
HELD = ("free",)  # kinds of joints that are held still

Mask = tuple[int, int]  # contype and conaffinity


@dataclass(frozen=True, slots=True)
class Body:
    """A body: the one that it hangs on, and the kinds of the joints between the two."""

    parent: str
    joints: tuple[str, ...]


def meet(first: Mask, second: Mask) -> bool:
    """Whether geoms with these masks may collide."""
    return bool(first[0] & second[1] or second[0] & first[1])


def solids_apart(masks: Mapping[str, Sequence[Mask]]) -> frozenset[frozenset[str]]:
    """Pairs of solids whose masks do not meet.

    Args:
        masks: Of the solids of each body, in their order.
    """
    return frozenset(
        frozenset((f"{first_body}_{i}", f"{second_body}_{j}"))
        for (first_body, first_masks), (second_body, second_masks) in combinations(masks.items(), 2)
        for (i, first_mask), (j, second_mask) in product(enumerate(first_masks), enumerate(second_masks))
        if not meet(first_mask, second_mask)
    )


def joined_bodies(bodies: Mapping[str, Body]) -> frozenset[frozenset[str]]:
    """Pairs of bodies that joints join, and what is welded to one of the two: neighbours, to MuJoCo.

    Here each of several joints has a link of its own behind it, and what is welded to a link is another link.
    """
    rigid_parts: dict[str, list[str]] = {}
    for name in bodies:
        rigid_parts.setdefault(_carrier(name, bodies), []).append(name)
    moving = [name for name, body in bodies.items() if _moving_joint_kinds(body)]
    pairs = {
        frozenset(pair)
        for name in moving
        for pair in product(rigid_parts[name], rigid_parts[_carrier(bodies[name].parent, bodies)])
    }

    return frozenset(pairs) - touchable(bodies)


def touchable(bodies: Mapping[str, Body]) -> frozenset[frozenset[str]]:
    """Pairs of bodies that may collide though one joint joins them: one stands still, the other moves.

    Bodies that are welded to the world are no neighbours of others to MuJoCo. What is rigidly part of a free body is.
    """
    standing = [name for name in bodies if _carrier(name, bodies) == WORLD]
    pairs = set()
    for name in bodies:
        base = bodies[_carrier(name, bodies)].parent
        if base in standing:
            base_anchor = _welded(base, bodies)
            pairs |= {
                frozenset((name, other))
                for other in standing
                if base_anchor == WORLD or _welded(other, bodies) != base_anchor
            }
    return frozenset(pairs)


def _moving_joint_kinds(body: Body) -> tuple[str, ...]:
    """Kinds of the joints that move a body against the one that it hangs on."""
    return tuple(kind for kind in body.joints if kind not in HELD)


def _ancestry(name: str, bodies: Mapping[str, Body]) -> Iterator[str]:
    """A body, the one that it hangs on, and so on to the world."""
    while name:
        yield name
        name = bodies[name].parent


def _carrier(name: str, bodies: Mapping[str, Body]) -> str:
    """The nearest body towards the world, itself among them, that a joint moves; the world if there is none."""
    return next((ancestor for ancestor in _ancestry(name, bodies) if _moving_joint_kinds(bodies[ancestor])), WORLD)


def _welded(name: str, bodies: Mapping[str, Body]) -> str:
    """As `_carrier`, where a free joint counts as one that moves."""
    return next((ancestor for ancestor in _ancestry(name, bodies) if bodies[ancestor].joints), WORLD)
