"""Which links of a robot a joint of its description joins: as it was written, before joints were held or merged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import pinocchio as pin

from rrtik_ompl.model.robot import Robot


@dataclass(frozen=True, slots=True)
class _Link:
    """A link as its description hangs it on another: by a fixed joint, or by one that moves (or is held)."""

    name: str
    parent: str
    fixed: bool


def joined_links(robot: Robot) -> frozenset[frozenset[str]]:
    """Pairs of names of links, with solids, that one joint joins which is not fixed in the description.

    A link without solids that is fixed to one with solids is a frame of that: what a joint joins to the frame is joined
    to the link. Where a frame has several such links, as a flange with a camera and a tool has, no one knows of which
    it is, and it is joined to none of them.

    Example:
        >>> sorted(map(sorted, joined_links(rrtik.load_robot("planar3", radius=0.02))))
        [['base', 'link1'], ['link1', 'link2'], ['link2', 'link3']]
    """
    links = _links(robot)
    solid = {robot.link_of(item) for item in robot.collision.geometryObjects}
    beside: dict[str, list[str]] = {}
    for link in links:
        if link.fixed:
            beside.setdefault(link.name, []).append(link.parent)
            beside.setdefault(link.parent, []).append(link.name)

    found = set()
    for link in links:
        if link.fixed:
            continue

        below = _nearest(link.name, beside, solid)
        above = _nearest(link.parent, beside, solid)
        if len(below) == 1 and len(above) == 1:
            found.add(below | above)

    return frozenset(found)


def _links(robot: Robot) -> list[_Link]:
    """All links but the base. The frames of a model tell how it was described: a link's hangs on that of its joint."""
    frames = robot.model.frames
    found = []
    for frame in frames:
        if frame.type != pin.FrameType.BODY:
            continue

        above = frames[frame.parentFrame]
        held = False
        if above.type != pin.FrameType.BODY:
            held = above.name in robot.movable
            above = frames[above.parentFrame]

        if above.type == pin.FrameType.BODY:
            moves = frame.parentJoint != above.parentJoint
            found.append(_Link(frame.name, above.name, not (moves or held)))
    return found


def _nearest(link: str, beside: Mapping[str, Iterable[str]], solid: set[str]) -> frozenset[str]:
    """The link if it has solids, else those that fixed joints lead to over links without any."""
    found = set()
    seen = {link}
    ahead = [link]

    while ahead:
        here = ahead.pop()
        if here in solid:
            found.add(here)
            continue
        for other in beside.get(here, ()):
            if other not in seen:
                seen.add(other)
                ahead.append(other)

    return frozenset(found)
