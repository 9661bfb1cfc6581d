"""The tree of MB-RRT in 3-D: the balls in which each joint is useful, every link, and the solution."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import require
from rrtik_ompl.ik.mb_rrt.published import TreeSearch
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.marks import Mark, balls, tubes

LINK_RADIUS, SOLUTION_RADIUS = 0.0016, 0.006  # of links and of the solution, over the reach
MAX_LINKS = 600  # drawn of each index, the first ones
REGION_OPACITY = 0.08


def tree_marks(run: TreeSearch, *, unit: float = 1.0) -> list[Mark]:
    """A tree to be shown by ``view(Scene(), marks=tree_marks(run))``, each index in a colour of its own.

    Args:
        run: A run in space or in the plane.
        unit: Length of one unit of the run [m]; 0.01 for centimetres.

    Raises:
        InputError: If ``run`` is something else.
    """
    require(run, TreeSearch, "tree to show")
    reach = run.links.reach * unit
    goal = _in_space(run.goal[None]) * unit

    marks = []
    for index in range(1, run.links.count + 1):
        color = palette.SERIES[(index - 1) % len(palette.SERIES)]
        if index < run.links.count:
            name = f"where joint {index + 1} can be"
            far = float(run.links.max_span[index]) * unit
            marks.append(balls(name, color, goal, far, opacity=REGION_OPACITY))

        before, level = (_in_space(run.nodes[k]) * unit for k in (index - 1, index))
        edges = np.stack([before[run.parents[index - 1]], level], axis=1)[:MAX_LINKS]
        rest = len(level) - len(edges)
        name = f"links of index {index}" + (f" (all but {rest})" if rest else "")
        marks.append(tubes(name, color, edges, LINK_RADIUS * reach))

    chain = _in_space(run.chain) * unit
    marks.append(
        tubes("answer", palette.INK, [chain[k : k + 2] for k in range(len(chain) - 1)], SOLUTION_RADIUS * reach)
    )
    marks.append(balls("its joints", palette.INK, chain, 1.6 * SOLUTION_RADIUS * reach))
    marks.append(balls("goal", palette.TRAIL, goal, 2.4 * SOLUTION_RADIUS * reach))

    return marks


def _in_space(points: Matrix) -> Matrix:
    """Points of the plane at height 0, those of space as they are; shape (k, 3)."""
    lifted: Matrix = np.pad(points, [(0, 0), (0, 3 - points.shape[1])])
    return lifted
