"""Conversion between the ``scene:`` section of YAML files and `Scene`: obstacles, attached objects, contacts."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pinocchio as pin

from rrtik_ompl.description.shapes.cloud import MAX_BYTES, read_cloud
from rrtik_ompl.description.shapes.mesh import read_mesh
from rrtik_ompl.description.shapes.octree import read_octree
from rrtik_ompl.files.kinds import KINDS, refusing_others
from rrtik_ompl.files.point_files import is_ply_mesh
from rrtik_ompl.files.pose_entry import PoseEntry, pose_data
from rrtik_ompl.files.sections import (
    ANYTHING,
    COLOR,
    NAME,
    NOT_NEGATIVE,
    NUMBER,
    VECTOR3,
    VERSION,
    Listed,
    Number,
    Section,
    key,
    parse,
)
from rrtik_ompl.files.strict_yaml import Location, YamlDocument, read_yaml, write_yaml
from rrtik_ompl.files.text import file_name, read_bytes
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Motion, Obstacle, Scene, TimedPoses, Touching
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.model.world_settings import SETTINGS_IN_FILES
from rrtik_ompl.problem_files.shapes import ShapeEntry, shape_data


class WaypointEntry(Section):
    """Where a moving obstacle is at a time [s]."""

    time = key(NUMBER, "[s]")
    pose = key(PoseEntry)


class MotionEntry(Section):
    """How an obstacle moves: a constant velocity [m/s], or poses at times with straight motions in between."""

    velocity = key(VECTOR3, default=None)
    waypoints = key(Listed(WaypointEntry, 1), default=None)

    def check_together(self) -> None:
        """Refuse both or none."""
        self.only_one(("velocity", "waypoints"), "a motion")

    def build(self) -> Motion:
        """Return the motion."""
        if self.velocity is not None:
            return ConstantVelocity(self.velocity)
        stations = self.waypoints or []
        return TimedPoses([w.time for w in stations], [w.pose.build() for w in stations])


class SolidEntry(ShapeEntry):
    """A named solid: exactly one shape and a pose."""

    pose = key(PoseEntry, default=None)
    color = key(COLOR, "in which pages draw it: '#rrggbb', or red, green and blue from 0 to 1", default=None)

    def build_pose(self) -> pin.SE3:
        """Return the pose; the identity if none is given."""
        return pin.SE3.Identity() if self.pose is None else self.pose.build(f"pose of '{self.name}'")


class ObstacleEntry(SolidEntry):
    """An obstacle in the world."""

    motion = key(MotionEntry, default=None)
    margin = key(NOT_NEGATIVE, "[m] that the arm keeps from it; that of the scene if absent", default=None)

    def build(self, folder: Path, margin: float = 0.0) -> Obstacle:
        """Return the obstacle.

        An obstacle that moves through waypoints and has no pose of its own gets its pose at time 0.

        Args:
            folder: Folder in which meshes are looked for.
            margin: Margin of an obstacle that states none [m].
        """
        motion = None if self.motion is None else self.motion.build()
        place = self.build_pose()
        if self.pose is None and motion is not None:
            place = motion.pose_at(place, 0.0)
        own = margin if self.margin is None else self.margin
        return Obstacle(self.name, self.build_shape(folder), place, motion, own, self.color)


class AttachedEntry(SolidEntry):
    """A solid that a link holds; ``pose`` is in the frame of the link."""

    link = key(NAME)
    allow = key(Listed(NAME), "links, obstacles and other objects that it may touch beside that link", default=[])
    padding = key(NOT_NEGATIVE, "[m] kept from all that it may not touch; that of the link if absent", default=None)
    margin = key(NOT_NEGATIVE, "[m] that it keeps beside that, also when it is set down", default=0.0)

    def build(self, folder: Path) -> AttachedObject:
        """Return the attached object."""
        shape = self.build_shape(folder)
        pose = self.build_pose()
        return AttachedObject(
            self.name, self.link, shape, pose, tuple(self.allow), self.padding, self.margin, self.color
        )


class ContactEntry(Section):
    """Two things that are in contact, one of them an obstacle or attached object."""

    pair = key(Listed(NAME, 2, 2))
    distance = key(Number(most=0.0), "[m] that the two must keep, whatever margins say: 0, or negative for a depth")

    def build(self) -> Touching:
        """Return the contact."""
        first, second = self.pair
        return Touching(first, second, self.distance)


class SceneEntry(Section):
    """What surrounds the arm."""

    margin = key(NOT_NEGATIVE, "[m] kept from obstacles that state none of their own", default=0.0)
    obstacles = key(Listed(ObstacleEntry), default=[])
    attached = key(Listed(AttachedEntry), default=[])
    allowed_collisions = key(
        Listed(Listed(NAME, 2, 2)), "pairs of names of links, obstacles or attached objects that may touch", default=[]
    )
    contacts = key(Listed(ContactEntry), "pairs that are in contact, and how far they may overlap", default=[])

    def build(self, document: YamlDocument, location: Location = ("scene",)) -> Scene:
        """Return the scene; errors name the line of the obstacle.

        Raises:
            InputError: If a shape or pose is invalid, a mesh cannot be read, or a name is used twice.
        """
        folder = document.path.parent

        obstacles = []
        for k, entry in enumerate(self.obstacles):
            with document.at((*location, "obstacles", k)):
                obstacles.append(entry.build(folder, self.margin))

        attached = []
        for k, held in enumerate(self.attached):
            with document.at((*location, "attached", k)):
                attached.append(held.build(folder))

        with document.at(location):
            allowed = tuple((a, b) for a, b in self.allowed_collisions)
            contacts = tuple(contact.build() for contact in self.contacts)
            return Scene(tuple(obstacles), tuple(attached), allowed, contacts)


class SceneFile(Section, keys={each.name: key(ANYTHING, default=None) for each in SETTINGS_IN_FILES}):
    """A file with a scene, or a whole problem file, whose other keys are ignored."""

    version = key(VERSION)
    scene = key(SceneEntry)
    robot = key(ANYTHING, default=None)
    start = key(ANYTHING, default=None)
    goal = key(ANYTHING, default=None)
    planner = key(ANYTHING, default=None)
    path_constraints = key(ANYTHING, default=None)
    run = key(ANYTHING, default=None)

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """A problem may leave its scene out: nothing surrounds the arm then."""
        whole = data.keys() >= {"robot", "start", "goal"}
        return super().prepared({"scene": {}, **data} if whole else data)


def _read_ply(file: Path) -> Shape:
    """Read a PLY: a mesh, or points without faces."""
    return (read_mesh if is_ply_mesh(read_bytes(file, MAX_BYTES)) else read_cloud)(file)


SOLIDS: dict[str, Callable[[Path], Shape]] = {
    **dict.fromkeys(KINDS["PointCloud"].endings, read_cloud),
    ".ply": _read_ply,
    **dict.fromkeys(KINDS["Octree"].endings, read_octree),
    **dict.fromkeys(KINDS["Mesh"].endings, read_mesh),
    ".npz": read_cloud,
}


def load_scene(file: str | os.PathLike[str]) -> Scene:
    """Read a scene.

    - YAML: ``version: 1`` and ``scene:``, or a whole problem file
    - MoveIt's ``.scene`` files, and its PlanningScene as YAML or JSON, without what that says of the robot
    - MJCF: what stands beside the robot, whose arm `load_robot` reads of the same file
    - one solid in metres, which becomes the only obstacle, named as the file: a cloud of points (PLY, PCD, XYZ, NPY,
      NPZ), a map of OctoMap (BT, OT) as its octree, or a mesh (STL, OBJ, DAE, GLB, PLY with faces)

    Raises:
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.

    Example:
        >>> rrtik.Scene([rrtik.Obstacle("post", rrtik.Box([0.1, 0.1, 1.0]))]).save("scene.yaml")
        >>> rrtik.load_scene("scene.yaml")
        Scene(post)
    """
    path = file_name(file)
    suffix = path.suffix.lower()
    if suffix == ".scene":
        from rrtik_ompl.problem_files.moveit_scene_text import read_scene_text  # few scenes are MoveIt's

        return read_scene_text(file)
    if suffix in (".xml", ".mjcf"):
        from rrtik_ompl.description.mjcf.scenery import scene_from_mjcf  # loads slowly, and few scenes are in MJCF

        return scene_from_mjcf(file)
    if suffix in SOLIDS:
        return Scene([Obstacle(path.stem, SOLIDS[suffix](path))])
    with refusing_others(file, "Scene"):
        document = read_yaml(file)
        if "version" not in document.data and "robot_model_name" in document.data:
            from rrtik_ompl.problem_files.moveit_scene import planning_scene

            return planning_scene(document)
        return parse(document, SceneFile).scene.build(document)


def write_scene(scene: Scene, file: str | os.PathLike[str]) -> None:
    """Write a scene as YAML; see :meth:`Scene.save`.

    Raises:
        InputError: If the file cannot be written, or a mesh does not come from a file.
    """
    write_yaml(file, {"version": 1, "scene": scene_data(scene, file_name(file).parent)})


def scene_data(scene: Scene, folder: Path) -> dict[str, Any]:
    """Return the content of the ``scene:`` section of a file in ``folder``."""
    data: dict[str, Any] = {}
    if scene.obstacles:
        data["obstacles"] = [_obstacle_data(o, folder) for o in scene.obstacles]
    if scene.attached:
        data["attached"] = [_attached_data(a, folder) for a in scene.attached]
    if scene.allowed_collisions:
        data["allowed_collisions"] = [list(pair) for pair in scene.allowed_collisions]
    if scene.contacts:
        data["contacts"] = [{"pair": list(each.names), "distance": each.distance} for each in scene.contacts]
    return data


def _obstacle_data(obstacle: Obstacle, folder: Path) -> dict[str, Any]:
    data = {"name": obstacle.name, **shape_data(obstacle.name, obstacle.shape, folder)}
    data["pose"] = pose_data(obstacle.pose)
    if isinstance(obstacle.motion, ConstantVelocity):
        data["motion"] = {"velocity": obstacle.motion.velocity.tolist()}
    elif obstacle.motion is not None:
        stations = zip(obstacle.motion.times.tolist(), obstacle.motion.poses, strict=True)
        data["motion"] = {"waypoints": [{"time": time, "pose": pose_data(T)} for time, T in stations]}
    data |= {"margin": obstacle.margin} if obstacle.margin else {}
    return data | ({"color": obstacle.color} if obstacle.color else {})


def _attached_data(held: AttachedObject, folder: Path) -> dict[str, Any]:
    data = {"name": held.name, "link": held.link, **shape_data(held.name, held.shape, folder)}
    data["pose"] = pose_data(held.pose)
    data |= {"allow": list(held.allow)} if held.allow else {}
    data |= {} if held.padding is None else {"padding": held.padding}
    data |= {"margin": held.margin} if held.margin else {}
    return data | ({"color": held.color} if held.color else {})
