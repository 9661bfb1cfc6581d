"""From poses in the frame of the camera to poses in the frame of the arm's base.

Source: [1, ch. 4]: ``T_camera_tip = T_camera_mount T_mount_base T_base_tip(q)``. Where the base is known from its mount
(the camera moves with the arm), only the pose of the target is noisy; with a marker on the base, that of the arm too.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.sight import Sighting


class NoBaseError(InputError):
    """The base of the arm is not in view, so that nothing can be said in its frame."""


def base_from_camera(marker_map: MarkerMap, sightings: tuple[Sighting, ...]) -> tuple[pin.SE3, Matrix]:
    """``T_base_camera`` and the covariance of the base's pose in the frame of the camera.

    Raises:
        NoBaseError: If the base has markers and none of them is in view, or its pose is refused.
    """
    if marker_map.T_base_camera is not None:
        return marker_map.T_base_camera, np.zeros((6, 6))

    name = marker_map.base.name if marker_map.base is not None else "base"
    for each in sightings:
        if each.object.role == "base":
            if each.refused:
                raise NoBaseError(f"base '{name}': {each.refused}")
            return each.pose.T_camera_object.inverse(), each.pose.covariance
    raise NoBaseError(f"no marker of the base '{name}' is in view; turn the camera, or say camera_pose in the map")


def tip_seen(marker_map: MarkerMap, sightings: tuple[Sighting, ...]) -> tuple[pin.SE3, Matrix] | None:
    """``T_base_tip`` and its covariance by a marker on the arm; None without one in view, or without the base."""
    try:
        T_base_camera, spread = base_from_camera(marker_map, sightings)
    except NoBaseError:
        return None
    seen = next((each for each in sightings if each.object.role == "arm" and not each.refused), None)
    return None if seen is None else place_in_base(T_base_camera, spread, seen)


def place_in_base(T_base_camera: pin.SE3, base_covariance: Matrix, sight: Sighting) -> tuple[pin.SE3, Matrix]:
    """``T_base_object`` and its covariance: position [m] and small rotation [rad] in the axes of the base, (6, 6).

    The error of the base's rotation counts with the distance between base and object as its lever arm.
    """
    pose = T_base_camera * sight.pose.T_camera_object
    turn = T_base_camera.rotation

    T_camera_base = T_base_camera.inverse()
    arm = sight.pose.T_camera_object.translation - T_camera_base.translation
    lever = np.eye(6)
    lever[:3, 3:] = -pin.skew(arm)
    spread = sight.pose.covariance + lever @ base_covariance @ lever.T

    axes = np.kron(np.eye(2), turn)
    return pose, axes @ spread @ axes.T
