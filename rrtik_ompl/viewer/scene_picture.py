"""What stands around the arm: obstacles, moving ones with a hint of their way, and the goal's frame or point."""

from __future__ import annotations

from typing import Any

import meshcat.geometry as mg
import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.goal import Goal, GoalRegion, PoseGoal, PositionGoal
from rrtik_ompl.scene import ConstantVelocity, Motion, Obstacle, Scene
from rrtik_ompl.shapes import Box, HalfSpace, Sphere
from rrtik_ompl.viewer import palette
from rrtik_ompl.viewer.framing import Frame
from rrtik_ompl.viewer.meshes import half_space_plate, look_of_shape, look_of_triangles
from rrtik_ompl.viewer.robot_picture import node_name
from rrtik_ompl.viewer.triangles import tube

MAX_GOALS_DRAWN = 20
LATER_SECONDS = (1.0, 2.0, 3.0)  # when an obstacle of constant velocity is drawn again, faintly


def draw_scene(vis: Any, scene: Scene, frame: Frame) -> None:
    """Draw all obstacles under ``obstacles`` and the later places of moving ones under ``later``."""
    for obstacle in scene.at(0.0).obstacles:
        _draw_obstacle(vis["obstacles"][node_name(obstacle.name)], obstacle, frame)
    for obstacle in scene.obstacles:
        if obstacle.motion is not None and not isinstance(obstacle.shape, HalfSpace):
            _draw_motion(vis["later"][node_name(obstacle.name)], obstacle, obstacle.motion, frame)


def _draw_obstacle(node: Any, obstacle: Obstacle, frame: Frame) -> None:
    pose = obstacle.pose.homogeneous
    if isinstance(obstacle.shape, HalfSpace):
        look, local = half_space_plate(obstacle.shape, obstacle.pose.actInv(frame.centre), 1.5 * frame.size)
        node.set_object(look.geometry, _material(palette.OBSTACLE, opacity=0.2))
        node.set_transform(pose @ local @ look.placement)
    else:
        look = look_of_shape(obstacle.shape)
        node.set_object(look.geometry, _material(palette.OBSTACLE))
        node.set_transform(pose @ look.placement)


def _draw_motion(node: Any, obstacle: Obstacle, motion: Motion, frame: Frame) -> None:
    times = LATER_SECONDS if isinstance(motion, ConstantVelocity) else tuple(motion.times[motion.times > 0.0])
    look = look_of_shape(obstacle.shape)
    for k, time in enumerate(times):
        node[f"at {k}"].set_object(look.geometry, _material(palette.OBSTACLE, opacity=0.2))
        node[f"at {k}"].set_transform(motion.pose_at(obstacle.pose, time).homogeneous @ look.placement)
    stations = np.array([motion.pose_at(obstacle.pose, time).translation for time in np.linspace(0.0, times[-1], 40)])
    draw_tube(node["way"], stations, 0.003 * frame.arm, palette.OBSTACLE)


def draw_goal(vis: Any, goal: Goal | None, frame: Frame) -> None:
    """Draw the frame of a pose goal, the point of a position goal, or all of those of a region, under ``goal``."""
    members = goal.members[:MAX_GOALS_DRAWN] if isinstance(goal, GoalRegion) else (goal,)
    for k, member in enumerate(members):
        node = vis["goal"][f"{k}"]
        if isinstance(member, PoseGoal):
            draw_triad(node["frame"], member.T_world_tip, 0.12 * frame.arm)
            if isinstance(goal, GoalRegion) and goal.box.any():
                look = look_of_shape(Box(np.maximum(goal.box, 0.002 * frame.arm)))
                node["region"].set_object(look.geometry, _material(palette.GOAL, opacity=0.3))
                node["region"].set_transform(member.T_world_tip.homogeneous)
        elif isinstance(member, PositionGoal):
            look = look_of_shape(Sphere(max(member.tolerance, 0.012 * frame.arm)))
            node["point"].set_object(look.geometry, _material(palette.GOAL))
            node["point"].set_transform(pin.SE3(np.eye(3), np.array(member.position)).homogeneous)


def draw_triad(node: Any, pose: Any, length: float) -> None:
    """Draw a frame: x, y and z axes of a given length [m] in three colours."""
    node.set_transform(pose.homogeneous)
    for axis, color, direction in zip("xyz", palette.AXES, np.eye(3), strict=True):
        draw_tube(node[axis], np.stack([0.0 * direction, length * direction]), 0.035 * length, color)


def draw_tube(node: Any, points: Matrix, radius: float, color: str) -> None:
    """Draw a line through points, shape (k, 3), as a tube, because WebGL draws lines one pixel wide."""
    look = look_of_triangles(*tube(points, radius))
    node.set_object(look.geometry, _material(color))


def _material(color: str, opacity: float = 1.0) -> Any:
    return mg.MeshPhongMaterial(color=palette.number(color), opacity=opacity, shininess=10, depthWrite=opacity == 1.0)
