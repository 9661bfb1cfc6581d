"""Read links and joints from MJCF text; every element is checked, and every error names file, element and remedy."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations, count, pairwise, product
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.errors import InputError, UnknownNameError, few
from rrtik_ompl.description.mjcf.compiled import compiled
from rrtik_ompl.description.mjcf.elements import (
    COMPILER,
    MAIN,
    OF_THE_SCENE,
    Meshes,
    Settings,
    UnreadableFieldError,
    ground_of,
    masks,
    meshes_of,
    solid_of,
)
from rrtik_ompl.description.robot_build import Mimic
from rrtik_ompl.description.tree import Joint, Link, Solid, Tree
from rrtik_ompl.description.urdf_read import attribute, flattened, located, numbers, parse_xml
from rrtik_ompl.files.text import read_text

MOST_FILES = 100  # most files that are included
UNREAD = ("composite", "flexcomp", "replicate", "attach", "frame")  # elements that make bodies from other bodies
SIZES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}  # how many numbers a joint has in a keyframe
WORLD = "world"
HELD = ("free", "ball")  # kinds of joints that are held fixed
DEFORMABLE = ("flex", "flexcomp", "skin", "composite")
OF_JOINTS = ("joint", "jointinparent")  # attributes of an actuator that name a joint

Mask = tuple[int, int]  # contype and conaffinity


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A solid of the world, or of a body on it that no hinge or slide moves.

    Attributes:
        name: Of its geom, or of its body.
        kind: The type of the geom.
        solid: With its pose in the world.
        apart: Links of the robot that it never collides with, because of masks or ``<exclude>``.
    """

    name: str
    kind: str
    solid: Solid
    apart: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Mjcf:
    """The contents of an MJCF file.

    Attributes:
        name: Name of the model.
        tree: The tree in which bodies and sites are links, hinges and slides are joints.
        mimics: Joints that follow others.
        excluded: Pairs of links that never collide.
        apart: Pairs of solids that never collide, named by link and number, such as "hand_0".
        touchable: Pairs of links that may collide although a joint joins them, as one of them is welded to the world.
        loops: Joints that a loop connects or an equality holds, with the values [rad or m] at which they are held.
        things: What stands beside the robot, which the scene has.
        unread: Things in the file about shapes, joints and limits that are not used.
        postures: The keyframes: joint values [rad or m] by name of the joint, for each name.
    """

    name: str
    tree: Tree
    mimics: tuple[Mimic, ...]
    excluded: frozenset[frozenset[str]]
    apart: frozenset[frozenset[str]]
    touchable: frozenset[frozenset[str]]
    loops: Mapping[str, float]
    things: tuple[Thing, ...]
    unread: tuple[str, ...]
    postures: Mapping[str, Mapping[str, float]]


def read_mjcf(path: Path, *, scene: bool = False) -> Mjcf:
    """Read a file and the files that it includes.

    What cannot be read here is read as MuJoCo compiles it, where the package mujoco is installed.

    Args:
        path: The file.
        scene: Whether what stands beside the robot is wanted: else what cannot be read of it is only named.

    Raises:
        InputError: If anything in it cannot be used.
    """
    where = str(path)
    try:
        root = parse_xml(read_text(path), "mujoco", where)
        _include(root, path.resolve().parent)
        settings = Settings()
        settings.read(root, where)
        return _read(root, settings, meshes_of(root, settings, path.resolve().parent, where), where, scene=scene)
    except InputError:
        result = compiled(path)
        if result is None:
            raise

    root, meshes = result
    settings = Settings()
    settings.read(root, where)
    made = {name: (mesh, pin.SE3.Identity()) for name, mesh in meshes.items()}
    return _read(root, settings, made, where, scene=scene)


def _read(root: Element, settings: Settings, meshes: Meshes, where: str, *, scene: bool) -> Mjcf:
    """Read the elements of a file."""
    fields = {each.get("name", ""): each for each in root.findall("asset/hfield")}
    reader = _Reader(where, settings, meshes, fields)
    for world in root.findall("worldbody"):
        reader.read(world)
    if scene and reader.unreadable:
        raise InputError(f"{where}: {reader.unreadable[0]}; {COMPILER}")

    loose = {name for name, body in reader.bodies.items() if "free" in body.joints}
    loose |= {body.get("name", "") for body in root.iter("body") if body.get("mocap") == "true"}
    things = _taken_out(root, reader, loose)
    tree = Tree(where, reader.finished(), reader.joints)
    links = {link.name for link in tree.links}
    loops = _loops(root, tree, loose)
    in_loops = {joint: reader.zeros[joint] for joints in loops.values() for joint in joints}
    scenery = [*reader.unreadable, *(f"{thing.kind} '{thing.name}'" for thing in things)]
    held = {name: body for name, body in reader.bodies.items() if name in links}
    unread = unread_of_mjcf(root, held, scenery, {name for name, _ in reader.moving}, loops)

    return Mjcf(
        name=root.get("model", ""),
        tree=tree,
        mimics=flattened(where, reader.joints, _followers(root, reader)),
        excluded=frozenset(pair for pair in _excluded(root, reader) if pair <= links),
        apart=_never_colliding_solids(reader),
        touchable=frozenset(pair for pair in touchable(reader.bodies) if pair <= links),
        loops=in_loops | _held_values(root, reader),
        things=things,
        unread=tuple(unread),
        postures=_keys(root, reader),
    )


def _include(root: Element, folder: Path) -> None:
    """Replace each ``<include>`` by the contents of its file, in place; the top elements of these may have any name."""
    stack = [root]
    count = 0
    while stack:
        element = stack.pop()
        children = list(element)
        for place, item in reversed(list(enumerate(children))):
            if item.tag == "include":
                count += 1
                if count > MOST_FILES:
                    raise InputError(f"{folder}: more than {MOST_FILES} files included; is it a ring?")
                file = folder / attribute(item, "include", "file", str(folder))
                text = read_text(file)
                children[place : place + 1] = list(parse_xml(text, None, str(file)))

        element[:] = children
        if any(item.tag == "include" for item in element):
            stack.append(element)
        else:
            stack += list(element)


@dataclass(frozen=True, slots=True)
class Body:
    """A body: the name of its parent, and the kinds of the joints between the two."""

    parent: str
    joints: tuple[str, ...]


@dataclass(slots=True, eq=False)
class _Reader:
    where: str
    settings: Settings
    meshes: Meshes
    fields: Mapping[str, Element]  # height fields by name
    solids: dict[str, tuple[list[Solid], list[Solid]]] = field(default_factory=lambda: {WORLD: ([], [])})
    joints: list[Joint] = field(default_factory=list)
    masks: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    moving: list[tuple[str, str]] = field(default_factory=list)  # names and kinds of joints, in the order of keyframes
    bodies: dict[str, Body] = field(default_factory=lambda: {WORLD: Body("", ())})
    names: dict[str, list[tuple[str, str]]] = field(default_factory=dict)  # of hard solids: names and kinds of geoms
    grounds: dict[str, list[tuple[str, str, Solid, Mask]]] = field(default_factory=dict)  # planes, height fields
    unreadable: list[str] = field(default_factory=list)  # height fields that cannot be read
    zeros: dict[str, float] = field(default_factory=dict)  # values of the joints in the pose that the file describes

    def read(self, world: Element) -> None:
        """Read all bodies depth first, which is the order of joints in keyframes."""
        self.contents(world, WORLD, MAIN)
        stack = _below(world, WORLD, MAIN)
        while stack:
            body, parent, name, style = stack.pop()
            self.mount(body, parent, name, style)
            self.contents(body, name, style)
            stack += _below(body, name, style)

    def contents(self, element: Element, link: str, style: str) -> None:
        """Read the geoms and sites of a body; each site becomes a link that is fixed to the body's."""
        place = f"{self.where}: body '{link}'"
        for item in element:
            if item.tag in UNREAD:
                raise InputError(f"{place}: <{item.tag}> cannot be read; {COMPILER}")

        for item in element.findall("geom"):
            geom = self.settings.filled(item, style, place)
            with located(place):
                geom_masks = masks(geom, place)
            named = geom.get("name", ""), geom.get("type", "sphere")
            if named[1] in OF_THE_SCENE:
                self.ground(geom, link, place, named, geom_masks)
                continue
            with located(place):
                solid = solid_of(geom, self.settings, self.meshes, place)
            self.solids[link][not any(geom_masks)].append(solid)
            if any(geom_masks):
                self.masks.setdefault(link, []).append(geom_masks)
                self.names.setdefault(link, []).append(named)

        for item in element.findall("site"):
            site = self.settings.filled(item, style, place)
            name = site.get("name", "")
            if name and name not in self.solids:
                self.solids[name] = [], []
                self.fix(link, name, self.settings.placement(site, place))

    def ground(self, geom: Element, link: str, place: str, named: tuple[str, str], geom_masks: Mask) -> None:
        """Read a plane or a height field, which belong to the scene."""
        if not any(geom_masks):
            return
        with located(place):
            try:
                solid = ground_of(geom, self.settings, self.fields, place)
            except UnreadableFieldError as fault:
                self.unreadable.append(str(fault))
                return
        self.grounds.setdefault(link, []).append((*named, solid, geom_masks))

    def mount(self, body: Element, parent: str, name: str, style: str) -> None:
        """Add the joints between a body and its parent, with a link without solids after each of them."""
        place = f"{self.where}: body '{name}'"
        if name in self.solids:
            raise InputError(f"{place}: its name stands there twice; rename one body or site")

        link = parent
        offset = self.settings.placement(body, place)
        kinds = []

        for number, item in enumerate([*body.findall("joint"), *body.findall("freejoint")]):
            joint = self.settings.filled(item, style, place)
            joint_name = joint.get("name") or f"{name}/joint{number + 1}"
            kind = joint.get("type", "hinge") if joint.tag == "joint" else "free"
            if kind not in SIZES:
                raise UnknownNameError("type of joint", kind, SIZES, where=place)
            self.moving.append((joint_name, kind))
            kinds.append(kind)
            if kind not in HELD:
                link, offset = self.turned(joint, kind, joint_name, link, offset)

        self.bodies[name] = Body(parent, tuple(kinds))
        self.solids[name] = [], []
        self.fix(link, name, offset)

    def turned(self, joint: Element, kind: str, name: str, link: str, offset: pin.SE3) -> tuple[str, pin.SE3]:
        """Add a hinge or slide.

        Args:
            joint: The element, with defaults filled in.
            kind: "hinge" or "slide".
            name: Name of the joint.
            link: Link before the joint.
            offset: Pose of the body in that link, in the pose that the file describes.

        Returns:
            The name of the link after the joint, and the pose of the body in that link.
        """
        place = f"{self.where}: joint '{name}'"
        joint_placement = pin.SE3(np.eye(3), np.array(numbers(joint, "pos", 3, (0.0, 0.0, 0.0), place)))
        axis = np.array(numbers(joint, "axis", 3, (0.0, 0.0, 1.0), place))

        slides = kind == "slide"
        unit = 1.0 if slides else self.settings.angle(1.0)
        low, high = (unit * value for value in numbers(joint, "range", 2, (0.0, 0.0), place))

        automatic = "true" if self.settings.limited and joint.get("range") is not None else "false"
        limited = joint.get("limited", "auto").replace("auto", automatic) == "true"
        joint_kind = "prismatic" if slides else "revolute" if limited else "continuous"
        bounds = {"lower": low, "upper": high} if limited else {"lower": -np.inf, "upper": np.inf}

        child = f"{name}/link"
        with located(place):
            self.joints.append(Joint(name, joint_kind, link, child, offset * joint_placement, axis, **bounds))
        self.solids[child] = [], []

        zero = unit * numbers(joint, "ref", 1, (0.0,), place)[0]
        self.zeros[name] = zero
        motion_to_zero = -zero * self.joints[-1].axis
        from_zero = pin.SE3(np.eye(3), motion_to_zero) if slides else pin.SE3(pin.exp3(motion_to_zero), np.zeros(3))
        return child, from_zero * joint_placement.inverse()

    def fix(self, parent: str, child: str, placement: pin.SE3) -> None:
        """Add a joint that fixes a link to another one at a pose."""
        self.joints.append(Joint(f"{child}/mount", "fixed", parent, child, placement))

    def finished(self) -> list[Link]:
        """Return all links; a link without visual solids is drawn by its collision geometry."""
        return [Link(name, tuple(hard), tuple(drawn or hard)) for name, (hard, drawn) in self.solids.items()]


def _taken_out(root: Element, reader: _Reader, loose: set[str]) -> tuple[Thing, ...]:
    """Take what the scene has out of what was read, and return it: the world's own solids, and bodies beside the robot.

    A body on the world belongs to the robot if a hinge or slide moves it or a body that it carries.

    Args:
        root: Top element of the file.
        reader: Loses the links of the scene.
        loose: Free bodies, and those that a user moves; what is fixed to one that is taken out is added.
    """
    roots = {name: _root(name, reader.bodies) for name in reader.bodies}
    moved = {roots[name] for name, body in reader.bodies.items() if _moving_joint_kinds(body)}
    beside = [name for name in reader.bodies if name == WORLD or roots[name] not in moved]

    poses = {WORLD: pin.SE3.Identity()}
    kept = []
    for joint in reader.joints:  # each after those above it
        if joint.parent in poses and (joint.parent != WORLD or joint.child in beside):
            poses[joint.child] = poses[joint.parent] * joint.T_parent_joint
            loose |= {joint.child} if joint.parent in loose else set()
        else:
            kept.append(joint)
    reader.joints[:] = kept

    solids = []
    for name in beside:
        hard = zip(reader.names.pop(name, ()), reader.solids[name][0], reader.masks.pop(name, ()), strict=True)
        solids += [(name, *each) for each in ((*named, solid, mask) for named, solid, mask in hard)]
        solids += [(name, *each) for each in reader.grounds.pop(name, ())]
        reader.solids[name] = [], []
    for name in poses:
        if name != WORLD:
            del reader.solids[name]

    excluded = {frozenset((item.get("body1", ""), item.get("body2", ""))) for item in root.findall("contact/exclude")}
    taken: set[str] = set()
    things = []
    for body, geom, kind, solid, mask in solids:
        name = _unused(geom or (kind if body == WORLD else body), taken)
        taken.add(name)
        apart = [
            link
            for link, own in reader.masks.items()
            if frozenset((link, body)) in excluded or not any(meet(mask, each) for each in own)
        ]
        things.append(Thing(name, kind, replace(solid, T_link_solid=poses[body] * solid.T_link_solid), tuple(apart)))
    return tuple(things)


def _root(name: str, bodies: Mapping[str, Body]) -> str:
    """Return the body on the world that carries a body; the world for itself."""
    way = [*_ancestry(name, bodies)]
    return way[-2] if len(way) > 1 else WORLD


def _unused(name: str, taken: Collection[str]) -> str:
    """Return a name, with a number behind it if it is taken."""
    return next(each for each in chain([name], (f"{name}_{k}" for k in count(2))) if each not in taken)


def _below(body: Element, name: str, style: str) -> list[tuple[Element, str, str, str]]:
    """Return the bodies in a body, the last one first: element, parent, name, class of defaults."""
    children = [
        (element, name, element.get("name") or f"{name}/body{number + 1}", element.get("childclass", style))
        for number, element in enumerate(body.findall("body"))
    ]
    return children[::-1]


def _followers(root: Element, reader: _Reader) -> tuple[Mimic, ...]:
    """Return the joints that follow others, from the equalities of two joints.

    Offsets are converted, as MuJoCo counts both joints from the pose that the file describes.
    """
    where = reader.where
    mimics = []

    for tie in root.findall("equality/joint"):
        if tie.get("joint2") is None or tie.get("active", "true") != "true":
            continue
        name, source = (attribute(tie, "joint", key, f"{where}: equality") for key in ("joint1", "joint2"))
        coefficients = [float(number) for number in numbers(tie, "polycoef", 5, (0.0, 1.0, 0.0, 0.0, 0.0), where)]
        if any(coefficients[2:]):
            raise InputError(f"{where}: joint '{name}' follows '{source}' by a curve; only straight lines can be read")
        values_at_zero = [reader.zeros.get(joint, 0.0) for joint in (name, source)]
        mimics.append(
            Mimic(
                name, source, coefficients[1], coefficients[0] + values_at_zero[0] - coefficients[1] * values_at_zero[1]
            )
        )
    return tuple(mimics)


def _excluded(root: Element, reader: _Reader) -> frozenset[frozenset[str]]:
    """Return the pairs of links that ``<exclude>`` names, and those without two geoms whose masks allow a collision."""
    pairs = {frozenset((item.get("body1", ""), item.get("body2", ""))) for item in root.findall("contact/exclude")}
    for (first, first_masks), (second, second_masks) in combinations(reader.masks.items(), 2):
        if not any(meet(a, b) for a in first_masks for b in second_masks):
            pairs.add(frozenset((first, second)))
    return frozenset(pair for pair in pairs if len(pair) == 2)


def _never_colliding_solids(reader: _Reader) -> frozenset[frozenset[str]]:
    """Return the pairs of solids that never collide: because of their masks, or as parts of neighbouring bodies."""
    pairs = set(solids_apart(reader.masks))
    for first, second in joined_bodies(reader.bodies):
        solid_names = ([f"{name}_{k}" for k in range(len(reader.masks.get(name, ())))] for name in (first, second))
        pairs |= {frozenset(pair) for pair in product(*solid_names)}
    return frozenset(pairs)


def _keys(root: Element, reader: _Reader) -> dict[str, dict[str, float]]:
    """Return the keyframes that have joint positions, as joint values by name of the joint."""
    postures = {}
    sizes = [SIZES[kind] for _, kind in reader.moving]
    starts = np.cumsum([0, *sizes]).tolist()
    for number, key in enumerate(root.findall("keyframe/key")):
        if key.get("qpos") is None:
            continue
        values = numbers(key, "qpos", sum(sizes), None, f"{reader.where}: key '{key.get('name', number)}'")
        values_by_joint = {
            name: values[start] for (name, kind), start in zip(reader.moving, starts, strict=False) if kind not in HELD
        }
        postures[key.get("name") or f"key{number}"] = values_by_joint
    return postures


def meet(first: Mask, second: Mask) -> bool:
    """Check whether geoms with these masks may collide."""
    return bool(first[0] & second[1] or second[0] & first[1])


def solids_apart(masks: Mapping[str, Sequence[Mask]]) -> frozenset[frozenset[str]]:
    """Return the pairs of solids whose masks exclude a collision, each named by body and number.

    Args:
        masks: Masks of the solids of each body, in their order.
    """
    return frozenset(
        frozenset((f"{first_body}_{i}", f"{second_body}_{j}"))
        for (first_body, first_masks), (second_body, second_masks) in combinations(masks.items(), 2)
        for (i, first_mask), (j, second_mask) in product(enumerate(first_masks), enumerate(second_masks))
        if not meet(first_mask, second_mask)
    )


def joined_bodies(bodies: Mapping[str, Body]) -> frozenset[frozenset[str]]:
    """Return the pairs of bodies that are neighbours to MuJoCo: joined by joints, or welded to one of such two.

    This differs from the tree, in which each of several joints has its own link behind it, and each welded body is a
    link.
    """
    rigid_parts: dict[str, list[str]] = {}
    for name in bodies:
        rigid_parts.setdefault(_carrier(name, bodies), []).append(name)
    moving = [name for name, body in bodies.items() if _moving_joint_kinds(body)]
    pairs = {
        frozenset(pair)
        for name in moving
        for pair in product(rigid_parts[name], rigid_parts[_carrier(bodies[name].parent, bodies)])
    }

    return frozenset(pairs) - touchable(bodies)


def touchable(bodies: Mapping[str, Body]) -> frozenset[frozenset[str]]:
    """Return the pairs of bodies that may collide although one joint joins them: one stands still, the other moves.

    To MuJoCo, bodies that are welded to the world are no neighbours of others; bodies that are rigidly part of a free
    body are.
    """
    standing = [name for name in bodies if _carrier(name, bodies) == WORLD]
    pairs = set()
    for name in bodies:
        base = bodies[_carrier(name, bodies)].parent
        if base in standing:
            base_anchor = _welded(base, bodies)
            pairs |= {
                frozenset((name, other))
                for other in standing
                if base_anchor == WORLD or _welded(other, bodies) != base_anchor
            }
    return frozenset(pairs)


def _moving_joint_kinds(body: Body) -> tuple[str, ...]:
    """Return the kinds of joints that move a body relative to its parent, without those that are held."""
    return tuple(kind for kind in body.joints if kind not in HELD)


def _ancestry(name: str, bodies: Mapping[str, Body]) -> Iterator[str]:
    """Yield a body, its parent, and so on up to the world."""
    while name:
        yield name
        name = bodies[name].parent


def _carrier(name: str, bodies: Mapping[str, Body]) -> str:
    """Return the nearest body towards the world, or the body itself, that a joint moves; the world if there is none."""
    return next((ancestor for ancestor in _ancestry(name, bodies) if _moving_joint_kinds(bodies[ancestor])), WORLD)


def _welded(name: str, bodies: Mapping[str, Body]) -> str:
    """Return the same as `_carrier`, except that free joints count as joints that move."""
    return next((ancestor for ancestor in _ancestry(name, bodies) if bodies[ancestor].joints), WORLD)


def unread_of_mjcf(
    root: Element,
    bodies: Mapping[str, Body],
    scenery: Sequence[str],
    joints: Collection[str],
    loops: Mapping[str, Sequence[str]],
) -> Iterator[str]:
    """Yield a line for each kind of thing that is left out, with the names of the first few.

    Args:
        root: Top element of the file.
        bodies: The bodies by name.
        scenery: Geoms of the scene, which are left out.
        joints: Names of all joints.
        loops: The loops, each with the joints that it connects.
    """
    free = [name for name, body in bodies.items() if "free" in body.joints]
    acting = [item for item in root.findall("actuator/*") if not any(item.get(key) in joints for key in OF_JOINTS)]
    tendons = [item for item in root.findall("tendon/*") if item.get("range") or item.get("limited") == "true"]
    kinds = {
        "of the scene (load_scene(file) has it):": scenery,
        "free bodies, held where they are:": _quoted(free),
        "bodies on ball joints, held where they are:": _quoted(
            [n for n, body in bodies.items() if "ball" in body.joints]
        ),
        "mocap bodies, held where they are:": _names(each for each in root.iter("body") if each.get("mocap") == "true"),
        "loops, left open:": list(loops),
        "joints held by <equality>:": _held(root),
        "actuators of no joint:": _names(acting),
        "limits of tendons:": _names(tendons),
        "pairs of <contact>:": _names(root.findall("contact/pair")),
        "flags:": _flags(root),
        "deformable bodies:": _names(item for tag in DEFORMABLE for item in root.iter(tag)),
        "other files of <asset>:": _names(root.findall("asset/model")),
    }
    for kind, names in kinds.items():
        if names:
            yield f"{kind} {few(names)}"


def _flags(root: Element) -> list[str]:
    """Return the names of the switches of collision checking that are not at their default."""
    flags = [flag for flag in root.findall("option/flag") if flag.get("filterparent") == "disable"]
    return ["filterparent"] if flags else []


def _quoted(names: Sequence[str]) -> list[str]:
    return [f"'{name}'" for name in names]


def _names(elements: Iterable[Element]) -> list[str]:
    """Return the quoted names of elements, or their tags if they have no name."""
    return [f"'{item.get('name') or item.tag}'" for item in elements]


def _loops(root: Element, tree: Tree, loose: Collection[str]) -> dict[str, list[str]]:
    """Return the active equalities that are not between two joints, each with the movable joints that it connects.

    What is loose, a free body or one that a user moves (``mocap``), takes part in no loop: it follows, or leads,
    whatever is tied.
    """
    links = {link.name for link in tree.links}
    found = {}

    for item in root.findall("equality/*"):
        if item.tag == "joint" or item.get("active", "true") != "true":
            continue
        ends = [item.get(f"{kind}{number}") for kind in ("body", "site", "tendon") for number in (1, 2)]
        named = [end for end in ends if end]
        if item.tag == "tendon":
            joints = [joint for name in named for joint in _joints_of_tendon(root, name, tree)]
        elif any(end in loose for end in named):
            joints = []
        else:
            joints = _between([end if end in links else WORLD for end in (*named, WORLD)[:2]], tree, loose)
        found[f"{item.tag} of {' and '.join(map(repr, named)) or item.get('name', '')}"] = joints
    return found


def _between(ends: Sequence[str], tree: Tree, loose: Collection[str]) -> list[str]:
    """Return the movable joints on the way between two links, or none if a body on the way is loose."""
    first, second = (tree.chain(end) for end in ends)
    way = [*(j for j in first if j not in second), *(j for j in second if j not in first)]
    return [] if any(joint.child in loose for joint in way) else [joint.name for joint in way if joint.moves]


def _joints_of_tendon(root: Element, name: str, tree: Tree) -> list[str]:
    """Return the joints that a tendon moves: those that it names, or those between the sites along which it runs."""
    tendon = next((item for item in root.findall("tendon/*") if item.get("name") == name), None)
    if tendon is None:
        return []
    moving = {joint.name for joint in tree.joints if joint.moves}
    named = [item.get("joint", "") for item in tendon.findall("joint")]
    sites = [item.get("site", "") for item in tendon.findall("site")]
    links = {link.name for link in tree.links}
    pairs = [pair for pair in pairwise(sites) if links.issuperset(pair)]
    return [joint for joint in (*named, *(j for pair in pairs for j in _between(pair, tree, ()))) if joint in moving]


def _held_values(root: Element, reader: _Reader) -> dict[str, float]:
    """Return the values [rad or m] of the joints that an active equality holds."""
    return {
        name: reader.zeros[name] + numbers(item, "polycoef", 5, (0.0, 1.0, 0.0, 0.0, 0.0), reader.where)[0]
        for item in root.findall("equality/joint")
        if item.get("joint2") is None and item.get("active", "true") == "true"
        if (name := item.get("joint1", "")) in reader.zeros
    }


def _held(root: Element) -> list[str]:
    """Return the joints that an active equality holds at a value."""
    ties = (item for item in root.findall("equality/joint") if item.get("active", "true") == "true")
    return [f"'{item.get('joint1', '')}'" for item in ties if item.get("joint2") is None]
