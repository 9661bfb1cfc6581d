"""Compute the poses of objects in a picture, each with its quality; unreliable poses are refused with a reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.linalg import block_diag

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.alignment import MIN_LIKENESS
from rrtik_ompl.sensing.markers.corner_pose import (
    ALIGNED_SIGMA,
    ROUGH_SIGMA,
    CornerPose,
    pose_of_points,
    pose_of_square,
)
from rrtik_ompl.sensing.markers.detection import SeenMarker, find_markers
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker

_GREEN_ENOUGH = 0.5  # least share of the mean of the brightest channel
MIN_SIDE_PIXELS = 12.0  # two pixels for each cell of the coarsest dictionaries
MAX_REPROJECTION_ERROR = 2.0  # [pixels]; a larger error of the corners means a wrong map or a wrong number
# The same as a share of a single marker's side: bent sheets deviate by this much, and their covariance shows it.
MAX_BENT = 0.04

# Largest `surprise` of several markers; sides that are wrong by 0.5 % give 6 to 40, correct ones 0.2 to 1.
MAX_CONTRADICTION = 5.0
# Largest `strain`: three standard deviations between the focal length or the distortion and the camera's file.
MAX_STRAIN = 9.0


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """An object in a picture.

    Attributes:
        object: The object of the marker map.
        pose: Its pose in the camera frame, the second pose, errors and covariance.
        markers: Its markers that were seen.
        refused: Why the pose must not be used; "" if it may.
    """

    object: MarkedObject
    pose: CornerPose
    markers: tuple[SeenMarker, ...]
    refused: str = ""

    @property
    def quality(self) -> float:
        """Quality from 0 (useless) to 1: likeness of the best marker, halved if the pose is ambiguous, 0 if refused."""
        if self.refused:
            return 0.0
        likeness = max((m.likeness for m in self.markers if m.likeness > 0.5), default=0.5)
        return likeness * (0.5 if self.pose.ambiguous else 1.0)


def as_gray(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the grey values of a picture, (height, width) or (height, width, 3 or 4; blue, green, red).

    They are those of green light alone, unless there is little of it.

    Raises:
        InputError: If the array is not such a picture.
    """
    array = np.asarray(picture)
    if array.dtype != np.uint8 or array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (3, 4)):
        raise InputError(f"a picture has 8 bits and 1, 3 or 4 channels; got {array.dtype} of shape {array.shape}")
    if array.ndim == 2:
        return np.ascontiguousarray(array)

    # A lens shows red and blue light at other places than green, so the sum of all has fringes.
    brightness = array[:: max(len(array) // 64, 1), :, :3].mean(axis=(0, 1))
    if brightness[1] >= _GREEN_ENOUGH * brightness.max():
        return np.ascontiguousarray(array[:, :, 1])

    import cv2

    code = cv2.COLOR_BGR2GRAY if array.shape[2] == 3 else cv2.COLOR_BGRA2GRAY
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(array), code), dtype=np.uint8)


def detect_objects(
    picture: NDArray[np.uint8],
    camera: Camera,
    marker_map: MarkerMap,
    *,
    align: bool = True,
    before: Sequence[Sighting] = (),
    near: bool = False,
    turn: int = 0,
    thorough: bool = False,
) -> tuple[Sighting, ...]:
    """Detect the objects of a map in a picture; they are returned in the order of the map.

    Args:
        picture: Shape (height, width) or (height, width, 3), 8 bits.
        camera: Camera of the picture, with the same size.
        marker_map: The map of all objects.
        align: Refine the corners (`alignment`).
        before: Where the objects were sighted last in earlier pictures of a film, which makes alignment faster.
        near: Search for markers only near those places, unless one of them has disappeared.
        turn: Number of the picture in the film: parts of the picture take turns in the search for missing objects.
        thorough: Search all of a large picture closely, as a single photograph deserves, however long it takes: some
            seconds for 12 million pixels, in place of 60 ms.

    Raises:
        InputError: If the picture does not have the camera's size, or is invalid.

    Example:
        >>> import rrtik_robots
        >>> shipped = f"{rrtik_robots.__path__[0]}/problems/pilot"
        >>> camera = rrtik.sensing.Camera.load(f"{shipped}/camera_640.yaml")
        >>> marker_map = rrtik.sensing.MarkerMap.load(f"{shipped}/titan4_panel_markers.yaml")
        >>> (picture,) = next(rrtik.sensing.pictures_together([f"{shipped}/photographs"]))
        >>> seen = rrtik.sensing.detect_objects(picture.pixels, camera, marker_map)
        >>> "valve" in [each.object.name for each in seen]
        True
    """
    require(camera, Camera, "camera", "use Camera.load(file)")
    require(marker_map, MarkerMap, "marker map", "use MarkerMap.load(file)")
    gray = as_gray(picture)
    check_size(gray, camera)

    last_markers = [marker for last_sighting in before for marker in last_sighting.markers]
    markers_seen = find_markers(
        gray,
        marker_map.dictionary,
        align=align,
        tone=camera.tone,
        wanted=[marker.number for marked_object in marker_map.objects for marker in marked_object.markers],
        before=last_markers,
        near=near,
        turn=turn,
        camera=camera,
        thorough=thorough,
    )

    sightings = (sighting(camera, marked_object, markers_seen) for marked_object in marker_map.objects)
    return tuple(found_sighting for found_sighting in sightings if found_sighting is not None)


def check_size(picture: NDArray[np.uint8], camera: Camera, name: str = "the picture") -> None:
    """Check that a picture has the size of its camera's pictures; ``name`` is used in the message.

    Raises:
        InputError: If the picture does not have the camera's size.
    """
    height, width = picture.shape[:2]
    if (height, width) != (camera.height, camera.width):
        raise InputError(
            f"{name}: {width} x {height} pixels, but the camera's file says {camera.width} x {camera.height}; "
            "take pictures of the size that it was calibrated for"
        )


def sighting(camera: Camera, thing: MarkedObject, seen: Sequence[SeenMarker]) -> Sighting | None:
    """Compute the sighting of one object from the markers in view; None if none of them is on it.

    Only sharp and sufficiently large markers are used, as long as there are any. A single marker, or several in a
    plane, may have two poses.
    """
    mounted = {marker.number: marker for marker in thing.markers}
    seen_on_object = tuple(marker for marker in seen if marker.number in mounted)
    if not seen_on_object:
        return None

    used_markers = [marker for marker in seen_on_object if marker.side >= MIN_SIDE_PIXELS] or list(seen_on_object)
    sharp_markers = [marker for marker in used_markers if marker.likeness >= MIN_LIKENESS]
    sigma = ALIGNED_SIGMA if sharp_markers else ROUGH_SIGMA
    used_markers = sharp_markers or used_markers

    pixels = np.vstack([marker.corners for marker in used_markers])
    shifts = _motion_shifts(camera.lateness(pixels), thing.speed)
    if len(used_markers) == 1:
        pose = _of_one(camera, used_markers[0], mounted[used_markers[0].number], sigma, shifts)
    else:
        points = np.vstack([mounted[marker.number].corners for marker in used_markers])
        spread = _joint_spread(used_markers)
        moving = len(shifts) > 0
        shifts += _map_shifts([mounted[marker.number] for marker in used_markers])
        pose = pose_of_points(camera, pixels, points, sigma, spread, shifts, moving)

    return Sighting(thing, pose, seen_on_object, _refusal(pose, used_markers))


def _joint_spread(markers: Sequence[SeenMarker]) -> Matrix | None:
    """Return the covariance of the corners of all markers, shape (8 m, 8 m) [pixels^2]; None if it is not known.

    What all markers of a picture share does not become less by their number.
    """
    spreads = [marker.spread for marker in markers if marker.spread is not None]
    if len(spreads) < len(markers):
        return None

    spread: Matrix = block_diag(*spreads)
    shared = [marker.common for marker in markers if marker.common is not None]
    if len(shared) < len(markers):
        return spread

    common = np.vstack(shared)
    between_markers = 1.0 - np.kron(np.eye(len(markers)), np.ones((8, 8)))
    return spread + between_markers * (common @ common.T)


def _motion_shifts(lateness: Vector, speed: float) -> list[Matrix]:
    """Return the displacements of corners that are taken late [s] along each axis, by one sigma, shape (4 m, 3) [m].

    The direction of the motion is not known. The pose is that of the time of the middle row.
    """
    if speed == 0.0 or not lateness.any():
        return []
    return [np.outer(speed / np.sqrt(3.0) * lateness, axis) for axis in np.eye(3)]


def _of_one(
    camera: Camera, marker: SeenMarker, mounted: MountedMarker, sigma: float, shifts: Sequence[Matrix]
) -> CornerPose:
    """Compute the pose of an object from its only visible marker."""
    marker_pose = pose_of_square(
        camera, marker.corners, mounted.side, sigma, marker.spread, mounted.side_sigma, shifts, len(shifts) > 0
    )
    T_marker_object = mounted.T_object_marker.inverse()

    object_pose = marker_pose.T_camera_object * T_marker_object
    other_object_pose = None if marker_pose.other is None else marker_pose.other * T_marker_object

    # A rotation error of the marker displaces the object's origin.
    origin_from_marker = object_pose.translation - marker_pose.T_camera_object.translation
    rotation_lever = np.eye(6)
    rotation_lever[:3, 3:] = -pin.skew(origin_from_marker)

    covariance = marker_pose.covariance
    if mounted.covariance is not None:
        # An error of the marker's place on the object, in the axes of the camera, turns and moves the object's origin.
        axes = np.kron(np.eye(2), object_pose.rotation)
        covariance = covariance + axes @ mounted.covariance @ axes.T

    return CornerPose(
        object_pose,
        other_object_pose,
        marker_pose.error,
        marker_pose.other_error,
        rotation_lever @ covariance @ rotation_lever.T,
    )


def _map_shifts(markers: Sequence[MountedMarker]) -> list[Matrix]:
    """Return the displacements of all corners on the object by each uncertain number of the map, by one sigma.

    These are the side of each marker, and what its pose's covariance says; shape (4 markers, 3) each [m].
    """
    shifts = []
    for k, marker in enumerate(markers):
        if marker.side_sigma > 0.0:
            shift = np.zeros((4 * len(markers), 3))
            from_centre = marker.corners - marker.T_object_marker.translation
            shift[4 * k : 4 * k + 4] = from_centre * marker.side_sigma / marker.side
            shifts.append(shift)

        if marker.covariance is not None:
            from_centre = marker.corners - marker.T_object_marker.translation
            variances, axes = np.linalg.eigh(marker.covariance)
            for direction in (axes * np.sqrt(np.maximum(variances, 0.0))).T:
                shift = np.zeros((4 * len(markers), 3))
                shift[4 * k : 4 * k + 4] = direction[:3] + np.cross(direction[3:], from_centre)
                shifts.append(shift)

    return shifts


def _refusal(pose: CornerPose, markers: Sequence[SeenMarker]) -> str:
    """Return why a pose must not be used, with a remedy; "" if it may."""
    side = max(marker.side for marker in markers)
    if side < MIN_SIDE_PIXELS:
        return f"too far away or too small: {side:.0f} pixels a side, {MIN_SIDE_PIXELS:.0f} are needed"

    likeness = max(marker.likeness for marker in markers)
    if likeness < MIN_LIKENESS:
        return f"covered or blurred: {likeness:.2f} like the marker, {MIN_LIKENESS:g} is needed; free it, hold still"
    if pose.error > max(MAX_REPROJECTION_ERROR, MAX_BENT * side if len(markers) == 1 else 0.0):
        return f"corners lie {pose.error:.1f} pixels off: check the marker map, the side of the markers and the camera"
    if len(markers) > 1 and pose.surprise > MAX_CONTRADICTION:
        return (
            f"its markers contradict each other, corners lie {pose.error:.2f} pixels off: measure their sides and "
            "places again, calibrate the camera, or state what is not certain (side_sigma, sigmas_px)"
        )
    if len(markers) > 1 and pose.strain > MAX_STRAIN:
        return (
            f"its markers contradict the camera's file by {pose.strain**0.5:.1f} standard deviations of its focal "
            "length or lens: calibrate the camera, or state what is not certain (sigmas_px, distortion_sigmas)"
        )

    return ""
