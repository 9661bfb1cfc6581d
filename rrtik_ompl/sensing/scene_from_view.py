"""Transform detected objects to the base frame, and make scenes of their solids and goals of their grasps.

Source: [1, ch. 4]: ``T_camera_tip = T_camera_mount T_mount_base T_base_tip(q)``. If the pose of the camera is known
from its mount (it moves with the arm), only the pose of the object is noisy; with a marker on the base, that of the arm
is noisy, too.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, finite_array, frozen
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.poses import pose, rigid
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import HalfSpace
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap
from rrtik_ompl.sensing.sight import Sighting, detect_objects
from rrtik_ompl.world.problem import Problem

SIGMAS = 3.0  # number of standard deviations of an obstacle's position that its margin covers


@dataclass(frozen=True, slots=True, eq=False)
class SeenObject:
    """A detected object in the base frame of the arm.

    Attributes:
        object: The object of the marker map.
        T_base_object: Its pose.
        covariance: Covariance of (position [m], small rotation about the axes of the base [rad]), shape (6, 6).
        sighting: Its detection; None if the pose comes from a record.
        sigmas: Number of standard deviations of its pose that the margins of its solids cover; 0 for no margins.
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
        """Return how far a point of one of its solids may be from its estimated place [m].

        This is ``sigmas`` times the standard deviation of the position, plus that of the rotation multiplied by the
        lever arm of the solid's farthest point. The sum bounds the deviation of any point in any direction, however the
        two are correlated. Only small errors are covered: not the second pose of a single marker, nor a wrong map. A
        half-space has no farthest point, so its distance from the object's origin is used.
        """
        return self.sigmas * (self.position_sigma + _lever(solid) * self.rotation_sigma)

    def solids(self) -> tuple[Obstacle, ...]:
        """Return its solids as obstacles in the base frame, named after it, with its uncertainty in their margins."""
        return tuple(
            replace(each, name=name, pose=self.T_base_object * each.pose, margin=each.margin + self.margin(each))
            for name, each in zip(self.object.solid_names, self.object.solids, strict=True)
        )

    def grasp_pose(self, kind: str, level: int) -> pin.SE3:
        """Return ``T_base_tip`` of a grasp; levels count from 0.

        Raises:
            UnknownNameError: If the object has no such grasp type.
            IndexError: If the type has no such level.
        """
        return self.T_base_object * self.object.grasp(kind).levels[level]


def objects_in_base(
    sightings: tuple[Sighting, ...], marker_map: MarkerMap, *, sigmas: float = SIGMAS
) -> tuple[SeenObject, ...]:
    """Return all objects with a usable pose in the base frame; the base itself and the arm are left out.

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
    """Return the scene in a picture: the solids of every target and obstacle in view, in the base frame.

    Args:
        picture: Shape (height, width) or (height, width, 3), 8 bits.
        camera: Camera of the picture.
        marker_map: The map of all objects.
        sigmas: Number of standard deviations of their poses that the margins cover.

    Raises:
        NoBaseError: If the pose of the base is not known.
        InputError: If the picture cannot be used, or ``sigmas`` is not 0 or more.
    """
    seen = objects_in_base(detect_objects(picture, camera, marker_map), marker_map, sigmas=sigmas)
    return Scene(tuple(solid for each in seen for solid in each.solids()))


def scene_with(scene: Scene, solids: Iterable[Obstacle]) -> Scene:
    """Return a scene with further solids, which replace those of the same names."""
    more = tuple(solids)
    names = {solid.name for solid in more}
    other_obstacles = tuple(obstacle for obstacle in scene.obstacles if obstacle.name not in names)
    return replace(scene, obstacles=(*other_obstacles, *more))


def grasp_problem(problem: Problem, seen: Iterable[SeenObject], name: str, kind: str, level: int) -> Problem:
    """Return the problem of moving from a given start to the approach pose of a grasp of a detected object.

    From there the tip moves straight along its own z axis, by the ``approach`` of the grasp type. This motion is not
    part of the problem, so nothing may touch the object along the path. Solids of detected objects have their margins.

    Args:
        problem: Its robot, start, scene and planner are kept.
        seen: Objects in the base frame.
        name: Name of the object to be grasped.
        kind: Grasp type.
        level: Number of the level, from 1.

    Raises:
        InputError: If the object was not seen, or has no such grasp.
        ProblemError: If the start is in collision.
    """
    objects = tuple(seen)
    target = next((object_seen for object_seen in objects if object_seen.object.name == name), None)
    if target is None:
        names = ", ".join(object_seen.object.name for object_seen in objects) or "nothing"
        raise InputError(f"object '{name}' was not seen; {names} was")

    levels = len(target.object.grasp(kind).levels)
    if not 1 <= level <= levels:
        raise InputError(f"grasp type '{kind}' of '{name}' has levels 1 to {levels}, not {level}")

    solids = [solid for object_seen in objects for solid in object_seen.solids()]
    scene = scene_with(problem.world.scene, solids)
    world = problem.world.with_accuracy("exact").with_scene(scene)

    approach_pose = target.grasp_pose(kind, level - 1) * pose([0.0, 0.0, -target.object.grasp(kind).approach])
    return Problem(
        world, problem.start, PoseGoal(approach_pose), name=f"{name}_{kind}_{level}", planner=problem.planner
    )


class NoBaseError(InputError):
    """The base of the arm is not in view, so that no poses can be given in its frame."""


def base_from_camera(marker_map: MarkerMap, sightings: tuple[Sighting, ...]) -> tuple[pin.SE3, Matrix]:
    """Return ``T_base_camera``, and the covariance of the base's pose in the camera frame, shape (6, 6).

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
    """Return ``T_base_tip`` and its covariance, (6, 6), from a marker on the arm; None without one or the base."""
    try:
        T_base_camera, spread = base_from_camera(marker_map, sightings)
    except NoBaseError:
        return None
    seen = next((each for each in sightings if each.object.role == "arm" and not each.refused), None)
    return None if seen is None else place_in_base(T_base_camera, spread, seen)


def place_in_base(T_base_camera: pin.SE3, base_covariance: Matrix, sight: Sighting) -> tuple[pin.SE3, Matrix]:
    """Return ``T_base_object``, and the covariance of position [m] and rotation [rad] in the axes of the base, (6, 6).

    The rotation error of the base contributes with the distance between base and object as its lever arm.
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


def relative_pose(first: Sighting, second: Sighting) -> tuple[pin.SE3, Matrix]:
    """Return the pose of one seen object in the frame of another, such as that of a part beside its socket.

    The errors of both poses count as independent. What they share, such as a wrong focal length, displaces both alike,
    so the covariance is too large rather than too small.

    Args:
        first: The object in whose frame the pose is.
        second: The other object, seen by the same camera at the same time.

    Returns:
        ``T_first_second``, and the covariance of position [m] and small rotation [rad] about the axes of the first
        object, shape (6, 6).

    Raises:
        InputError: If the pose of one of them is refused.
    """
    for each in (first, second):
        require(each, Sighting, "sighting of a relative pose", "use detect_objects(...)")
        if each.refused:
            raise InputError(f"object '{each.object.name}': {each.refused}")
    return place_in_base(first.pose.T_camera_object.inverse(), first.pose.covariance, second)


def checked_sigmas(value: float) -> float:
    """Check a number of standard deviations, and return it as ``float``.

    Raises:
        InputError: If it is not finite, or negative.
    """
    number = float(finite_array(value, (), "sigmas"))
    if number < 0.0:
        raise InputError(f"sigmas must be 0 (no margins) or more, got {number:g}")
    return number


def _lever(solid: Obstacle) -> float:
    """Return the distance from the object's origin to the point of a solid that moves most under rotation [m]."""
    if isinstance(solid.shape, HalfSpace):
        normal = solid.pose.rotation @ solid.shape.normal
        return abs(float(solid.shape.offset + normal @ solid.pose.translation))
    return farthest(solid.shape, solid.pose)


def _largest_sigma(covariance: Matrix) -> float:
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
