"""The names that a caller chooses from, as types that editors, checks and commands share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, TypeAlias, TypeVar

from rrtik_ompl.base.errors import UnknownNameError

Accuracy: TypeAlias = Literal["exact", "conservative"]
ProofMode: TypeAlias = Literal["preferred", "required", "off"]
ShorteningMethod: TypeAlias = Literal[
    "auto",
    "axis",
    "axis-rounds",
    "sequential",
    "random",
    "shortcut",
    "retraction",
    "corners",
    "ompl",
    "fewest-moves",
]
PathObjective: TypeAlias = Literal["length", "time", "clearance"]
ImproveStrategy: TypeAlias = Literal["restart-shorten", "shorten"]
CommandShortening: TypeAlias = Literal[ShorteningMethod, "none"]
SuiteShortening: TypeAlias = Literal[ShorteningMethod, "by-kind", "none"]
IkMethod: TypeAlias = Literal[
    "auto",
    "closed-form",
    "numeric",
    "genetic",
    "mb-rrt",
    "projection",
    "damped",
    "pinocchio",
    "ccd",
    "fabrik",
    "pso",
    "pso-resampled",
]
TrajectoryIkMethod: TypeAlias = Literal["auto", "closed-form", "numeric", "genetic"]
GeneticPreset: TypeAlias = Literal["standard", "historical", "refined"]
Between: TypeAlias = Literal["lines", "cubics", "quintics"]
FrameAxis: TypeAlias = Literal["x", "y", "z"]
DhConvention: TypeAlias = Literal["standard", "modified"]
Replanner: TypeAlias = Literal["drrt-con", "rrt-connect", "drrt"]
TickEvent: TypeAlias = Literal["plan", "walk", "repair", "wait", "evade", "arrive"]
RunOutcome: TypeAlias = Literal["arrived", "out of time", "no scene", "too fast", "interrupted"]

Name = TypeVar("Name", bound=str)


def one_of(names: Iterable[Name], name: str, kind: str) -> Name:
    """Check that a name given as text is one of the known ones, and return it.

    Args:
        names: The known names.
        name: The name that was given.
        kind: Kind of things that are named, for the error message.

    Raises:
        UnknownNameError: If it is unknown.
    """
    known = tuple(names)
    for each in known:
        if isinstance(name, str) and each == name:
            return each
    raise UnknownNameError(kind, type(name).__name__ if callable(name) else str(name), known)
