"""Record the whole picture of a subject as commands of meshcat's viewer, and compute the box that the camera shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.viewer.drawing.framing import Frame, frame_around
from rrtik_ompl.viewer.drawing.marks import draw_marks
from rrtik_ompl.viewer.drawing.meshes import thickened
from rrtik_ompl.viewer.drawing.nodes import Node, Recording
from rrtik_ompl.viewer.drawing.robot_picture import (
    Part,
    attached_parts,
    draw_parts,
    joint_nodes,
    link_parts,
    swept_points,
)
from rrtik_ompl.viewer.drawing.scene_picture import draw_constraints, draw_goal, draw_scene, draw_triad, goal_frames
from rrtik_ompl.viewer.drawing.trail import draw_before, draw_trail
from rrtik_ompl.viewer.subject import Subject

FRAMING_SAMPLES = 100
MIN_THICKNESS = 0.01  # least thickness of a link, as a share of the picture


def draw(subject: Subject) -> tuple[Recording, Frame]:
    """Draw a subject: arm in its first configuration, obstacles, goal and trail; the page adds the ghosts."""
    recording = Recording()
    vis = recording.root
    robot = subject.robot
    scene = subject.scene

    if robot is None:
        frame = frame_around(None, scene, [mark.vertices for mark in subject.marks])
    else:
        frame = _draw_robot(vis, robot, subject)
        draw_goal(vis, subject.goal, frame)
        draw_constraints(vis, subject.held, frame)

        if len(subject.waypoints) > 1:
            doubtful = () if subject.verdict is None else subject.verdict.unproven
            beads = subject.run is None and subject.times is None
            goal = subject.goal
            arms = [robot] if goal is None else goal.arms(robot)
            draw_trail(vis, arms, subject.waypoints, 0.0035 * frame.arm, beads=beads, unproven=doubtful)

        if subject.before is not None:
            draw_before(vis, robot, subject.before, 0.0035 * frame.arm)

    draw_scene(vis, scene, frame)
    draw_marks(vis, subject.marks)
    draw_triad(vis["frames"]["world"], pin.SE3.Identity(), 0.1 * frame.arm, _axes(robot))

    if robot is not None and robot.planar:
        _flatten(vis, frame)

    return recording, frame


def _draw_robot(vis: Node, robot: Robot, subject: Subject) -> Frame:
    """Draw the arm and the model of its ghosts in the first configuration; return the box around everything."""
    shown = _spread(subject.waypoints)
    if subject.end is not None:
        shown = np.vstack([shown, subject.end])
    if subject.ghosts is not None:
        shown = np.vstack([shown, subject.ghosts])

    frames = robot.joint_frames(shown)
    held = attached_parts(robot, subject.scene.attached)
    parts = link_parts(robot) + held
    points = swept_points(parts, frames)

    places = _goal_points(subject.goal) + [mark.vertices for mark in subject.marks]
    if subject.before is not None:
        places.append(robot.fk_batch(_spread(subject.before))[:, :3, 3])

    frame = frame_around(points, subject.scene, places, whole=robot.planar)
    _draw_parts(vis["robot"], robot, parts, frames[0], frame)

    tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
    draw_triad(
        vis["robot"][joint_nodes(robot)[tip.parentJoint]]["tip frame"], tip.placement, 0.07 * frame.arm, _axes(robot)
    )

    return frame


def _axes(robot: Robot | None) -> str:
    """Return the axes of frames that are drawn: seen from above, the third one is a point."""
    return "xy" if robot is not None and robot.planar else "xyz"


def _draw_parts(node: Node, robot: Robot, parts: list[Part], frames: NDArray[np.float64], frame: Frame) -> None:
    """Draw the arm; if it consists only of lines and points, it is made thick enough to be visible."""
    least = MIN_THICKNESS * frame.size
    seen = [replace(part, look=thickened(part.look, least)) for part in parts]
    too_thin = all(new.look is not old.look for new, old in zip(seen, parts, strict=True))
    draw_parts(node, robot, seen if too_thin else parts, frames)


def _spread(waypoints: Matrix) -> Matrix:
    """Return configurations distributed over a path, shape (m, dof), that must be in the picture."""
    places = np.arange(len(waypoints))
    wanted = np.linspace(0.0, places[-1], FRAMING_SAMPLES if len(places) > 1 else 1)
    return np.stack([np.interp(wanted, places, column) for column in waypoints.T], 1)


def _flatten(vis: Node, frame: Frame) -> None:
    """Flatten the obstacles of a planar world, so that, seen from above, they do not cover the arm."""
    height = max(2.0 * float(np.abs([frame.low[2], frame.high[2]]).max()), 1e-9)
    squeeze = np.diag([1.0, 1.0, min(0.01 * frame.size / height, 1.0), 1.0])
    vis["obstacles"].set_transform(squeeze)
    vis["later"].set_transform(squeeze)


def _goal_points(goal: Goal | None) -> list[Matrix]:
    """Return positions of the tip that represent each part of a goal, shape (m, 3) each."""
    parts = () if goal is None else goal.parts
    return [goal_frames(part.region())[:, :3, 3] for part in parts]
