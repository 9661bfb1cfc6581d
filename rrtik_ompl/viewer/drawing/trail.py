"""The trail of one or several tips: one tube per move, so that the page can highlight the present move."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.nodes import Material, Node, SphereGeometry
from rrtik_ompl.viewer.drawing.scene_picture import draw_tube

# [rad]; motion of all joints together between two rings of a tube: what turns a long arm's tip.
RING_STEP = np.deg2rad(6.0)
MAX_RINGS = 1500  # approximate total number of rings
BEFORE_OPACITY = 0.5  # of the path for comparison: the path that counts is the strong one
MAX_PIECES = 150  # longer paths are drawn in this many pieces of several moves each


def pieces(waypoints: Matrix) -> NDArray[np.int64]:
    """Return, for each move of a path, shape (k, dof), the number of its piece of the trail, shape (k - 1,)."""
    moves = len(waypoints) - 1
    return np.arange(moves) * min(moves, MAX_PIECES) // max(moves, 1)


def draw_trail(
    vis: Node,
    arms: Sequence[Robot],
    waypoints: Matrix,
    radius: float,
    *,
    beads: bool = True,
    unproven: Sequence[int] = (),
) -> None:
    """Draw the trails of tips under ``trail/piece N``, and under ``beads`` a bead at every waypoint of the first.

    Args:
        vis: Root of the tree of nodes.
        arms: The arm, once for each of its tips whose trail is drawn.
        waypoints: Shape (k, dof) with k at least 2.
        radius: Radius of the tubes [m].
        beads: Whether to draw the beads.
        unproven: Numbers of the moves that are not proven free; pieces with such moves have another colour.
    """
    piece = pieces(waypoints)
    doubtful = set(piece[list(unproven)].tolist())

    for k in np.unique(piece):
        first, last = np.flatnonzero(piece == k)[[0, -1]]
        rows = _dense(arms[0], waypoints[first : last + 2], len(waypoints))
        for number, arm in enumerate(arms):
            tips = _way(arm, rows, radius)
            node = vis["trail"][f"piece {k}"]
            if len(tips) > 1:  # a rotating wrist may leave the tip in place
                color = palette.UNPROVEN if k in doubtful else palette.TRAIL
                draw_tube(node if number == 0 else node[f"tip {number + 1}"], tips, radius, color)

    if beads and len(waypoints) <= MAX_PIECES:
        for k, tip in enumerate(arms[0].fk_batch(waypoints)):
            bead = vis["beads"][f"waypoint {k}"]
            bead.set_object(SphereGeometry(2.0 * radius), Material(color=palette.number(palette.TRAIL)))
            bead.set_transform(tip)


def draw_before(vis: Node, robot: Robot, waypoints: Matrix, radius: float) -> None:
    """Draw the tip's trail on another path, thinner, under ``before``; arguments as of :func:`draw_trail`."""
    tips = _way(robot, _dense(robot, waypoints, len(waypoints)), radius)
    if len(tips) > 1:
        draw_tube(vis["before"], tips, 0.6 * radius, palette.BEFORE, BEFORE_OPACITY)


def _way(arm: Robot, rows: Matrix, radius: float) -> Matrix:
    """Return the positions of the tip, shape (m, 3), without those too close for a tube of this radius [m]."""
    tips = arm.fk_batch(rows)[:, :3, 3]
    far = np.linalg.norm(np.diff(tips, axis=0), axis=1) > 0.05 * radius
    way: Matrix = tips[np.insert(far, 0, True)]
    return way


def _dense(robot: Robot, waypoints: Matrix, total: int) -> Matrix:
    """Return configurations along moves, shape (m, dof), so dense that the arcs of the tip appear round."""
    most = max(MAX_RINGS // total, 2)
    rows = [waypoints[:1]]

    for a, b in pairwise(waypoints):
        turn = float(np.abs(b - a)[~robot.prismatic].sum())
        steps = int(np.clip(np.ceil(turn / RING_STEP), 1, most))
        rows.append(a + (b - a) * np.linspace(0.0, 1.0, steps + 1)[1:, None])

    return np.concatenate(rows)
