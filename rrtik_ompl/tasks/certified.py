"""Certificates of whole tasks: one for each motion, with what is held and what is in contact then.

Section 10 of ``docs/science/certificate.md``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.certificate import TaskCertificate
from rrtik_ompl.tasks.contact_life import world_from
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.world.world import World

if TYPE_CHECKING:
    from rrtik_ompl.tasks import TaskPlan

SAME = 1e-9  # [rad] or [m] between the end of a part and the beginning of the next one
SAME_PLACE = 1e-6  # [m], and of entries of rotations: how far things may seem to jump between two parts


class Part(NamedTuple):
    """A motion of a task, or what is left of it once a contact has ended.

    Attributes:
        world: The world that it is in.
        rows: Its waypoints, shape (k, dof).
    """

    world: World
    rows: Matrix


def parts_of(plan: TaskPlan) -> Iterator[Part]:
    """Yield the parts of a plan's motions, divided where contacts end."""
    contacts = plan.contacts or ((),) * len(plan.paths)
    for path, world, stage, stood_on in zip(plan.paths, plan.worlds, plan.stages, contacts, strict=True):
        held = world_of_motion(path, world, stage)
        last = len(path.waypoints) - 1
        partings = {each.until for each in stood_on if each.until is not None and 0 < each.until < last}
        cuts = [0, *sorted(partings), last]
        for first, end in pairwise(cuts) if last else [(0, 0)]:
            yield Part(world_from(held, stood_on, first), path.waypoints[first : end + 1])


def certificate_of_task(plan: TaskPlan, clearance: float) -> TaskCertificate | None:
    """Return the certificate of a plan; None without motions, or if one is not proven.

    See :meth:`TaskPlan.certificate`.
    """
    found = []
    for part in parts_of(plan):
        made = part.world.certificate(part.rows, clearance)
        if made is None:
            return None
        found.append(made)
    return TaskCertificate(tuple(found)) if found else None


def fault_of_task(certificate: TaskCertificate, plan: TaskPlan, clearance: float) -> str:
    """Return the first fault of a certificate of a plan; "" if there is none. See :meth:`TaskPlan.verify`."""
    parts = list(parts_of(plan))
    if len(certificate.parts) != len(parts):
        return f"it has {len(certificate.parts)} parts, and the task {len(parts)}"
    for k, (made, part) in enumerate(zip(certificate.parts, parts, strict=True)):
        if fault := part.world.verify(made, part.rows, clearance=clearance):
            return f"part {k + 1}: {fault}"
    for k, (one, other) in enumerate(pairwise(parts)):
        if fault := _jump(one, other):
            return f"from part {k + 1} to the next: {fault}"
    return ""


def _jump(one: Part, other: Part) -> str:
    """Return what is elsewhere at the beginning of a part than at the end of the one before; "" if nothing is."""
    same_arm = one.world.robot.joint_names == other.world.robot.joint_names
    if not same_arm or np.abs(one.rows[-1] - other.rows[0]).max() > SAME:
        return "the arm jumps"
    before = _places(one.world, one.rows[-1])
    after = _places(other.world, other.rows[0])
    if before.keys() != after.keys():
        return f"'{sorted(before.keys() ^ after.keys())[0][0]}' comes or goes"
    for key, place in before.items():
        if np.abs(place - after[key]).max() > SAME_PLACE:
            return f"'{key[0]}' jumps"
    return ""


def _places(world: World, q: Matrix) -> dict[tuple[str, int], Matrix]:
    """Return where the bodies of obstacles and attached objects are at q, by name and number, shape (4, 4) each."""
    frames = world.robot.joint_frames(q[None])[0]
    seen = Counter[str]()
    found: dict[tuple[str, int], Matrix] = {}
    for body in world.bodies:
        if body.kind != "link":
            found[body.name, seen[body.name]] = frames[body.joint] @ body.placement.homogeneous
            seen[body.name] += 1
    return found
