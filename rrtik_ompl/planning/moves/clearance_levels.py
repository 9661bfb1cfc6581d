"""Forms of a world that keep less and less clearance: fewest moves come first, clearance second."""

from __future__ import annotations

from functools import cached_property

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.world.clearances import CLEARANCE, Clearances, clearances_between, keeping
from rrtik_ompl.world.world import World

PREFERRED_CLEARANCE = 0.01  # [m] of single-joint moves, which a person may follow by hand


class Level:
    """A form of a world, made when it is first asked for.

    Attributes:
        clearance: What motions are proven to keep from obstacles [m].

    Args:
        world: As it is.
        clearance: See above; None where nothing is proven.
        searched_clearance: What searches in kernels keep in steps [m].
    """

    def __init__(self, world: World, clearance: float | None, searched_clearance: float) -> None:
        self._world = world
        self._proven_clearance = clearance
        self._searched_clearance = searched_clearance
        self.clearance = 0.0 if clearance is None else clearance

    @cached_property
    def searched(self) -> World:
        """A form whose searches in kernels keep more than the clearance in steps."""
        return keeping(self._world, self._searched_clearance)

    @cached_property
    def proving(self) -> World:
        """The same, where motions have to be proven."""
        if self._proven_clearance is None:
            return self.searched
        return keeping(self._world, self._searched_clearance, proven=self._proven_clearance)


def clearance_levels(world: World, ends: Matrix, clearance: float | None) -> list[Level]:
    """The levels, from the clearance wanted down to none, or to checks in steps where no end is proven free.

    Args:
        world: As it is.
        ends: Where moves begin and end, shape (k, dof); all of them keep all levels.
        clearance: Wanted [m]; None for a centimetre. Less is kept where the ends have less.
    """
    clearances = wide_clearances_between(world, ends, clearance)
    if clearances is None:
        return [Level(world, None, 0.0)]
    smallest = world.settings.required_clearance
    usual = max(min(clearances.proven_clearance, CLEARANCE), smallest)
    levels = sorted({clearances.proven_clearance, usual, smallest}, reverse=True)
    most = clearances.searched_clearance
    return [Level(world, proven, min(most, proven + min(proven, CLEARANCE))) for proven in levels]


def wide_clearances_between(world: World, ends: Matrix, clearance: float | None) -> Clearances | None:
    """As :func:`clearances_between`, with a centimetre where ``clearance`` is None; never less than the world keeps.

    Returns:
        What may be kept between two ends, shape (2, dof); None if an end cannot be proven free.
    """
    wanted = PREFERRED_CLEARANCE if clearance is None else clearance
    return clearances_between(world, ends, max(wanted, world.settings.required_clearance))
