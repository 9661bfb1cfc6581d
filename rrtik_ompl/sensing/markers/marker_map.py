"""Objects with their markers, solids and grasps, and the map of all of them. Immutable."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, finite_array, finite_number, frozen, not_negative
from rrtik_ompl.base.copies import set_fields
from rrtik_ompl.base.errors import InputError, UnknownNameError, listed, require
from rrtik_ompl.base.poses import PoseLike, rigid
from rrtik_ompl.files.kinds import read
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.sensing.markers.corner_pose import square_corners

ROLES = ("base", "arm", "target", "obstacle")
_ROUNDED = 1e-6  # relative error of covariances that are written to files


def covariance_of_pose(values: ArrayLike, what: str) -> Matrix:
    """Check and copy the covariance of a pose, shape (6, 6); ``what`` names it in messages.

    Raises:
        InputError: If it is not symmetric, or has a negative eigenvalue.
    """
    given = finite_array(values, (6, 6), what)
    covariance = 0.5 * (given + given.T)
    # Positions and rotations have different units, so what is compared is the correlations.
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlations = covariance / np.outer(scale, scale)
    uneven = np.abs(given - given.T) / np.outer(scale, scale)
    if uneven.max() > _ROUNDED or np.linalg.eigvalsh(correlations)[0] < -_ROUNDED:
        raise InputError(f"{what} must be symmetric and without negative eigenvalues")
    return frozen(covariance)


@dataclass(frozen=True, slots=True, eq=False)
class MountedMarker:
    """A marker on an object.

    The marker's frame has x to its right, y to its top and z out of the paper, with the origin in its centre.

    Attributes:
        number: Number in the dictionary.
        side: Side of its black square [m].
        T_object_marker: Its pose.
        side_sigma: Standard deviation of the side [m].
        covariance: Covariance of its pose: of (position [m], small rotation about the axes of the object [rad]), shape
            (6, 6); None if the pose is known.
    """

    number: int
    side: float
    T_object_marker: pin.SE3 = field(default_factory=pin.SE3.Identity)
    side_sigma: float = 0.0
    covariance: Matrix | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_object_marker", rigid(self.T_object_marker, f"marker {self.number}: its pose"))
        for word in ("side", "side_sigma"):
            object.__setattr__(self, word, finite_number(getattr(self, word), f"marker {self.number}: {word}"))
        if not 0.0 < self.side < 100.0:
            raise InputError(f"marker {self.number}: side must be between 0 and 100 m, got {self.side:g}")
        if not 0.0 <= self.side_sigma < self.side:
            raise InputError(
                f"marker {self.number}: side_sigma must be 0 or more and below side, got {self.side_sigma:g}"
            )
        if self.covariance is not None:
            covariance = covariance_of_pose(self.covariance, f"marker {self.number}: covariance")
            object.__setattr__(self, "covariance", covariance)

    @property
    def corners(self) -> Matrix:
        """Its corners in the object frame [m], in the order of detection, shape (4, 3)."""
        return frozen(square_corners(self.side) @ self.T_object_marker.rotation.T + self.T_object_marker.translation)


@dataclass(frozen=True, slots=True, eq=False)
class GraspType:
    """A family of grasps with one orientation, at several places along the object (levels).

    Attributes:
        name: Name shown to the pilot.
        levels: ``T_object_tip`` of each level.
        approach: Distance at which the tip first stops before the grasp, against its own z axis [m].
        lift: Height by which the object is lifted afterwards, along the world's z axis [m].
    """

    name: str
    levels: tuple[pin.SE3, ...]
    approach: float = 0.1
    lift: float = 0.1

    def __init__(self, name: str, levels: Iterable[pin.SE3], approach: float = 0.1, lift: float = 0.1) -> None:
        object.__setattr__(self, "name", name)
        poses = (
            rigid(T, f"grasp type '{name}': level {k}")
            for k, T in enumerate(listed(levels, f"levels of grasp type '{name}'"), 1)
        )
        object.__setattr__(self, "levels", tuple(poses))
        for word, value in (("approach", approach), ("lift", lift)):
            object.__setattr__(self, word, not_negative(value, f"grasp type '{name}': {word}"))

        if not self.levels:
            raise InputError(f"grasp type '{name}' needs at least one level")


@dataclass(frozen=True, slots=True, eq=False)
class MarkedObject:
    """A rigid object with markers on it.

    Attributes:
        name: Its name.
        role: "base" (of the arm: its frame is the world of the scene), "arm" (on its last link: its frame is that of
            the tip), "target" or "obstacle".
        markers: Its markers; those in view are used together.
        solids: Its solids, with poses ``T_object_solid``.
        grasps: Its grasp types.
        loose: Whether a gripper can carry it away.
        speed: Speed at which it may move beside the camera [m/s]: the rows of a rolling shutter see it at other places.
    """

    name: str
    role: str
    markers: tuple[MountedMarker, ...]
    solids: tuple[Obstacle, ...] = ()
    grasps: tuple[GraspType, ...] = ()
    loose: bool = False
    speed: float = 0.0

    def __post_init__(self) -> None:
        for word in ("markers", "solids", "grasps"):
            object.__setattr__(self, word, listed(getattr(self, word), f"{word} of object '{self.name}'"))

        object.__setattr__(self, "speed", not_negative(self.speed, f"object '{self.name}': speed"))
        require(self.role, str, f"role of object '{self.name}'", f"use one of {', '.join(ROLES)}")
        if self.role not in ROLES:
            raise UnknownNameError("role of an object", self.role, ROLES, where=self.name)
        if not self.markers:
            raise InputError(f"object '{self.name}' needs at least one marker")

    @property
    def solid_names(self) -> tuple[str, ...]:
        """Names of its solids in a scene: the object's name, followed by the solid's if there are several."""
        several = len(self.solids) > 1
        return tuple(f"{self.name}.{each.name}" if several else self.name for each in self.solids)

    def grasp(self, name: str) -> GraspType:
        """Return the grasp type of a name.

        Raises:
            UnknownNameError: If there is none.
        """
        for each in self.grasps:
            if each.name == name:
                return each
        raise UnknownNameError("grasp type", name, [g.name for g in self.grasps], where=self.name)


@dataclass(frozen=True, slots=True, eq=False)
class MarkerMap:
    """All objects that a camera may see, and how the camera is mounted.

    Attributes:
        dictionary: Dictionary of the markers.
        objects: The objects.
        T_base_camera: Pose of the camera, if one body carries arm and camera (as on a vehicle); None if the base has
            markers of its own and the camera may be anywhere.

    Example:
        >>> import rrtik_robots
        >>> shipped = f"{rrtik_robots.__path__[0]}/problems/pilot"
        >>> marker_map = rrtik.sensing.MarkerMap.load(f"{shipped}/titan4_panel_markers.yaml")
        >>> [each.name for each in marker_map.objects if each.role == "target"]
        ['valve']
    """

    dictionary: str
    objects: tuple[MarkedObject, ...]
    T_base_camera: pin.SE3 | None

    def __init__(self, dictionary: str, objects: Iterable[MarkedObject], T_base_camera: PoseLike | None = None) -> None:
        things = listed(objects, "objects of a marker map")
        for marked_object in things:
            require(marked_object, MarkedObject, "object of a marker map")
        place = None if T_base_camera is None else rigid(T_base_camera, "pose of the camera")
        set_fields(self, dictionary=dictionary, objects=things, T_base_camera=place)

        for what, names in (
            ("object", [o.name for o in self.objects]),
            ("marker", [m.number for o in self.objects for m in o.markers]),
        ):
            twice = [name for name, count in Counter(names).items() if count > 1]
            if twice:
                raise InputError(f"{what} {twice[0]} is twice in the marker map; every one needs its own")

        bases = [o.name for o in self.objects if o.role == "base"]
        if len(bases) > 1:
            raise InputError(f"two objects are the base: {bases[0]} and {bases[1]}; there is one arm")
        if not bases and self.T_base_camera is None:
            raise InputError("nothing says where the base is: give an object the role base, or say camera_pose")

    @staticmethod
    def load(file: str | os.PathLike[str]) -> MarkerMap:
        """Read a marker map (YAML).

        Raises:
            InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
        """
        return read(MarkerMap, file)

    @property
    def base(self) -> MarkedObject | None:
        """The object that is the base of the arm; None if the base has no markers."""
        return next((o for o in self.objects if o.role == "base"), None)

    def named(self, name: str) -> MarkedObject:
        """Return the object of a name.

        Raises:
            UnknownNameError: If there is none.
        """
        for each in self.objects:
            if each.name == name:
                return each
        raise UnknownNameError("object", name, [o.name for o in self.objects])
