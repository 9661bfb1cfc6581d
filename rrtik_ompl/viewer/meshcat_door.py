"""Draw into a meshcat server that already runs: the solids of a page, and the motion as an animation of meshcat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import umsgpack
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_xyzw
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.viewer.asked import Parts
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.nodes import ROOT, Material, Recording
from rrtik_ompl.viewer.drawing.robot_picture import joint_nodes
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.run_story import run_story
from rrtik_ompl.viewer.story import play_times
from rrtik_ompl.viewer.subject import Subject
from rrtik_ompl.viewer.task_story import subject_asked

OWN = "rrtik"  # the node below which everything is drawn; a second call replaces it
RATE = 30  # poses a second of the animation
GHOST = 0.42  # opacity of the arm at the goal


def draw_into(visualizer: object, parts: Parts, run: ReplanRun | None) -> None:
    """Draw what is shown below the node ``rrtik`` of a visualizer, and let its motion play there once.

    Args:
        visualizer: A ``meshcat.Visualizer``, or pinocchio's ``MeshcatVisualizer``, whose server runs.
        parts: What is shown.
        run: A run in place of a path.

    Raises:
        InputError: If it is neither, or has no server yet.
    """
    vis = _meshcat_of(visualizer)
    subject = subject_asked(parts.shown, parts.path, run, parts.before)
    recording, frame = draw(subject)
    if subject.robot is not None and subject.end is not None:
        _draw_goal(recording, subject.robot, subject.end)
    own = vis[OWN]
    own.delete()
    for command in recording.commands:
        _send(own, umsgpack.unpackb(command))
    if len(subject.waypoints) > 1:
        own.set_animation(_animation(own, subject, frame), play=True, repetitions=1)


def _meshcat_of(visualizer: Any) -> Any:  # noqa: ANN401 - meshcat has no types
    """Return the ``meshcat.Visualizer`` that is given, or that a visualizer of pinocchio holds."""
    found = visualizer if hasattr(visualizer, "window") else getattr(visualizer, "viewer", None)
    if not hasattr(found, "window") or not hasattr(found, "set_animation"):
        remedy = "; call its initViewer() first" if hasattr(visualizer, "initViewer") else ""
        raise InputError(
            "meshcat: expected a meshcat.Visualizer, or pinocchio's MeshcatVisualizer, "
            f"got a {type(visualizer).__name__}{remedy}"
        )
    return found


def _send(own: Any, command: dict[str, Any]) -> None:  # noqa: ANN401
    """Send a recorded command to the server, for the same node below the one that is ours."""
    path = own.path.lower() + command["path"].removeprefix(ROOT)
    socket = own.window.zmq_socket
    socket.send_multipart([command["type"].encode(), path.encode(), umsgpack.packb({**command, "path": path})])
    socket.recv()


def _draw_goal(recording: Recording, robot: Robot, q: NDArray[np.float64]) -> None:
    """Draw the arm at the goal, in the goal's colour and seen through."""
    arm = f"{ROOT}/robot"
    glass = Material(color=palette.number(palette.GOAL), opacity=GHOST, hides=False)
    ghost = recording.root["goal ghost"]
    names = joint_nodes(robot)
    for name, frame in zip(names, robot.joint_frames(q[None])[0], strict=True):
        ghost[name].set_transform(frame)
    for path, (geometry, _) in list(recording.drawn.items()):
        joint, _, leaf = path.removeprefix(f"{arm}/").partition("/")
        if path.startswith(f"{arm}/") and leaf and "tip frame" not in leaf:
            node = ghost[joint][leaf]
            node.set_object(geometry, glass)
            if path in recording.places:
                node.set_transform(recording.places[path])


def _animation(own: Any, subject: Subject, frame: Any) -> Any:  # noqa: ANN401
    """Return the motion as an animation: the poses of joints, and of obstacles that move in a run or a task."""
    from meshcat.animation import Animation

    robot = subject.robot
    assert robot is not None, "what moves has one"
    if subject.times is not None:
        times = subject.times
    else:
        times = play_times(robot, subject.waypoints, frame.arm) if subject.run is None else subject.run.times
    clock = np.linspace(times[0], times[-1], int(np.ceil(RATE * (times[-1] - times[0]))) + 1)
    rows = np.stack([np.interp(clock, times, column) for column in subject.waypoints.T], axis=1)

    animation = Animation(default_framerate=RATE)
    frames = robot.joint_frames(rows)
    for number, name in enumerate(joint_nodes(robot)):
        _add_poses(animation, own["robot"][name], frames[:, number])
    if subject.run is not None:
        latest = np.searchsorted(times, clock + 1e-9, side="right") - 1
        for name, moving in run_story(subject.run, robot, subject.scene, frame)["moving"].items():
            placement = np.reshape(moving["placement"], (4, 4))
            poses = [pose_from_xyzw(row[:3], row[3:]).homogeneous @ placement for row in moving["poses"]]
            _add_poses(animation, own["obstacles"][name], np.array(poses)[latest])
    return animation


def _add_poses(animation: Any, node: Any, poses: NDArray[np.float64]) -> None:  # noqa: ANN401
    """Add poses of a node, shape (frames, 4, 4), one for each picture; only the first of a node that stands still."""
    turns = np.array([pin.Quaternion(pose[:3, :3]).coeffs() for pose in poses])
    flips = np.sign((turns[1:] * turns[:-1]).sum(axis=1))  # of two signs of a turn the nearer one, for what is between
    turns[1:] *= np.cumprod(np.where(flips == 0.0, 1.0, flips))[:, None]
    still = np.array_equal(poses, np.broadcast_to(poses[0], poses.shape))
    with animation.at_frame(node, 0) as clip:
        for k in range(1 if still else len(poses)):
            clip.current_frame = k
            clip.set_property("position", "vector3", poses[k, :3, 3].tolist())
            clip.set_property("quaternion", "quaternion", turns[k].tolist())
