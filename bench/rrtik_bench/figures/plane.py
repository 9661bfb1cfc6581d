"""What stands in a plane scene, as a drawing shows it: obstacles, arms, routes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SOLID, INK = "#8494a5", "#1d2733"


def draw_scene(panel: Axes, scene: Scene, *, axes: tuple[int, int] = (0, 1)) -> None:
    """The obstacles seen along the third axis."""
    from matplotlib.collections import PolyCollection

    for item in scene.obstacles:
        surface = item.shape.surface()
        corners = surface.vertices @ item.pose.rotation.T + item.pose.translation
        triangles = corners[surface.faces][:, :, list(axes)]
        panel.add_collection(PolyCollection(list(triangles), facecolors=SOLID, edgecolors=SOLID, linewidths=0.3))
    panel.set_aspect("equal")


def arm_points(robot: Robot, q: Vector) -> Matrix:
    """Origins of the joints that move the tip, and the tip, shape (n + 1, 3)."""
    frames = robot.joint_frames(q[None])[0]
    points: Matrix = np.vstack([frames[-robot.dof :, :3, 3], robot.fk(q).translation])
    return points


def draw_arm(panel: Axes, robot: Robot, q: Vector, color: str, *, width: float = 1.5, strength: float = 1.0) -> None:
    """An arm as lines from joint to joint."""
    points = arm_points(robot, q)
    panel.plot(points[:, 0], points[:, 1], "-o", color=color, linewidth=width, markersize=1.6 * width, alpha=strength)


def between(waypoints: Matrix, count: int) -> Matrix:
    """So many configurations at equal distances along a route, ends included, shape (count, dof)."""
    steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    places = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, places[-1], count)
    return np.stack([np.interp(wanted, places, column) for column in waypoints.T], axis=1)
