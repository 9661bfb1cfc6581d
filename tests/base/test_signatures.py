"""What a public function can be told stands in its signature."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values

OPEN = {
    "following.RobotLink",  # a protocol, which nobody calls
    "ompl.MotionChecker",  # of OMPL's bindings
}


def callables() -> Iterator[tuple[str, Any]]:
    """Public functions and classes, and the public methods of these."""
    for name, value in public_values(rrtik).items():
        if callable(value):
            yield name, value
        if isinstance(value, type):
            for key in vars(value):
                if not key.startswith("_") and callable(getattr(value, key)):
                    yield f"{name}.{key}", getattr(value, key)


def test_no_public_function_takes_options_that_its_signature_does_not_name() -> None:
    taking = {
        name
        for name, function in callables()
        if any(each.kind is each.VAR_KEYWORD for each in inspect.signature(function).parameters.values())
    }
    assert taking == OPEN
