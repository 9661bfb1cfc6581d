"""JSON objects received over a connection, which are not trusted: only small and shallow ones are accepted."""

from __future__ import annotations

import json
import re
from itertools import accumulate
from typing import Any

MAX_DEPTH = 16  # largest depth of nested lists and objects
MAX_LETTERS = 100  # largest number of letters of a quoted value
_TEXTS = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
_STEP = {"[": 1, "{": 1, "]": -1, "}": -1}


def message_in(text: str | bytes) -> dict[str, Any] | None:
    """Return the JSON object in a text; None if it contains none, or is nested more deeply than ``MAX_DEPTH``.

    The depth is checked before parsing, as the parser, or printing the result, would overflow the stack.
    """
    try:
        letters = text if isinstance(text, str) else text.decode("utf-8")
        brackets = (_STEP.get(letter, 0) for letter in _TEXTS.sub("", letters))
        if max(accumulate(brackets), default=0) > MAX_DEPTH:
            return None
        found = json.loads(letters)
    except (ValueError, RecursionError):  # not UTF-8, not JSON, or a number of thousands of digits
        return None
    return found if isinstance(found, dict) else None


def quoted(value: object) -> str:
    """Return the first letters of any value as text, for a message."""
    try:
        return str(value)[:MAX_LETTERS]
    except (ValueError, RecursionError):  # a number of thousands of digits, or deep nesting
        return f"a {type(value).__name__}"
