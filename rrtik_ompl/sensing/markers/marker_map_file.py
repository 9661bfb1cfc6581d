"""Read marker maps from YAML files: markers on objects, solids, and grasps; write markers into them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.files.pose_entry import PoseEntry, pose_data
from rrtik_ompl.files.sections import (
    FLAG,
    LENGTH,
    NAME,
    NOT_NEGATIVE,
    NUMBER,
    VERSION,
    Choice,
    Listed,
    Section,
    Whole,
    key,
    parse,
)
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml, write_yaml
from rrtik_ompl.files.text import file_name
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.problem_files.scene import SolidEntry
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker


class MarkerEntry(Section):
    """A marker on an object; x to its right, y to its top, z out of the paper."""

    id = key(Whole(0))
    side = key(LENGTH, "of the black square [m]; measure the print")
    side_sigma = key(NOT_NEGATIVE, "standard deviation of the side [m]", default=0.0)
    pose = key(PoseEntry, "in the frame of the object; its origin if absent", default=None)
    covariance = key(
        Listed(Listed(NUMBER, 6, 6), 6, 6),
        "of this pose: of position [m] and small rotation about the axes of the object [rad], in rows; known if absent",
        default=None,
    )

    def build(self) -> MountedMarker:
        """Return the marker."""
        place = pin.SE3.Identity() if self.pose is None else self.pose.build()
        covariance = None if self.covariance is None else np.array(self.covariance)
        return MountedMarker(self.id, self.side, place, self.side_sigma, covariance)


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
    speed = key(NOT_NEGATIVE, "at which it may move beside the camera, for rolling shutters [m/s]", default=0.0)

    def build(self, folder: Path) -> MarkedObject:
        """Return the object; files of meshes are relative to ``folder``."""
        solids = [Obstacle(each.name, each.build_shape(folder), each.build_pose()) for each in self.solids]
        grasps = [each.build() for each in self.grasps]
        markers = tuple(each.build() for each in self.markers)
        return MarkedObject(self.name, self.role, markers, tuple(solids), tuple(grasps), self.loose, self.speed)


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


def write_markers(
    file: str | os.PathLike[str], dictionary: str, markers: Sequence[MountedMarker], name: str = "markers"
) -> None:
    """Write a marker map with one object, which is the base of the arm.

    Raises:
        InputError: If the file cannot be written.
    """
    only = {"name": name, "role": "base", "markers": [_marker_data(marker) for marker in markers]}
    write_yaml(file, {"version": 1, "dictionary": dictionary, "objects": [only]})


def write_into(
    file: str | os.PathLike[str],
    map_file: str | os.PathLike[str],
    *,
    name: str,
    markers: Sequence[MountedMarker],
) -> None:
    """Write a copy of a marker map with other markers on an object.

    Args:
        file: The file to write, in the same folder if the map names files of meshes.
        map_file: The map.
        name: Name of the object.
        markers: Its markers, in its frame.

    Raises:
        InputError: If there is no such object, the map cannot be read, or the file cannot be written.
    """
    document = read_yaml(map_file)
    parse(document, MarkerMapFile)
    data: dict[str, Any] = dict(document.data)
    files = any("mesh" in solid or "file" in solid for each in data["objects"] for solid in each.get("solids") or [])
    if files and file_name(file).resolve().parent != document.path.resolve().parent:
        raise InputError(f"{file}: the map names files beside it; write to the folder {document.path.parent}")

    names = [each["name"] for each in data["objects"]]
    if name not in names:
        raise UnknownNameError("object", name, names, where=str(map_file))
    changed = dict(data["objects"][names.index(name)])
    changed["markers"] = [_marker_data(marker) for marker in markers]
    data["objects"] = [changed if each["name"] == name else each for each in data["objects"]]
    write_yaml(file, data)


def _marker_data(marker: MountedMarker) -> dict[str, Any]:
    data: dict[str, Any] = {"id": marker.number, "side": marker.side}
    if marker.side_sigma:
        data["side_sigma"] = marker.side_sigma
    data["pose"] = pose_data(marker.T_object_marker)
    if marker.covariance is not None:
        data["covariance"] = marker.covariance.tolist()
    return data
