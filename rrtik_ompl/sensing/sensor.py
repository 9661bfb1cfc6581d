"""A camera over time: it takes pictures, and returns tracked objects in the base frame of the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.poses import quaternion_xyzw
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture, write_picture
from rrtik_ompl.sensing.markers.corner_pose import CornerPose
from rrtik_ompl.sensing.markers.detection import dictionaries_seen
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.rig import Rig, detect_in_rig
from rrtik_ompl.sensing.scene_from_view import SIGMAS, NoBaseError, SeenObject, checked_sigmas, objects_in_base
from rrtik_ompl.sensing.sight import Sighting, as_gray, check_size, detect_objects
from rrtik_ompl.sensing.tracker import PoseTracker

# Every n-th picture is searched as a whole. In between, markers are searched near their last places, unless one of
# them has disappeared.
WHOLE_EVERY = 4
GOOD, DOUBTFUL, REFUSED = (80, 200, 60), (0, 170, 255), (60, 60, 230)  # blue, green, red
AXES = ((0, 0, 255), (0, 200, 0), (255, 80, 0))  # x red, y green, z blue


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The objects in one picture.

    Attributes:
        picture: The picture.
        camera: Camera of the picture.
        seen: Every object with a marker in view; its pose is smoothed over the previous pictures.
        placed: Those with a usable pose, in the base frame.
        why_not_placed: Why there are none, if the base is unknown; "" otherwise.
    """

    picture: Picture
    camera: Camera
    seen: tuple[Sighting, ...]
    placed: tuple[SeenObject, ...]
    why_not_placed: str = ""

    def scene(self) -> Scene:
        """Return the solids of all located objects.

        Raises:
            NoBaseError: If the pose of the base is not known.
        """
        return Scene(tuple(solid for each in self.usable() for solid in each.solids()))

    def usable(self) -> tuple[SeenObject, ...]:
        """Return all located objects.

        Raises:
            NoBaseError: If the pose of the base is not known.
        """
        if self.why_not_placed:
            raise NoBaseError(self.why_not_placed)
        return self.placed

    def save_picture(self, path: Path) -> None:
        """Write the picture with the detected objects drawn in.

        Raises:
            InputError: If it cannot be written.
        """
        write_picture(annotated(self.picture.pixels, self.camera, self.seen), path)

    def lines(self) -> list[str]:
        """Return one line for each object, for a person."""
        if not self.seen:
            return [f"{self.picture.name}: no marker of the map in view"]
        return [f"{self.picture.name}: {_line(each, self._place(each))}" for each in self.seen]

    def document(self) -> dict[str, Any]:
        """Return the objects as plain values; metres, radians, quaternions x, y, z, w."""
        objects = [_data(each, self._place(each)) for each in self.seen]
        return {"picture": self.picture.name, "time": self.picture.time, "objects": objects}

    def _place(self, sight: Sighting) -> SeenObject | None:
        return next((p for p in self.placed if p.object is sight.object), None)


class Sensor:
    """Detect and track objects in a sequence of pictures.

    Example:
        >>> import rrtik_robots
        >>> shipped = f"{rrtik_robots.__path__[0]}/problems/pilot"
        >>> camera = rrtik.sensing.Camera.load(f"{shipped}/camera_640.yaml")
        >>> marker_map = rrtik.sensing.MarkerMap.load(f"{shipped}/titan4_panel_markers.yaml")
        >>> sensor = rrtik.sensing.Sensor(camera, marker_map)
        >>> for (picture,) in rrtik.sensing.pictures_together([f"{shipped}/photographs"]):
        ...     view = sensor.view(picture)
        >>> "valve" in [each.object.name for each in view.placed]
        True
    """

    def __init__(
        self, camera: Camera | Rig, marker_map: MarkerMap, *, smooth: bool = True, sigmas: float = SIGMAS
    ) -> None:
        """Start without objects.

        Args:
            camera: Camera of the pictures; or a rig of several that take pictures at the same time, whose poses are in
                the frame of the first.
            marker_map: The map of all objects.
            smooth: Whether to smooth poses over time and reject outliers. Otherwise each picture is searched
                thoroughly by itself, as photographs deserve, however long that takes.
            sigmas: Number of standard deviations of their poses that the margins of obstacles cover; 0 for no margins.

        Raises:
            InputError: If ``sigmas`` is not 0 or more.
        """
        require(camera, Camera | Rig, "camera of a sensor", "use Camera.load(file) or Rig.load(file)")
        require(marker_map, MarkerMap, "marker map", "use MarkerMap.load(file)")
        self._rig = camera if isinstance(camera, Rig) else None
        self.camera = camera.cameras[0] if isinstance(camera, Rig) else camera
        self.marker_map = marker_map
        self._sigmas = checked_sigmas(sigmas)
        self._trackers = {each.name: PoseTracker() for each in marker_map.objects} if smooth else {}
        self._last: dict[str, Sighting] = {}  # where each object was sighted last
        self._count = 0  # number of pictures so far
        self._blank: NDArray[np.uint8] | None = None  # last picture without any marker of the map

    def view(self, picture: Picture, *others: Picture) -> View:
        """Return the objects in a picture, which must be later than the previous one.

        Args:
            picture: Picture of the camera, or of the first one.
            others: Pictures of the other cameras, taken at the same time.

        Raises:
            InputError: If the numbers of pictures and cameras differ, a picture does not have its camera's size, or
                times go backwards.
        """
        detected = self._detected(picture, others)
        if self._trackers:
            self._last |= {sighting.object.name: sighting for sighting in detected}
        self._count += 1

        seen = tuple(self._tracked(sighting, picture.time) for sighting in detected)
        if not seen:
            self._blank = picture.pixels

        try:
            placed = objects_in_base(seen, self.marker_map, sigmas=self._sigmas)
            return View(picture, self.camera, seen, placed)
        except NoBaseError as error:
            return View(picture, self.camera, seen, (), str(error))

    def _detected(self, picture: Picture, others: tuple[Picture, ...]) -> tuple[Sighting, ...]:
        cameras = (self.camera,) if self._rig is None else self._rig.cameras
        if len(cameras) != 1 + len(others):
            raise InputError(f"{len(cameras)} cameras need as many pictures of a moment, got {1 + len(others)}")
        for each, camera in zip((picture, *others), cameras, strict=True):
            check_size(each.pixels, camera, each.name)

        if self._rig is not None:
            return detect_in_rig([each.pixels for each in (picture, *others)], self._rig, self.marker_map)

        near = bool(self._trackers) and self._count % WHOLE_EVERY != 0
        last = tuple(self._last.values())
        return detect_objects(
            picture.pixels,
            self.camera,
            self.marker_map,
            before=last,
            near=near,
            turn=self._count,
            thorough=not self._trackers,
        )

    def why_nothing(self, source: str) -> str:
        """Return one line on why no object was found in the last picture without one, with a remedy.

        Markers of all dictionaries are searched, which takes as long as dozens of pictures.
        """
        if self._blank is None:
            return f"{source}: markers of the map are in view, but none that says where the arm's base is"

        dictionary = self.marker_map.dictionary
        dictionaries_found = dictionaries_seen(as_gray(self._blank))
        if dictionary in dictionaries_found:
            return f"{source}: markers are in view, but none that the map knows; add their ids to the map"
        if dictionaries_found:
            other = dictionaries_found[0]
            return (
                f"{source}: no marker of {dictionary}, but of {other}: print others, or change the map's 'dictionary'"
            )
        return f"{source}: no marker in view; go nearer, add light, or check that the white rim of the marker is whole"

    def _tracked(self, sight: Sighting, time: float) -> Sighting:
        """Return a sighting with its pose smoothed and its ambiguity resolved by the tracker of the object."""
        tracker = self._trackers.get(sight.object.name)
        if tracker is None or sight.refused:
            return sight

        tracked = tracker.update(sight, time)
        pose = sight.pose
        refused = "jumped: left out as an outlier" if tracked.outlier else ""

        first = (pose.T_camera_object, pose.error)
        second = (pose.other, pose.other_error)
        chosen, other = (second, first) if tracked.other_branch else (first, second)
        if tracked.sure:  # the ambiguity is resolved by this picture or earlier ones
            other = (None, np.inf)

        pose = CornerPose(tracked.T_camera_object, other[0], chosen[1], other[1], tracked.covariance)
        return replace(sight, pose=pose, refused=refused)


def _line(sight: Sighting, place: SeenObject | None) -> str:
    """Return one line about a sighting, for a person; the pose is in the base frame if it is known there."""
    if sight.refused:
        return f"{sight.object.name}: refused: {sight.refused}"

    pose, frame = _pose_and_frame(sight, place)
    xyz = " ".join(f"{value:.4f}" for value in pose.translation)
    rpy = " ".join(f"{value:.2f}" for value in np.degrees(pin.rpy.matrixToRpy(pose.rotation)))

    sigma = (sight.pose if place is None else place).position_sigma
    doubt = "; two poses fit: tilt the marker or add another" if sight.pose.ambiguous else ""

    return (
        f"{sight.object.name} in the frame of the {frame}: xyz {xyz} m, rpy {rpy} deg, "
        f"+- {1e3 * sigma:.2f} mm, quality {sight.quality:.2f}, {len(sight.markers)} markers{doubt}"
    )


def _data(sight: Sighting, place: SeenObject | None) -> dict[str, Any]:
    """Return a sighting as plain values; the pose is in the base frame if it is known there."""
    pose, frame = _pose_and_frame(sight, place)
    doubt = sight.pose if place is None else place
    return {
        "name": sight.object.name,
        "role": sight.object.role,
        "frame": frame,
        "xyz": pose.translation.tolist(),
        "quat_xyzw": quaternion_xyzw(pose).tolist(),
        "position_sigma": doubt.position_sigma,
        "rotation_sigma": doubt.rotation_sigma,
        "quality": sight.quality,
        "ambiguous": sight.pose.ambiguous,
        "refused": sight.refused,
        "markers": [marker.number for marker in sight.markers],
    }


def _pose_and_frame(sight: Sighting, place: SeenObject | None) -> tuple[pin.SE3, str]:
    return (sight.pose.T_camera_object, "camera") if place is None else (place.T_base_object, "base")


def annotated(
    picture: NDArray[np.uint8], camera: Camera, sightings: Sequence[Sighting], axis_length: float = 0.06
) -> NDArray[np.uint8]:
    """Return a copy of a picture with every detected object drawn in, shape (height, width, 3).

    Args:
        picture: Shape (height, width) or (height, width, 3).
        camera: Camera of the picture.
        sightings: From `detect_objects`.
        axis_length: Length of the drawn axes [m].
    """
    drawn: Any = np.array(picture if picture.ndim == 3 else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    for each in sightings:
        colour = REFUSED if each.refused else DOUBTFUL if each.pose.ambiguous else GOOD
        for marker in each.markers:
            outline = np.rint(16.0 * marker.corners).astype(np.int32)
            cv2.polylines(drawn, [outline[:, None]], True, colour, 2, cv2.LINE_AA, 4)
        _draw_axes(drawn, camera, each, axis_length)
        _write(drawn, _caption(each), np.vstack([m.corners for m in each.markers]), colour)

    return np.asarray(drawn, dtype=np.uint8)


def _caption(sight: Sighting) -> str:
    if sight.refused:
        return f"{sight.object.name}: {sight.refused}"
    distance = float(np.linalg.norm(sight.pose.T_camera_object.translation))
    doubt = ", two poses fit" if sight.pose.ambiguous else ""
    return f"{sight.object.name} {distance:.3f} m +- {1e3 * sight.pose.position_sigma:.1f} mm{doubt}"


def _draw_axes(drawn: NDArray[np.uint8], camera: Camera, sight: Sighting, length: float) -> None:
    pose = sight.pose.T_camera_object
    tips = np.vstack([np.zeros(3), length * np.eye(3)]) @ pose.rotation.T + pose.translation
    if (tips[:, 2] <= 0.01).any():
        return

    pixels = np.clip(np.rint(16.0 * camera.project(tips)), -(2**20), 2**20).astype(int)
    for k, colour in enumerate(AXES):
        cv2.line(drawn, tuple(pixels[0]), tuple(pixels[k + 1]), colour, 2, cv2.LINE_AA, 4)


def _write(drawn: NDArray[np.uint8], text: str, corners: NDArray[np.float64], colour: tuple[int, int, int]) -> None:
    """Write a caption below the markers, within the picture, on a dark background."""
    height, width = drawn.shape[:2]
    (wide, high), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    x = int(np.clip(corners[:, 0].min(), 2, max(width - wide - 4, 2)))
    y = int(np.clip(corners[:, 1].max() + high + 10, high + 4, height - below - 2))

    cv2.rectangle(drawn, (x - 2, y - high - 3), (x + wide + 2, y + below), (30, 30, 30), -1)
    cv2.putText(drawn, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)
