"""JSON objects from the other side of a connection, whom nobody has checked: small and shallow ones, or none."""

from __future__ import annotations

import json
import re
from itertools import accumulate
from typing import Any

MAX_DEPTH = 16  # lists and objects in each other
MAX_LETTERS = 100  # of a value that is quoted
_TEXTS = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
_STEP = {"[": 1, "{": 1, "]": -1, "}": -1}


def message_in(text: str | bytes) -> dict[str, Any] | None:
    """Return the JSON object in a text; None if there is none, or it is nested more deeply than any message of ours.

    Deep nesting is found before it is read: what reads it, or later shows it, would run out of stack.
    """
    try:
        letters = text if isinstance(text, str) else text.decode("utf-8")
        brackets = (_STEP.get(letter, 0) for letter in _TEXTS.sub("", letters))
        if max(accumulate(brackets), default=0) > MAX_DEPTH:
            return None
        found = json.loads(letters)
    except (ValueError, RecursionError):  # not UTF-8, no JSON, or a number of thousands of digits
        return None
    return found if isinstance(found, dict) else None


def quoted(value: object) -> str:
    """Return the beginning of a value as a person reads it, whatever it is."""
    try:
        return str(value)[:MAX_LETTERS]
    except (ValueError, RecursionError):  # a number of thousands of digits, or deep nesting
        return f"a {type(value).__name__}"
