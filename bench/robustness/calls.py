"""The public face called by its signatures, with good values of every kind and odd ones."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import rrtik_ompl as rrtik

LEFT_OUT = {"view", "plan_batch", "replan", "GoalSampler"}  # a server, processes, minutes; an object of OMPL


@cache
def corpus() -> list[Any]:
    """Values that arguments are drawn from: good ones of every kind, and odd ones."""
    robot = rrtik.load_robot("planar3")
    world = rrtik.World(robot, rrtik.Scene((rrtik.Obstacle("far", rrtik.Sphere(0.1), rrtik.pose([9, 9, 9])),)))
    problem = rrtik.Problem(world, [0, 0, 0], [0.5, 0.2, 0])
    path = rrtik.JointPath.of(robot, np.array([[0, 0, 0], [0.5, 0.2, 0]]))
    good: list[Any] = [
        robot,
        world,
        problem,
        path,
        world.scene,
        rrtik.pose([1, 0, 0]),
        rrtik.PositionGoal([1, 1, 0]),
        "planar3",
    ]
    good += [rrtik.TaskRegion([1, 1, 0], np.zeros((6, 2))), rrtik.MoveRules(["a", "b", "c"]), rrtik.GoalSet([good[6]])]
    good += [rrtik.PoseGoal(rrtik.pose([1, 1, 0])), rrtik.Sphere(0.1), [0, 0, 0], [1.0, 0.5, 0.1], "auto", "RRTConnect"]
    good += [np.zeros((2, 3)), np.eye(4), 1, 2, 0.5, True, world.scene.obstacles, ["joint1"], {"range": 0.1}]
    odd: list[Any] = [
        None,
        -1,
        0,
        10**400,
        float("nan"),
        float("inf"),
        1e300,
        1j,
        "",
        "\x00",
        "\ud800",
        "a" * 5000,
        b"x",
        [],
        {},
    ]
    odd += [
        [[]],
        [[1, 2], [3]],
        "\ud7ff\udc00",
        [None],
        ["a"],
        {"a": 1},
        {1: 2},
        object(),
        int,
        len,
        np.zeros(0),
        np.zeros((0, 3)),
        np.full(3, np.nan),
    ]
    odd += [np.array(["a"]), np.array([None]), np.zeros((2, 3, 4)), -np.eye(4), iter([1]), range(3), Path("/none"), ...]
    return [*good, *good, *odd]


@cache
def functions() -> list[tuple[str, Callable[..., Any]]]:
    """Public functions and classes, and the public methods of what the corpus holds."""
    names = [name for name in vars(rrtik)["__all__"] if name not in LEFT_OUT]
    found = [(name, getattr(rrtik, name)) for name in names]
    for thing in corpus():
        if type(thing).__module__.startswith("rrtik_ompl"):
            names = [name for name in dir(thing) if not name.startswith("_")]  # of Python 3.10 some others raise
            methods = [(name, each) for name in names if inspect.ismethod(each := getattr(thing, name, None))]
            found += [(f"{type(thing).__name__}.{name}", each) for name, each in methods]
    return list(dict(found).items())


def call_one(rng: np.random.Generator, folder: Path) -> None:
    """Call a function with values of the corpus; ``folder/now`` says which."""
    name, function = functions()[rng.integers(len(functions()))]
    args, options = _arguments(rng, function)
    said = f"{name}({', '.join([*map(_short, args), *(f'{k}={_short(v)}' for k, v in options.items())])})"
    (folder / "now").write_text(said, errors="backslashreplace")
    os.chdir(folder)
    function(*args, **options)


def _arguments(rng: np.random.Generator, function: Callable[..., Any]) -> tuple[list[Any], dict[str, Any]]:
    values, args, options = corpus(), [], dict[str, Any]()
    for parameter in inspect.signature(function).parameters.values():
        value = values[rng.integers(len(values))]
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY:
            if rng.random() < 0.3:
                options[parameter.name] = value
        elif parameter.default is parameter.empty or rng.random() < 0.5:
            args.append(value)
        else:
            break
    return args, options


def _short(value: object) -> str:
    try:
        return repr(value)[:60]
    except Exception:
        return type(value).__name__
