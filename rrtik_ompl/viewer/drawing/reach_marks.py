"""A reachability map as bodies of cells, one for each class of values, so that the page's legend is its scale."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.ik.reach.grid_map import ReachMap
from rrtik_ompl.viewer.drawing.marks import Mark, cubes

SCALE = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")  # of viridis, low to high
MEANING = {"orientations": "of all directions", "manipulability": "manipulability", "samples": "samples"}


def reach_marks(reach: ReachMap, *, cut: bool = True) -> list[Mark]:
    """Marks to be shown by ``view(robot, marks=reach_marks(map))``.

    Args:
        reach: The map.
        cut: Leave out the quarter in front of the base, on its right, so that the inside can be seen.
    """
    seen = np.array(reach.reached)
    if cut and seen.shape[2] > 1:
        x, y = (reach.centres(k) - reach.base[k] for k in (0, 1))
        seen[np.ix_(x > 0.0, y < 0.0, np.ones(seen.shape[2], dtype=bool))] = False

    most = 1.0 if reach.measure == "orientations" else float(reach.values.max(initial=0.0))
    step = most / len(SCALE)
    kind = np.minimum((reach.values / step).astype(int), len(SCALE) - 1) if most else np.zeros(seen.shape, dtype=int)

    names = [f"{k * step:.2g} to {(k + 1) * step:.2g} {MEANING[reach.measure]}" for k in range(len(SCALE))]
    return [
        cubes(name, color, seen & (kind == k), reach.corner, reach.size)
        for k, (name, color) in enumerate(zip(names, SCALE, strict=True))
    ]
