"""Levels of clearance, from largest to smallest: few moves matter more than clearance."""

from __future__ import annotations

from functools import cached_property

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.world.clearances import CLEARANCE, Clearances, clearances_between, keeping
from rrtik_ompl.world.world import World

PREFERRED_CLEARANCE = 0.01  # [m] preferred by single-joint moves, which a person may carry out by hand


class Level:
    """A world whose checks keep a clearance; its forms are made when they are first used.

    Attributes:
        clearance: The clearance that motions are proven to keep from obstacles [m].

    Args:
        world: The original world.
        clearance: Clearance to prove [m]; None if nothing is proven.
        searched_clearance: Clearance that searches in kernels keep in steps [m].
    """

    def __init__(self, world: World, clearance: float | None, searched_clearance: float) -> None:
        self._world = world
        self._proven_clearance = clearance
        self._searched_clearance = searched_clearance
        self.clearance = 0.0 if clearance is None else clearance

    @cached_property
    def searched(self) -> World:
        """The world for searches in kernels, whose checks in steps keep more than the clearance."""
        return keeping(self._world, self._searched_clearance)

    @cached_property
    def proving(self) -> World:
        """The same world where motions have to be proven, too."""
        if self._proven_clearance is None:
            return self.searched
        return keeping(self._world, self._searched_clearance, proven=self._proven_clearance)


def clearance_levels(world: World, ends: Matrix, clearance: float | None) -> list[Level]:
    """Return the levels from the clearance wanted down to none, or one level without proofs.

    Args:
        world: The original world.
        ends: Begin and end of moves, shape (k, dof); all of them keep all levels. If one of them cannot be proven free,
            the only level checks motions in steps.
        clearance: The clearance wanted [m]; None for a centimetre. If the ends have less, less is kept.
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
    """Return :func:`clearances_between` two ends, where None stands for a clearance of one centimetre.

    Args:
        world: The world; the result is never less than it keeps.
        ends: Shape (2, dof).
        clearance: The clearance wanted [m].

    Returns:
        The clearances that can be kept between the ends; None if an end cannot be proven free.
    """
    wanted = PREFERRED_CLEARANCE if clearance is None else clearance
    return clearances_between(world, ends, max(wanted, world.settings.required_clearance))
