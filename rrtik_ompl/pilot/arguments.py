"""Checks of the arguments of commands, which come from outside: only what a command expects is accepted."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.messages import quoted

NUMBERS = ("joint", "target", "level", "direction", "share", "press")  # arguments of commands; all others are words
MAX_NUMBER, MAX_WORD_LENGTH = 1e6, 100  # a number, and a word, that a command may hold


def number(value: object, name: str) -> float:
    """A finite number of moderate size.

    Raises:
        InputError: If it is none.
    """
    plain = value.item() if isinstance(value, np.number) else value
    if isinstance(plain, bool) or not isinstance(plain, int | float) or not -MAX_NUMBER <= plain <= MAX_NUMBER:
        raise InputError(f"{name} must be a finite number, got {quoted(value)!r}")
    return float(plain)


def fitting(command: Callable[..., object], name: str, arguments: Mapping[str, object]) -> dict[str, float | str]:
    """The arguments, if they are those that a command takes.

    Raises:
        InputError: If one is missing, unknown, or of another kind.
    """
    wanted = tuple(inspect.signature(command).parameters)
    if set(arguments) != set(wanted):
        given = ", ".join(arguments)[:MAX_WORD_LENGTH] or "none"
        raise InputError(f"{name} takes {', '.join(wanted) or 'no arguments'}, got {given}")
    return {word: _value(f"{name}: {word}", word, value) for word, value in arguments.items()}


def _value(place: str, word: str, value: object) -> float | str:
    if word in NUMBERS:
        return number(value, place)
    if not isinstance(value, str) or len(value) > MAX_WORD_LENGTH:
        raise InputError(f"{place} must be a word, got {quoted(value)!r}")
    return value
