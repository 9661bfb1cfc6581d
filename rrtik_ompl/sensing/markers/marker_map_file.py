"""Read marker maps from YAML files: markers on objects, solids, and grasps."""

from __future__ import annotations

import os
from pathlib import Path

import pinocchio as pin

from rrtik_ompl.files.pose_entry import PoseEntry
from rrtik_ompl.files.sections import (
    FLAG,
    LENGTH,
    NAME,
    NOT_NEGATIVE,
    VERSION,
    Choice,
    Listed,
    Section,
    Whole,
    key,
    parse,
)
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.problem_files.scene import SolidEntry
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker


class MarkerEntry(Section):
    """A marker on an object; x to its right, y to its top, z out of the paper."""

    id = key(Whole(0))
    side = key(LENGTH, "of the black square [m]; measure the print")
    side_sigma = key(NOT_NEGATIVE, "standard deviation of the side [m]", default=0.0)
    pose = key(PoseEntry, "in the frame of the object; its origin if absent", default=None)

    def build(self) -> MountedMarker:
        """Return the marker."""
        place = pin.SE3.Identity() if self.pose is None else self.pose.build()
        return MountedMarker(self.id, self.side, place, self.side_sigma)


class GraspEntry(Section):
    """A family of grasps: poses of the tip in the frame of the object, one a level."""

    type = key(NAME)
    levels = key(Listed(PoseEntry, 1))
    approach = key(NOT_NEGATIVE, "distance of the pose before the grasp, against the tip's z axis [m]", default=0.1)
    lift = key(NOT_NEGATIVE, "how far the object is taken up, along the world's z axis [m]", default=0.1)

    def build(self) -> GraspType:
        """Return the grasp type."""
        return GraspType(self.type, [level.build() for level in self.levels], self.approach, self.lift)


class ObjectEntry(Section):
    """An object with markers."""

    name = key(NAME)
    role = key(Choice("base", "arm", "target", "obstacle"))
    markers = key(Listed(MarkerEntry, 1))
    solids = key(Listed(SolidEntry), "with poses in the frame of the object", default=[])
    grasps = key(Listed(GraspEntry), default=[])
    loose = key(FLAG, "whether a gripper can carry it away", default=False)

    def build(self, folder: Path) -> MarkedObject:
        """Return the object; files of meshes are relative to ``folder``."""
        solids = [Obstacle(each.name, each.build_shape(folder), each.build_pose()) for each in self.solids]
        grasps = [each.build() for each in self.grasps]
        markers = tuple(each.build() for each in self.markers)
        return MarkedObject(self.name, self.role, markers, tuple(solids), tuple(grasps), self.loose)


class MarkerMapFile(Section):
    """A file with one marker map."""

    version = key(VERSION)
    dictionary = key(NAME)
    camera_pose = key(PoseEntry, "T_base_camera, if one body holds arm and camera", default=None)
    objects = key(Listed(ObjectEntry, 1))

    def build(self, document: YamlDocument) -> MarkerMap:
        """Return the map; error messages name the line of the object."""
        from rrtik_ompl.sensing.markers.dictionaries import marker_cells

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
