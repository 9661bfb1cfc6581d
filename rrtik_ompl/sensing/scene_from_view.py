"""Objects seen become obstacles and goals: a scene in the frame of the arm's base, from one picture or several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.sensing.camera import Camera
from rrtik_ompl.sensing.frames import base_from_camera, position_in_base
from rrtik_ompl.sensing.margins import grown
from rrtik_ompl.sensing.marker_map import MarkedObject, MarkerMap
from rrtik_ompl.sensing.sight import Sighting, look

SIGMAS = 3.0  # of an obstacle's position, by which it may be larger than it looks


@dataclass(frozen=True, slots=True, eq=False)
class SeenObject:
    """An object in the frame of the arm's base.

    Attributes:
        object: Which one.
        T_base_object: Where it is.
        covariance: Of its position, in the axes of the base [m^2]. Shape (3, 3).
        sighting: What was seen of it; None if the pose was written down earlier.
    """

    object: MarkedObject
    T_base_object: Any
    covariance: Matrix
    sighting: Sighting | None

    @property
    def margin(self) -> float:
        """How far from its place it may be: three standard deviations along the worst direction [m]."""
        return SIGMAS * float(np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)))

    def kept_away(self) -> tuple[Obstacle, ...]:
        """Its solids, larger by the margin: what planners should keep away from."""
        return tuple(grown(solid, self.margin) for solid in self.solids())

    def solids(self) -> tuple[Obstacle, ...]:
        """Its solids as obstacles in the frame of the base, named after it, at their own size."""
        several = len(self.object.solids) > 1
        return tuple(
            Obstacle(f"{self.object.name}.{each.name}" if several else self.object.name, each.shape,
                     self.T_base_object * each.pose)
            for each in self.object.solids
        )  # fmt: skip

    def grasp_pose(self, kind: str, level: int) -> Any:
        """``T_base_tip`` of a grasp.

        Raises:
            UnknownNameError: If the object has no such grasp type.
            IndexError: If the type has no such level.
        """
        return self.T_base_object * self.object.grasp(kind).levels[level]


def objects_in_base(sightings: tuple[Sighting, ...], marker_map: MarkerMap) -> tuple[SeenObject, ...]:
    """All objects with a pose that can be used, in the frame of the arm's base; the base itself is left out.

    Raises:
        NoBaseError: If nothing says where the base is.
    """
    T_base_camera, spread = base_from_camera(marker_map, sightings)
    return tuple(
        SeenObject(each.object, *position_in_base(T_base_camera, spread, each), each)
        for each in sightings
        if each.object.role != "base" and not each.refused
    )


def scene_from_image(
    picture: NDArray[np.uint8], camera: Camera, marker_map: MarkerMap, *, margins: bool = False
) -> Scene:
    """The scene that a picture shows: the solids of every target and obstacle in view, in the frame of the base.

    Args:
        picture: Shape (height, width) or (height, width, 3), 8 bits.
        camera: Who took it.
        marker_map: What may be there.
        margins: Make each solid larger by three standard deviations of its place.

    Raises:
        NoBaseError: If nothing says where the base is.
        InputError: If the picture cannot be used.
    """
    seen = objects_in_base(look(picture, camera, marker_map), marker_map)
    return Scene(tuple(solid for each in seen for solid in (each.kept_away() if margins else each.solids())))
