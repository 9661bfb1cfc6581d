"""Read SRDF (MoveIt's semantic description): groups of joints, named states, pairs of links that are never checked."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.arm import FINGER
from rrtik_ompl.description.faults import nearest_name
from rrtik_ompl.description.tree import Tree
from rrtik_ompl.description.urdf_read import attribute, element_lines, numbers, parse_xml

# Names of groups: of those that are end effectors, unless they have an arm too.
HAND = re.compile(r"hand|gripper|finger|jaw|claw")
ARM = re.compile(r"arm|manip|torso|body|all|with|and_")
# Where an SRDF refers to something that must exist: path of the elements, attribute, and kind of what it names.
MENTIONS = (
    ("disable_collisions", "link1", "link"),
    ("disable_collisions", "link2", "link"),
    ("enable_collisions", "link1", "link"),
    ("enable_collisions", "link2", "link"),
    ("disable_default_collisions", "link", "link"),
    ("group/link", "name", "link"),
    ("group/chain", "base_link", "link"),
    ("group/chain", "tip_link", "link"),
    ("group/joint", "name", "joint"),
    ("group/group", "name", "group"),
    ("group_state", "group", "group"),
    ("group_state/joint", "name", "joint"),
    ("end_effector", "parent_link", "link"),
    ("end_effector", "group", "group"),
    ("end_effector", "parent_group", "group"),
    ("passive_joint", "name", "joint"),
    ("virtual_joint", "child_link", "link"),
)


@dataclass(frozen=True, slots=True)
class Mention:
    """A reference of an element to a link, joint or group: file and line, tag, kind of what it names, and the name."""

    place: str
    tag: str
    kind: str
    name: str


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """A planning group: the chains (base and tip link), joints, links and other groups that its joints come from."""

    name: str
    chains: tuple[tuple[str, str], ...] = ()
    joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    subgroups: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class EndEffector:
    """An end effector: the link that holds it, the group of its own joints, and the group at whose end it is."""

    name: str
    parent_link: str
    group: str
    parent_group: str


@dataclass(frozen=True, slots=True, eq=False)
class Srdf:
    """The contents of an SRDF.

    Attributes:
        where: File name for messages.
        name: Name of the robot.
        groups: The groups by name.
        states: Joint values [rad or m] by (group, state).
        allowed: Pairs of link names that are never checked against each other.
        never: Links that are checked against no other, except as in ``checked``.
        checked: Pairs that are checked although one of them is in ``never``.
        end_effectors: The end effectors, in the order of the file.
        passive: Joints without a motor.
        virtual: Joints between the world and the base.
        mentions: All references to links, joints and groups, which must exist.
        places: File and line of each state, by (group, state).
    """

    where: str
    name: str = ""
    groups: Mapping[str, Group] = field(default_factory=dict)
    states: Mapping[tuple[str, str], Mapping[str, float]] = field(default_factory=dict)
    allowed: frozenset[frozenset[str]] = frozenset()
    never: frozenset[str] = frozenset()
    checked: frozenset[frozenset[str]] = frozenset()
    end_effectors: tuple[EndEffector, ...] = ()
    passive: frozenset[str] = frozenset()
    virtual: frozenset[str] = frozenset()
    mentions: tuple[Mention, ...] = ()
    places: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def unknown_names(self, tree: Tree) -> list[str]:
        """Return a line for each name that neither robot nor file defines, with its place and a similar name."""
        known_names = {
            "link": {link.name for link in tree.links},
            "joint": {joint.name for joint in tree.joints} | self.virtual,
            "group": set(self.groups),
        }

        first_mention: dict[tuple[str, str], Mention] = {}
        for mention in self.mentions:
            if mention.name not in known_names[mention.kind]:
                first_mention.setdefault((mention.kind, mention.name), mention)

        lines = []
        for mention in first_mention.values():
            nearest = nearest_name(mention.name, known_names[mention.kind])
            lines.append(f"{mention.place}: <{mention.tag}>: no {mention.kind} '{mention.name}'{nearest}")
        return lines

    def short_states(self, group: str | None, joints: Iterable[str]) -> list[str]:
        """Return a line for each state of a group that lacks a value for one of the joints, and so is no posture."""
        lines = []
        for (owner, state), values in self.states.items():
            lacking = [joint for joint in joints if joint not in values]
            if owner == group and lacking:
                place = self.places[owner, state]
                lines.append(f"{place}: group_state '{state}' has no value of joint '{lacking[0]}' and is left out")
        return lines

    def of_another(self, name: str, where: str) -> list[str]:
        """Return a line if the file is for a robot of another name than the one that a URDF describes."""
        if not self.name or not name or self.name == name:
            return []
        return [f"{self.where}: it is of robot '{self.name}', and {where} describes '{name}'; is it the right file?"]

    def moved_passive(self, joints: Iterable[str]) -> list[str]:
        """Return a line for each of the given joints, which are moved, that has no motor."""
        moving = set(joints)
        return [
            f"{mention.place}: <{mention.tag}>: joint '{mention.name}' has no motor and is moved like the others; "
            "choose by group= or joints="
            for mention in self.mentions
            if mention.tag == "passive_joint" and mention.name in moving
        ]

    def place_of(self, state: str, group: str | None) -> str:
        """Return file and line of a group's state, or of a state of that name in another group if this one has none."""
        places = [place for (_, name), place in self.places.items() if name == state]
        return self.places.get((group or "", state), places[-1] if places else self.where)

    def group_joints(self, group: str, tree: Tree) -> tuple[str, ...]:
        """Return the movable joints of a group, parents before children.

        Raises:
            InputError: If the group does not exist, is empty, or names a joint or link that the robot does not have.
        """
        chosen = self.movable(group, tree)
        if not chosen:
            raise InputError(f"{self.where}: group '{group}' holds no movable joint; choose another group")
        return chosen

    def movable(self, group: str, tree: Tree) -> tuple[str, ...]:
        """Return the same as :meth:`group_joints`, for a group that may have none.

        Raises:
            InputError: If the group does not exist, or names a joint or link that the robot does not have.
        """
        members = self._members(group, tree, ()) - self.passive
        return tuple(joint.name for joint in tree.walk() if joint.name in members and joint.moves)

    def _members(self, name: str, tree: Tree, enclosing: tuple[str, ...]) -> set[str]:
        """Return the names of a group's joints, including those of its subgroups.

        ``enclosing`` has the groups that led here, so that a group that contains itself is found.
        """
        if name not in self.groups:
            raise UnknownNameError("group", name, self.groups, where=self.where)
        if name in enclosing:
            raise InputError(f"{self.where}: group '{name}' contains itself; take it out")

        group = self.groups[name]
        where = f"{self.where}: group '{name}'"
        joints = [joint.name for joint in tree.joints]
        joint_above = {joint.child: joint.name for joint in tree.joints}
        members = set()

        for joint in group.joints:
            if joint not in joints and joint not in self.virtual:
                raise UnknownNameError("joint", joint, joints, where=where)
            members.add(joint)
        for link in group.links:
            if link not in joint_above and link != tree.root.name:
                raise UnknownNameError("link", link, [x.name for x in tree.links], where=where)
            members |= {joint_above[link]} if link in joint_above else set()
        for base, tip in group.chains:
            members |= {joint.name for joint in tree.chain(tip, base)}
        for subgroup in group.subgroups:
            members |= self._members(subgroup, tree, (*enclosing, name))

        return members

    def hands(self, tree: Tree, solved: Collection[str] = ()) -> set[str]:
        """Return the groups of end effectors, and those that are called so.

        An SRDF may call the arm an end effector by mistake: a group with more joints than any other one is left out,
        and so is one with as many as another if it has a solver.

        Args:
            tree: Links and joints of the robot.
            solved: The groups that have a solver.
        """
        joints = {name: self.known_movable(name, tree) for name in self.groups}
        sizes = {name: 1 if known is None else len(known) for name, known in joints.items()}
        moving = sum(joint.moves for joint in tree.joints)
        said = {end.group for end in self.end_effectors if end.group != end.parent_group}
        called = {name for name in sizes if HAND.search(name.lower()) and not ARM.search(name.lower())}

        hands = set()
        for hand in (said | called) & sizes.keys():
            others = [size for name, size in sizes.items() if name != hand]
            most_joints = max(others, default=moving - sizes[hand])
            if (sizes[hand], hand in solved) <= (most_joints, False):
                hands.add(hand)
        return hands

    def known_movable(self, group: str, tree: Tree) -> tuple[str, ...] | None:
        """Return the same as :meth:`movable`; None if the group names joints or links that the robot does not have."""
        try:
            return self.movable(group, tree)
        except InputError:
            return None

    def fingers(self, tree: Tree) -> frozenset[str]:
        """Return the movable joints of its end effectors, without those of the groups that carry these."""
        carriers = {end.parent_group for end in self.end_effectors} & self.groups.keys()

        def joints_of(groups: Iterable[str]) -> frozenset[str]:
            return frozenset(joint for group in groups for joint in self.known_movable(group, tree) or ())

        return joints_of(self.hands(tree)) - joints_of(carriers)

    def allowed_pairs(self, tree: Tree) -> frozenset[frozenset[str]]:
        """Return the pairs of links of a robot that are never checked against each other."""
        never_checked = {frozenset((link, other.name)) for link in self.never for other in tree.links}
        return self.allowed | frozenset(pair for pair in never_checked - self.checked if len(pair) == 2)

    def group_tip(self, group: str, tree: Tree) -> str:
        """Return the link at the end of a group: that of its last chain, its end effector or its last joint.

        Joints with the name of a finger do not count, unless there are no others.
        """
        chains = self.groups[group].chains
        if chains:
            return chains[-1][1]

        links = {link.name for link in tree.links}
        for end in self.end_effectors:
            if group in (end.parent_group, end.group) and end.parent_link in links:
                return end.parent_link

        members = self.group_joints(group, tree)
        moved = [joint for joint in tree.walk() if joint.name in members]
        arm = [joint for joint in moved if not FINGER.search(f"{joint.name} {joint.child}".lower())]
        return (arm or moved)[-1].child

    def postures(self, group: str | None) -> dict[str, dict[str, float]]:
        """Return the named states merged over all groups; those of ``group`` take precedence."""
        merged: dict[str, dict[str, float]] = {}
        for (_, state), values in sorted(self.states.items(), key=lambda item: item[0][0] == group):
            merged.setdefault(state, {}).update(values)
        return merged


def read_srdf(text: str, where: str = "SRDF text") -> Srdf:
    """Read SRDF text. Its names are compared with the robot only when they are used.

    Raises:
        InputError: If the text is not XML, or an element lacks what it must have; the message names it.
    """
    robot = parse_xml(text, "robot", where)
    lines = element_lines(robot, text, where)
    groups = [_group(element, where) for element in robot.findall("group")]

    states: dict[tuple[str, str], dict[str, float]] = {}
    places: dict[tuple[str, str], str] = {}
    for element in robot.findall("group_state"):
        name = attribute(element, "group_state", "name", where)
        states[(element.get("group", ""), name)] = _state(element, f"{where}: group_state '{name}'")
        places[(element.get("group", ""), name)] = lines[element]

    mentions = tuple(
        Mention(lines[element], element.tag, kind, element.get(key, ""))
        for tags, key, kind in MENTIONS
        for element in robot.findall(tags)
        if element.get(key)
    )

    end_effectors = tuple(
        EndEffector(*(element.get(key, "") for key in ("name", "parent_link", "group", "parent_group")))
        for element in robot.findall("end_effector")
    )

    return Srdf(
        where=where,
        name=robot.get("name", ""),
        groups={group.name: group for group in groups},
        states=states,
        allowed=_pairs(robot, "disable_collisions"),
        never=frozenset(e.get("link", "") for e in robot.findall("disable_default_collisions")),
        checked=_pairs(robot, "enable_collisions"),
        end_effectors=end_effectors,
        passive=frozenset(e.get("name", "") for e in robot.findall("passive_joint")),
        virtual=frozenset(e.get("name", "") for e in robot.findall("virtual_joint")),
        mentions=mentions,
        places=places,
    )


def _pairs(robot: Element, tag: str) -> frozenset[frozenset[str]]:
    pairs = (frozenset((e.get("link1", ""), e.get("link2", ""))) for e in robot.findall(tag))
    return frozenset(pair for pair in pairs if len(pair) == 2)


def _group(element: Element, where: str) -> Group:
    """Read a planning group; every part of it must have a name."""
    name = attribute(element, "group", "name", where)
    place = f"{where}: group '{name}'"

    def names(tag: str) -> tuple[str, ...]:
        return tuple(attribute(item, tag, "name", place) for item in element.findall(tag))

    chains = tuple(
        (attribute(c, "chain", "base_link", place), attribute(c, "chain", "tip_link", place))
        for c in element.findall("chain")
    )
    return Group(name, chains, names("joint"), names("link"), names("group"))


def _state(element: Element, where: str) -> dict[str, float]:
    """Return the joint values of a state; joints with several values (planar, floating) are left out."""
    values = {}
    for joint in element.findall("joint"):
        name = attribute(joint, "joint", "name", where)
        words = (joint.get("value") or "").split()
        if len(words) == 1:  # Planar and floating joints have more numbers and are not supported.
            values[name] = numbers(joint, "value", 1, None, f"{where}: joint '{name}'")[0]
    return values
