"""What the session says to the pilot: a line with its level, by which the page shows it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Level(str, Enum):
    """What kind of line it is: what was done, a command that is not executed, or what nobody has commanded."""

    NEWS = "news"
    REFUSAL = "refusal"
    ALARM = "alarm"


@dataclass(frozen=True, slots=True)
class Answer:
    """A line for the pilot.

    Attributes:
        level: Of the line.
        text: The line.

    Example:
        >>> refused("no object is chosen; choose one that is in view").level.value
        'refusal'
    """

    level: Level
    text: str


def news(text: str) -> Answer:
    """What was done, or is so now."""
    return Answer(Level.NEWS, text)


def refused(text: str) -> Answer:
    """Why a command is not executed, or has not led to what it is for."""
    return Answer(Level.REFUSAL, text)


def alarm(text: str) -> Answer:
    """What nobody has commanded: the arm was stopped, something is lost, a route must not be followed any more."""
    return Answer(Level.ALARM, text)
