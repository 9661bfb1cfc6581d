"""Arguments of commands as they come from outside: nothing is taken that a command does not expect."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.errors import InputError

NUMBERS = ("joint", "target", "change", "level")  # arguments of commands; all others are words
LARGEST, LONGEST = 1e6, 100  # a number, and a word, that a command may hold


def number(value: Any, name: str) -> float:
    """A finite number of moderate size.

    Raises:
        InputError: If it is none.
    """
    good = isinstance(value, int | float | np.number) and not isinstance(value, bool) and -LARGEST <= value <= LARGEST
    if not good:
        raise InputError(f"{name} must be a finite number, got {str(value)[:LONGEST]!r}")
    return float(value)


def fitting(command: Callable[..., str], name: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """The arguments, if they are those that a command takes.

    Raises:
        InputError: If one is missing, unknown, or of another kind.
    """
    wanted = tuple(inspect.signature(command).parameters)
    if set(arguments) != set(wanted):
        given = ", ".join(arguments)[:LONGEST] or "none"
        raise InputError(f"{name} takes {', '.join(wanted) or 'no arguments'}, got {given}")
    return {word: _value(f"{name}: {word}", word, value) for word, value in arguments.items()}


def _value(place: str, word: str, value: Any) -> Any:
    if word in NUMBERS:
        return number(value, place)
    if not isinstance(value, str) or len(value) > LONGEST:
        raise InputError(f"{place} must be a word, got {str(value)[:LONGEST]!r}")
    return value
