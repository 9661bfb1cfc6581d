"""Colours of obstacles that state none: things of one kind share one, and neighbouring sizes differ."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.meshes import look_of_shape

# Words that say where a thing is, not what it is.
PLACES = re.compile(
    "above|back|below|between|bottom|down|far|front|high|inner|left|low|lower|middle|near|outer|right|side|the|top|"
    "under|up|upper"
)


def obstacle_colors(obstacles: Iterable[Obstacle]) -> dict[str, str]:
    """Return the colour of each obstacle by its name, as '#rrggbb'.

    Obstacles whose names differ in numbers and places are of one kind ("jar 1", "jar_left"). The kind of the largest
    one has the first colour of the palette, the next one the second, and so on.
    """
    listed = tuple(obstacles)
    sizes: dict[str, float] = {}
    for each in listed:
        if each.color is None and each.shape.bounded:
            kind = _kind(each.name)
            extent = float(np.ptp(look_of_shape(each.shape).corners, axis=0).max())
            sizes[kind] = max(extent, sizes.get(kind, 0.0))

    largest_first = sorted(sizes, key=lambda kind: -sizes[kind])
    chosen = {kind: palette.OBSTACLES[k % len(palette.OBSTACLES)] for k, kind in enumerate(largest_first)}
    return {each.name: each.color or chosen.get(_kind(each.name), palette.GROUND) for each in listed}


def _kind(name: str) -> str:
    """Return the first word of a name that says neither a number nor a place; "" if there is none."""
    words = re.findall("[^\\W\\d_]+", name.lower())
    return next((word for word in words if not PLACES.fullmatch(word)), "")
