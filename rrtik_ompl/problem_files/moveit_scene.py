"""The scene of MoveIt's messages: objects that are added, changed and removed in order, attached objects, contacts.

Objects, links and fixed frames are frames that other messages may refer to (:class:`Frames`).
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import combinations
from typing import ClassVar, NamedTuple, cast

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError, SceneWarning, UnknownNameError, few
from rrtik_ompl.description.faults import nearest_name
from rrtik_ompl.description.shapes.octree import cells_of_tree
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import Location, YamlDocument
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes.octree import Octree
from rrtik_ompl.problem_files.moveit_messages import (
    AllowedMatrix,
    AttachedMessage,
    CollisionObject,
    FixedFrame,
    PlacedOctomap,
    RobotState,
    SceneMessage,
    Solid,
)

OCTOMAP = "<octomap>"  # MoveIt's name for the map
SHOWN = 3  # names or pairs shown in a warning
WORLD = "world"  # name of the world frame; an empty name stands for it, too


@dataclass
class _Object:
    """An object: its pose in the world, its shapes with their poses in it, and the poses of its subframes in it."""

    pose: pin.SE3
    shapes: list[tuple[Solid, pin.SE3]] = field(default_factory=list)
    parts: dict[str, pin.SE3] = field(default_factory=dict)


class SceneReader:
    """Builds the scene from the messages of one problem.

    Args:
        robot: The arm, padded as the scene says.
        frames: The known frames; frames of objects are added to it.
        message: The scene.
    """

    def __init__(self, robot: Robot, frames: Frames, message: SceneMessage) -> None:
        self._robot = robot
        self._frames = frames
        self._message = message
        self._factors = {each.link_name: each.scale for each in message.link_scale}
        self._objects: dict[str, _Object] = {}
        self._held: dict[str, list[AttachedObject]] = {}
        self._map: Obstacle | None = None

    def read_world(self, document: YamlDocument) -> None:
        """Read the objects of the world and its map.

        Raises:
            InputError: If one of them cannot be read; with file, line and key.
        """
        for k, item in enumerate(self._message.world.collision_objects):
            with document.at(("world", "collision_objects", k)):
                self._do(item)
        with document.at(("world", "octomap", "octomap")):
            self._map = _mapped(self._message.world.octomap, self._frames)

    def start_at(self, q: Vector) -> Frames:
        """Move the arm, with the objects attached to it, to the start of a path, shape (dof,); return the frames."""
        self._frames = self._frames.moved_to(q)
        return self._frames

    def hold(self, document: YamlDocument, location: Location, state: RobotState) -> None:
        """Read the objects that a state attaches to links; one with the name of an earlier one replaces it.

        Args:
            document: The file of the state.
            location: Keys that lead to the state in the file.
            state: The state.

        Raises:
            InputError: If one of them cannot be read; with file, line and key.
        """
        for k, item in enumerate(state.attached_collision_objects):
            place = (*location, "attached_collision_objects", k)
            with document.at(place):
                self._attach(item)
            for j, link in enumerate(item.touch_links):
                if link and link not in self._robot.link_names:
                    near = nearest_name(link, self._robot.link_names)
                    line = f"no link '{link}' of robot '{self._robot.name}'; it is left out{near}"
                    tell(document, (*place, "touch_links", j), line)

    def scene(self, document: YamlDocument) -> Scene:
        """Return the scene.

        Raises:
            InputError: If a name is used twice, or the table of allowed collisions is malformed.
        """
        names: dict[str, list[str]] = {}

        # Collect the obstacles and attached objects, and the names of their parts.
        obstacles = []
        for name, item in self._objects.items():
            names[name] = _numbered(name, len(item.shapes))
            for part, (solid, place) in zip(names[name], item.shapes, strict=True):
                obstacles.append(Obstacle(part, solid.build(), item.pose * place))

        if self._map is not None:
            obstacles.append(self._map)
            names[OCTOMAP] = [OCTOMAP]

        attached = []
        for name, parts in self._held.items():
            names[name] = [part.name for part in parts]
            attached += parts

        with document.at(("world",)):
            scene = Scene(tuple(obstacles), tuple(attached))

        with document.at(("allowed_collision_matrix",)):
            # Add the allowed collisions, and warn of names that nothing has.
            matrix = self._message.allowed_collision_matrix
            allowed = _allowed(matrix, self._robot, names)

            once = {item.id for item in self._message.world.collision_objects}
            known = {*self._robot.link_names, *names, *once, OCTOMAP}
            unknown = dict(_unknown_entries(matrix, known))
            if unknown:
                name, key = next(iter(unknown.items()))
                others = f" (so are {few(list(unknown)[1:], SHOWN)})" if len(unknown) > 1 else ""
                line = f"no link or object '{name}'; what is said of it is left out{others}{nearest_name(name, known)}"
                tell(document, ("allowed_collision_matrix", *key), line)

            return Scene(scene.obstacles, scene.attached, allowed)

    def _do(self, item: CollisionObject) -> None:
        """Carry out the operation of an object's message."""
        if item.operation == "remove":
            for name in [item.id] if item.id else list(self._objects):
                self._objects.pop(name, None)
                self._frames.forget(name)
            return

        _named(item)
        item.check()
        known = self._objects.get(item.id)

        # Move an object, append shapes to one, or add a new one.
        if item.operation == "move":
            if known is None:
                raise UnknownNameError("object to move", item.id, self._objects)
            self._move(item, known)
        elif item.operation == "append" and known is not None:
            added = self._built(item)
            own = known.pose.actInv(added.pose)
            known.shapes += [(solid, own * place) for solid, place in added.shapes]
            known.parts |= {name: own * place for name, place in added.parts.items()}
        elif known is not None:
            raise InputError(f"scene: the name '{item.id}' is used 2 times; names must differ")
        else:
            self._objects[item.id] = self._built(item)

        # Other messages may refer to the object's frames from now on.
        placed = self._objects[item.id]
        self._frames.add(item.id, _frame_of(item, placed), placed.parts)

    def _move(self, item: CollisionObject, known: _Object) -> None:
        """Move an object, or each of its shapes, to another pose, in place."""
        header = self._frames.pose(item.header.frame_id)
        if item.pose.given:
            known.pose = header * item.pose.build()
        elif len(item.poses) == len(known.shapes):
            known.pose = header
            places = [place.build() for place in item.poses]
            known.shapes = [(solid, place) for (solid, _), place in zip(known.shapes, places, strict=True)]
        else:
            raise InputError(f"'{item.id}': to move it, give its pose, or a pose for each of its shapes")

    def _built(self, item: CollisionObject) -> _Object:
        """Return the object that a message describes."""
        pose = self._frames.pose(item.header.frame_id) * item.pose.build()
        parts = dict(zip(item.subframe_names, [each.build() for each in item.subframe_poses], strict=True))
        return _Object(pose, list(zip(item.solids, item.places(), strict=True)), parts)

    def _attach(self, item: AttachedMessage) -> None:
        """Attach an object to a link: the one in the message, or the one in the world that it names."""
        _named(item.object)
        item.object.check()
        if item.object.operation != "add":
            raise InputError(f"'{item.object.id}': an attached object is added; leave out those that are not held")
        if not self._robot.model.existFrame(item.link_name) or item.link_name not in self._robot.link_names:
            raise UnknownNameError(f"link of robot '{self._robot.name}'", item.link_name, self._robot.link_names)

        # The shapes come with the message, or from an object of the world with this name.
        name = item.object.id
        if item.object.solids:
            taken = self._built(item.object)
        elif name in self._objects:
            taken = self._objects[name]
        else:
            raise InputError(f"'{name}' has no shapes, and the world has no object of that name")

        # The object leaves the world.
        self._objects.pop(name, None)
        self._frames.forget(name)
        T_link_object = self._frames.pose(item.link_name).actInv(taken.pose)

        # It takes over the padding and scale of the link.
        allow = tuple(link for link in item.touch_links if link in self._robot.link_names and link != item.link_name)
        thick = self._robot.padding.get(item.link_name, 0.0)
        factor = self._factors.get(item.link_name, 1.0)
        self._held[name] = [
            AttachedObject(part, item.link_name, solid.build(factor), T_link_object * place, allow, thick)
            for part, (solid, place) in zip(_numbered(name, len(taken.shapes)), taken.shapes, strict=True)
        ]

        frame = _frame_of(item.object, taken)
        self._frames.add(name, frame, taken.parts, link=item.link_name)


class _Nobody:
    """What a scene without its robot knows of it: its name, and the links that its table of contacts names.

    Attributes:
        name: Of the robot.
        link_names: See above.
    """

    padding: ClassVar[dict[str, float]] = {}
    allowed_collisions = frozenset({frozenset[str]()})  # has a list: pairs of links are the robot's affair

    def __init__(self, message: SceneMessage) -> None:
        objects = {item.id for item in message.world.collision_objects}
        matrix = message.allowed_collision_matrix
        named = dict.fromkeys((*matrix.entry_names, *matrix.default_entry_names))
        self.name = message.robot_model_name
        self.link_names = tuple(name for name in named if name not in (*objects, OCTOMAP))
        self.model = self

    def existFrame(self, name: str) -> bool:
        """Say that no frame is known."""
        return False


def planning_scene(document: YamlDocument) -> Scene:
    """Return the objects of the world of a PlanningScene alone, without its robot.

    The frame in which all objects are given is taken for the world, as MoveIt saves them in the root of its robot.

    Raises:
        InputError: If one of them cannot be read, or is placed in a frame of the robot; with file, line and key.

    Warns:
        SceneWarning: If a frame is taken for the world, or the scene says something of the robot, which is left out.
    """
    message = parse(document, SceneMessage)
    nobody = cast(Robot, _Nobody(message))
    with document.at(("fixed_frame_transforms",)):
        frames = Frames(nobody, np.zeros(0), message.fixed_frame_transforms)

    used = {_bare(item.header.frame_id): k for k, item in enumerate(message.world.collision_objects)}
    first = next(iter(used), WORLD)
    if len(used) == 1 and not frames.knows(first):
        line = f"frame '{first}' is taken for the world, as a scene alone has no robot"
        tell(document, ("world", "collision_objects", used[first], "header"), line)
        frames.add(first, pin.SE3.Identity())

    reader = SceneReader(nobody, frames, message)
    try:
        reader.read_world(document)
    except UnknownNameError as error:
        remedy = "state it in fixed_frame_transforms, or load the scene with its request and robot (load_problem)"
        raise InputError(f"{error}; a scene alone knows no links: {remedy}") from None

    said = {
        "attached objects": message.robot_state.attached_collision_objects,
        "link_padding": [each for each in message.link_padding if each.padding],
        "link_scale": [each for each in message.link_scale if each.scale != 1.0],
    }
    for what, values in said.items():
        if values:
            line = f"{what}: left out, as a scene alone has no robot; load_problem takes them"
            tell(document, ("robot_state",) if what == "attached objects" else (what,), line)
    return reader.scene(document)


def tell(document: YamlDocument, location: Location, line: str) -> None:
    """Warn of something at a location of a message that does not become part of the problem."""
    warnings.warn(SceneWarning(f"{document.place(location)}: {line}"), stacklevel=3)


def passed_over(matrix: AllowedMatrix, robot: Robot) -> str:
    """Return a warning about links that the scene does not allow to touch but the robot never compares; "" for none."""
    never = robot.allowed_collisions
    pairs = [pair for pair, free in matrix.stated().items() if not free and frozenset(pair) in never]
    if not pairs:
        return ""
    shown = ", ".join(" and ".join(sorted(pair)) for pair in pairs[:SHOWN]) + (", ..." if len(pairs) > SHOWN else "")
    return (
        f"robot '{robot.name}' never compares {shown}, by its own list (SRDF); the allowed_collision_matrix of the "
        "scene does not allow that"
    )


def _named(item: CollisionObject) -> None:
    if not item.id:
        raise InputError("id: an object needs a name")


def _numbered(name: str, count: int) -> list[str]:
    """Return the names of the parts of an object: ``id``, then ``id_2``, ``id_3``..."""
    return [name if k == 0 else f"{name}_{k + 1}" for k in range(count)]


def _frame_of(item: CollisionObject, placed: _Object) -> pin.SE3:
    """Return the frame by which others refer to an object, in the world.

    An object without a pose of its own and with a single shape has the frame of this shape.
    """
    alone = len(placed.shapes) == 1 and not item.pose.given
    return placed.pose * placed.shapes[0][1] if alone else placed.pose


def _mapped(placed: PlacedOctomap, frames: Frames) -> Obstacle | None:
    """Return the occupied cells of a map as an obstacle; None if there is no map.

    Raises:
        InputError: If its data are malformed.
    """
    if not placed.octomap.data:
        return None
    tree = placed.octomap
    if not all(-128 <= value <= 255 for value in tree.data):
        raise InputError("data: must be bytes")

    body = np.array(tree.data, dtype=np.int64).astype(np.uint8).tobytes()
    centres, sides = cells_of_tree(body, tree.resolution, tree.id, "data", binary=tree.binary)
    pose = frames.pose(placed.header.frame_id) * placed.origin.build()
    return Obstacle(OCTOMAP, Octree(centres, sides), pose)


def _allowed(matrix: AllowedMatrix, robot: Robot, names: dict[str, list[str]]) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links and solids that may touch, by the table or else by the defaults of names.

    Args:
        matrix: The table of allowed collisions.
        robot: Its own list decides about pairs of links, if it has one.
        names: For each object the names of its parts.
    """
    links = robot.link_names
    stated = matrix.stated()
    allowed = [pair for pair, free in stated.items() if free and {*pair} <= {*links, *names}]
    allowed += _by_default(matrix, [*links, *names])

    found = []
    for first, second in allowed:
        between_links = first in links and second in links
        if not (between_links and robot.allowed_collisions):
            found += [(a, b) for a in names.get(first, [first]) for b in names.get(second, [second])]
    return tuple(found)


def _by_default(matrix: AllowedMatrix, every: list[str]) -> list[tuple[str, str]]:
    """Return the pairs without an entry in the table that may touch by the defaults of their names.

    If both names have a default, both must allow it.
    """
    defaults = matrix.defaults()
    stated = {frozenset(pair) for pair in matrix.stated()}
    found = []
    for first, second in combinations(every, 2):
        said = [defaults[name] for name in (first, second) if name in defaults]
        if said and all(said) and frozenset((first, second)) not in stated:
            found.append((first, second))
    return found


def _unknown_entries(matrix: AllowedMatrix, known: Collection[str]) -> Iterator[tuple[str, Location]]:
    """Yield the names of a table that nothing has although their entries would have an effect, and their locations.

    Tables often belong to a robot with more links, or name objects that are gone. A name is therefore not reported as a
    misspelling if the known name most similar to it is in the same list.
    """
    stated = matrix.stated()
    defaults = matrix.defaults()
    free = {name for pair, allowed in stated.items() if allowed for name in pair}
    overrides = any(defaults.values())  # then entries that forbid a contact have an effect, too
    lists: dict[str, tuple[Sequence[str], Collection[str]]] = {
        "entry_names": (matrix.entry_names, matrix.entry_names if overrides else free),
        "default_entry_names": (matrix.default_entry_names, [name for name, allowed in defaults.items() if allowed]),
    }

    for key, (names, deciding) in lists.items():
        for k, name in enumerate(names):
            if name in known or name not in deciding:
                continue
            if not set(get_close_matches(name, known, n=1)) & set(names):
                yield name, (key, k)


class _Carried(NamedTuple):
    """A frame: the link that carries it ("" for none), and T_link_frame."""

    link: str
    pose: pin.SE3


_STANDING = _Carried("", pin.SE3.Identity())


class Frames:
    """Poses of named frames in the world, at one configuration of the arm.

    A frame is carried by a link or fixed in the world. An empty name stands for the world.

    Args:
        robot: The arm.
        q: Its configuration, shape (dof,).
        fixed: Frames of the scene that are fixed in other frames, in any order.

    Raises:
        InputError: If fixed frames refer to each other in a circle.
    """

    def __init__(self, robot: Robot, q: Vector, fixed: Iterable[FixedFrame]) -> None:
        self._robot = robot
        self._q = q
        self._known: dict[str, _Carried] = {"": _STANDING, WORLD: _STANDING}

        for each in self._parents_first(each for each in fixed if not _names_itself(each)):
            parent = _bare(each.header.frame_id)
            # An unknown parent frame is taken as another name of the world.
            if not self.knows(parent):
                self._known[parent] = _STANDING
            self.add(_bare(each.child_frame_id), self.pose(parent) * each.transform.build(), link=self.link(parent))

        # Some files give coordinates in a frame with the name of the robot.
        if not self.knows(robot.name):
            self._known[robot.name] = _STANDING

    def moved_to(self, q: Vector) -> Frames:
        """Return the same frames at another configuration of the arm, shape (dof,)."""
        moved = Frames(self._robot, q, ())
        moved._known = dict(self._known)
        return moved

    def pose(self, name: str) -> pin.SE3:
        """Return ``T_world_frame`` of a frame.

        Raises:
            UnknownNameError: If there is no such frame.
        """
        name = _bare(name)
        if name in self._known:
            known = self._known[name]
            return self._link_pose(known.link) * known.pose

        if not self._robot.model.existFrame(name):
            raise UnknownNameError("frame", name, filter(None, (*self._known, *self._robot.link_names)))
        return self._link_pose(name)

    def link(self, name: str) -> str:
        """Return the link that carries a frame; "" for a frame that is fixed in the world."""
        name = _bare(name)
        return self._known[name].link if name in self._known else name

    def moves(self, name: str) -> bool:
        """Check whether a frame moves with the arm."""
        link = self.link(name)
        model = self._robot.model
        return bool(link and model.existFrame(link) and model.frames[model.getFrameId(link)].parentJoint > 0)

    def add(self, name: str, pose: pin.SE3, parts: Mapping[str, pin.SE3] | None = None, *, link: str = "") -> None:
        """Add a frame, and frames in it under the names ``name/part``.

        Args:
            name: Name of the frame.
            pose: T_world_frame.
            parts: T_frame_part, by name.
            link: The link that carries it; "" if it is fixed in the world.
        """
        T_link_frame = self._link_pose(link).actInv(pose)
        placed = {name: T_link_frame} | {
            f"{name}/{part}": T_link_frame * inner for part, inner in (parts or {}).items()
        }
        self._known |= {each: _Carried(link, place) for each, place in placed.items()}

    def forget(self, name: str) -> None:
        """Remove a frame and the frames in it."""
        for each in [each for each in self._known if each == name or each.startswith(f"{name}/")]:
            del self._known[each]

    def knows(self, name: str) -> bool:
        """Check whether there is such a frame."""
        return name in self._known or self._robot.model.existFrame(name)

    def _link_pose(self, link: str) -> pin.SE3:
        return self._robot.fk(self._q, link) if link else pin.SE3.Identity()

    def _parents_first(self, fixed: Iterable[FixedFrame]) -> Iterator[FixedFrame]:
        """Yield fixed frames, each after the frame that it is fixed in."""
        left = list(fixed)
        while left:
            children = {_bare(each.child_frame_id) for each in left}
            ready = [each for each in left if _bare(each.header.frame_id) not in children]
            if not ready:
                raise InputError(
                    f"fixed frames stand in each other: {', '.join(sorted(children))}; place one in the world"
                )
            yield from ready
            left = [each for each in left if each not in ready]


def _bare(name: str) -> str:
    return name.removeprefix("/")


def _names_itself(frame: FixedFrame) -> bool:
    """Whether a fixed frame stands in itself, at the identity: MotionBenchMaker writes the base of the Fetch so."""
    return _bare(frame.child_frame_id) == _bare(frame.header.frame_id) and frame.transform.build().isIdentity(0.0)
