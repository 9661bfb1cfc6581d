"""Pictures of demonstrations as fixed cameras see them, drawn without a graphics card, a window or a browser.

What a picture shows depends on the arrays of a demonstration alone: joints, gripper and poses of objects.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.demos.episode import observed
from rrtik_ompl.files.text import file_name
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.overlay.rasterizer import Canvas, figure_of, moved, placed, robot_surfaces, surface_of_shape
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.tasks import Gripper, Task
from rrtik_ompl.tasks.setting import with_gripper
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.film_view import camera_of, sides_of

SIDES = {"front": (1.0, 0.0, 0.6), "side": (0.0, -1.0, 0.6), "top": (0.0, 0.0, 1.0)}  # where a camera is, from the task
FARTHER = 2.2  # times as far from the middle as the task is from the base
OPENING = 45.0  # [deg] of its view, from the upper to the lower edge
FINER = 2  # drawn so much finer, then made smaller: edges without steps
BACKGROUND = 0.88  # from 0 to 1
UP = np.array([0.0, 0.0, 1.0])


class DemoPictures:
    """Draws the pictures of demonstrations of a task; `rrtik.demos.record` takes it as ``pictures``.

    Args:
        task: The task.
        cameras: "front", "side" or "top"; or files of a view, as a page saves them, whose names are those of the
            cameras.
        size: Width and height [px], (320, 240) or "320x240".

    Attributes:
        names: Names of the cameras.
        size: Width and height [px].

    Raises:
        InputError: If a camera cannot be used, or two have one name.

    Example:
        >>> rrtik.demos.DemoPictures(rrtik.Task.load("panda_pick_place"), ["front", "top"]).names
        ('front', 'top')
    """

    def __init__(
        self, task: Task, cameras: Sequence[str | os.PathLike[str]], size: str | Sequence[int] = (320, 240)
    ) -> None:
        require(task, Task, "task of pictures", "use Task.load(file)")
        known = listed(cameras, "cameras of demonstrations")
        self.size = sides_of(size, ".png")
        self.names = tuple(each if each in SIDES else file_name(each).stem for each in map(str, known))
        if not self.names or len(set(self.names)) < len(self.names):
            raise InputError(f"cameras of demonstrations: expected different names, got {', '.join(self.names)}")
        self._task = task
        self._robot = task.world.robot
        self._views = [self._view(camera) for camera in known]
        self._make()

    def of(self, arrays: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, NDArray[np.uint8]]]:
        """Yield the pictures of a demonstration at each tick, by camera: red, green, blue, shape (height, width, 3)."""
        joints = self._robot.joint_frames(arrays["position"])
        shares = arrays["gripper"] if "gripper" in arrays else np.zeros(len(joints))
        canvases = [Canvas(self._lens(opening)) for _, opening in self._views]
        for frames, share, objects in zip(joints, shares.tolist(), arrays["object_pose"], strict=True):
            fingers = [frames[joint] @ pin.exp6(share * twist).homogeneous for joint, twist in self._fingers]
            things = [pin.XYZQUATToSE3(row).homogeneous for row in objects]
            world = np.array([*frames, *fingers, *things])
            yield {
                name: self._drawn(canvas, T @ world)
                for name, canvas, (T, _) in zip(self.names, canvases, self._views, strict=True)
            }

    def _drawn(self, canvas: Canvas, T_camera_frames: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture of a camera, with the frames of the figure in the frame of the camera."""
        canvas.clear()
        canvas.draw(placed(self._figure, T_camera_frames))
        colors = np.where(canvas.drawn[:, :, None], canvas.colors, np.float32(BACKGROUND))
        small = cv2.resize(colors, self.size, interpolation=cv2.INTER_AREA)
        picture: NDArray[np.uint8] = np.rint(255.0 * np.clip(small, 0.0, 1.0)).astype(np.uint8)
        return picture

    def _make(self) -> None:
        """Make the figure: links by their joints, fingers by their screws, and things that are observed."""
        robots = [self._robot] * 2
        if self._robot.gripper is not None:
            robots = [with_gripper(self._robot, Gripper("close", opening=share)) for share in (0.0, 1.0)]
        shut, wide = map(_solids, robots)
        numbers = []
        self._fingers: list[tuple[int, pin.Motion]] = []
        count = self._robot.model.njoints
        for closed, opened in zip(shut, wide, strict=True):
            twist = pin.log6(opened.placement * closed.placement.inverse())
            numbers.append(closed.parentJoint)
            if np.abs(twist.vector).max() > 1e-9:
                numbers[-1] = count + len(self._fingers)
                self._fingers.append((closed.parentJoint, twist))

        surfaces = list(robot_surfaces(robots[0], frames=numbers))
        first = count + len(self._fingers)
        things = {name: first + k for k, name in enumerate(observed(self._task))}
        for obstacle in self._task.world.scene.obstacles:
            if not obstacle.shape.bounded:
                continue
            pose = obstacle.pose
            if obstacle.name in things:
                color = obstacle.color or palette.ATTACHED
                surfaces.append(surface_of_shape(obstacle.shape, color, things[obstacle.name]))
            else:
                surface = surface_of_shape(obstacle.shape, obstacle.color or palette.OBSTACLE)
                surfaces.append(moved(surface, pose.rotation, pose.translation))
        self._figure = figure_of(surfaces)

    def _view(self, camera: str | os.PathLike[str]) -> tuple[Matrix, float]:
        """Return T_camera_world, shape (4, 4), and the angle of view [deg]."""
        if camera in SIDES:
            scene = self._task.world.scene
            places = [scene.obstacle(name).pose.translation for name in observed(self._task)]
            start = self._task.start
            q = self._robot.posture(start) if isinstance(start, str) else start
            place = np.mean(places, axis=0) if places else self._robot.fk(q).translation
            base = np.array(self._robot.model.jointPlacements[1].translation)
            far = max(float(np.linalg.norm(place - base)), 0.1)
            target = 0.5 * (place + base)
            way = np.array(SIDES[str(camera)])
            return _looking(target + FARTHER * far * way / np.linalg.norm(way), target), OPENING

        if not Path(file_name(camera)).is_file():
            raise InputError(f"camera '{camera}': expected {', '.join(SIDES)}, or a file of a view")
        views = camera_of(camera)
        if len(views) > 1 or isinstance(views, str):
            raise InputError(f"{camera}: has several views; a camera of demonstrations stands still, so leave one")
        (view,) = views
        return _looking(np.array(view["eye"]), np.array(view["target"])), float(view["fov"])

    def _lens(self, opening: float) -> Camera:
        """Return the camera of an angle of view [deg], as fine as it is drawn."""
        width, height = (FINER * side for side in self.size)
        focal = 0.5 * height / np.tan(0.5 * np.deg2rad(opening))
        matrix = [[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]]
        return Camera(matrix, width, height)


def _solids(robot: Robot) -> list[pin.GeometryObject]:
    """Return what is drawn of a robot's links."""
    return list(robot.visual.geometryObjects) or list(robot.collision.geometryObjects)


def _looking(eye: Vector, target: Vector) -> Matrix:
    """Return T_camera_world (z forward, y down), shape (4, 4), of a camera that looks at a point, upright."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    aside = UP if abs(forward @ UP) < 0.999 else np.array([1.0, 0.0, 0.0])
    right = np.cross(forward, aside)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    T = np.eye(4)
    T[:3, :3] = axes
    T[:3, 3] = -axes @ eye
    return T
