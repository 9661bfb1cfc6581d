"""The public face called by its signatures, with good values of every kind and odd ones."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from bench.robustness import values
from bench.robustness.spoilt_files import Drawn
from rrtik_ompl.base.lazy import public_values

Function = Callable[..., Any]
RARE = {"replan": 0.3, "plan_many": 0.2, "reach_map": 0.3}  # processes, or many searches, each call


def viewed(*args: Any, on_ready: Any = values.anything, **options: Any) -> Any:
    """`view()`, which opens no browser."""
    return rrtik.view(*args, on_ready=on_ready, **options)


STAND_INS = {"view": viewed}


@cache
def functions() -> tuple[tuple[str, Function, tuple[inspect.Parameter, ...]], ...]:
    """Public functions and classes, and the public methods of what values are; with their parameters."""
    found: dict[str, Function] = dict(public_values(rrtik))
    for thing in values.good():
        if type(thing).__module__.startswith("rrtik_ompl"):
            kind = type(thing)  # properties of a value may raise
            names = [name for name in dir(kind) if name[0] != "_" and callable(getattr(kind, name, None))]
            methods = [(name, each) for name in names if inspect.ismethod(each := getattr(thing, name, None))]
            found |= {f"{type(thing).__name__}.{name}": each for name, each in methods}
    return tuple(
        (name, STAND_INS.get(name, each), tuple(inspect.signature(each).parameters.values()))
        for name, each in found.items()
        if callable(each)
    )


@cache
def _shares() -> np.ndarray[Any, np.dtype[np.float64]]:
    """Up to which number each function is drawn, of numbers from 0 to 1."""
    weights = np.cumsum([RARE.get(name.split(".")[-1], 1.0) for name, *_ in functions()])
    return np.asarray(weights / weights[-1])


def draw(rng: np.random.Generator) -> Drawn:
    """A function with values."""
    name, function, parameters = functions()[int(np.searchsorted(_shares(), rng.random(), side="right"))]
    args, options = _arguments(rng, parameters)
    return Drawn(partial(_said, name, args, options), partial(_call, function, args, options))


def _said(name: str, args: list[Any], options: dict[str, Any]) -> str:
    return f"{name}({', '.join([*map(_short, args), *(f'{k}={_short(v)}' for k, v in options.items())])})"


def _call(function: Function, args: list[Any], options: dict[str, Any], folder: Path) -> None:
    os.chdir(folder)
    function(*args, **options)


def _arguments(rng: np.random.Generator, parameters: tuple[inspect.Parameter, ...]) -> tuple[list[Any], dict[str, Any]]:
    args, options, positional = list[Any](), dict[str, Any](), True
    for parameter in parameters:
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY:
            if parameter.default is parameter.empty or rng.random() < 0.3 or parameter.name == "seconds":
                options[parameter.name] = values.drawn(rng, parameter)
        elif positional and (parameter.default is parameter.empty or rng.random() < 0.5):
            args.append(values.drawn(rng, parameter))
        else:
            positional = False
    return args, options


def _short(value: object) -> str:
    try:
        return repr(value)[:60]
    except Exception:
        return type(value).__name__
