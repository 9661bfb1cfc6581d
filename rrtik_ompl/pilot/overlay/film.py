"""Draw an arm that follows a path into the pictures of a film, in which objects are detected."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from pathlib import Path

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.overlay.augment import Augmenter, Ghost
from rrtik_ompl.sensing.cameras.pictures import Picture, quiet
from rrtik_ompl.sensing.scene_from_view import NoBaseError, SeenObject, base_from_camera
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.viewer.film_file import whole_film

FILMS = {".mp4": "mp4v", ".avi": "MJPG"}
DEFAULT_RATE = 30.0  # pictures a second
MAX_RATE = 240.0
TRAIL_POINTS = 80


class ArmInPictures:
    """Draw an arm that follows a path into a sequence of pictures.

    Attributes:
        count: Number of pictures processed.
        without_base: Number of pictures before the pose of the arm's base was known; these are left unchanged.
    """

    def __init__(self, robot: Robot, sensor: Sensor, waypoints: ArrayLike, *, seconds: float, ghosts: int = 1) -> None:
        """Prepare the arm.

        Args:
            robot: The arm.
            sensor: Detects objects in the pictures.
            waypoints: Waypoints of the path, shape (k, dof), k at least 1; with one waypoint the arm does not move.
            seconds: Time from the first to the last waypoint [s].
            ghosts: Number of further configurations drawn ahead of the arm; the last one is the end of the path.

        Raises:
            InputError: If a number is out of range.
        """
        self._rows = finite_array(waypoints, (None, robot.dof), "waypoints of the film")
        if len(self._rows) == 0 or not seconds > 0.0 or not 0 <= ghosts <= 20:
            raise InputError(f"a film needs a waypoint, seconds above 0 and 0 to 20 ghosts; got {seconds:g}, {ghosts}")

        lengths = np.linalg.norm(np.diff(self._rows, axis=0), axis=1)
        self._shares = np.concatenate([[0.0], np.cumsum(lengths)]) / max(float(lengths.sum()), 1e-12)
        self._robot = robot
        self._sensor = sensor
        self._seconds = seconds

        self._augmenter = Augmenter(robot, sensor.camera)
        self._ghost_shares = np.linspace(0.0, 1.0, ghosts + 1)[1:]
        self._trail = robot.fk_batch(self._along(np.linspace(0.0, 1.0, TRAIL_POINTS)))[:, :3, 3]

        self._T_base_camera: pin.SE3 | None = None
        self._objects_seen: dict[str, SeenObject] = {}
        self._first_time: float | None = None
        self.count = self.without_base = 0

    def draw(self, picture: Picture) -> NDArray[np.uint8]:
        """Return the picture with the arm, its ghosts, the trail of the tip, and the frames of tip and objects.

        Objects that were seen hide what is behind them; objects out of view stay where they were seen last.

        Raises:
            InputError: If the picture does not have the camera's size, or times go backwards.
        """
        view = self._sensor.view(picture)
        self.count += 1
        try:
            self._T_base_camera = base_from_camera(self._sensor.marker_map, view.seen)[0]
        except NoBaseError:
            if self._T_base_camera is None:
                self.without_base += 1
                return picture.pixels

        self._objects_seen |= {each.object.name: each for each in view.placed}
        self._first_time = picture.time if self._first_time is None else self._first_time

        share = min((picture.time - self._first_time) / self._seconds, 1.0)
        q = self._along(np.array([share]))[0]
        ghosts = (
            [Ghost(row) for row in self._along(self._ghost_shares[self._ghost_shares > share])]
            if len(self._rows) > 1
            else []
        )
        return self._augmenter.draw(
            picture.pixels, self._T_base_camera, q, ghosts=ghosts,
            real=[solid for each in self._objects_seen.values() for solid in each.solids()],
            trail=self._trail if len(self._rows) > 1 else None,
            frames=[self._robot.fk(q), *(each.T_base_object for each in self._objects_seen.values())],
        )  # fmt: skip

    def _along(self, shares: Vector) -> Matrix:
        """Return the configurations at shares of the path's length, shape (m, dof)."""
        columns = [np.interp(shares, self._shares, column) for column in self._rows.T]
        return np.stack(columns, axis=1)


def rate_of(pictures: Iterator[Picture]) -> tuple[float, Iterator[Picture]]:
    """Estimate the rate of a sequence of pictures from the times of the first two.

    Returns:
        Pictures a second, and an iterator over all pictures, including the two that were read.
    """
    first = list(islice(pictures, 2))
    interval = first[1].time - first[0].time if len(first) == 2 else 0.0
    rate = 1.0 / interval if interval > 1.0 / MAX_RATE else DEFAULT_RATE
    return rate, chain(first, pictures)


def write_film(path: Path, frames: Iterable[NDArray[np.uint8]], rate: float) -> None:
    """Write pictures to a film; the file appears only when it is complete.

    Raises:
        InputError: If the ending is none of `FILMS`, there is no picture, or the file cannot be written.
    """
    if path.suffix.lower() not in FILMS:
        raise InputError(f"{path}: a film ends in {', '.join(FILMS)}")

    with whole_film(path) as unfinished:
        writer = None
        count = 0
        try:
            for frame in frames:
                writer = writer or _writer(unfinished, path, rate, frame.shape)
                writer.write(frame)
                count += 1
        finally:
            if writer is not None:
                writer.release()

        if writer is None:
            raise InputError(f"{path}: there is no picture to write")
        if _pictures_in(unfinished) != count:
            raise InputError(f"{path}: cannot be written whole; is there room on the disk?")


def _pictures_in(film: Path) -> int:
    """Return the number of pictures according to the film's header; 0 if the film cannot be read."""
    with quiet():
        opened = cv2.VideoCapture(str(film))
        try:
            return int(opened.get(cv2.CAP_PROP_FRAME_COUNT)) if opened.isOpened() else 0
        finally:
            opened.release()


def _writer(file: Path, path: Path, rate: float, shape: tuple[int, ...]) -> cv2.VideoWriter:
    code = cv2.VideoWriter.fourcc(*FILMS[path.suffix.lower()])
    with quiet():
        writer = cv2.VideoWriter(str(file), code, rate, (shape[1], shape[0]))
    if not writer.isOpened():
        raise InputError(f"{path}: cannot be written; is the folder there, and yours to write in?")
    return writer
