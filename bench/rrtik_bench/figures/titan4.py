"""Figures of [1, ch. 3]: TITAN-4 where it is singular, with the postures that keep the pose of the tip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.figures.plane import INK, arm_points
from rrtik_bench.report.figures import Figure
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.viewer.plots.joints import COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

STEP, STEPS, SHOWN = 0.02, 45, 9  # [rad] along a self-motion, so many both ways, every so manieth drawn
TICKS = (0.0, 0.5, 1.0, 1.5)  # [m]
ROUNDED = 1e-5  # singular values below are 0: the last posture has four decimals
CASES = {  # joints [deg]; P lies on axis 1 in the last
    "elbow: theta3 = 0": (20.0, 40.0, 0.0, -60.0, 30.0, 0.0),
    "wrist: theta5 = 90 deg": (20.0, 30.0, -70.0, 40.0, 90.0, 10.0),
    "shoulder: P on axis 1": (11.4592, 80.0, 43.9549, -33.9549, 0.0, 17.1887),
}


def self_motion(robot: Robot, q: Vector) -> Matrix:
    """Postures with the tip's pose of a singular one, both ways along the direction that leaves it at rest; (k, 6)."""
    goal, ways = rrtik.PoseGoal(robot.fk(q)), []
    for sign in (-1.0, 1.0):
        here, along, rows = q, None, []
        for _ in range(STEPS):
            rest = np.linalg.svd(robot.jacobian(here))[2][-1]
            along = sign * rest if along is None else rest * np.sign(rest @ along)
            ends, _ = descend(robot, goal, (here + STEP * along)[None], iterations=8)
            tip, wanted = robot.fk(ends[0]).homogeneous, robot.fk(q).homogeneous
            if np.abs(tip - wanted).max() > 1e-6 or np.linalg.norm(ends[0] - here) < 0.5 * STEP:
                break
            here = ends[0]
            rows.append(here)
        ways.append(rows)
    return np.array([*ways[0][::-1], q, *ways[1]])


def singular(drawing: Drawing, quick: bool) -> None:
    """The three families; blue: postures with the same pose of the tip."""
    del quick
    robot = rrtik.load_robot("titan4")
    for place, (title, degrees) in enumerate(CASES.items(), start=1):
        panel, q = drawing.add_subplot(1, 3, place, projection="3d"), np.radians(degrees)
        row = self_motion(robot, q)
        for posture in row[:: max(1, len(row) // SHOWN)]:
            _draw(panel, robot, posture, COLORS[0], 0.45)
        _draw(panel, robot, q, INK, 1.0)
        panel.plot([0, 0], [0, 0], [-0.3, 1.3], color=COLORS[7], linewidth=0.8, linestyle="dashed")
        span = float(np.degrees(np.abs(np.diff(row, axis=0)).sum(axis=0)).max()) if len(row) > 1 else 0.0
        values = np.linalg.svd(robot.jacobian(q), compute_uv=False)
        moved = f"{span:.0f} deg of self-motion drawn" if span > 0.0 else "no self-motion"
        panel.set_title(f"{title}\nrank {int((values > ROUNDED).sum())}; {moved}", fontsize=9)
        panel.set_box_aspect((1, 1, 1))
        panel.set(xlim=(-0.3, 1.6), ylim=(-0.6, 1.3), zlim=(-0.3, 1.6), xticks=TICKS, yticks=TICKS, zticks=TICKS)


def _draw(panel: Axes, robot: Robot, q: Vector, color: str, strength: float) -> None:
    panel.plot(*arm_points(robot, q).T, "-o", color=color, linewidth=1.6, markersize=3, alpha=strength)


FIGURES: dict[str, tuple[Figure, ...]] = {
    "titan4-singularities": (
        Figure("titan4_singular", "Singular postures; blue: others with the same pose", "[1, figures 3.4 to 3.6]",
               singular, size=(12.0, 4.8)),
    ),
}  # fmt: skip
