"""How near a free motion comes to anything, with few looks: between two of them a distance changes little."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.world import Contact, World

CLOSE_ENOUGH = 0.002  # [m]; the least distance found is at most that much too large


def tightest(world: World, rows: Matrix) -> Contact | None:
    """The pair that is nearest to contact at any of some free configurations; None if nothing can collide.

    Looks first where the bound from earlier looks is lowest: two bodies approach each other by no more than twice the
    bound on the arm's displacement (world.py), so that most rows need no look.

    Args:
        world: Robot and surroundings.
        rows: Configurations that are free, shape (m, dof), m > 0.
    """
    bound, best = np.full(len(rows), -np.inf), None
    while True:
        row = int(np.argmin(bound))
        if best is not None and bound[row] >= best.distance - CLOSE_ENOUGH:
            return best
        found = world.closest(rows[row], known_free=True)
        if found is None:
            return None
        if best is None or found.distance < best.distance:
            best = found
        bound = np.maximum(bound, found.distance - 2.0 * np.abs(rows - rows[row]) @ world.weights)
        bound[row] = np.inf
