"""Detected objects become obstacles and goals: a scene in the frame of the arm's base, from one picture or several."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, finite_array, frozen
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import HalfSpace
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.frames import base_from_camera, place_in_base
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap
from rrtik_ompl.sensing.sight import Sighting, detect_objects

SIGMAS = 3.0  # standard deviations of an obstacle's position that its margin covers


@dataclass(frozen=True, slots=True, eq=False)
class SeenObject:
    """An object in the frame of the arm's base.

    Attributes:
        object: Which one.
        T_base_object: Its pose.
        covariance: Of (position [m], small rotation about the axes of the base [rad]). Shape (6, 6).
        sighting: Its detection; None if the pose is that of a record.
        sigmas: How many standard deviations of its place the margins of its solids cover; 0 for no margins.
    """

    object: MarkedObject
    T_base_object: pin.SE3
    covariance: Matrix
    sighting: Sighting | None
    sigmas: float = SIGMAS

    __reduce__ = as_value

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigmas", checked_sigmas(self.sigmas))
        where = f"object '{self.object.name}'"
        object.__setattr__(self, "T_base_object", rigid(self.T_base_object, f"{where}: its pose"))
        object.__setattr__(self, "covariance", frozen(finite_array(self.covariance, (6, 6), f"{where}: covariance")))

    @property
    def position_sigma(self) -> float:
        """Standard deviation of its position along the worst direction [m]."""
        return _largest_sigma(self.covariance[:3, :3])

    @property
    def rotation_sigma(self) -> float:
        """Standard deviation of its rotation about the worst axis [rad]."""
        return _largest_sigma(self.covariance[3:, 3:])

    def margin(self, solid: Obstacle) -> float:
        """How far a point of one of its solids may be from where it seems to be [m].

        ``sigmas`` times the deviation of the position and that of the rotation at the lever arm of the solid's farthest
        point, which is no less than that of any point along any direction, however the two are correlated. Only small
        errors are covered: not the second pose of a single marker, nor a map that is wrong. Of a half-space the point
        that is nearest to the object counts, for it has no farthest one.
        """
        return self.sigmas * (self.position_sigma + _lever(solid) * self.rotation_sigma)

    def solids(self) -> tuple[Obstacle, ...]:
        """Its solids as obstacles in the frame of the base, named after it, with what is uncertain as their margins."""
        return tuple(
            Obstacle(name, each.shape, self.T_base_object * each.pose, margin=each.margin + self.margin(each))
            for name, each in zip(self.object.solid_names, self.object.solids, strict=True)
        )

    def grasp_pose(self, kind: str, level: int) -> pin.SE3:
        """``T_base_tip`` of a grasp.

        Raises:
            UnknownNameError: If the object has no such grasp type.
            IndexError: If the type has no such level.
        """
        return self.T_base_object * self.object.grasp(kind).levels[level]


def objects_in_base(
    sightings: tuple[Sighting, ...], marker_map: MarkerMap, *, sigmas: float = SIGMAS
) -> tuple[SeenObject, ...]:
    """All objects with a pose that can be used, in the frame of the arm's base; the base itself is left out.

    Args:
        sightings: Detected objects.
        marker_map: The map of all objects.
        sigmas: See :class:`SeenObject`.

    Raises:
        NoBaseError: If the pose of the base is not known.
        InputError: If ``sigmas`` is not 0 or more.
    """
    T_base_camera, spread = base_from_camera(marker_map, sightings)
    return tuple(
        SeenObject(each.object, *place_in_base(T_base_camera, spread, each), each, sigmas)
        for each in sightings
        if each.object.role not in ("base", "arm") and not each.refused
    )


def scene_from_image(
    picture: NDArray[np.uint8], camera: Camera, marker_map: MarkerMap, *, sigmas: float = SIGMAS
) -> Scene:
    """The scene that a picture shows: the solids of every target and obstacle in view, in the frame of the base.

    Args:
        picture: Shape (height, width) or (height, width, 3), 8 bits.
        camera: Of the picture.
        marker_map: The map of all objects.
        sigmas: How many standard deviations of where they are the margins cover.

    Raises:
        NoBaseError: If the pose of the base is not known.
        InputError: If the picture cannot be used, or ``sigmas`` is not 0 or more.
    """
    seen = objects_in_base(detect_objects(picture, camera, marker_map), marker_map, sigmas=sigmas)
    return Scene(tuple(solid for each in seen for solid in each.solids()))


def checked_sigmas(value: float) -> float:
    """A number of standard deviations.

    Raises:
        InputError: If it is not finite, or negative.
    """
    number = float(finite_array(value, (), "sigmas"))
    if number < 0.0:
        raise InputError(f"sigmas must be 0 (no margins) or more, got {number:g}")
    return number


def _lever(solid: Obstacle) -> float:
    """How far from the origin of the object the point of a solid is that moves most when it turns [m]."""
    if isinstance(solid.shape, HalfSpace):
        normal = solid.pose.rotation @ solid.shape.normal
        return abs(float(solid.shape.offset + normal @ solid.pose.translation))
    return farthest(solid.shape, solid.pose)


def _largest_sigma(covariance: Matrix) -> float:
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
