"""Simulated cameras of a vehicle: pictures of marked objects, surroundings and the arm, and the motion of the base.

Pictures are made at the rate of a camera: solids by the rasteriser, markers as images warped into their plane.
For measurements of the markers themselves use `rrtik_bench.sensing.synthetic_camera`, which is exact and slow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy, rigid
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.pilot.devices.arm import Arm, SimulatedArm
from rrtik_ompl.pilot.overlay.augment import Augmenter
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap

PIXELS_PER_CELL = 24  # resolution of a marker's image
WATER = ((96, 84, 60), (60, 52, 40))  # blue, green, red above and below
NOISE = 2.0  # grey levels
NOISE_PICTURES = 4  # number of noise pictures, which are used in turn
PICTURE_RATE = 30.0  # pictures a second
TRIANGLES = 8_000  # largest number for the arm
MIN_PERIOD = 0.2  # [s] of the sway of a base
MAX_SPEED = 2.0  # [m/s]
MAX_AMPLITUDE = 2.0  # [m]
FINGERS = 0.02  # [m]; a gripper that closes this close to a grasp takes the object


class SimulatedCamera:
    """A camera in front of a known scene with a moving arm."""

    def __init__(
        self,
        camera: Camera,
        marker_map: MarkerMap,
        robot: Robot,
        scene: Scene,
        places: Mapping[str, pin.SE3],
        T_base_camera: pin.SE3,
        seed: int = 0,
        fixed: bool = False,
    ) -> None:
        """Prepare the scene.

        Args:
            camera: Camera model; without distortion the picture is exact.
            marker_map: The objects with their markers.
            robot: The arm in the picture.
            scene: Further obstacles.
            places: ``T_base_object`` by name of the object; objects without an entry are left out.
            T_base_camera: Pose of the camera.
            seed: Seed of the noise.
            fixed: Whether the obstacles stand on the ground like the objects, instead of moving with the base.
        """
        self.camera = camera
        self.marker_map = marker_map
        self.T_base_camera = rigid(T_base_camera, "pose of the camera")
        self.places = {name: rigid(T, f"pose of object '{name}'") for name, T in places.items()}
        self.T_start_base = pin.SE3.Identity()  # present pose of the base
        self._fixed = fixed
        self.robot = robot
        self._scene = scene
        self._arm = Augmenter(robot, camera, TRIANGLES)

        rng = np.random.default_rng(seed)
        size = (camera.height, camera.width, 1)
        grey = [np.rint(rng.normal(0.0, NOISE, size)).astype(np.int16) for _ in range(NOISE_PICTURES)]
        self._noise = [np.repeat(each, 3, axis=2) for each in grey]

        self._cached_background: Any = (None, None, None)
        self._cached_arm: Any = (None, None, None)

    def picture(self, q: NDArray[np.float64], time: float) -> Picture:
        """Return the picture with the arm at a configuration, shape (dof,), and with noise."""
        noise = self._noise[int(time * PICTURE_RATE) % NOISE_PICTURES]
        noisy = cv2.add(self._clean(q), noise, dtype=cv2.CV_8U)
        return Picture(np.asarray(noisy, dtype=np.uint8), "simulated camera", time)

    def _clean(self, q: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture without noise; it is redrawn only when the arm or an object has moved."""
        background, solids = self._background()
        cached_background, cached_q, clean = self._cached_arm
        if cached_background is not background or not np.array_equal(cached_q, q):
            clean = self._arm.draw(background, self.T_base_camera, q, real=solids, opacity=1.0)
            self._cached_arm = (background, np.array(q), clean)
        return np.asarray(clean)

    def _background(self) -> tuple[NDArray[np.uint8], list[Obstacle]]:
        """Draw the scene without the arm; it is redrawn only when an object or the base has moved.

        Returns:
            The picture, and the solids in it, which hide parts of the arm.
        """
        T_base_start = self.T_start_base.inverse()
        places = {name: T_base_start * T for name, T in sorted(self.places.items())}
        key: Any = tuple((name, T.homogeneous.tobytes()) for name, T in places.items())
        key = (self.T_base_camera.homogeneous.tobytes(), key)
        if key != self._cached_background[0]:
            obstacles = self._scene.obstacles
            if self._fixed:
                obstacles = tuple(replace(each, pose=T_base_start * each.pose) for each in obstacles)

            solids = [*obstacles, *self._object_solids(places)]
            drawn = self._arm.draw(_water(self.camera), self.T_base_camera, obstacles=solids, opacity=1.0)
            depths = self._arm.depths()
            T_camera_base = self.T_base_camera.inverse()
            for thing in self.marker_map.objects:
                if thing.name in places:
                    self._lay_markers(drawn, depths, thing, T_camera_base * places[thing.name])

            self._cached_background = (key, drawn, solids)
        return self._cached_background[1], self._cached_background[2]

    def _object_solids(self, places: Mapping[str, pin.SE3]) -> list[Obstacle]:
        return [
            Obstacle(f"{thing.name} {k}", solid.shape, places[thing.name] * solid.pose)
            for thing in self.marker_map.objects
            if thing.name in places
            for k, solid in enumerate(thing.solids)
        ]

    def _lay_markers(
        self, drawn: NDArray[np.uint8], depths: NDArray[np.float32], thing: MarkedObject, T_camera_object: pin.SE3
    ) -> None:
        """Draw the markers of an object into a picture in place, except where something hides them.

        Args:
            drawn: Picture, shape (height, width, 3).
            depths: Depths of the solids in it [m], shape (height, width).
            thing: The object.
            T_camera_object: Its pose in the frame of the camera.
        """
        for marker in thing.markers:
            T = T_camera_object * marker.T_object_marker
            if float(T.rotation[:, 2] @ T.translation) >= 0.0:
                continue  # seen from behind

            sheet = np.pad(marker_cells(self.marker_map.dictionary, marker.number), 1, constant_values=255)
            half = 0.5 * marker.side * len(sheet) / (len(sheet) - 2)
            corners = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
            corners_in_camera = corners @ T.rotation.T + T.translation
            if (corners_in_camera[:, 2] > 0.05).all():
                self._draw_marker(drawn, depths, sheet, self.camera.project(corners_in_camera), T)

    def _draw_marker(
        self,
        drawn: NDArray[np.uint8],
        depths: NDArray[np.float32],
        sheet: NDArray[np.uint8],
        pixels: Matrix,
        T: pin.SE3,
    ) -> None:
        """Draw one marker into the picture in place.

        The image of the marker is warped at three times the resolution, averaged, and blended where nothing is in
        front.
        """
        grey = 30 + (sheet // 255) * 190
        cell = np.ones((PIXELS_PER_CELL, PIXELS_PER_CELL), dtype=np.uint8)
        fine = np.kron(grey, cell).astype(np.uint8)

        size = len(fine)
        square = np.array([[0, 0], [size, 0], [size, size], [0, size]], dtype=np.float32) - 0.5
        low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 2, 0)
        high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 3, (self.camera.width, self.camera.height))
        if (high <= low).any():
            return

        ss = 3  # samples per pixel along each axis
        shape = (ss * (high - low)).tolist()
        target = ((pixels - low + 0.5) * ss - 0.5).astype(np.float32)
        homography = cv2.getPerspectiveTransform(square, target)

        warped = cv2.warpPerspective(fine, homography, shape, flags=cv2.INTER_AREA, borderValue=(0.0,))
        coverage = cv2.warpPerspective(
            np.full_like(fine, 255), homography, shape, flags=cv2.INTER_LINEAR, borderValue=(0.0,)
        )
        small = tuple((high - low).tolist())
        opacity = cv2.resize(coverage, small, interpolation=cv2.INTER_AREA).astype(np.float32)[..., None] / 255.0
        value = cv2.resize(warped, small, interpolation=cv2.INTER_AREA).astype(np.float32)[..., None]

        box = np.s_[low[1] : high[1], low[0] : high[0]]
        opacity[depths[box] < T.translation[2] - 0.02 - 0.5 * np.ptp(pixels) / self.camera.matrix[0, 0]] = 0.0
        below = drawn[box].astype(np.float32)
        drawn[box] = np.clip(value + (1.0 - opacity) * below, 0, 255) * (opacity > 0) + below * (opacity == 0)


def _water(camera: Camera) -> NDArray[np.uint8]:
    share = np.linspace(0.0, 1.0, camera.height)[:, None]
    rows = (1.0 - share) * np.array(WATER[0]) + share * np.array(WATER[1])
    return np.repeat(np.rint(rows).astype(np.uint8)[:, None], camera.width, axis=1)


class SimulatedSource:
    """Make pictures of a simulated camera on demand.

    Attributes:
        camera: The simulated camera.
        arm: The arm in its pictures.
    """

    def __init__(self, camera: SimulatedCamera, arm: Arm, motion: BaseMotion | None = None) -> None:
        """Store camera and arm, and the motion of their base; None for a base that stands still."""
        self.camera = camera
        self.arm = arm
        self._motion = motion
        self._count = 0
        self._time = 0.0
        self._was_closed = False
        # Name of the object that the gripper has taken, and T_tip_object; None if there is none.
        self._carried: tuple[str, pin.SE3] | None = None

    def advance(self, seconds: float) -> None:
        """Advance the simulated time [s], and move the base."""
        self._time += seconds
        if self._motion is not None:
            self.camera.T_start_base = self._motion.at(self._time)

    def latest(self) -> Picture:
        """Return a picture with the arm at its present configuration."""
        self._count += 1
        arm = self.arm
        q = arm.links() if isinstance(arm, SimulatedArm) else arm.read()
        if isinstance(arm, SimulatedArm):
            self._carry(arm, arm.robot.fk(q))

        tip = self.camera.T_start_base * self.camera.robot.fk(q)
        on_arm = (marked_object for marked_object in self.camera.marker_map.objects if marked_object.role == "arm")
        places_on_arm = {marked_object.name: tip for marked_object in on_arm}
        if places_on_arm:
            self.camera.places = {**self.camera.places, **places_on_arm}

        return self.camera.picture(q, float(self._count))

    def _carry(self, arm: SimulatedArm, T_base_tip: pin.SE3) -> None:
        """Move the object that the gripper has taken with the tip.

        A loose object is taken when the gripper closes within `FINGERS` of one of its grasps, the nearest one first. It
        is released where the gripper opens.
        """
        tip = self.camera.T_start_base * T_base_tip
        camera = self.camera
        if arm.closed and not self._was_closed:
            grasp_distances = [
                (
                    float(np.linalg.norm(tip.actInv(camera.places[marked_object.name] * level).translation)),
                    marked_object.name,
                )
                for marked_object in camera.marker_map.objects
                if marked_object.loose and marked_object.name in camera.places
                for grasp in marked_object.grasps
                for level in grasp.levels
            ]

            if grasp_distances and min(grasp_distances)[0] <= FINGERS:
                name = min(grasp_distances)[1]
                self._carried = (name, tip.actInv(camera.places[name]))

        if self._carried is not None:
            camera.places = {**camera.places, self._carried[0]: tip * self._carried[1]}

        if not arm.closed:  # the object stays where the gripper has opened
            self._carried = None
        self._was_closed = arm.closed

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


class Mount(NamedTuple):
    """The place of a further camera of a simulated vehicle.

    Attributes:
        name: Name shown to the pilot.
        at_tip: Whether the camera is carried by the arm's last link, instead of the vehicle.
        pose: In the frame of the tip, or in the base frame of the arm.
    """

    name: str
    at_tip: bool
    pose: pin.SE3


class SimulatedFurtherCamera:
    """A further camera of a simulated vehicle."""

    def __init__(self, mount: Mount, camera: SimulatedCamera, first: SimulatedCamera, arm: Arm) -> None:
        """Store the parts.

        Args:
            mount: Place of the camera.
            camera: Makes its pictures.
            first: The vehicle's first camera, whose scene is shown.
            arm: The arm.
        """
        self._mount = mount
        self._camera = camera
        self._first = first
        self._arm = arm
        self._count = 0

    def picture(self) -> NDArray[np.uint8]:
        """Return the present picture, shape (height, width, 3)."""
        camera = self._camera
        arm = self._arm
        q = arm.links() if isinstance(arm, SimulatedArm) else arm.read()
        carried = camera.robot.fk(q) if self._mount.at_tip else pin.SE3.Identity()
        camera.T_base_camera = carried * self._mount.pose

        camera.places = self._first.places
        camera.T_start_base = self._first.T_start_base
        self._count += 1
        return camera.picture(q, float(self._count)).pixels

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


@dataclass(frozen=True, slots=True, eq=False)
class BaseMotion:
    """Motion of a base: drift at a constant velocity, and sway as a sine; both are zero at the beginning.

    Attributes:
        drift: Velocity, shape (3,) [m/s].
        sway: Amplitude, shape (3,) [m].
        tilt: Amplitude of roll, pitch and yaw, shape (3,) [rad].
        period: Period of sway and tilt [s].

    Raises:
        InputError: If a value is not finite, the period is shorter than 0.2 s, or the motion is too fast or too wide.

    Example:
        >>> BaseMotion(drift=[0.01, 0.0, 0.0]).at(2.0).translation.tolist()
        [0.02, 0.0, 0.0]
    """

    drift: Vector
    sway: Vector
    tilt: Vector
    period: float

    def __init__(
        self,
        drift: ArrayLike = (0.0, 0.0, 0.0),
        sway: ArrayLike = (0.0, 0.0, 0.0),
        tilt: ArrayLike = (0.0, 0.0, 0.0),
        period: float = 5.0,
    ) -> None:
        for name, given, most in (("drift", drift, MAX_SPEED), ("sway", sway, MAX_AMPLITUDE), ("tilt", tilt, np.pi)):
            value = frozen(finite_array(given, (3,), f"{name} of the base"))
            if np.abs(value).max() > most:
                raise InputError(f"{name} of the base must be at most {most:.3g}, got {np.abs(value).max():.3g}")
            object.__setattr__(self, name, value)
        seconds = float(finite_array(period, (), "period of the base's sway"))
        if seconds < MIN_PERIOD:
            raise InputError(f"period of the base's sway must be {MIN_PERIOD} s or more, got {seconds:g}")
        object.__setattr__(self, "period", seconds)

    def at(self, time: float) -> pin.SE3:
        """Return the pose of the base at a time [s], relative to its pose at time 0: ``T_start_base``."""
        phase = float(np.sin(2.0 * np.pi * time / self.period))
        return pose_from_rpy(self.drift * time + phase * self.sway, phase * self.tilt)
