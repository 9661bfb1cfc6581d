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
    solid_links = {robot.link_of(item) for item in robot.collision.geometryObjects}
    fixed_neighbours: dict[str, list[str]] = {}
    for link in links:
        if link.fixed:
            fixed_neighbours.setdefault(link.name, []).append(link.parent)
            fixed_neighbours.setdefault(link.parent, []).append(link.name)

    pairs = set()
    for link in links:
        if link.fixed:
            continue

        lower_links = _nearest(link.name, fixed_neighbours, solid_links)
        upper_links = _nearest(link.parent, fixed_neighbours, solid_links)
        if len(lower_links) == 1 and len(upper_links) == 1:
            pairs.add(lower_links | upper_links)

    return frozenset(pairs)


def _links(robot: Robot) -> list[_Link]:
    """All links but the base. The frames of a model tell how it was described: a link's hangs on that of its joint."""
    frames = robot.model.frames
    links = []
    for frame in frames:
        if frame.type != pin.FrameType.BODY:
            continue

        parent = frames[frame.parentFrame]
        is_held = False
        if parent.type != pin.FrameType.BODY:
            is_held = parent.name in robot.movable
            parent = frames[parent.parentFrame]

        if parent.type == pin.FrameType.BODY:
            moves = frame.parentJoint != parent.parentJoint
            links.append(_Link(frame.name, parent.name, not (moves or is_held)))
    return links


def _nearest(link: str, fixed_neighbours: Mapping[str, Iterable[str]], solid_links: set[str]) -> frozenset[str]:
    """The link if it has solids, else those that fixed joints lead to over links without any."""
    nearest = set()
    visited = {link}
    to_visit = [link]

    while to_visit:
        visited_link = to_visit.pop()
        if visited_link in solid_links:
            nearest.add(visited_link)
            continue
        for other in fixed_neighbours.get(visited_link, ()):
            if other not in visited:
                visited.add(other)
                to_visit.append(other)

    return frozenset(nearest)
