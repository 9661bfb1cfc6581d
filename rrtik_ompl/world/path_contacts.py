"""Where bodies touch along a path: which ones, from where to where, and how deep at the worst place."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.judgement import PathContact
from rrtik_ompl.world.clearance_curve import places_along

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World


def contacts_along(world: World, waypoints: Matrix) -> tuple[PathContact, ...]:
    """The contacts of a path, waypoints of shape (k, dof), at places spread evenly over how far the arm moves.

    A contact that is shorter than the way between two places can be missed: this shows what is wrong with a path, and
    is no check of it.
    """
    motions, shares, places = places_along(world, waypoints)
    return contacts_at(world, motions + shares, places)


def contacts_at(world: World, at: Vector, places: Matrix) -> tuple[PathContact, ...]:
    """The contacts at configurations, shape (m, dof), that stand at places, shape (m,), in their order."""
    blocked = np.flatnonzero(~world.valid_batch(places))
    contacts_of_place = {int(k): found for k in blocked if (found := world.contacts(places[k]))}
    names_of_place = {
        k: frozenset(name for c in found for name in (c.first, c.second)) for k, found in contacts_of_place.items()
    }

    def stretch(item: tuple[int, int]) -> tuple[int, frozenset[str]]:
        """What is the same for blocked places that follow each other and at which the same bodies touch."""
        count, place = item
        return place - count, names_of_place[place]

    stretches = []
    for (_, together), run in groupby(enumerate(contacts_of_place), stretch):
        numbers = [k for _, k in run]
        deepest = min((contacts_of_place[k][0] for k in numbers), key=lambda contact: contact.clearance)
        stretches.append(PathContact(float(at[numbers[0]]), float(at[numbers[-1]]), deepest, together))
    return tuple(stretches)
