"""A simulated pilot's hands: they hold "next" for one move of the route after the other, until all are made."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.pilot.devices.wrong_arm import WrongArm
from rrtik_ompl.pilot.session import Session

STEP = 0.03  # [s] between two renewals of what is held
REST, STILL, PRESSES = 40, 33, 60  # steps between presses; steps at rest after which they let go; presses at most
HOLD_SECONDS = 20.0
HASTY_RADIANS = np.deg2rad(1.0)


class Followed(NamedTuple):
    """What became of a route.

    Attributes:
        rows: Where the links were after each press, shape (n, dof).
        plans: How often the route was planned anew.
        presses: How often "next" was pressed.
        moving: For how long the links moved [s].
        refused: How many presses ended because the arm follows too late to be driven.
    """

    rows: Matrix
    plans: int
    presses: int
    moving: float
    refused: int


def follow_route(session: Session, arm: WrongArm, *, hasty: bool = False) -> Followed:
    """Plan, accept, and make all moves; plan anew where the tool asks for it.

    Args:
        session: Whose target and grasp are chosen, or whose problem has a goal.
        arm: Its arm.
        hasty: Each move is let go a degree before its end once, and made to its end by a second press.
    """
    rows, plans, press, moving, refused = [arm.links()], 0, 0, 0.0, 0
    _plan(session, "plan")
    while press < PRESSES and session.follower is not None and session.mode == "following":
        moving += hold_next(session, arm, press, early=hasty and press % 2 == 0)
        press += 1
        refused += "is not driven" in session.message
        rows.append(arm.links())
        if "off the route" in session.message or session.state.way.withdrawn:
            plans += 1
            _plan(session, "replan")
    return Followed(np.array(rows), plans, press, moving, refused)


def hold_next(session: Session, arm: WrongArm, press: int, *, early: bool = False) -> float:
    """Hold "next" until its move is made, or the arm is at rest; let go, and wait. For how long its links moved [s].

    Args:
        session: That follows a route.
        arm: Its arm.
        press: Number of the press.
        early: Let go a degree before the end.
    """
    still, end, moving = 0, session.time + HOLD_SECONDS, 0
    while still < STILL and session.time < end and not (early and _near(session)):
        session.command("next", session.time, press=press)
        if session.state.press.over:
            break
        moved = _pass(session, arm)
        still, moving = (0 if moved else still + 1), moving + moved
    session.command("release", session.time)
    return STEP * (moving + sum(_pass(session, arm) for _ in range(REST)))


def _pass(session: Session, arm: WrongArm) -> bool:
    """A step of time; whether the links moved."""
    before = arm.links()
    arm.advance(STEP)
    session.tick(session.time + STEP)
    return not np.array_equal(before, arm.links())


def _near(session: Session) -> bool:
    progress = session.progress
    return progress is not None and progress.share > 0.0 and abs(progress.remaining) <= HASTY_RADIANS


def _plan(session: Session, verb: str) -> None:
    session.command(verb, session.time)
    if session.mode == "proposed":
        session.command("accept", session.time)
