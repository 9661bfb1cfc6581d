"""Forms of a world that keep less and less room around obstacles: fewest moves come first, clearance second."""

from __future__ import annotations

from functools import cached_property

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.world.kept_clearance import CLEARANCE, Room, keeping, room_between
from rrtik_ompl.world.world import World

PREFERRED_CLEARANCE = 0.01  # [m] of single-joint moves, which a person may follow by hand


class Level:
    """A form of a world, made when it is first asked for.

    Attributes:
        clearance: What motions are proven to keep from obstacles [m].

    Args:
        world: As it is.
        clearance: See above; None where nothing is proven.
        searched: What searches in kernels keep in steps [m].
    """

    def __init__(self, world: World, clearance: float | None, searched: float) -> None:
        self._world = world
        self._kept = clearance
        self._searched = searched
        self.clearance = 0.0 if clearance is None else clearance

    @cached_property
    def searched(self) -> World:
        """A form whose searches in kernels keep more than the clearance in steps."""
        return keeping(self._world, self._searched)

    @cached_property
    def proving(self) -> World:
        """The same, where motions have to be proven."""
        return self.searched if self._kept is None else keeping(self._world, self._searched, proven=self._kept)


def clearance_levels(world: World, ends: Matrix, clearance: float | None) -> list[Level]:
    """The levels, from the clearance wanted down to none, or to checks in steps where no end is proven free.

    Args:
        world: As it is.
        ends: Where moves begin and end, shape (k, dof); all of them keep all levels.
        clearance: Wanted [m]; None for a centimetre. Less is kept where the ends have less.
    """
    room = roomiest(world, ends, clearance)
    if room is None:
        return [Level(world, None, 0.0)]
    least = world.settings.kept
    kept = sorted({room.kept, max(min(room.kept, CLEARANCE), least), least}, reverse=True)
    return [Level(world, each, min(room.searched, each + min(each, CLEARANCE))) for each in kept]


def roomiest(world: World, ends: Matrix, clearance: float | None) -> Room | None:
    """As :func:`room_between`, with a centimetre, or what the world keeps, where nothing is said."""
    wanted = max(PREFERRED_CLEARANCE if clearance is None else clearance, world.settings.kept)
    return room_between(world, ends, wanted)
