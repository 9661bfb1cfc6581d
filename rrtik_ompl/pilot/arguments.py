"""Checks of the arguments of commands, which come from outside: only what a command expects is accepted."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.messages import quoted

MAX_NUMBER = 1e6  # that a command may hold
MAX_WORD_LENGTH = 100  # of a word in a command


def number(value: object, name: str) -> float:
    """A finite number of moderate size.

    Raises:
        InputError: If it is none.
    """
    plain = value.item() if isinstance(value, np.number) else value
    if isinstance(plain, bool) or not isinstance(plain, int | float) or not -MAX_NUMBER <= plain <= MAX_NUMBER:
        raise InputError(f"{name} must be a finite number, got {quoted(value)!r}")
    return float(plain)


def fitting(act: Callable[..., object], name: str, arguments: Mapping[str, object]) -> dict[str, float | str]:
    """The arguments of a command, if they are those that are taken by what executes it.

    Args:
        act: Its first two parameters are not of the command; the others are words, ``str``, or numbers.
        name: Of the command.
        arguments: By their names.

    Raises:
        InputError: If one is missing, unknown, or of another kind.
    """
    wanted = list(inspect.signature(act).parameters.values())[2:]
    if set(arguments) != {each.name for each in wanted}:
        given = ", ".join(arguments)[:MAX_WORD_LENGTH] or "none"
        takes = ", ".join(each.name for each in wanted) or "no arguments"
        raise InputError(f"{name} takes {takes}, got {given}")

    words = {each.name for each in wanted if each.annotation in (str, "str")}
    return {each: _value(f"{name}: {each}", each in words, value) for each, value in arguments.items()}


def _value(place: str, word: bool, value: object) -> float | str:
    if not word:
        return number(value, place)
    if not isinstance(value, str) or len(value) > MAX_WORD_LENGTH:
        raise InputError(f"{place} must be a word, got {quoted(value)!r}")
    return value
