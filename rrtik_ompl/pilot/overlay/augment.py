"""Augmented pictures: arm, ghosts, obstacles, trail and frames over a camera's picture, with occlusion.

Source: [1, ch. 4 and 6].
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.base.colors import fractions
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.pilot.overlay.rasterizer import (
    FARTHEST_DRAWN,
    NEAREST_DRAWN,
    ROBOT_TRIANGLES,
    Canvas,
    Figure,
    ShapeSurfaces,
    figure_of,
    half_as_fine,
    obstacle_surfaces,
    placed,
    robot_surfaces,
    tinted,
)
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.viewer.drawing import palette

GHOST_TRIANGLES = 5_000
# In pictures with more pixels, ghosts are drawn at half the resolution, in a quarter of the time.
FINE_PIXELS = 500_000
HALF_COVERED = 127
MAX_FIGURES = 4  # cached from picture to picture
MAX_LAYERS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Ghost:
    """The arm at another configuration, drawn transparently in one colour ('#rrggbb').

    Attributes:
        q: The configuration, shape (dof,); None draws only the gripper, for a pose that no configuration reaches.
        color: Its colour.
        opacity: From 0 to 1.
        T_base_tip: Pose of the gripper if ``q`` is None.
        outline: Colour of a contour, for viewers who cannot distinguish the colours; None for no contour.
    """

    q: Vector | None
    color: str = palette.GOAL
    opacity: float = 0.35
    T_base_tip: pin.SE3 | None = None
    outline: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """A rendered drawing that can be blended into pictures.

    Attributes:
        depths: Depth along the optical axis [m], shape (height, width).
        drawn: Mask of the pixels that were drawn, shape (height, width).
        box: Slices of rows and columns that contain all drawn pixels.
        painted: Colours inside the box, blue, green, red, shape (rows, columns, 3); undefined where nothing was drawn.
    """

    depths: NDArray[np.float32]
    drawn: NDArray[np.bool_]
    box: tuple[slice, slice]
    painted: NDArray[np.uint8]

    @classmethod
    def of(cls, canvas: Canvas, camera: Camera) -> Layer:
        """Convert a canvas to a layer of the camera's size; the canvas may have a lower resolution."""
        colors: Any = canvas.colors
        depths: Any = canvas.depths.copy()
        drawn = canvas.drawn
        if depths.shape != (camera.height, camera.width):
            size = camera.width, camera.height
            colors, depths = (cv2.resize(each, size, interpolation=cv2.INTER_NEAREST) for each in (colors, depths))
            share = cv2.resize(255 * drawn.view(np.uint8), size, interpolation=cv2.INTER_LINEAR)
            # The interpolated mask has smooth edges, without the steps of the coarse one.
            drawn = (depths < FARTHEST_DRAWN) & (share > HALF_COVERED)

        left, top, width, height = cv2.boundingRect(drawn.view(np.uint8))

        box = np.s_[top : top + height, left : left + width]

        piece: Any = colors[box]
        if width > 0:
            piece = cv2.cvtColor(cv2.convertScaleAbs(piece, alpha=255.0), cv2.COLOR_RGB2BGR)
        return cls(np.asarray(depths), drawn, box, np.asarray(piece, dtype=np.uint8))

    def blend(self, picture: NDArray[np.uint8], mask: NDArray[np.bool_], opacity: float) -> None:
        """Blend the layer into a picture where a mask is set; the picture is changed in place.

        Args:
            picture: Blue, green, red, shape (height, width, 3).
            mask: Shape (height, width).
            opacity: From 0 to 1.
        """
        if self.painted.size == 0:
            return

        piece = picture[self.box]
        mixed = cv2.addWeighted(piece, 1.0 - opacity, self.painted, opacity, 0.0)
        cv2.copyTo(mixed, mask[self.box].view(np.uint8), piece)


class Augmenter:
    """Draw one arm over the pictures of one camera."""

    def __init__(self, robot: Robot, camera: Camera, triangles: int = ROBOT_TRIANGLES) -> None:
        """Prepare the arm's triangles once.

        Args:
            robot: The arm.
            camera: Camera of the pictures, real or virtual.
            triangles: Approximate largest number of triangles of the whole arm.
        """
        self.robot = robot
        self.camera = camera
        self._canvas = Canvas(camera)
        large = camera.width * camera.height > FINE_PIXELS
        self._ghosts_canvas = Canvas(half_as_fine(camera)) if large else self._canvas
        self._layers: dict[Hashable, Layer] = {}
        self._arm = figure_of(robot_surfaces(robot, triangles))

        thin = robot_surfaces(robot, min(triangles, GHOST_TRIANGLES))
        self._tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
        self._ghost = figure_of(thin)
        self._gripper = figure_of([each for each in thin if each.frame == self._tip.parentJoint])

        self._figures: dict[Hashable, tuple[tuple[Obstacle, ...], Figure]] = {}
        self._shapes = ShapeSurfaces()
        self._last: Layer  # the layer of the arm drawn last

    def draw(
        self,
        picture: NDArray[np.uint8],
        T_base_camera: pin.SE3,
        q: Vector | None = None,
        *,
        ghosts: Sequence[Ghost] = (),
        obstacles: Sequence[Obstacle] = (),
        real: Sequence[Obstacle] = (),
        trail: Matrix | None = None,
        frames: Sequence[pin.SE3] = (),
        opacity: float = 0.85,
        color: str | None = None,
    ) -> NDArray[np.uint8]:
        """Return a copy of a picture with everything drawn over it, shape (height, width, 3), blue, green, red.

        Ghosts are drawn first, then the arm with the virtual obstacles, then the trail and the frames.

        Args:
            picture: Of the camera's size; grey, or blue, green, red.
            T_base_camera: Pose of the camera in the base frame of the arm.
            q: Configuration of the arm, shape (dof,); None draws no arm.
            ghosts: Further configurations, or poses of the gripper.
            obstacles: Virtual obstacles, which are drawn.
            real: Solids that the picture shows already: they are not drawn, but hide what is behind them.
            trail: Points of a polyline, shape (k, 3) in the base frame [m].
            frames: Poses in the base frame, drawn as axes.
            opacity: Opacity of arm and obstacles, from 0 to 1.
            color: Colour of the arm ('#rrggbb') instead of its own colours.

        Raises:
            InputError: If the picture does not have the camera's size.
        """
        height = self.camera.height
        width = self.camera.width
        if picture.shape[:2] != (height, width):
            raise InputError(f"picture has shape {picture.shape[:2]}, the camera's has {(height, width)}")

        drawn: NDArray[np.uint8] = np.array(picture if picture.ndim == 3 else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
        T_camera_base = rigid(T_base_camera, "pose of the camera").inverse().homogeneous

        hidden_by = self._depths(real, T_camera_base)
        for ghost in ghosts:
            self._draw_ghost(drawn, ghost, T_camera_base, hidden_by)

        solids = self._figure(obstacles)
        self._draw_arm(drawn, self._arm, q, T_camera_base, hidden_by, opacity, color, solids)

        if trail is not None:
            self._draw_line(drawn, trail, T_camera_base, palette.TRAIL)
        for frame in frames:
            self._draw_axes(drawn, frame, T_camera_base)
        return np.asarray(drawn, dtype=np.uint8)

    def depths(self) -> NDArray[np.float32]:
        """Return the depths of the arm and obstacles drawn last [m], shape (height, width).

        They are `rasterizer.FARTHEST_DRAWN` where nothing was drawn.
        """
        return self._last.depths.copy()

    def _draw_ghost(
        self,
        drawn: NDArray[np.uint8],
        ghost: Ghost,
        T_camera_base: NDArray[np.float64],
        hidden_by: NDArray[np.float32] | None,
    ) -> None:
        """Draw a ghost, the whole arm or only the gripper, with its outline."""
        style = T_camera_base, hidden_by, ghost.opacity, ghost.color
        if ghost.q is not None:
            mask = self._draw_arm(drawn, self._ghost, ghost.q, *style)
        elif ghost.T_base_tip is not None:
            joint = (ghost.T_base_tip * self._tip.placement.inverse()).homogeneous
            mask = self._draw_arm(drawn, self._gripper, joint, *style)
        else:
            return

        if ghost.outline is not None:
            edges, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
            cv2.drawContours(drawn, edges, -1, (0.0, 0.0, 0.0), 3, cv2.LINE_AA)
            cv2.drawContours(drawn, edges, -1, _bgr(ghost.outline), 1, cv2.LINE_AA)

    def _draw_arm(
        self,
        drawn: NDArray[np.uint8],
        arm: Figure,
        q: Vector | None,
        T_camera_base: NDArray[np.float64],
        hidden_by: NDArray[np.float32] | None,
        opacity: float,
        color: str | None,
        solids: Figure | None = None,
    ) -> NDArray[np.bool_]:
        """Draw an arm or a gripper into a picture in place, and return the mask of its visible pixels."""
        self._last = layer = self._layer(arm, q, solids, T_camera_base, color)

        mask = layer.drawn if hidden_by is None else layer.drawn & (layer.depths < hidden_by)
        layer.blend(drawn, mask, opacity)
        return mask

    def _layer(
        self, arm: Figure | None, q: Vector | None, solids: Figure | None, T: NDArray[np.float64], color: str | None
    ) -> Layer:
        """Return the rendered layer of an arm and solids, cached because most of what is drawn does not move.

        Args:
            arm: What to draw; None for the solids only.
            q: A configuration, shape (dof,), or the pose of a single joint that carries all of ``arm``, shape (4, 4).
            solids: In the base frame; None for the arm only.
            T: ``T_camera_base``, shape (4, 4).
            color: Colour of the arm ('#rrggbb'); None for its own colours.
        """
        key = (arm, None if q is None else np.asarray(q).tobytes(), solids, T.tobytes(), color)
        if key not in self._layers:
            canvas = self._ghosts_canvas if arm is self._ghost or arm is self._gripper else self._canvas
            canvas.clear()
            if arm is not None and q is not None:
                shown = placed(arm, T @ (self._all_at(q) if q.ndim == 2 else self._joint_frames(q)))
                canvas.draw(shown if color is None else tinted(shown, fractions(color)))
            if solids is not None:
                canvas.draw(placed(solids, T[None]))

            if len(self._layers) >= MAX_LAYERS:
                self._layers.pop(next(iter(self._layers)))
            self._layers[key] = Layer.of(canvas, self.camera)

        layer = self._layers[key] = self._layers.pop(key)  # moved to the end: the least recently used is dropped first
        return layer

    def _joint_frames(self, q: Vector) -> NDArray[np.float64]:
        """Return ``T_base_joint`` of all joints at a configuration, shape (joints + 1, 4, 4)."""
        return np.asarray(self.robot.joint_frames(self.robot.configuration(q)[None])[0])

    def _all_at(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the same pose for every joint, shape (joints + 1, 4, 4)."""
        return np.broadcast_to(pose, (self.robot.model.njoints, 4, 4))

    def _depths(self, real: Sequence[Obstacle], T_camera_base: NDArray[np.float64]) -> NDArray[np.float32] | None:
        """Return the depths of solids that hide what is behind them, shape (height, width); None without solids."""
        return self._layer(None, None, self._figure(real), T_camera_base, None).depths if real else None

    def _figure(self, obstacles: Sequence[Obstacle]) -> Figure:
        """Return the triangles of obstacles, cached as long as the obstacles do not move."""
        key = tuple((id(obstacle.shape), obstacle.pose.homogeneous.tobytes()) for obstacle in obstacles)
        if key not in self._figures:
            if len(self._figures) >= MAX_FIGURES:
                self._figures.pop(next(iter(self._figures)))

            held_obstacles = tuple(obstacles)  # kept alive: the key holds ids, which Python reuses
            self._figures[key] = (held_obstacles, figure_of(obstacle_surfaces(held_obstacles, self._shapes)))
        return self._figures[key][1]

    def _pixels(
        self, points: Matrix, T_camera_base: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Project points of the base frame, shape (k, 3) [m], to the picture.

        Returns:
            Pixel coordinates in sixteenths of a pixel, shape (k, 2), and a mask of the points in front of the camera,
            shape (k,).
        """
        in_camera = np.asarray(points, dtype=np.float64) @ T_camera_base[:3, :3].T + T_camera_base[:3, 3]
        is_visible = in_camera[:, 2] > NEAREST_DRAWN

        pixels = np.zeros((len(in_camera), 2))
        if is_visible.any():
            pixels[is_visible] = self.camera.project(in_camera[is_visible])
        return np.clip(np.rint(16.0 * pixels), -(2**20), 2**20).astype(np.int64), is_visible

    def _draw_line(
        self, drawn: NDArray[np.uint8], points: Matrix, T_camera_base: NDArray[np.float64], color: str
    ) -> None:
        pixels, is_visible = self._pixels(finite_array(points, (None, 3), "trail"), T_camera_base)

        runs = np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(is_visible.astype(int))) + 1)
        for run in runs:
            if len(run) > 1 and is_visible[run[0]]:
                line = pixels[run].astype(np.int32)[:, None]
                cv2.polylines(drawn, [line], False, (0, 0, 0), 4, cv2.LINE_AA, 4)
                cv2.polylines(drawn, [line], False, _bgr(color), 2, cv2.LINE_AA, 4)

    def _draw_axes(
        self, drawn: NDArray[np.uint8], pose: pin.SE3, T_camera_base: NDArray[np.float64], length: float = 0.1
    ) -> None:
        for axis, color in enumerate(palette.AXES):
            tip = pose.translation + length * pose.rotation[:, axis]
            self._draw_line(drawn, np.stack([pose.translation, tip]), T_camera_base, color)


def _bgr(color: str) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in fractions(color))
    return blue, green, red
