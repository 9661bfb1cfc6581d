"""Two or more cameras that take pictures at the same time; their poses of an object are fused to one.

Each camera's pose has a covariance that is small across its line of sight and large along it. When the poses are
weighted by the inverse covariances, cameras that are apart supply what the others cannot measure: distance, and which
of two poses of a single square is correct. Poses that contradict each other by more than their covariances are refused.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, not_negative
from rrtik_ompl.base.copies import set_fields
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.base.poses import PoseLike, rigid
from rrtik_ompl.files.kinds import read, write
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import CornerPose
from rrtik_ompl.sensing.markers.detection import SeenMarker
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.sight import Sighting, as_gray, check_size, detect_objects

# Sum of squared normalised deviations per degree of freedom; 1 is usual.
MAX_CONTRADICTION = 5.0
NEAREST = 0.01  # [m]; least distance in front of a camera that can be seen
ROUNDS = 4  # iterations of Gauss-Newton; after the first, rotations are small and nearly linear
CONTRADICTION = (
    "the cameras contradict each other by {:.0f} times what is stated: check their focal lengths, the marker's side, "
    "and how they stand to each other"
)


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """Cameras that are rigidly mounted to each other.

    Attributes:
        cameras: At least two.
        poses: ``T_first_camera`` of each; the first one is the identity.
        position_sigma: Standard deviation of the positions of the others [m].
        rotation_sigma: Standard deviation of their rotations [rad].

    Raises:
        InputError: If there are fewer than two cameras, the numbers of cameras and poses differ, or one is invalid.

    Example:
        >>> camera = rrtik.sensing.Camera([[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]], 640, 480)
        >>> rig = rrtik.sensing.Rig([camera, camera], [rrtik.pose(), rrtik.pose([0.3, 0.0, 0.0])])
        >>> cameras = rig.save("rig.yaml")
        >>> len(rrtik.sensing.Rig.load("rig.yaml").cameras)
        2
    """

    cameras: tuple[Camera, ...]
    poses: tuple[pin.SE3, ...]
    position_sigma: float
    rotation_sigma: float

    def __init__(
        self,
        cameras: Iterable[Camera],
        poses: Iterable[PoseLike],
        position_sigma: float = 0.0,
        rotation_sigma: float = 0.0,
    ) -> None:
        eyes = listed(cameras, "cameras of a rig")
        for camera in eyes:
            require(camera, Camera, "camera of a rig", "use Camera.load(file)")
        places = tuple(rigid(T, f"pose of camera {k}") for k, T in enumerate(listed(poses, "poses of a rig"), start=1))
        if len(eyes) < 2 or len(places) != len(eyes):
            raise InputError(f"a rig has two cameras or more, each with its pose; got {len(eyes)} and {len(places)}")
        if not places[0].isIdentity(1e-9):
            raise InputError("poses of a rig are in the frame of its first camera, whose own pose is the identity")
        set_fields(
            self,
            cameras=eyes,
            poses=places,
            position_sigma=not_negative(position_sigma, "position_sigma of a rig"),
            rotation_sigma=not_negative(rotation_sigma, "rotation_sigma of a rig"),
        )

    def save(self, file: str | os.PathLike[str]) -> list[Path]:
        """Write the rig, and its cameras to files beside it: for ``rig.yaml`` these are ``rig_1.yaml`` and so on.

        Returns:
            The files of the cameras.

        Raises:
            InputError: If a file cannot be written.
        """
        files: list[Path] = write(self, file)
        return files

    @staticmethod
    def load(file: str | os.PathLike[str]) -> Rig:
        """Read a rig and the camera files that it names.

        Raises:
            InputError: If a file cannot be used; one line with file, line, key, what was found and the remedy.
        """
        return read(Rig, file)


def detect_in_rig(pictures: Sequence[NDArray[np.uint8]], rig: Rig, marker_map: MarkerMap) -> tuple[Sighting, ...]:
    """Detect the objects of a map with all cameras of a rig; poses are in the frame of the first camera.

    Args:
        pictures: One of each camera, taken at the same time.
        rig: The cameras.
        marker_map: The map of all objects.

    Returns:
        The objects in the order of the map. An object seen by only one camera has the pose of this camera. Each marker
        is listed once; corners not seen by the first camera are those that it would see.

    Raises:
        InputError: If there are not as many pictures as cameras, or one does not have its camera's size.
    """
    require(rig, Rig, "rig", "use Rig.load(file)")
    pictures = listed(pictures, "pictures of a rig")
    if len(pictures) != len(rig.cameras):
        raise InputError(f"a rig of {len(rig.cameras)} cameras needs as many pictures, got {len(pictures)}")

    sightings_of: dict[str, list[Sighting]] = {}
    for number, (picture, camera) in enumerate(zip(pictures, rig.cameras, strict=True)):
        check_size(as_gray(picture), camera, f"picture of camera {number + 1}")
        for sighting in detect_objects(picture, camera, marker_map):
            sightings_of.setdefault(sighting.object.name, []).append(_in_first(sighting, rig, number))

    names = [marked_object.name for marked_object in marker_map.objects]
    return tuple(joined(sightings_of[name]) for name in names if name in sightings_of)


def joined(sightings: Sequence[Sighting]) -> Sighting:
    """Fuse several sightings of one object, in the same frame, to one.

    Refused sightings are ignored unless all are refused. Where a camera has two possible poses, the combination with
    the least contradiction is taken; the second best remains as the other pose if it is consistent, too.
    """
    usable = [sighting for sighting in sightings if not sighting.refused]
    if len(usable) < 2:
        return (usable or list(sightings))[0]

    # Each camera may have two possible poses: take the combination with the least contradiction.
    fused = [_fuse(usable, poses) for poses in product(*(_branches(sighting) for sighting in usable))]
    pose = min(fused, key=lambda candidate: candidate.surprise)

    other_fused = [candidate for candidate in fused if candidate is not pose]
    second_best = min(other_fused, key=lambda candidate: candidate.surprise, default=None)
    if second_best is not None and second_best.surprise < MAX_CONTRADICTION:
        pose = replace(pose, other=second_best.T_camera_object, other_error=pose.error)

    markers = {marker.number: marker for sighting in reversed(usable) for marker in sighting.markers}
    refused = "" if pose.surprise <= MAX_CONTRADICTION else CONTRADICTION.format(pose.surprise**0.5)
    return Sighting(usable[0].object, pose, tuple(markers[number] for number in sorted(markers)), refused)


def _branches(sight: Sighting) -> list[pin.SE3]:
    pose = sight.pose
    if pose.ambiguous and pose.other is not None:
        return [pose.T_camera_object, pose.other]
    return [pose.T_camera_object]


def _fuse(sightings: Sequence[Sighting], poses: Sequence[pin.SE3]) -> CornerPose:
    """Return the weighted mean of poses, with their inverse covariances as weights, by Gauss-Newton iterations.

    Its ``surprise`` is the normalised sum of squared deviations; above 1, it scales the covariance up.
    """
    weights = [np.linalg.inv(sighting.pose.covariance) for sighting in sightings]
    covariance = np.linalg.inv(sum(weights))

    fused_pose = poses[0]
    for _ in range(ROUNDS):
        differences = [_pose_difference(fused_pose, pose) for pose in poses]
        step = covariance @ sum(w @ a for w, a in zip(weights, differences, strict=True))
        fused_pose = pin.SE3(pin.exp3(step[3:]) @ fused_pose.rotation, fused_pose.translation + step[:3])

    differences = [_pose_difference(fused_pose, pose) for pose in poses]
    squares = sum(float(a @ w @ a) for w, a in zip(weights, differences, strict=True))
    surprise = squares / (6.0 * (len(poses) - 1))
    error = max(sighting.pose.error for sighting in sightings)
    return CornerPose(fused_pose, None, error, np.inf, frozen(max(surprise, 1.0) * covariance), surprise)


def _pose_difference(begin: pin.SE3, end: pin.SE3) -> Vector:
    """Return the change from one pose to another: translation, and rotation vector in the camera's axes, shape (6,)."""
    rotation: Matrix = end.rotation @ begin.rotation.T
    return np.concatenate([end.translation - begin.translation, pin.log3(rotation)])


def _in_first(sight: Sighting, rig: Rig, number: int) -> Sighting:
    """Transform a sighting of one of the cameras to the frame of the first one; the rig's uncertainty is added."""
    if number == 0:
        return sight

    T = rig.poses[number]
    pose = sight.pose
    rotation_of_both = np.kron(np.eye(2), T.rotation)

    rotation_lever = np.eye(6)
    rotation_lever[:3, 3:] = -pin.skew(T.rotation @ pose.T_camera_object.translation)
    pose_doubt = np.diag(np.repeat(np.square([rig.position_sigma, rig.rotation_sigma]), 3))
    covariance = (
        rotation_of_both @ pose.covariance @ rotation_of_both.T + rotation_lever @ pose_doubt @ rotation_lever.T
    )

    other = None if pose.other is None else T * pose.other
    in_first = replace(pose, T_camera_object=T * pose.T_camera_object, other=other, covariance=frozen(covariance))

    return replace(
        sight, pose=in_first, markers=tuple(_marker_in_first(m, in_first, sight, rig) for m in sight.markers)
    )


def _marker_in_first(marker: SeenMarker, pose: CornerPose, sight: Sighting, rig: Rig) -> SeenMarker:
    """Return a marker with the corners that the first camera would see; zeros if any is not in front of it."""
    mounted_marker = next(candidate for candidate in sight.object.markers if candidate.number == marker.number)
    T = pose.T_camera_object
    corners = mounted_marker.corners @ T.rotation.T + T.translation
    in_front = bool((corners[:, 2] > NEAREST).all())
    pixels = rig.cameras[0].project(corners) if in_front else np.zeros((4, 2))
    return replace(marker, corners=frozen(pixels), spread=None)
