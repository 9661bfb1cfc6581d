"""Data with which the page replays a run: groups of ticks, poses of obstacles, and the tip's trail on each path."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.viewer.drawing.framing import Frame
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.viewer.drawing.scene_picture import obstacle_look
from rrtik_ompl.viewer.run_actors import Actor, actors_of
from rrtik_ompl.viewer.task_story import TASK

MAX_POINTS = 40  # points of the trail of a path
SHOWN_SECONDS = 0.5  # how long a replaced path remains visible
DIGITS = 5


def run_story(run: ReplanRun, robot: Robot, scene: Scene, frame: Frame) -> dict[str, Any]:
    """Return the part of the page's data that describes a run."""
    lines, numbers = _lines(run, robot)
    actors = [each for each in actors_of(run, scene) if each.acts]
    return {
        "groups": _motions(run.ticks) if run.planner == TASK else _groups(run.ticks),
        "outcome": run.outcome + (f": {run.reason}" if run.reason else ""),
        "moving": {node_name(each.drawn.name): _places(each, frame) for each in actors},
        "lines": lines,
        "line": numbers,
        "replaced": _replaced(run, numbers),
    }


def _motions(ticks: Iterable[Tick]) -> list[dict[str, Any]]:
    """Return the groups of ticks of a task, as :func:`_groups` does, one for each motion."""
    found = _groups(ticks)
    for group in found:
        name = group["reason"].partition(": ")[2]
        group |= {"event": "motion", "text": name, "caption": name}
    return found


def _groups(ticks: Iterable[Tick]) -> list[dict[str, Any]]:
    """Group consecutive ticks of the same kind.

    Returns:
        For each group the number of its first tick, the number of ticks, the event, its reason, a text, and a caption
        of films, which says nothing of how long this machine took.
    """
    found: list[dict[str, Any]] = []
    for (event, reason), members in groupby(ticks, lambda tick: (tick.event, tick.reason)):
        rows = list(members)
        first = found[-1]["first"] + found[-1]["count"] if found else 0
        # Only plans and repairs have times.
        spent = [1e3 * tick.seconds[event] for tick in rows if event in tick.seconds]
        text = event + (f" ({reason})" if reason else "")
        timed = f"{text}, {max(spent):.1f} ms" if spent else text
        caption = "" if event == "walk" else text
        found.append(
            {"first": first, "count": len(rows), "event": event, "reason": reason, "text": timed, "caption": caption}
        )
    return found


def _places(actor: Actor, frame: Frame) -> dict[str, Any]:
    """Return the placement of an obstacle's geometry in its own frame, the pose of that frame, and if it is there."""
    _, own = obstacle_look(actor.drawn, frame)
    return {
        "placement": own.ravel().tolist(),
        "poses": np.round(actor.poses, DIGITS).tolist(),
        "shown": None if actor.shown.all() else actor.shown.tolist(),
    }


def _lines(run: ReplanRun, robot: Robot) -> tuple[list[list[list[float]]], list[int]]:
    """Return the tip's trail on each path, and for each tick the number of its path; -1 for none."""
    lines: list[list[list[float]]] = []
    numbers: list[int] = []
    known: Matrix | None = None
    for tick in run.ticks:
        rest = None if tick.path is None else tick.path[1:]
        if tick.path is None or rest is None or len(rest) == 0:
            numbers.append(-1)
        elif known is not None and known.shape == rest.shape and np.array_equal(known, rest):
            numbers.append(len(lines) - 1)
        else:
            lines.append(np.round(_tips(robot, tick.path), DIGITS).tolist())
            numbers.append(len(lines) - 1)
        known = rest

    return lines, numbers


def _tips(robot: Robot, path: Matrix) -> Matrix:
    """Return points of the tip's trail, shape (m, 3), without consecutive duplicates."""
    lengths: Vector = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    wanted = np.union1d(np.linspace(0.0, lengths[-1], MAX_POINTS), lengths)
    rows = np.stack([np.interp(wanted, lengths, column) for column in path.T], axis=1)

    tips = robot.fk_batch(rows)[:, :3, 3]
    kept: Matrix = tips[np.append(True, np.linalg.norm(np.diff(tips, axis=0), axis=1) > 1e-6)]
    return kept


def _replaced(run: ReplanRun, numbers: list[int]) -> list[int]:
    """Return, for each tick, the number of the path that a repair has recently replaced; -1 for none."""
    found = []
    last = -1
    until = -1

    for k, tick in enumerate(run.ticks):
        if tick.event == "repair" and k and numbers[k - 1] != numbers[k]:
            last = numbers[k - 1]
            until = k + int(SHOWN_SECONDS * run.rate)
        found.append(last if k <= until else -1)

    return found
