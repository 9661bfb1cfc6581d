"""Read links and joints from URDF text; every element is checked, and every error names file, element and remedy."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.errors import InputError, RrtikError, UnknownNameError, few
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.description.faults import nearest_name
from rrtik_ompl.description.package_path import Packages, resolve_mesh
from rrtik_ompl.description.robot_build import Mimic
from rrtik_ompl.description.tree import JOINT_KINDS, Joint, Link, MeshFile, Solid, Tree
from rrtik_ompl.description.tree_model import MOST_UNDRAWN
from rrtik_ompl.model.shapes import SHAPES, Cylinder, Measure, Shape

Colour = tuple[float, float, float, float]
XACRO = "{http://www.ros.org/wiki/xacro}"  # namespace of macros
HELD_KINDS = ("floating", "planar")  # types of joints that are held still
THIN = 1e-4  # [m] thickness of solids that the file gives none
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True, slots=True, eq=False)
class UrdfDescription:
    """The contents of a URDF.

    Attributes:
        name: Its name.
        tree: Its links and joints.
        mimics: Which joints follow others, with chains of followers resolved.
        unread: Things in it about shapes, joints and limits that are not used.
        mended: What it says that could not be used as it is, and what was done instead, a sentence each.
        undrawn: A line about visual shapes that are not drawn; "" if all are.
    """

    name: str
    tree: Tree
    mimics: tuple[Mimic, ...]
    unread: tuple[str, ...] = ()
    mended: tuple[str, ...] = ()
    undrawn: str = ""


def read_urdf(
    text: str, *, where: str = "URDF text", folder: Path | None = None, packages: Iterable[Path] = ()
) -> UrdfDescription:
    """Read URDF text.

    Args:
        text: The XML.
        where: File name, put in front of every error message.
        folder: Folder of the file, for meshes; None if meshes can only be found by absolute path or ``packages``.
        packages: Folders that contain packages (``package://NAME/...``), or are packages themselves.

    Raises:
        InputError: If anything in the text cannot be used.
    """
    robot = parse_xml(text, "robot", where)
    if robot.find(f".//{XACRO}*") is not None:
        raise InputError(f"{where}: holds xacro macros; load it as a file, or expand it: xacro FILE > robot.urdf")

    reader = _Reader(where, Packages(packages, folder), {})
    for material in robot.iter("material"):
        reader.learn_material(material)
    links = [reader.link(element) for element in robot.findall("link")]

    joints = [reader.joint(element) for element in robot.findall("joint")]
    mimics = [tie for element in robot.findall("joint") for tie in reader.mimics(element)]
    reader.hold_leaderless(joints, mimics)
    held, following = _held(reader.still, joints, mimics)
    tree = Tree(where, links, joints).hold(held)
    ties = flattened(where, tree.joints, following)
    undrawn = f"{where}: not drawn: {few(reader.undrawn, MOST_UNDRAWN)}" if reader.undrawn else ""
    return UrdfDescription(
        robot.get("name", ""), tree, ties, tuple(unread_of_urdf(robot)), tuple(reader.mended()), undrawn
    )


def parse_xml(text: str, root: str | None, where: str) -> Element:
    """Parse XML text and return its top element, which may have any name if ``root`` is None.

    Raises:
        InputError: If the text is not XML (with the line) or its top element is not ``root``.
    """
    try:
        element = ElementTree.fromstring(text.strip())
    except (ElementTree.ParseError, ValueError) as error:
        mark = re.search(r"^(<{7}|={7}|>{7})( |$)", text, re.MULTILINE)
        if mark is not None:
            line = text.count("\n", 0, mark.start()) + 1
            raise InputError(f"{where}:{line}: git's merge marker '{mark[1]}'; settle the conflict there") from error
        line = getattr(error, "position", (1, 0))[0]
        raise InputError(f"{where}:{line}: not valid XML: {error}; correct it or export it again") from error
    if root is not None and element.tag != root:
        raise InputError(f"{where}: the top element is <{element.tag}>, expected <{root}>; is it the right file?")
    return element


def element_lines(root: Element, text: str, where: str) -> dict[Element, str]:
    """Return file and line of each element of XML text that :func:`parse_xml` has read.

    If macros have produced the text, only the file is returned, as they shift the lines.
    """
    # ElementTree does not keep line numbers, so the text is parsed once more by the parser that it uses.
    lines: list[int] = []
    if not where.lower().endswith(".xacro"):
        parser = expat.ParserCreate()
        parser.StartElementHandler = lambda *_: lines.append(parser.CurrentLineNumber)
        parser.Parse(text.strip(), True)

    skipped_lines = text[: len(text) - len(text.lstrip())].count("\n")
    elements = list(root.iter())
    locations = [f"{where}:{line + skipped_lines}" for line in lines] or [where] * len(elements)
    return dict(zip(elements, locations, strict=True))


def numbers(element: Element, key: str, count: int, default: Sequence[float] | None, where: str) -> list[float]:
    """Return the finite numbers of an attribute, ``count`` of them.

    Args:
        element: The element.
        key: Name of the attribute.
        count: How many numbers there must be.
        default: The numbers if the attribute is missing; None if it must be there.
        where: File and element, put in front of error messages.

    Raises:
        InputError: If the attribute is missing without a default, or does not hold that many finite numbers.
    """
    text = element.get(key)
    if text is None:
        if default is None:
            raise InputError(f'{where}: <{element.tag}> has no {key}; add {key}="{" ".join(["0"] * count)}"')
        return list(default)

    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []

    if len(values) != count or not np.isfinite(values).all():
        plural = "number" if count == 1 else "numbers"
        raise InputError(f'{where}: <{element.tag} {key}="{text}"> must hold {count} finite {plural}')
    return values


def attribute(element: Element | None, tag: str, key: str, where: str) -> str:
    """Return an attribute that must be there, such as the link of ``<parent link="..."/>``.

    Raises:
        InputError: If the element or the attribute is missing.
    """
    value = "" if element is None else element.get(key, "")
    if not value:
        raise InputError(f'{where}: <{tag} {key}="..."> is missing; add it')
    return value


@contextmanager
def located(where: str) -> Iterator[None]:
    """Put file and element in front of an error's message if it does not begin with them; its class and data stay."""
    try:
        yield
    except RrtikError as error:
        if not str(error).startswith(where):
            error.args = (f"{where}: {error}",)
        raise


@dataclass(slots=True, eq=False)
class _Reader:
    """Reads the elements of a URDF, and collects what it could not use on the way.

    Attributes:
        where: File name for messages.
        packages: The packages, and the folder of the file.
        materials: Colours by name of the material.
        undrawn: Why visual shapes are not drawn, each with its link.
        held: Joints whose two limits are equal.
        still: The values [rad or m] at which those, and the leaderless, are held.
        floating: Joints of a type that is held still.
        leaderless: Joints that mimic one that does not exist.
        pointlike, thin: Links with collision shapes whose sizes are all 0, or partly.
        odd: Colours and inertias that are not usable, each with where it is.
    """

    where: str
    packages: Packages
    materials: dict[str, Colour]
    undrawn: list[str] = field(default_factory=list)
    held: list[str] = field(default_factory=list)
    still: dict[str, float] = field(default_factory=dict)
    floating: list[str] = field(default_factory=list)
    leaderless: list[str] = field(default_factory=list)
    pointlike: list[str] = field(default_factory=list)
    thin: list[str] = field(default_factory=list)
    odd: list[str] = field(default_factory=list)

    def mended(self) -> Iterator[str]:
        """Yield a line for each kind of thing that could not be used as it is."""
        for found, words in (
            (self.held, "held still, as its limits are equal: joint {}"),
            (self.leaderless, "held still, as what it mimics is no joint: {}"),
            (self.floating, "held still, as only joints with one axis are moved: joint {}"),
            (self.pointlike, "ignored, as its size is 0: a collision shape of {}"),
            (self.thin, f"taken {1e3 * THIN:g} mm thick, as one of its sizes is 0: a collision shape of {{}}"),
            (self.odd, "not usable and left out: {}"),
        ):
            if found:
                yield f"{self.where}: {words.format(few(dict.fromkeys(found)))}"
        for package, folder in self.packages.renamed.items():
            yield f"{self.where}: package '{package}' is not found; its files are taken from {folder}"

    def learn_material(self, material: Element) -> None:
        """Store the colour of a named material; the first definition counts."""
        colour = self.rgba(material, f"material '{material.get('name', '')}'")
        if colour is not None:
            self.materials.setdefault(material.get("name", ""), colour)

    def rgba(self, material: Element, what: str) -> Colour | None:
        """Return the colour that a material states, opaque if it is of three numbers; None if it is none."""
        element = material.find("color")
        if element is None:
            return None
        try:
            values = [float(word) for word in element.get("rgba", "").split()]
        except ValueError:
            values = []

        if len(values) not in (3, 4) or not np.isfinite(values).all():
            self.odd.append(f"the colour of {what}")
            return None
        red, green, blue, opacity = (*values, 1.0)[:4]
        return red, green, blue, opacity

    def link(self, element: Element) -> Link:
        """Read a link.

        A cylinder that ``<collision_checking>`` names as a capsule becomes one.
        """
        name = attribute(element, "link", "name", self.where)
        where = f"{self.where}: link '{name}'"
        capsules = {c.get("name", "") for c in element.findall("collision_checking/capsule")}
        with located(where):
            solids = [self.solid(item, where, capsules) for item in element.findall("collision")]
            collision = tuple(solid for solid in solids if solid is not None)
            return Link(name, collision, tuple(self.visuals(element, where)) or collision, self.inertia(element, where))

    def visuals(self, element: Element, where: str) -> Iterator[Solid]:
        """Yield the visual solids. One that cannot be drawn is noted, not refused, as planning does not need it."""
        for item in element.findall("visual"):
            try:
                with located(where):
                    solid = self.solid(item, where, set())
            except InputError as error:
                self.undrawn.append(str(error).removeprefix(f"{self.where}: "))
            else:
                if solid is not None:
                    yield solid

    def solid(self, element: Element, where: str, capsules: set[str]) -> Solid | None:
        """Read a visual or collision solid; None if it is a point."""
        geometry = element.find("geometry")
        shapes = [] if geometry is None else list(geometry)
        if len(shapes) != 1:
            raise InputError(f"{where}: <{element.tag}> must hold one <geometry> with one shape")

        shape = self.shape(shapes[0], where, [] if element.tag == "visual" else self.thin)
        if shape is None:
            if element.tag == "collision":
                self.pointlike.append(where.removeprefix(f"{self.where}: "))
            return None

        if isinstance(shape, Cylinder) and element.get("name", "") in capsules:
            shape = shape.capped()
        return Solid(shape, _origin(element, where), self.colour(element.find("material"), where))

    def shape(self, element: Element, where: str, thin: list[str]) -> Shape | MeshFile | None:
        """Read a shape or the reference to a mesh file; None if all sizes of a shape are 0.

        A single size of 0 is replaced by a small one, as the others may be large; the link is then added to ``thin``.
        """
        kind = SHAPES.get(element.tag)
        if kind is not None and kind.in_urdf:
            sizes = {measure.name: _measured(element, measure, where) for measure in kind.measures}
            if not any(np.any(size) for size in sizes.values()):
                return None
            if not all(np.all(size) for size in sizes.values()):
                thin.append(where.removeprefix(f"{self.where}: "))
                sizes = {name: np.where(np.equal(size, 0.0), THIN, size).tolist() for name, size in sizes.items()}
            return kind(**sizes)

        if element.tag == "mesh":
            uri = attribute(element, "mesh", "filename", where)
            x, y, z = numbers(element, "scale", 3, (1.0, 1.0, 1.0), where)
            if x * y * z == 0.0:
                raise InputError(f"{where}: mesh '{uri}' has a scale of 0; every axis needs another number")
            return MeshFile(resolve_mesh(uri, self.packages, where), (x, y, z), painted=True)

        in_urdf = (key for key, kind in SHAPES.items() if kind.in_urdf)
        raise UnknownNameError("shape", element.tag, (*in_urdf, "mesh"), where=where)

    def colour(self, material: Element | None, where: str) -> Colour | None:
        """Return the colour of a solid: its own, or that of the named material."""
        if material is None:
            return None
        own = self.rgba(material, where.removeprefix(f"{self.where}: "))
        return own or self.materials.get(material.get("name", ""))

    def inertia(self, element: Element, where: str) -> pin.Inertia | None:
        """Return the inertia of a link; None if it has none that is usable, as planning does not need it."""
        try:
            return _inertia(element.find("inertial"), where)
        except InputError:
            self.odd.append(f"the inertia of {where.removeprefix(f'{self.where}: ')}")
            return None

    def joint(self, element: Element) -> Joint:
        """Read a joint with its limits."""
        name = attribute(element, "joint", "name", self.where)
        where = f"{self.where}: joint '{name}'"
        kind = attribute(element, "joint", "type", where)
        if kind in HELD_KINDS:
            self.floating.append(f"'{name}' ({kind})")
            kind = "fixed"
        if kind not in JOINT_KINDS:
            raise UnknownNameError("usable joint type", kind, (*JOINT_KINDS, *HELD_KINDS), where=where)

        parent = attribute(element.find("parent"), "parent", "link", where)
        child = attribute(element.find("child"), "child", "link", where)

        axis_element = element.find("axis")
        axis = [1.0, 0.0, 0.0] if axis_element is None else numbers(axis_element, "xyz", 3, (1.0, 0.0, 0.0), where)
        bounds = _limits(element.find("limit"), kind, where)
        if not JOINT_KINDS[kind].moves:
            axis = [1.0, 0.0, 0.0]  # The axis of a fixed joint means nothing, and may be zero.

        if bounds["lower"] == bounds["upper"]:
            if element.find("mimic") is None:
                self.held.append(name)
                self.still[name] = bounds["lower"]
            else:  # Files often state no range for what follows.
                bounds |= {"lower": -np.inf, "upper": np.inf}

        with located(self.where):
            return Joint(name, kind, parent, child, _origin(element, where), axis, **bounds)

    def mimics(self, element: Element) -> Iterator[Mimic]:
        tie = element.find("mimic")
        if tie is not None and element.get("type") != "fixed":
            where = f"{self.where}: joint '{element.get('name')}'"
            source = attribute(tie, "mimic", "joint", where)
            multiplier = numbers(tie, "multiplier", 1, (1.0,), where)[0]
            yield Mimic(element.get("name", ""), source, multiplier, numbers(tie, "offset", 1, (0.0,), where)[0])

    def hold_leaderless(self, joints: Sequence[Joint], mimics: Sequence[Mimic]) -> None:
        """Hold joints that mimic one that does not exist at 0, or at the limit next to it."""
        joint_of = {joint.name: joint for joint in joints}
        for tie in mimics:
            if tie.source not in joint_of:
                follower = joint_of[tie.joint]
                self.still[tie.joint] = min(max(0.0, follower.lower), follower.upper)
                self.leaderless.append(f"'{tie.joint}' of '{tie.source}'{nearest_name(tie.source, joint_of)}")


def _measured(element: Element, measure: Measure, where: str) -> float | list[float]:
    if measure.kind == "three lengths":
        return numbers(element, measure.name, 3, None, where)
    return numbers(element, measure.name, 1, None, where)[0]


def _limits(limit: Element | None, kind: str, where: str) -> dict[str, float]:
    """Return the limits of position, velocity and effort; inf where the joint has none, or the file gives none."""
    moves = JOINT_KINDS[kind].moves
    endless = JOINT_KINDS[kind].endless
    has_range = moves and not endless
    bounds = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf, "effort": np.inf}

    if limit is None and has_range:
        raise InputError(
            f'{where}: a {kind} joint needs <limit lower=".." upper=".." velocity=".." effort=".."/>; add it'
            + (', or make the type "continuous"' if not JOINT_KINDS[kind].slides else "")
        )
    if limit is None or not moves:
        return bounds

    velocity = numbers(limit, "velocity", 1, (0.0,), where)[0]
    if velocity < 0.0:
        raise InputError(f"{where}: velocity limit {velocity:g} is negative; give its size")

    if has_range:
        lower, upper = (numbers(limit, key, 1, (0.0,), where)[0] for key in ("lower", "upper"))
        if lower > upper:
            raise InputError(f"{where}: lower limit {lower:g} is above upper limit {upper:g}; swap them")
        bounds |= {"lower": lower, "upper": upper}

    effort = numbers(limit, "effort", 1, (0.0,), where)[0]
    return bounds | {"velocity": velocity or np.inf, "effort": effort if effort > 0.0 else np.inf}


def _origin(element: Element, where: str) -> pin.SE3:
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    zero = (0.0, 0.0, 0.0)
    return pose_from_rpy(numbers(origin, "xyz", 3, zero, where), numbers(origin, "rpy", 3, zero, where), where)


def _inertia(inertial: Element | None, where: str) -> pin.Inertia | None:
    """Return the inertia of a link in the link's frame; None if it is missing or physically impossible."""
    mass = None if inertial is None else inertial.find("mass")
    tensor = None if inertial is None else inertial.find("inertia")
    if inertial is None or mass is None or tensor is None:
        return None

    xx, xy, xz, yy, yz, zz = (numbers(tensor, key, 1, (0.0,), where)[0] for key in _TENSOR)
    placement = _origin(inertial, where)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    in_link = placement.rotation @ matrix @ placement.rotation.T

    mass_value = numbers(mass, "value", 1, None, where)[0]
    if mass_value < 0.0 or np.linalg.eigvalsh(in_link)[0] < 0.0:
        return None  # Such files are common, and planning does not need inertias.
    return pin.Inertia(mass_value, placement.translation, in_link)


def _held(
    held: Mapping[str, float], joints: Sequence[Joint], mimics: Sequence[Mimic]
) -> tuple[dict[str, float], list[Mimic]]:
    """Return the values of joints that are held still, with those that follow them, and the other followers."""
    still = {joint.name: 0.0 for joint in joints if not joint.moves} | dict(held)
    following = [tie for tie in mimics if tie.joint not in still]
    while stopped := [tie for tie in following if tie.source in still]:
        still |= {tie.joint: tie.multiplier * still[tie.source] + tie.offset for tie in stopped}
        following = [tie for tie in following if tie.joint not in still]
    return {joint.name: still[joint.name] for joint in joints if joint.moves and joint.name in still}, following


def flattened(where: str, joints: Sequence[Joint], mimics: Sequence[Mimic]) -> tuple[Mimic, ...]:
    """Make every follower follow a joint that follows nothing itself.

    Args:
        where: File name, put in front of error messages.
        joints: All joints.
        mimics: Which joints follow which.
    """
    mimic_of = {tie.joint: tie for tie in mimics}
    movable = [joint.name for joint in joints if joint.moves]
    resolved = []

    for tie in mimics:
        source = tie.source
        multiplier = tie.multiplier
        offset = tie.offset
        visited = {tie.joint}
        while True:
            if source not in movable:
                raise UnknownNameError("movable joint to mimic", source, movable, where=f"{where}: joint '{tie.joint}'")
            if source in visited:
                raise InputError(f"{where}: joint '{tie.joint}' mimics itself by way of '{source}'; break the ring")
            if source not in mimic_of:
                break

            # Substitute the leader's own rule: m (m' x + o') + o.
            leader = mimic_of[source]
            visited.add(source)
            source = leader.source
            offset = multiplier * leader.offset + offset
            multiplier = multiplier * leader.multiplier

        resolved.append(Mimic(tie.joint, source, multiplier, offset))
    return tuple(resolved)


# Elements that are read, or that do not concern shapes, joints and limits.
OF_ROBOT = {"gazebo", "joint", "link", "material", "mujoco", "plugin", "ros2_control", "sensor", "transmission"}
OF_LINK = {
    "collision",
    "collision_checking",
    "contact",
    "gazebo",
    "inertial",
    "material",
    "origin",
    "self_collision_checking",
    "sensor",
    "visual",
}
OF_JOINT = {
    "axis",
    "calibration",
    "child",
    "dynamics",
    "gazebo",
    "joint_properties",
    "limit",
    "mimic",
    "origin",
    "parent",
    "safety_controller",
}
OF_LIMIT = {"effort", "lower", "upper", "velocity"}
OF_MIMIC = {"joint", "multiplier", "offset"}
SOFT = (("soft_lower_limit", "lower", 1.0), ("soft_upper_limit", "upper", -1.0))
NARROWER = 1e-6  # [rad or m] difference above which a soft limit is narrower than the limit


def unread_of_urdf(robot: Element) -> list[str]:
    """Return what is not read of a URDF, each thing once: "<capsule_chain>", "<limit jerk> of joints 'a', 'b'"."""
    found = [f"<{tag}>" for tag in _others(robot, OF_ROBOT)]
    if robot.find("gazebo/joint") is not None:
        found.append("joints within <gazebo>")

    for tag, known in (("link", OF_LINK), ("joint", OF_JOINT)):
        named: dict[str, list[str]] = {}
        for element in robot.findall(tag):
            for what in (*_others(element, known), *(_of_joint(element) if tag == "joint" else ())):
                named.setdefault(what, []).append(f"'{element.get('name', '')}'")
        found += [f"<{what}> of {tag} {few(names, 3)}" for what, names in named.items()]
    return found


def _others(element: Element, known: set[str]) -> list[str]:
    """Return the tags of an element's parts that are not known, each once, without their namespace."""
    tags = (part.tag for part in element if isinstance(part.tag, str) and part.tag not in known)
    return list(dict.fromkeys(tag.rpartition("}")[2] for tag in tags))


def _of_joint(joint: Element) -> Iterator[str]:
    """Yield the attributes of a joint's limit and mimic that are not read, and its soft limits if they are narrower."""
    for tag, known in (("limit", OF_LIMIT), ("mimic", OF_MIMIC)):
        part = joint.find(tag)
        yield from (f"{tag} {key}" for key in (() if part is None else part.keys()) if key not in known)

    soft = joint.find("safety_controller")
    hard = joint.find("limit")
    if soft is not None and hard is not None and any(_narrower(soft, hard, *names) for names in SOFT):
        yield "safety_controller"


def _narrower(soft: Element, hard: Element, own: str, other: str, way: float) -> bool:
    """Check whether a soft limit leaves less than the limit that is read."""
    try:
        gap = float(soft.get(own, "nan")) - float(hard.get(other, "0"))
    except ValueError:
        return False
    return way * gap > NARROWER
