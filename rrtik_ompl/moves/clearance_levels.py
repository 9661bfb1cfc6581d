"""Forms of a world that keep less and less room around obstacles: fewest moves come first, clearance second."""

from __future__ import annotations

from typing import NamedTuple

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.world import World
from rrtik_ompl.world.kept_clearance import CLEARANCE, Room, room_between

PREFERRED_CLEARANCE = 0.01  # [m] of single-joint moves, which a person may follow by hand


class Level(NamedTuple):
    """A form of a world.

    Attributes:
        clearance: What motions are proven to keep from obstacles [m].
        searched: A form whose searches in kernels keep more than that in steps.
        proving: The same, where motions have to be proven.
    """

    clearance: float
    searched: World
    proving: World


def clearance_levels(world: World, ends: Matrix, clearance: float | None) -> list[Level]:
    """The levels, from the clearance wanted down to none, or to checks in steps where no end is proven free.

    Args:
        world: As it is.
        ends: Where moves begin and end, shape (k, dof); all of them keep all levels.
        clearance: Wanted [m]; None for a centimetre. Less is kept where the ends have less.
    """
    room = roomiest(world, ends, clearance)
    if room is None:
        return [Level(0.0, world, world)]
    kept = sorted({room.kept, min(room.kept, CLEARANCE), 0.0}, reverse=True)
    return [_level(world, each, min(room.searched, each + min(each, CLEARANCE))) for each in kept]


def roomiest(world: World, ends: Matrix, clearance: float | None) -> Room | None:
    """As :func:`room_between`, with a centimetre where nothing is said."""
    return room_between(world, ends, PREFERRED_CLEARANCE if clearance is None else clearance)


def _level(world: World, kept: float, searched: float) -> Level:
    roomy = world.with_clearance(searched)
    return Level(kept, roomy, roomy.proving(kept))
