"""Hold the data of all bodies of a world in arrays, so that checks need one call however many bodies there are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from weakref import WeakValueDictionary

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body, contact_distance

UNBOUNDED_METRES = 1e9  # [m] half extent of a half-space's box


@dataclass(frozen=True, eq=False)
class BodyArrays:
    """The data of n bodies.

    Attributes:
        joints: Pinocchio's numbers of their joints, 0 for bodies that stand still, shape (n,).
        placements: Their poses in the joints' frames, shape (n, 4, 4).
        centres, halves: Centres and half extents of their bounding boxes in their own frames [m], shape (n, 3) each; a
            half-space has a practically endless box about its origin.
        half_spaces, obstacles: Masks of the half-spaces and of the obstacles, shape (n,) each.
        margins: Distance that others must keep from each body [m], shape (n,).
        paddings: Thickness that is added around each body [m], shape (n,).
        touching: Mask of the bodies that are in contact with another one, shape (n,).
        contacts: Least allowed distance of two bodies in contact [m], negative for a penetration depth, by the numbers
            of the bodies, the smaller one first.
    """

    joints: NDArray[np.int64]
    placements: NDArray[np.float64]
    centres: Matrix
    halves: Matrix
    half_spaces: Mask
    obstacles: Mask
    margins: Vector
    paddings: Vector
    touching: Mask
    contacts: Mapping[tuple[int, int], float]

    def kept_apart(self, pairs: NDArray[np.int64]) -> Vector:
        """Return the distances that bodies must keep [m], for pairs of shape (k, 2); see :func:`.bodies.kept_apart`."""
        first, second = pairs.T
        both_stand = (self.joints[first] == 0) & (self.joints[second] == 0)
        margin = self.margins[np.where(self.obstacles[second], second, first)]
        separation: Vector = np.where(both_stand, 0.0, margin + self.paddings[first] + self.paddings[second])

        for rows, distance in self._contacts_among(pairs):
            separation[rows] = np.minimum(separation[rows], distance)
        return separation

    def least_gaps(self, pairs: NDArray[np.int64], frames: NDArray[np.float64]) -> Vector:
        """Return lower bounds of the distances of bodies [m], shape (k,), by the boxes around them.

        Args:
            pairs: Numbers of the bodies, shape (k, 2).
            frames: Pose of every joint frame in the world, the world's own first, shape (joints + 1, 4, 4).
        """
        poses = frames[self.joints] @ self.placements
        turns = poses[:, :3, :3]
        centres = np.einsum("nij,nj->ni", turns, self.centres) + poses[:, :3, 3]
        radii = np.sqrt(np.einsum("ni,ni->n", self.halves, self.halves))

        # The ball around one body is apart from the box around the other.
        gaps = []
        for one, other in (pairs.T, pairs.T[::-1]):
            inside = np.einsum("nji,nj->ni", turns[other], centres[one] - centres[other])
            beyond = np.maximum(np.abs(inside) - self.halves[other], 0.0)
            gaps.append(np.sqrt(np.einsum("ni,ni->n", beyond, beyond)) - radii[one])
        least: Vector = np.maximum(*gaps)
        return least

    def in_contact(self, pairs: NDArray[np.int64]) -> Mask:
        """Return a mask, shape (k,), of the pairs, shape (k, 2), whose bodies are in contact."""
        in_contact: Mask = np.zeros(len(pairs), dtype=bool)
        for rows, _ in self._contacts_among(pairs):
            in_contact[rows] = True
        return in_contact

    def _contacts_among(self, pairs: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], float]]:
        """Yield the rows of pairs, shape (k, 2), that are of each contact, and its least allowed distance [m]."""
        touching = np.flatnonzero(self.touching[pairs].all(axis=1))
        if not len(touching):
            return
        first, second = pairs[touching].T
        for (i, j), distance in self.contacts.items():
            yield touching[((first == i) & (second == j)) | ((first == j) & (second == i))], distance


def _contacts(bodies: Sequence[Body]) -> dict[tuple[int, int], float]:
    """Return the least allowed distances of bodies in contact; see :attr:`BodyArrays.contacts`."""
    contacts = {}
    touching = [k for k, body in enumerate(bodies) if body.contacts]
    for i, j in combinations(touching, 2):
        distance = contact_distance(bodies[i], bodies[j])
        if distance is not None:
            contacts[i, j] = distance
    return contacts


# Several checks of one world use the same arrays, which are kept for as long as one of the checks holds them.
_KNOWN: WeakValueDictionary[tuple[Body, ...], BodyArrays] = WeakValueDictionary()


def body_arrays(bodies: Sequence[Body]) -> BodyArrays:
    """Return the data of bodies as arrays; the same object for the same bodies, while it is in use."""
    key = tuple(bodies)
    arrays = _KNOWN.get(key)
    if arrays is None:
        _KNOWN[key] = arrays = _body_arrays(key)
    return arrays


def arrays_in_contact(arrays: BodyArrays, bodies: tuple[Body, ...]) -> BodyArrays:
    """Return the data of bodies from that of the same bodies with other contacts."""
    known = _KNOWN.get(bodies)
    if known is None:
        touching = np.array([bool(body.contacts) for body in bodies], dtype=bool)
        _KNOWN[bodies] = known = replace(arrays, touching=touching, contacts=_contacts(bodies))
    return known


def _body_arrays(bodies: tuple[Body, ...]) -> BodyArrays:
    """Collect the data of bodies; a half-space gets a box that is practically endless."""
    boxes = [body.geometry.aabb_local for body in bodies]
    half_spaces = np.array([isinstance(body.geometry, coal.Halfspace) for body in bodies], dtype=bool)
    low, high = (np.array(ends).reshape(-1, 3) for ends in ([b.min_ for b in boxes], [b.max_ for b in boxes]))
    low[half_spaces] = -UNBOUNDED_METRES
    high[half_spaces] = UNBOUNDED_METRES

    return BodyArrays(
        joints=np.array([body.joint for body in bodies], dtype=np.int64),
        placements=np.array([body.placement.homogeneous for body in bodies]).reshape(-1, 4, 4),
        centres=0.5 * low + 0.5 * high,
        halves=0.5 * high - 0.5 * low,
        half_spaces=half_spaces,
        obstacles=np.array([body.kind == "obstacle" for body in bodies], dtype=bool),
        margins=np.array([body.margin for body in bodies]),
        paddings=np.array([body.padding for body in bodies]),
        touching=np.array([bool(body.contacts) for body in bodies], dtype=bool),
        contacts=_contacts(bodies),
    )
