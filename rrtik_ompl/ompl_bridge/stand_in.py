"""What stands in for OMPL where it is not installed; its names are OMPL's."""

from __future__ import annotations

import random
from enum import Enum
from functools import cache
from typing import Any

from rrtik_ompl.base.floors import NO_OMPL, DependencyError


class PlannerStatus(Enum):
    """How a search ended, in OMPL's words."""

    UNKNOWN = "Unknown status"
    INVALID_START = "Invalid start"
    INVALID_GOAL = "Invalid goal"
    UNRECOGNIZED_GOAL_TYPE = "Unrecognized goal type"
    TIMEOUT = "Timeout"
    APPROXIMATE_SOLUTION = "Approximate solution"
    EXACT_SOLUTION = "Exact solution"
    CRASH = "Crash"

    def __str__(self) -> str:
        return str(self.value)


class RealVectorBounds:
    """Lower and upper bounds, one number a coordinate."""

    def __init__(self, size: int) -> None:
        self.low = [0.0] * size
        self.high = [0.0] * size

    def setLow(self, k: int, value: float) -> None:
        """Set a lower bound."""
        self.low[k] = value

    def setHigh(self, k: int, value: float) -> None:
        """Set an upper bound."""
        self.high[k] = value


class RealVectorStateSpace:
    """A space of real coordinates."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._bounds = RealVectorBounds(size)

    def getDimension(self) -> int:
        """Return the number of coordinates."""
        return self._size

    def getSerializationLength(self) -> int:
        """Return 0: states are lists."""
        return 0

    def setBounds(self, bounds: RealVectorBounds) -> None:
        """Set the bounds."""
        self._bounds = bounds

    def getBounds(self) -> RealVectorBounds:
        """Return the bounds."""
        return self._bounds


class SpaceInformation:
    """A space, whose states nothing checks."""

    def __init__(self, space: RealVectorStateSpace) -> None:
        self._space = space

    def getStateSpace(self) -> RealVectorStateSpace:
        """Return the space."""
        return self._space

    def getStateDimension(self) -> int:
        """Return the number of coordinates."""
        return self._space.getDimension()

    def allocState(self) -> list[float]:
        """Return a state, which nothing serializes."""
        return [0.0] * self._space.getDimension()

    def setStateValidityChecker(self, checker: object) -> None:
        """Accept the one checker that there is."""

    def setMotionValidator(self, validator: object) -> None:
        """Refuse: only OMPL's algorithms ask it."""
        raise DependencyError(NO_OMPL)

    def setup(self) -> None:
        """Do nothing."""


class AllValidStateValidityChecker:
    """Checks nothing."""

    def __init__(self, si: SpaceInformation) -> None:
        pass


class Planner:
    """A planner with a name and a space."""

    def __init__(self, si: SpaceInformation, name: str) -> None:
        self._si = si
        self._name = name

    def getSpaceInformation(self) -> SpaceInformation:
        """Return the space."""
        return self._si

    def getName(self) -> str:
        """Return the name."""
        return self._name

    def setName(self, name: str) -> None:
        """Set the name."""
        self._name = name

    def setup(self) -> None:
        """Do nothing."""

    def clear(self) -> None:
        """Do nothing."""

    def solve(self, *_: object) -> None:
        """Refuse: this is OMPL's way to a planner."""
        raise DependencyError(NO_OMPL)


class RNG:
    """Seeded random numbers."""

    @staticmethod
    def setSeed(seed: int) -> None:
        """Set the seed of numbers that are drawn from now on."""
        _random.seed(seed)

    def uniformInt(self, low: int, high: int) -> int:
        """Return a whole number, both bounds included."""
        return _random.randint(low, high)


_random = random.Random()


class _Module:
    """Some names of a module of OMPL; every other one is a class of which nothing can be made."""

    def __init__(self, **names: Any) -> None:
        for name, value in names.items():
            if isinstance(value, type):
                value.__module__ = "ompl.base"  # by which states are read
            setattr(self, name, value)

    def __getattr__(self, name: str) -> type:
        if name.startswith("_"):
            raise AttributeError(name)
        return _absent(name)


@cache
def _absent(name: str) -> type:
    def refuse(self: object, *_: object, **__: object) -> None:
        raise DependencyError(NO_OMPL)

    return type(name, (), {"__init__": refuse, "__module__": "ompl.base"})


ob = _Module(
    PlannerStatus=PlannerStatus,
    RealVectorBounds=RealVectorBounds,
    RealVectorStateSpace=RealVectorStateSpace,
    SpaceInformation=SpaceInformation,
    AllValidStateValidityChecker=AllValidStateValidityChecker,
    Planner=Planner,
)
og = _Module()
ou = _Module(RNG=RNG, getLogLevel=lambda: 0, setLogLevel=lambda level: None, LogLevel=_Module(LOG_NONE=0))
