"""The camera of a simulated vehicle: pictures of marked objects, surroundings and the arm.

Pictures are made at the rate of a camera: solids by the rasteriser, markers as images warped into their plane.
For measurements of the markers themselves use `sensing.synthetic_camera`, which is exact and slow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.pilot.overlay.augment import Augmenter
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers.detection import marker_cells
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap

PIXELS_PER_CELL = 24  # of a marker's image
WATER = ((96, 84, 60), (60, 52, 40))  # blue, green, red above and below
NOISE = 2.0  # grey levels
NOISE_PICTURES = 4  # taken in turn
PICTURE_RATE = 30.0  # pictures a second
TRIANGLES = 8_000  # of the arm


class SimulatedCamera:
    """A camera before a known scene with a moving arm."""

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
            camera: The lens; without distortion the picture is exact.
            marker_map: The objects.
            robot: The arm in the picture.
            scene: Further obstacles.
            places: ``T_base_object`` of objects, by name; objects without one are left out.
            T_base_camera: Pose of the camera.
            seed: Of the noise.
            fixed: The obstacles stand on the ground like the objects, and do not move with the base.
        """
        self.camera = camera
        self.marker_map = marker_map
        self.T_base_camera = rigid(T_base_camera, "pose of the camera")
        self.places = {name: rigid(T, f"pose of object '{name}'") for name, T in places.items()}
        self.T_start_base = pin.SE3.Identity()  # where the base is
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
        """The picture with the arm at a configuration, shape (dof,)."""
        noise = self._noise[int(time * PICTURE_RATE) % NOISE_PICTURES]
        noisy = cv2.add(self._clean(q), noise, dtype=cv2.CV_8U)
        return Picture(np.asarray(noisy, dtype=np.uint8), "simulated camera", time)

    def _clean(self, q: NDArray[np.float64]) -> NDArray[np.uint8]:
        """The picture without noise; made anew only when the arm or an object moved."""
        background, solids = self._background()
        cached_background, cached_q, clean = self._cached_arm
        if cached_background is not background or not np.array_equal(cached_q, q):
            clean = self._arm.draw(background, self.T_base_camera, q, real=solids, opacity=1.0)
            self._cached_arm = (background, np.array(q), clean)
        return np.asarray(clean)

    def _background(self) -> tuple[NDArray[np.uint8], list[Obstacle]]:
        """The picture without the arm, and the solids in it; made anew only when an object moved."""
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
        """Draw the markers of an object into the picture where nothing hides them."""
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
        grey = 30 + (sheet // 255) * 190
        cell = np.ones((PIXELS_PER_CELL, PIXELS_PER_CELL), dtype=np.uint8)
        fine = np.kron(grey, cell).astype(np.uint8)

        size = len(fine)
        square = np.array([[0, 0], [size, 0], [size, size], [0, size]], dtype=np.float32) - 0.5
        low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 2, 0)
        high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 3, (self.camera.width, self.camera.height))
        if (high <= low).any():
            return

        ss = 3  # rays through a pixel, squared
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
