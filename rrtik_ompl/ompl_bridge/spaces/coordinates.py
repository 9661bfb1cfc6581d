"""Spaces whose states are rows of numbers: real coordinates, angles of SO(2), and compounds of both."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from ompl import base as ob

from rrtik_ompl.base.arrays import Mask, frozen
from rrtik_ompl.base.errors import InputError

WANTED = "needs a RealVectorStateSpace, an SO2StateSpace or a compound of them (one number a coordinate)"


@dataclass(frozen=True)
class Coordinates:
    """The numbers of a state, in the order in which OMPL serializes them.

    Attributes:
        kind: Of the space: real, SO(2), SE(2), any other compound, or one that is constrained. Those that interpolate
            otherwise, such as Dubins' curves, are none of these.
        size: How many numbers.
        parts: Of a compound those of its subspaces.
    """

    kind: type[ob.StateSpace]
    size: int
    parts: tuple[Coordinates, ...] = ()

    @cached_property
    def turning(self) -> Mask:
        """Which numbers are angles of SO(2), shape (size,)."""
        if self.parts:
            return frozen(np.concatenate([part.turning for part in self.parts]), bool)
        return frozen(np.full(self.size, self.kind is ob.SO2StateSpace), bool)

    def read(self, state: ob.State) -> list[float]:
        """The numbers of a state."""
        if self.kind is ob.RealVectorStateSpace:
            return list(state[0 : self.size])
        if self.kind is ob.SO2StateSpace:
            return [state.value]
        if self.kind is ob.SE2StateSpace:
            return [state.getX(), state.getY(), state.getYaw()]
        if self.kind is ob.ConstrainedStateSpace:
            return [state[k] for k in range(self.size)]
        return [number for k, part in enumerate(self.parts) for number in part.read(state[k])]

    def write(self, state: ob.State, numbers: list[float]) -> None:
        """Set the numbers of a state."""
        if self.kind is ob.RealVectorStateSpace:
            state[0 : self.size] = numbers
        elif self.kind is ob.SO2StateSpace:
            state.value = numbers[0]
        elif self.kind is ob.SE2StateSpace:
            state.setXY(*numbers[:2])
            state.setYaw(numbers[2])
        elif self.kind is ob.ConstrainedStateSpace:
            state.copy(np.array(numbers))
        else:
            for k, part in enumerate(self.parts):
                part.write(state[k], numbers[: part.size])
                numbers = numbers[part.size :]

    def bounds(self, space: ob.StateSpace) -> tuple[list[float], list[float]]:
        """Lower and upper bounds of a space of this kind as they are; of an angle -pi and pi."""
        if self.kind is ob.RealVectorStateSpace:
            bounds = space.getBounds()
            return list(bounds.low), list(bounds.high)
        if self.kind is ob.SO2StateSpace:
            return [-np.pi], [np.pi]
        if self.kind is ob.ConstrainedStateSpace:
            return self.parts[0].bounds(space.getSpace())

        of_parts = [part.bounds(space.getSubspace(k)) for k, part in enumerate(self.parts)]
        lower, upper = ([number for each in of_parts for number in each[side]] for side in (0, 1))
        return lower, upper


def coordinates_of(si: ob.SpaceInformation, *, constrained: bool = False) -> Coordinates:
    """The coordinates of the space of a SpaceInformation.

    Args:
        si: The SpaceInformation.
        constrained: Whether the space may be a constrained one of real coordinates, in which motions are not straight.

    Raises:
        InputError: If ``si`` is no SpaceInformation, or its space has other states than rows of numbers, or none.
    """
    if not isinstance(si, ob.SpaceInformation):
        raise InputError(f"planner: expected an ompl.base.SpaceInformation, got {type(si).__name__}")

    space = si.getStateSpace()
    if constrained and isinstance(space, ob.ConstrainedStateSpace):
        ambient = _coordinates(space.getSpace(), " that is constrained")
        return Coordinates(ob.ConstrainedStateSpace, ambient.size, (ambient,))

    found = _coordinates(space, "")
    if found.size == 0:
        raise InputError("planner: needs a space of at least one coordinate, got none")
    return found


def _coordinates(space: ob.StateSpace, inside: str) -> Coordinates:
    kind = next(each for each in type(space).__mro__ if each.__module__.startswith("ompl"))  # below classes in Python
    if kind is ob.RealVectorStateSpace:
        return Coordinates(kind, int(space.getDimension()))
    if kind is ob.SO2StateSpace:
        return Coordinates(kind, 1)
    if kind not in (ob.CompoundStateSpace, ob.SE2StateSpace):
        raise InputError(f"planner: {WANTED}, got a {type(space).__name__}{inside}")

    parts = tuple(_coordinates(space.getSubspace(k), " in a compound") for k in range(space.getSubspaceCount()))
    return Coordinates(kind, sum(part.size for part in parts), parts)
