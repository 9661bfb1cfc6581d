"""The obstacles that the page of a run shows: those that its record has, each as long as it keeps name and shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.model.scene import Obstacle, Scene, pose_at
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.model.shapes.shape import same_but_for_points
from rrtik_ompl.replanning.record import ReplanRun

ROUNDING = 1e-9  # [s]


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """An obstacle of a run, as long as it keeps its name and shape.

    Attributes:
        drawn: The obstacle where it was first, under a name of its own.
        poses: Where it is in each tick, as :func:`pose_row` writes it, shape (ticks, 7).
        shown: Whether it is there in each tick, shape (ticks,).
    """

    drawn: Obstacle
    poses: Matrix
    shown: Mask

    @property
    def acts(self) -> bool:
        """Whether it is ever away, or elsewhere than where it is drawn."""
        return not self.shown.all() or bool((self.poses != pose_row(pose_at(self.drawn, 0.0))).any())


def actors_of(run: ReplanRun, scene: Scene) -> list[Actor]:
    """Return the obstacles of a run, those too that appear later; one that changes its shape is there again for each.

    Args:
        run: The record, whose scenes say what was there when.
        scene: What was there all the time, if the record has no scenes.
    """
    scenes = [seen.scene for seen in run.scenes] or [scene]
    seen_at = np.array([seen.time for seen in run.scenes] or [0.0])
    latest = np.maximum(np.searchsorted(seen_at, run.times + ROUNDING, side="right") - 1, 0)

    # For each name the shapes that it has had, and for each of these the obstacle in each scene that shows it.
    shapes: dict[str, list[dict[int, Obstacle]]] = {}
    for number in dict.fromkeys([0, *latest.tolist()]):
        for o in scenes[number].obstacles:
            known = shapes.setdefault(o.name, [])
            same = (each for each in known if _same(next(reversed(each.values())).shape, o.shape))
            found = next(same, None)
            if found is None:
                known.append(found := {})
            found[number] = o

    actors = []
    taken = set(shapes)
    for name, known in shapes.items():
        for count, places in enumerate(known, start=1):
            drawn = replace(next(iter(places.values())), name=name if count == 1 else _free_name(name, count, taken))
            shown = np.array([number in places for number in latest.tolist()])
            actors.append(Actor(drawn, _poses(name, places, run, latest), shown))
    return actors


def _same(first: Shape, second: Shape) -> bool:
    return first is second or same_but_for_points(first, second)


def _free_name(name: str, count: int, taken: set[str]) -> str:
    """Return a name for the next shape of an obstacle, and add it to those that are taken."""
    while (free := f"{name} ({count})") in taken:
        count += 1
    taken.add(free)
    return free


def _poses(name: str, places: Mapping[int, Obstacle], run: ReplanRun, latest: NDArray[np.int64]) -> Matrix:
    """Return the pose of an obstacle in each tick, shape (ticks, 7): where it is not there, the one before or after.

    Args:
        name: Its name in the record.
        places: The obstacle by the number of each scene that shows it.
        run: The record.
        latest: Number of the last scene at each tick, shape (ticks,).
    """
    first = next(iter(places.values()))
    if run.scenes and run.scenes[0].stated:
        return np.array([pose_row(pose_at(first, tick.time)) for tick in run.ticks])
    poses = []
    last = pose_row(pose_at(first, 0.0))
    for tick, number in zip(run.ticks, latest.tolist(), strict=True):
        if number in places:
            last = tick.poses.get(name, pose_row(pose_at(places[number], 0.0)))
        poses.append(last)
    return np.array(poses)
