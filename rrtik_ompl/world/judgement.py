"""The verdict on a motion that is drawn: whether it is proven, how near obstacles are, and what touches.

It describes the motion itself, a path or a timed one, and does not depend on how many pictures of it are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.judgement import Judged, PathContact, Verdict
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.clearance_curve import Course, clearance_on, course_along, places_along
from rrtik_ompl.world.route_check import as_it_stands, route_violations, verification_resolution
from rrtik_ompl.world.row_checks import RowChecks

BISECTIONS = 12  # steps in which the place where a contact begins or ends is located

Fault: TypeAlias = tuple[int, float, str]  # index of the piece, position on it from 0 to 1, and the reason


def judged_path(checks: RowChecks, rows: Matrix) -> Judged:
    """Return the verdict on a path, waypoints of shape (k, dof); a single waypoint is judged as a posture."""
    course = course_along(checks, rows)
    judged, faults = judged_course(checks, course, partial(_faults_of_path, checks, rows))

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
    return replace(judged, verdict=with_reason(verdict, checks.settings.scene, where, checked=faults is not None))


def judged_course(
    checks: RowChecks, course: Course, faults_of: Callable[[], list[Fault]]
) -> tuple[Judged, list[Fault] | None]:
    """Judge a course: its proof, clearance curve and contacts.

    Args:
        checks: The checks of the world.
        course: The course.
        faults_of: Computes the faults; only called if the course is not proven. It may raise InputError if the course
            needs too many checks.

    Returns:
        The judgement, whose verdict has no text yet; and the faults, None if the course needs too many checks.
    """
    curve = clearance_on(checks, course) if checks.settings.scene.obstacles else None
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

    # Look for contacts at the samples and at the faults.
    places = course if curve is None else curve
    at = np.append(places.motions + places.shares, [piece + share for piece, share, _ in faults or ()])
    at = _with_ends(checks, course, np.unique(at))
    return Judged(verdict, curve, contacts_at(checks, at, _configurations(course, at))), faults


def _with_ends(checks: RowChecks, course: Course, at: Vector) -> Vector:
    """Add the places on a course where the arm becomes blocked or free, located by bisection.

    Args:
        checks: The checks of the world.
        course: The course.
        at: Places as index of a piece plus share, ascending, shape (m,).

    Returns:
        All places, ascending, shape (m or more,).
    """
    free = checks.free(_configurations(course, at))
    changes = np.flatnonzero(free[:-1] != free[1:])

    # Each change lies between a blocked and a free place, which approach each other by bisection.
    last_blocked = np.where(free[changes], at[changes + 1], at[changes])
    last_free = np.where(free[changes], at[changes], at[changes + 1])

    for _ in range(BISECTIONS if len(changes) else 0):
        middle = 0.5 * (last_blocked + last_free)
        is_free = checks.free(_configurations(course, middle))
        last_blocked = np.where(is_free, last_blocked, middle)
        last_free = np.where(is_free, middle, last_free)

    return np.union1d(at, last_blocked)


def _configurations(course: Course, at: Vector) -> Matrix:
    """Return the configurations, shape (m, dof), at places written as index of a piece plus share, shape (m,)."""
    pieces = np.clip(at.astype(np.int64), 0, course.motions[-1])
    return course.at(pieces, at - pieces)


def with_reason(verdict: Verdict, scene: Scene, faults: list[str], *, checked: bool) -> Verdict:
    """Append to a verdict's text the first fault, and for which state of the scene it holds.

    Args:
        verdict: The verdict without these.
        scene: The scene of the world.
        faults: The faults that were found.
        checked: Whether faults were searched for; they are not if that takes too long.
    """
    text = verdict.text
    if not verdict.proven:
        text += f"; {faults[0]}" if faults else ", free in steps" if checked else ", too long to be checked in steps"
    return replace(verdict, text=text + as_it_stands(scene))


def _faults_of_path(checks: RowChecks, rows: Matrix) -> list[Fault]:
    """Return the first violation of each motion of a path, waypoints of shape (k, dof)."""
    rows = np.vstack([rows, rows]) if len(rows) == 1 else rows
    faults = []
    for each in route_violations(checks, rows, verification_resolution(checks.settings)):
        motion = rows[each.edge + 1] - rows[each.edge]
        share = float((each.q - rows[each.edge]) @ motion / max(float(motion @ motion), 1e-300))
        faults.append((each.edge, min(max(share, 0.0), 1.0), each.reason))
    return faults


def contacts_along(checks: RowChecks, waypoints: Matrix) -> tuple[PathContact, ...]:
    """Return the contacts of a path, waypoints of shape (k, dof), at the samples of :func:`places_along`.

    A contact that is shorter than the distance between two samples can be missed. The result explains what is wrong
    with a path, but does not check it.
    """
    motions, shares, places = places_along(checks, waypoints)
    return contacts_at(checks, motions + shares, places)


def contacts_at(checks: RowChecks, at: Vector, places: Matrix) -> tuple[PathContact, ...]:
    """Return the contacts at places along a motion.

    Consecutive places at which the same bodies touch form one contact, which is described by its deepest pair.

    Args:
        checks: The checks of the world.
        at: The places as index of a piece plus share, ascending, shape (m,).
        places: The configurations there, shape (m, dof).
    """
    blocked = np.flatnonzero(~checks.free(places))
    contacts_of_place = {int(k): found for k in blocked if (found := checks.contacts(places[k]))}
    names_of_place = {
        k: frozenset(name for c in found for name in (c.first, c.second)) for k, found in contacts_of_place.items()
    }

    def stretch(item: tuple[int, int]) -> tuple[int, frozenset[str]]:
        """Return a key that is equal for consecutive blocked places at which the same bodies touch."""
        count, place = item
        return place - count, names_of_place[place]

    stretches = []
    for (_, together), run in groupby(enumerate(contacts_of_place), stretch):
        numbers = [k for _, k in run]
        deepest = min((contacts_of_place[k][0] for k in numbers), key=lambda contact: contact.clearance)
        stretches.append(PathContact(float(at[numbers[0]]), float(at[numbers[-1]]), deepest, together))
    return tuple(stretches)
