"""Read marker maps from YAML files: markers on objects, solids, and grasps."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import pinocchio as pin
from pydantic import Field

from rrtik_ompl.files.pose_entry import PoseEntry
from rrtik_ompl.files.sections import Length, Name, NotNegative, Section, Version, parse
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.problem_files.scene import SolidEntry
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker


class MarkerEntry(Section):
    """A marker on an object; x to its right, y to its top, z out of the paper."""

    id: Annotated[int, Field(strict=True, ge=0)]
    side: Length = Field(description="of the black square [m]; measure the print")
    side_sigma: NotNegative = Field(0.0, description="standard deviation of the side [m]")
    pose: PoseEntry | None = Field(None, description="in the frame of the object; its origin if absent")

    def build(self) -> MountedMarker:
        """Return the marker."""
        place = pin.SE3.Identity() if self.pose is None else self.pose.build()
        return MountedMarker(self.id, self.side, place, self.side_sigma)


class GraspEntry(Section):
    """A family of grasps: poses of the tip in the frame of the object, one a level."""

    type: Name
    levels: Annotated[list[PoseEntry], Field(min_length=1)]
    approach: NotNegative = Field(
        0.1, description="distance of the pose before the grasp, against the tip's z axis [m]"
    )
    lift: NotNegative = Field(0.1, description="how far the object is taken up, along the world's z axis [m]")

    def build(self) -> GraspType:
        """Return the grasp type."""
        return GraspType(self.type, [level.build() for level in self.levels], self.approach, self.lift)


class ObjectEntry(Section):
    """An object with markers."""

    name: Name
    role: Literal["base", "arm", "target", "obstacle"]
    markers: Annotated[list[MarkerEntry], Field(min_length=1)]
    solids: list[SolidEntry] = Field(default=[], description="with poses in the frame of the object")
    grasps: list[GraspEntry] = Field(default=[])
    loose: bool = Field(False, strict=True, description="whether a gripper can carry it away")

    def build(self, folder: Path) -> MarkedObject:
        """Return the object; files of meshes are relative to ``folder``."""
        solids = [Obstacle(each.name, each.build_shape(folder), each.build_pose()) for each in self.solids]
        grasps = [each.build() for each in self.grasps]
        markers = tuple(each.build() for each in self.markers)
        return MarkedObject(self.name, self.role, markers, tuple(solids), tuple(grasps), self.loose)


class MarkerMapFile(Section):
    """A file with one marker map."""

    version: Version
    dictionary: Name
    camera_pose: PoseEntry | None = Field(None, description="T_base_camera, if one body holds arm and camera")
    objects: Annotated[list[ObjectEntry], Field(min_length=1)]

    def build(self, document: YamlDocument) -> MarkerMap:
        """Return the map; error messages name the line of the object."""
        from rrtik_ompl.sensing.markers.detection import marker_cells

        objects = []
        for k, entry in enumerate(self.objects):
            with document.at(("objects", k)):
                objects.append(entry.build(document.path.parent))
                for marker in entry.markers:
                    marker_cells(self.dictionary, marker.id)  # raises if the dictionary has no such marker

        with document.at(()):
            return MarkerMap(
                self.dictionary, tuple(objects), None if self.camera_pose is None else self.camera_pose.build()
            )


def read_marker_map(file: str | os.PathLike[str]) -> MarkerMap:
    """Read a marker map; see :meth:`MarkerMap.load`.

    Raises:
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
    """
    document = read_yaml(file)
    return parse(document, MarkerMapFile).build(document)
