"""What the library says of a motion that a page plays: proven or not, how near it comes to obstacles, what touches.

All of it is said of the motion itself, a path or a timed one, however many pictures of it are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.motion.trajectory.motion import faults_of, greatest_speeds
from rrtik_ompl.viewer.path_contacts import PathContact, contacts_at
from rrtik_ompl.world.clearance_curve import PLACES, ClearanceCurve, Course, clearance_on, course_along
from rrtik_ompl.world.route_check import as_it_stands, route_violations, verification_resolution
from rrtik_ompl.world.world import World

MOST_KNOTS = 900  # of a timed motion, that are all looked at
FRAME_RATE = 30.0  # [1/s] of a timed motion
MOST_FRAMES = 900  # beside what is looked at
TIME_DIGITS = 9  # of a page's times [s]
BISECTIONS = 12  # of a place at which a contact begins or ends

Fault: TypeAlias = tuple[int, float, str]  # the piece, where on it, and what is wrong there


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a motion is proven free.

    Attributes:
        proven: All of it.
        text: The same for a person, in one line.
        unproven: Numbers of the moves that are drawn on which it is not.
    """

    proven: bool
    text: str
    unproven: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A verdict with its pictures.

    Attributes:
        verdict: The verdict.
        curve: How far the motion stays from obstacles; None if none is near, or nothing is known of them.
        contacts: Where bodies touch.
    """

    verdict: Verdict
    curve: ClearanceCurve | None
    contacts: tuple[PathContact, ...]


def judged_path(world: World, rows: Matrix) -> Judged:
    """The verdict on a path, waypoints of shape (k, dof); of a single one, on the posture."""
    course = course_along(world, rows)
    found, faults = _judged(world, course, partial(_faults_of_path, world, rows))
    unproven = found.verdict.unproven
    if len(rows) == 1:
        text = f"the posture is {'not ' if unproven else ''}proven free"
        curve = None
    else:
        text = f"{moves(len(unproven))} not proven free (violet)" if unproven else "every move is proven free"
        curve = found.curve
    where = [f"move {k + 1}: {reason}" for k, _, reason in faults or ()]
    return replace(found, verdict=_verdict(world, text, unproven, where, checked=faults is not None), curve=curve)


def judged_motion(world: World, motion: Trajectory) -> tuple[Vector, Judged]:
    """Times at which a timed motion is drawn [s], shape (k,), and the verdict on it, by the moves between these.

    Everything that is looked at is drawn too: a motion of some tenths of a second is not lost between two pictures.
    """
    course = _course_of(world, motion)
    found, faults = _judged(world, course, partial(_faults_of_motion, world, motion))
    pieces = len(motion.times) - 1
    text = "the whole motion is proven free"
    if found.verdict.unproven:
        text = f"not proven free in {len(found.verdict.unproven)} of {pieces} pieces (violet)"
    seen = course if found.curve is None else found.curve
    touched = [end for contact in found.contacts for end in (contact.begin, contact.end)]
    clock = frames_of(motion, np.append(_clock(motion, seen.motions, seen.shares), _times(motion, np.array(touched))))
    where = [f"after {_clock(motion, np.array([k]), np.array([x]))[0]:.3f} s: {why}" for k, x, why in faults or ()]
    drawn = _drawn_moves(motion, found.verdict.unproven, clock)
    verdict = _verdict(world, text, drawn, where, checked=faults is not None)
    curve = None if found.curve is None else _on_frames(motion, found.curve, clock, drawn)
    contacts = tuple(_contact_on_frames(motion, each, clock) for each in found.contacts)
    return clock, Judged(verdict, curve, contacts)


def frames_of(motion: Trajectory, more: Vector) -> Vector:
    """Times at which a motion is drawn [s], shape (k,): at an even rate, at its knots, and at some more."""
    count = int(np.clip(np.ceil(FRAME_RATE * motion.duration), 2, MOST_FRAMES))
    knots = motion.times if len(motion.times) <= MOST_KNOTS else motion.times[[0, -1]]
    clock = np.concatenate([np.linspace(0.0, motion.duration, count + 1), knots, more])
    return frozen(np.unique(np.round(clock, TIME_DIGITS)))  # the page rounds them, and no two may be the same


def moves(count: int) -> str:
    """So many moves."""
    return f"{count} move{'s' * (count != 1)}"


def _judged(world: World, course: Course, faults_of: Callable[[], list[Fault]]) -> tuple[Judged, list[Fault] | None]:
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
    looked = course if curve is None else curve
    at = np.append(looked.motions + looked.shares, [piece + share for piece, share, _ in faults or ()])
    at = _with_ends(world, course, np.unique(at))
    return Judged(verdict, curve, contacts_at(world, at, _configurations(course, at))), faults


def _with_ends(world: World, course: Course, at: Vector) -> Vector:
    """Places, shape (m,), and those at which what is not free begins or ends between them."""
    free = world.valid_batch(_configurations(course, at))
    turns = np.flatnonzero(free[:-1] != free[1:])
    inside = np.where(free[turns], at[turns + 1], at[turns])
    outside = np.where(free[turns], at[turns], at[turns + 1])
    for _ in range(BISECTIONS if len(turns) else 0):
        middle = 0.5 * (inside + outside)
        ok = world.valid_batch(_configurations(course, middle))
        inside = np.where(ok, inside, middle)
        outside = np.where(ok, middle, outside)
    return np.union1d(at, inside)


def _configurations(course: Course, at: Vector) -> Matrix:
    """Configurations at places that are written as the number of a piece plus the share of it, shape (m, dof)."""
    pieces = np.clip(at.astype(np.int64), 0, course.motions[-1])
    return course.at(pieces, at - pieces)


def _verdict(world: World, text: str, unproven: tuple[int, ...], faults: list[str], *, checked: bool) -> Verdict:
    """A verdict in words, with the first fault."""
    if unproven:
        text += f"; {faults[0]}" if faults else ", free in steps" if checked else ", too long to be checked in steps"
    return Verdict(not unproven, text + as_it_stands(world.scene), unproven)


def _faults_of_path(world: World, rows: Matrix) -> list[Fault]:
    """The first violation of each motion of a path."""
    rows = np.vstack([rows, rows]) if len(rows) == 1 else rows
    found = []
    for each in route_violations(world, rows, verification_resolution(world)):
        way = rows[each.edge + 1] - rows[each.edge]
        share = float((each.q - rows[each.edge]) @ way / max(float(way @ way), 1e-300))
        found.append((each.edge, min(max(share, 0.0), 1.0), each.reason))
    return found


def _faults_of_motion(world: World, motion: Trajectory) -> list[Fault]:
    """The first fault of each piece of a timed motion."""
    found = faults_of(motion, world)
    pieces, shares = _places_at(motion.times, np.array([moment for moment, _ in found]))
    return [(k, x, reason) for k, x, (_, reason) in zip(pieces.tolist(), shares.tolist(), found, strict=True)]


def _course_of(world: World, motion: Trajectory) -> Course:
    """A timed motion as a course: its places are spread over how far the arm moves, and at its knots."""
    h = np.diff(motion.times)
    speed = greatest_speeds(motion)
    ways = np.append(0.0, np.cumsum(h * np.maximum(speed @ world.weights, 1e-12)))
    clock = np.interp(np.linspace(0.0, ways[-1], PLACES + 1), ways, motion.times)
    if len(motion.times) <= MOST_KNOTS:
        clock = np.unique(np.append(clock, motion.times))
    return Course(
        *_places_at(motion.times, clock),
        at=lambda pieces, shares: motion(_clock(motion, pieces, shares)).positions,
        prove=lambda clearance: motion.prove(world, clearance=clearance),
    )


def _places_at(times: Vector, clock: Vector) -> tuple[NDArray[np.int64], Vector]:
    """Numbers of the pieces between some times on which others are, and where on these, from 0 to 1."""
    pieces = np.clip(np.searchsorted(times, clock, side="right") - 1, 0, len(times) - 2)
    return pieces, np.clip((clock - times[pieces]) / np.diff(times)[pieces], 0.0, 1.0)


def _clock(motion: Trajectory, pieces: NDArray[np.int64], shares: Vector) -> Vector:
    """Times of places on pieces [s]."""
    return np.asarray(motion.times[pieces] + shares * np.diff(motion.times)[pieces])


def _times(motion: Trajectory, at: Vector) -> Vector:
    """Times of places that are written as the number of a piece plus the share of it [s]."""
    pieces = np.clip(at.astype(np.int64), 0, len(motion.times) - 2)
    return _clock(motion, pieces, at - pieces)


def _drawn_moves(motion: Trajectory, pieces: tuple[int, ...], clock: Vector) -> tuple[int, ...]:
    """Numbers of the moves between drawn times that lie on some pieces, at least in part."""
    first = np.searchsorted(clock, motion.times[list(pieces)] + 10.0**-TIME_DIGITS, side="right") - 1
    end = np.searchsorted(clock, motion.times[[k + 1 for k in pieces]] - 10.0**-TIME_DIGITS, side="left")
    found = {k for a, b in zip(first.tolist(), end.tolist(), strict=True) for k in range(a, max(b, a + 1))}
    return tuple(sorted(k for k in found if k < len(clock) - 1))


def _on_frames(motion: Trajectory, curve: ClearanceCurve, clock: Vector, unproven: tuple[int, ...]) -> ClearanceCurve:
    """A curve by pieces as one by the moves between drawn times."""
    moves_, shares = _places_at(clock, _clock(motion, curve.motions, curve.shares))
    return replace(curve, motions=moves_, shares=frozen(shares), unproven=unproven)


def _contact_on_frames(motion: Trajectory, contact: PathContact, clock: Vector) -> PathContact:
    ends = _places_at(clock, _times(motion, np.array([contact.begin, contact.end])))
    begin, end = (ends[0] + ends[1]).tolist()
    return replace(contact, begin=begin, end=end)
