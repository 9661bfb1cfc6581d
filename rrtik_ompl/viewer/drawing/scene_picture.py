"""Draw the surroundings: obstacles, moving ones with a part of their motion, and the goal's frame or point."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.poses import turned_z
from rrtik_ompl.constraints.held_region import ANYWHERE, HeldRegion, Turning
from rrtik_ompl.model.goal import Goal, Target
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.scene import ConstantVelocity, Motion, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, HalfSpace, Sphere
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.framing import Frame
from rrtik_ompl.viewer.drawing.meshes import Look, half_space_plate, look_of_margin, look_of_shape, look_of_triangles
from rrtik_ompl.viewer.drawing.nodes import Material, Node
from rrtik_ompl.viewer.drawing.painting import obstacle_colors
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.viewer.drawing.triangles import tube

MAX_GOALS_DRAWN = 20
FRAMES_PER_RANGE = 7
LATER_SECONDS = (1.0, 2.0, 3.0)  # times at which an obstacle of constant velocity is drawn again, faintly

SIDES = 24  # sides of a cone
CONE = 0.3  # length of a cone, as a share of the arm's diagonal
THINNEST = 0.004  # thickness of a plane or a line, as a share of the arm's diagonal
OPACITY = 0.2
PLATE_OPACITY = 0.4  # of a half-space


def draw_scene(vis: Node, scene: Scene, frame: Frame) -> None:
    """Draw obstacles and their margins under ``obstacles``, the later poses of moving ones under ``later``."""
    colors = obstacle_colors(scene.obstacles)
    for obstacle in scene.at(0.0).obstacles:
        _draw_obstacle(vis["obstacles"][node_name(obstacle.name)], obstacle, colors[obstacle.name], frame)
    for obstacle in scene.obstacles:
        if obstacle.motion is not None and obstacle.shape.bounded:
            node = vis["later"][node_name(obstacle.name)]
            _draw_motion(node, obstacle, obstacle.motion, colors[obstacle.name], frame)


def obstacle_look(obstacle: Obstacle, frame: Frame) -> tuple[Look, Matrix]:
    """Return the look of an obstacle, and its placement in the obstacle's frame, shape (4, 4)."""
    if isinstance(obstacle.shape, HalfSpace):
        look, local = half_space_plate(obstacle.shape, obstacle.pose.actInv(frame.centre), 1.5 * frame.size)
        return look, local @ look.placement
    look = look_of_shape(obstacle.shape)
    return look, look.placement


def _draw_obstacle(node: Node, obstacle: Obstacle, color: str, frame: Frame) -> None:
    look, placement = obstacle_look(obstacle, frame)
    opacity = 1.0 if obstacle.shape.bounded else PLATE_OPACITY
    node.set_object(look.geometry, look_material(color, opacity))
    node.set_transform(obstacle.pose.homogeneous @ placement)
    _draw_margin(node["margin"], obstacle, color, placement)


def _draw_margin(node: Node, obstacle: Obstacle, color: str, placement: Matrix) -> None:
    """Draw the margin of an obstacle below its node, which has ``placement`` in the obstacle's frame."""
    look = look_of_margin(obstacle.shape, obstacle.margin) if obstacle.margin else None
    if look is not None:
        node.set_object(look.geometry, look_material(color, opacity=0.2))
        node.set_transform(np.linalg.solve(placement, look.placement))


def _draw_motion(node: Node, obstacle: Obstacle, motion: Motion, color: str, frame: Frame) -> None:
    times = LATER_SECONDS if isinstance(motion, ConstantVelocity) else tuple(motion.times[motion.times > 0.0])
    look = look_of_shape(obstacle.shape)

    for k, time in enumerate(times):
        node[f"at {k}"].set_object(look.geometry, look_material(color, opacity=0.2))
        node[f"at {k}"].set_transform(motion.pose_at(obstacle.pose, time).homogeneous @ look.placement)

    stations = np.array([motion.pose_at(obstacle.pose, time).translation for time in np.linspace(0.0, times[-1], 40)])
    draw_tube(node["way"], stations, 0.003 * frame.arm, color)


def draw_goal(vis: Node, goal: Goal | None, frame: Frame) -> None:
    """Draw under ``goal`` the frame of a pose, the point of a position, or all parts of a region."""
    if goal is None:
        return

    for k, part in enumerate(goal.parts[:MAX_GOALS_DRAWN]):
        node = vis["goal"][f"{k}"]
        if not isinstance(part, Target):
            _draw_region(node, part.region(), frame)
        elif part.oriented:
            draw_triad(node["frame"], part.pose, 0.12 * frame.arm)
        else:
            look = look_of_shape(Sphere(max(part.tolerances[0], 0.012 * frame.arm)))
            node["point"].set_object(look.geometry, look_material(palette.GOAL))
            node["point"].set_transform(part.pose.homogeneous)


def _draw_region(node: Node, region: TaskRegion, frame: Frame) -> None:
    """Draw the box of a region's positions, and frames of the tip along each of its ranges."""
    low, high = region.bounds.T
    if (low < high)[:3].any():
        look = look_of_shape(Box(np.maximum((high - low)[:3], 0.002 * frame.arm)))
        node["region"].set_object(look.geometry, look_material(palette.GOAL, opacity=0.3))
        middle = pin.SE3(np.eye(3), 0.5 * (low + high)[:3] + region.T_w_tip.translation)
        node["region"].set_transform((region.T_world_w * middle).homogeneous)

    for k, pose in enumerate(goal_frames(region)):
        draw_triad(node["frame" if k == 0 else f"frame {k}"], pin.SE3(pose), (0.12 if k == 0 else 0.05) * frame.arm)


def goal_frames(region: TaskRegion) -> NDArray[np.float64]:
    """Return poses of the tip that represent a region, shape (k, 4, 4).

    The first one has the least displacement; the others vary it along each range that is free.
    """
    low, high = region.bounds.T
    least = np.clip(np.zeros(6), low, high)

    rows = [least]
    for k in np.flatnonzero(region.free):
        for value in np.linspace(low[k], min(high[k], low[k] + TAU), FRAMES_PER_RANGE):
            rows.append(np.where(np.arange(6) == k, value, least))

    return region.poses(np.array(rows))


def draw_triad(node: Node, pose: pin.SE3, length: float, axes: str = "xyz") -> None:
    """Draw a frame: axes of a given length [m] in three colours; those of a planar world are x and y."""
    node.set_transform(pose.homogeneous)
    for axis, color, direction in zip(axes, palette.AXES, np.eye(3), strict=False):
        draw_tube(node[axis], np.stack([0.0 * direction, length * direction]), 0.025 * length, color)


def draw_tube(node: Node, points: Matrix, radius: float, color: str, opacity: float = 1.0) -> None:
    """Draw a line through points, shape (k, 3), as a tube, because WebGL draws lines one pixel wide."""
    look = look_of_triangles(*tube(points, radius))
    node.set_object(look.geometry, look_material(color, opacity))


def look_material(color: str, opacity: float = 1.0) -> Material:
    """Return a dull surface of a colour, transparent if its opacity is below 1."""
    return Material(color=palette.number(color), opacity=opacity, shininess=10, hides=opacity == 1.0)


def draw_constraints(vis: Node, held: Iterable[tuple[HeldRegion, Vector]], frame: Frame) -> None:
    """Draw regions under ``constraints``: the box that bounds the position, and a cone for a bounded axis.

    Args:
        vis: Root node of the page.
        held: Regions, and the configurations, shape (dof,), at which they begin to hold.
        frame: What the page shows.
    """
    for k, (region, start) in enumerate(held):
        node = vis["constraints"][f"{k}"]
        D = region.displacements(start[None])[0]

        if (np.abs(region.region.bounds[:3]) < ANYWHERE).any():
            low, high = _seen(region.region.bounds[:3], D[:3, 3], frame)
            look = look_of_shape(Box(np.maximum(high - low, THINNEST * frame.arm)))
            node["place"].set_object(look.geometry, look_material(palette.GOAL, OPACITY))
            node["place"].set_transform(region.T_world_w @ pin.SE3(np.eye(3), 0.5 * (low + high)).homogeneous)

        if region.turning == Turning.AXIS:
            length = CONE * frame.arm
            cone = _cone(length, length * np.tan(region.region.orientation_tolerance))
            node["axis"].set_object(look_of_triangles(*cone).geometry, look_material(palette.GOAL, 2.0 * OPACITY))
            node["axis"].set_transform(region.T_world_w @ pin.SE3(turned_z(region.direction), D[:3, 3]).homogeneous)


def _seen(bounds: Matrix, near: Vector, frame: Frame) -> tuple[Vector, Vector]:
    """Return the corners, shape (3,) each, of the drawn part of a box that may be unbounded, around a point."""
    half = 0.75 * frame.arm
    return np.maximum(bounds[:, 0], near - half), np.minimum(bounds[:, 1], near + half)


def _cone(length: float, radius: float) -> tuple[Matrix, NDArray[np.int64]]:
    """Return the vertices and faces, shapes (n, 3), of a cone that opens along z from its tip."""
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(SIDES, length)])

    # Vertex 0 is the tip, 1 to SIDES are the rim, SIDES + 1 is the centre of the lid.
    around = np.arange(SIDES) + 1
    following = np.roll(np.arange(SIDES) + 1, -1)
    faces = np.column_stack([np.zeros(SIDES, dtype=np.int64), following, around])
    lid = np.column_stack([np.full(SIDES, SIDES + 1), around, following])

    return np.vstack([np.zeros(3), rim, [0.0, 0.0, length]]), np.vstack([faces, lid])
