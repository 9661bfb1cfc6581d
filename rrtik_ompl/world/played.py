"""A motion as a picture plays it, and what the library says of it: proven or not, how near obstacles are, what touches.

All of it is said of the motion itself, a path or a timed one, however many pictures of it are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.judgement import Judged, Verdict
from rrtik_ompl.world.clearance_curve import Course, clearance_on, course_along
from rrtik_ompl.world.path_contacts import contacts_at
from rrtik_ompl.world.route_check import as_it_stands, route_violations, verification_resolution

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World

BISECTIONS = 12  # of a place at which a contact begins or ends

Fault: TypeAlias = tuple[int, float, str]  # the piece, where on it, and what is wrong there


def judged_path(rows: Matrix, world: World) -> Judged:
    """The verdict on a path, waypoints of shape (k, dof); if it is a single one, on the posture."""
    course = course_along(world, rows)
    judged, faults = judged_course(world, course, partial(_faults_of_path, world, rows))

    unproven = judged.verdict.unproven
    text = doubt = ""
    if len(rows) == 1:
        text = f"the posture is {'not ' if unproven else ''}proven free"
        judged = replace(judged, curve=None)
    elif unproven:
        doubt = f"{len(unproven)} move{'s' * (len(unproven) != 1)} not proven free"
    else:
        text = "every move is proven free"

    where = [f"move {k + 1}: {reason}" for k, _, reason in faults or ()]
    verdict = Verdict(not unproven, text, unproven, doubt)
    return replace(judged, verdict=with_reason(verdict, world, where, checked=faults is not None))


def judged_course(
    world: World, course: Course, faults_of: Callable[[], list[Fault]]
) -> tuple[Judged, list[Fault] | None]:
    """What is said of a course by its pieces, without words, and its faults; None if it is too long for its checks."""
    curve = clearance_on(world, course) if world.scene.obstacles else None
    unproven = tuple(gap.motion for gap in course.prove(None).unproven) if curve is None else curve.unproven
    verdict = Verdict(not unproven, "", unproven)

    if curve is not None and not any(first for first, _ in curve.pairs):
        curve = None
    if not unproven:
        return Judged(verdict, curve, ()), []

    try:
        faults: list[Fault] | None = faults_of()
    except InputError:
        faults = None

    places = course if curve is None else curve
    at = np.append(places.motions + places.shares, [piece + share for piece, share, _ in faults or ()])
    at = _with_ends(world, course, np.unique(at))
    return Judged(verdict, curve, contacts_at(world, at, _configurations(course, at))), faults


def _with_ends(world: World, course: Course, at: Vector) -> Vector:
    """Places, shape (m,), and those at which what is not free begins or ends between them."""
    free = world.valid_batch(_configurations(course, at))
    changes = np.flatnonzero(free[:-1] != free[1:])

    last_blocked = np.where(free[changes], at[changes + 1], at[changes])
    last_free = np.where(free[changes], at[changes], at[changes + 1])

    for _ in range(BISECTIONS if len(changes) else 0):
        middle = 0.5 * (last_blocked + last_free)
        is_free = world.valid_batch(_configurations(course, middle))
        last_blocked = np.where(is_free, last_blocked, middle)
        last_free = np.where(is_free, middle, last_free)

    return np.union1d(at, last_blocked)


def _configurations(course: Course, at: Vector) -> Matrix:
    """Configurations at places that are written as the number of a piece plus the share of it, shape (m, dof)."""
    pieces = np.clip(at.astype(np.int64), 0, course.motions[-1])
    return course.at(pieces, at - pieces)


def with_reason(verdict: Verdict, world: World, faults: list[str], *, checked: bool) -> Verdict:
    """A verdict that says too what the first fault is, and of which world that is said.

    Args:
        verdict: Without these.
        world: The world.
        faults: Those that were found.
        checked: Whether they were looked for; not if that takes too long.
    """
    text = verdict.text
    if not verdict.proven:
        text += f"; {faults[0]}" if faults else ", free in steps" if checked else ", too long to be checked in steps"
    return replace(verdict, text=text + as_it_stands(world.scene))


def _faults_of_path(world: World, rows: Matrix) -> list[Fault]:
    """The first violation of each motion of a path."""
    rows = np.vstack([rows, rows]) if len(rows) == 1 else rows
    faults = []
    for each in route_violations(world, rows, verification_resolution(world)):
        motion = rows[each.edge + 1] - rows[each.edge]
        share = float((each.q - rows[each.edge]) @ motion / max(float(motion @ motion), 1e-300))
        faults.append((each.edge, min(max(share, 0.0), 1.0), each.reason))
    return faults
