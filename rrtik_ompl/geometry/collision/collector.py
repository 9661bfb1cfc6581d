"""Python's garbage collector waits while thousands of bodies are made, of which nothing is garbage yet."""

from __future__ import annotations

import gc
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Made = TypeVar("Made")


def collector_waits(work: Callable[Given, Made]) -> Callable[Given, Made]:
    """The same work, in which the collector does not look through all objects again and again."""

    @wraps(work)
    def undisturbed(*args: Given.args, **kwargs: Given.kwargs) -> Made:
        if not gc.isenabled():
            return work(*args, **kwargs)
        gc.disable()
        try:
            return work(*args, **kwargs)
        finally:
            gc.enable()

    return undisturbed
