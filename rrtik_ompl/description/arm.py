"""Find the arms of a tree of links and joints: which joints move a tip, which drive only fingers, where the tip is.

A description says neither. What is decided here is the default of `rrtik_ompl.load_robot`, which ``joints``, ``group``
and ``tip`` overrule:

1. Fingers are joints that an SRDF calls those of an end effector, joints with the name of one, and branches of the
   same depth at the end of an arm.
2. What is left ends in limbs: the longest one, and those with at least two thirds as many joints of their own. Legs and
   heads are none where there is an arm.
3. The tip of a limb is a frame with a usual name that is fixed to its last body, else the link that carries the
   fingers, else the last link.

Joints that move no tip are held still, and so are endless slides and joints in loops.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.description.tree import Joint, Tree

# Usual names of the frame at the tip, the most telling first.
TIP_NAMES = tuple(
    re.compile(rf"(^|[^a-z])({names})($|[^a-z])")
    for names in (
        r"tool0|tcp|tool_?cent(er|re)_?point",
        r"ee|eef|eff|end_?eff(ector)?|grasp(ing)?|grip_?(site|point|target)|pinch",
        r"tool",
        r"hand|palm|gripper",
        r"flange|attachment_?site",
    )
)
FRAME = re.compile(r"frame|site|point|target")  # of a link without a body
FINGER = re.compile(
    r"finger|thumb|knuckle|jaw|claw|phalan|proximal|distal"
    r"|(^|[^a-z])(index|middle|ring|little|pinky)_(?!lumbar|thoracic|cervical)"  # a spine has a middle, too
)
CLOSING = re.compile(r"grip|grasp|pinch")  # of the last joint: it opens and closes a gripper
TURNING = re.compile(r"roll|pitch|yaw|wrist|rotat|twist|turn")
NOT_FINGER = re.compile(r"head|neck|eye|camera|arm|shoulder|elbow|leg|foot|hip|knee|wheel|caster")
LEG = re.compile(r"leg|foot|feet|knee|ankle|thigh|calf|haa|hfe|kfe|(^|[^a-z])hip")
HEAD = re.compile(r"head|neck|eye|camera|lidar|laser|antenna")
AIDS = re.compile(  # what is fixed to an arm and is no tool; "/link" ends the names of links without a body of an MJCF
    r"camera|(^|_)cam(_|$)|optical|realsense|sensor|imu|accel|range|laser|lidar|light|(^|_)led(_|$)|marker"
    r"|(^|_)ft(_|$)|force|torque|/link$"
)
LONGEST_FINGER = 5  # joints
LONGEST_NAMED = 8  # the same, of one that has the name of a finger
CARRIED = 3  # least number of joints before fingers that have no such names
SHARE = 2 / 3  # least number of joints of a further limb, by that of the longest one


@dataclass(frozen=True, slots=True)
class Limb:
    """One arm of a tree.

    Attributes:
        tip: The frame at its end.
        named: Whether the tip has a usual name, or there was no other choice.
        links: The links of its last body.
        chain: Names of the joints before its last body that move independently of each other, base first.
        own: Those of them that no earlier limb has.
        fingers: Names of the joints of its fingers, without those that follow others.
    """

    tip: str
    named: bool
    links: tuple[str, ...]
    chain: tuple[str, ...]
    own: frozenset[str]
    fingers: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Arms:
    """The arms of a tree, and which of its joints move.

    Attributes:
        limbs: The arms, the main one first.
        joints: Names of the joints that move their tips, base first.
        held: Names of the joints that are held still though nobody said so, by what they are.
    """

    limbs: tuple[Limb, ...]
    joints: tuple[str, ...]
    held: Mapping[str, tuple[str, ...]]

    def moved_by(self, joints: Collection[str]) -> tuple[Limb, ...]:
        """Return the limbs that at least one of the given joints moves without moving an earlier limb."""
        return tuple(limb for limb in self.limbs if not limb.own.isdisjoint(joints))


def arms_of(
    tree: Tree,
    drivers: Mapping[str, str],
    loops: Collection[str] = (),
    tip: str | None = None,
    fingers: Collection[str] = (),
) -> Arms:
    """Find the arms of a tree.

    Args:
        tree: Links and joints.
        drivers: For each joint that follows another one, the joint that it follows.
        loops: Joints that a loop connects, which the tree leaves open.
        tip: The link that is the tip of the only arm; None to find all arms.
        fingers: Names of joints that are known to be those of fingers.
    """
    finder = _Finder(tree, drivers, loops, fingers)
    return finder.arms() if tip not in finder.body else finder.arm_to(tip)


class _Finder:
    """The tree as bodies (links that are fixed to each other) with movable joints between them."""

    def __init__(
        self, tree: Tree, drivers: Mapping[str, str], loops: Collection[str], fingers: Collection[str]
    ) -> None:
        self.drivers = drivers
        self.walk = [joint for joint in tree.walk() if joint.moves]
        self.links: dict[str, list[str]] = {}  # of each body, which is called by its first link
        self.depth: dict[str, int] = {}  # fixed joints between a link and the first link of its body
        self.body: dict[str, str] = {}
        self.above: dict[str, Joint] = {}  # the joint that moves each body
        self.below: dict[str, list[Joint]] = {}

        self._place(tree.root.name, tree.root.name, 0)
        for joint in tree.walk():
            if joint.moves:
                self._place(joint.child, joint.child, 0)
                self.above[joint.child] = joint
                self.below[self.body[joint.parent]].append(joint)
            else:
                self._place(joint.child, self.body[joint.parent], self.depth[joint.parent] + 1)

        empty = {link.name for link in tree.links if not link.collision}
        self.loops = set(loops)
        self.excluded = self.loops | self._endless_slides(empty)
        self.heights = self._heights(self.walk)
        self.fingers = set(fingers)
        self._find_fingers()
        self.is_hand = all(joint.name in self.fingers | self.excluded for joint in self.walk)
        if self.is_hand:  # Its fingers are the limbs.
            self.fingers = set()
        if all(joint.name in self.excluded for joint in self.walk):  # A gantry may get its limits elsewhere.
            self.excluded = set(self.loops)

    def _place(self, link: str, body: str, depth: int) -> None:
        self.body[link] = body
        self.depth[link] = depth
        self.links.setdefault(body, []).append(link)
        self.below.setdefault(body, [])

    def _heights(self, joints: Iterable[Joint]) -> dict[str, int]:
        """Return for each body the largest number of the given joints one after another that begin at it."""
        heights = dict.fromkeys(self.links, 0)
        for joint in reversed(list(joints)):
            base = self.body[joint.parent]
            heights[base] = max(heights[base], heights[joint.child] + 1)
        return heights

    def _endless_slides(self, empty: set[str]) -> set[str]:
        """Return slides without limits, and endless turns beside them: the freedoms of a base that drives."""
        slides = {
            joint.name for joint in self.walk if joint.slides and not np.isfinite([joint.lower, joint.upper]).all()
        }
        found = set(slides)
        for joint in self.walk:
            before = self.above.get(self.body[joint.parent])
            if (
                joint.endless
                and before is not None
                and before.name in slides
                and empty.issuperset(self.links[before.child])
            ):
                found.add(joint.name)
            if (
                joint.name in slides
                and before is not None
                and before.endless
                and empty.issuperset(self.links[before.child])
            ):
                found.add(before.name)
        return found

    def _chain(self, body: str) -> list[Joint]:
        """Return the movable joints between the base and a body, base first."""
        chain: list[Joint] = []
        while body in self.above:
            chain.append(self.above[body])
            body = self.body[chain[-1].parent]
        return chain[::-1]

    def _independent(self, chain: Iterable[Joint]) -> tuple[str, ...]:
        """Return what moves the joints of a chain, each once."""
        names = dict.fromkeys(self.drivers.get(joint.name, joint.name) for joint in chain)
        return tuple(name for name in names if name not in self.excluded)

    def _find_fingers(self) -> None:
        """Find the joints of fingers: by their names, then by their shape; also what they carry, and followers."""
        found = self.fingers
        for is_finger in (self._named_finger, self._like_finger):
            heights = self._heights(joint for joint in self.walk if joint.name not in found)
            for joint in self.walk:  # parents first
                carrier = self.above.get(self.body[joint.parent])
                carried = carrier is not None and carrier.name in found
                if carried or self.drivers.get(joint.name) in found or is_finger(joint, heights[joint.child]):
                    found.add(joint.name)

    def _named_finger(self, joint: Joint, height: int) -> bool:
        """Check whether a joint has the name of a finger, or moves a link that has; a wrist may turn a fixed jaw."""
        own, moved = _words(joint.name), _words(joint.child)
        named = FINGER.search(own) or (FINGER.search(moved) and "fixed" not in moved and not TURNING.search(own))
        return height < LONGEST_NAMED and bool(named)

    def _like_finger(self, joint: Joint, height: int) -> bool:
        """Check whether a joint is one of a gripper.

        It closes a gripper by its name; or it is the last one, beside fingers or behind the frame of the tip; or one of
        several that are alike at the end of an arm.

        Args:
            joint: The joint.
            height: The most joints behind it that are not known to be those of a finger.
        """
        name = joint.name.lower()
        if height == 0 and CLOSING.search(name) and not TURNING.search(name):
            return True

        base = self.body[joint.parent]
        branches = self.below[base]
        beside_fingers = any(each.name in self.fingers for each in branches)
        beyond_tip = any(pattern.search(_words(link)) for pattern in TIP_NAMES[:2] for link in self.links[base])
        if height == 0 and (beside_fingers or (beyond_tip and not TURNING.search(name))):
            return True

        heights = [self.heights[each.child] + 1 for each in branches]
        before = len(self._independent(self._chain(base)))
        unlike = max(heights) - min(heights)
        return (
            len(branches) > 1
            and unlike <= (len(branches) > 2 or min(heights) > 2)  # a thumb may have a joint more, or fewer
            and max(heights) <= min(LONGEST_FINGER, before)
            and before >= CARRIED
            and not any(NOT_FINGER.search(text.lower()) for each in branches for text in (each.name, each.child))
        )

    def arms(self) -> Arms:
        """Choose the limbs, and with them the joints that move."""
        arm_joints = [joint for joint in self.walk if joint.name not in self.fingers]
        heights = self._heights(arm_joints)
        ends = [joint.child for joint in arm_joints if heights[joint.child] == 0]
        chains = {end: self._independent(self._chain(end)) for end in ends}
        ends = self._no_legs([end for end in ends if chains[end]], chains)

        limbs: list[Limb] = []
        ranked = sorted(ends, key=lambda end: -len(chains[end]))
        for end in ranked:
            chain = chains[end]
            used = {name for limb in limbs for name in limb.chain}
            own = frozenset(chain) - used
            shared = len(chain) - len(own)
            least = 0.0 if self.is_hand else SHARE * (len(limbs[0].chain) - shared) if limbs else 0.0
            if own and len(own) >= least:
                limbs.append(self._limb(end, chain, own))

        return self._arms(limbs, self.walk)

    def arm_to(self, tip: str) -> Arms:
        """Return the arm that ends at a link."""
        end = self.body[tip]
        way = self._chain(end)
        chain = self._independent(way)
        limb = Limb(tip, True, tuple(self.links[end]), chain, frozenset(chain), tuple(self._hand(end)))
        return self._arms([limb], way)

    def _arms(self, limbs: Sequence[Limb], expected: Iterable[Joint]) -> Arms:
        """Return limbs with the joints that move them, and those of the ``expected`` joints that do not."""
        moving = {name for limb in limbs for name in limb.chain}
        held: dict[str, tuple[str, ...]] = {}
        for joint in expected:
            if joint.name not in moving and joint.name not in self.drivers:
                kind = self._kind(joint.name)
                held[kind] = (*held.get(kind, ()), joint.name)
        return Arms(tuple(limbs), tuple(joint.name for joint in self.walk if joint.name in moving), held)

    def _kind(self, joint: str) -> str:
        """Return what a joint is that is held still."""
        if joint in self.loops:
            return "joints in loops"
        if joint in self.excluded:
            return "endless slides of a base"
        return "fingers" if joint in self.fingers else "joints that move no tip"

    def _no_legs(self, ends: list[str], chains: Mapping[str, tuple[str, ...]]) -> list[str]:
        """Leave out legs and heads, unless there is nothing else of three joints."""

        def is_other(end: str) -> bool:
            texts = [f"{joint.name} {joint.child}".lower() for joint in self._chain(end)]
            return any(2 * sum(bool(kind.search(text)) for text in texts) >= len(texts) for kind in (LEG, HEAD))

        arms = [end for end in ends if not is_other(end)]
        return arms if any(len(chains[end]) >= CARRIED for end in arms) else ends

    def _limb(self, end: str, chain: tuple[str, ...], own: frozenset[str]) -> Limb:
        tip, named = self._tip(end)
        return Limb(tip, named, tuple(self.links[end]), chain, own, tuple(self._hand(end)))

    def _hand(self, end: str) -> Iterator[str]:
        """Yield the joints of the fingers that a body carries, without followers."""
        for joint in self.walk:
            carriers = (above.child for above in self._chain(self.body[joint.parent]))
            if joint.name in self.fingers and joint.name not in self.drivers and end in carriers:
                yield joint.name

    def _tip(self, end: str) -> tuple[str, bool]:
        """Return the frame of a body that is the tip, and whether its name says so or there is no other choice."""
        links = [link for link in self.links[end] if not AIDS.search(link.lower())] or self.links[end]
        links = [link for link in links if not FINGER.search(link.lower())] or links
        carriers = [j.parent for j in self.below[end] if j.name in self.fingers and j.parent in links]
        for pattern in TIP_NAMES:
            fitting = [link for link in links if pattern.search(_words(link)) and not TURNING.search(link.lower())]
            if fitting:
                return max(fitting, key=lambda x: (bool(FRAME.search(_words(x))), x in carriers, self.depth[x])), True

        if carriers:
            return carriers[0], True
        return max(reversed(links), key=self.depth.__getitem__), len(links) == 1


def _words(name: str) -> str:
    """Return a name in lower case, with _ before capitals: "rightToolFrame" is "right_tool_frame"."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
