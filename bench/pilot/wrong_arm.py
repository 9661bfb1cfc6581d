"""What the pilot's tool does with an arm that is wrong by stated amounts.

Usage: ``python bench/pilot/wrong_arm.py [--routes 20] [--jobs N] [--out bench/reports/wrong_arm.md]``
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from bench.pilot.scene import PROBLEM, ROBOT, WORLD
from bench.shared.parts import Parts, add_options
from rrtik_bench.report.machine import processes
from rrtik_bench.report.page import Report
from rrtik_ompl.pilot.devices.wrong_arm import Faults, WrongArm
from rrtik_ompl.pilot.session import Session

DEGREE = np.pi / 180.0
KINDS: dict[str, Mapping[str, float]] = {
    "none": {},
    "lag 0.2 s": {"lag": 0.2},
    "lag 0.5 s": {"lag": 0.5},
    "sticks below 0.5 deg": {"stick": 0.5 * DEGREE},
    "overshoot 0.5 deg": {"overshoot": 0.5 * DEGREE},
    "overshoot 2 deg": {"overshoot": 2.0 * DEGREE},
    "play 0.5 deg": {"backlash": 0.5 * DEGREE},
    "play 1 deg": {"backlash": 1.0 * DEGREE},
    "angles wrong by 0.5 deg": {"offset": 0.5 * DEGREE},
    "angles wrong by -1 deg": {"offset": -1.0 * DEGREE},
    "all: 0.2 s, 0.2, 0.5, 0.3, 0.3 deg": {
        "lag": 0.2, "stick": 0.2 * DEGREE, "overshoot": 0.5 * DEGREE, "backlash": 0.3 * DEGREE, "offset": 0.3 * DEGREE,
    },
}  # fmt: skip
HEADS = ("the arm", "hands", "routes", "done [%]", "plans anew, mean", "links touched something [%]",
         "tip from the end of its route [mm], median", "worst")  # fmt: skip
KNOWN = ("none", "lag 0.2 s", "lag 0.5 s", "sticks below 0.5 deg", "overshoot 0.5 deg", "overshoot 2 deg")
INTRO = (
    'TITAN-4 from the bay to the button. A simulated pilot holds "next" until the move is made (patient), or lets go '
    "as soon as it counts as done, up to 1 degree before its end (hasty), and plans anew where the tool asks for it. "
    "Judged by where the links truly are. Play and wrong angles are what an arm does not know of itself: the tool "
    "cannot see them, and only what is left free beside the route forgives them."
)
STEP, REST, PRESSES, HOLD_SECONDS = 0.03, 40, 40, 20.0


class Driven(NamedTuple):
    """How a route was followed: to its end, what was said last, plans anew, contacts, tip from its end [m]."""

    done: bool
    said: str
    plans: int
    touched: bool
    away: float


def driven(amounts: Mapping[str, float], seed: int, hasty: bool = False) -> Driven:
    """One route from the bay to the button; see `INTRO`."""
    arm = WrongArm(ROBOT, PROBLEM.start, Faults(**amounts))
    session, rows, plans = Session(PROBLEM, arm, seed=seed, past=True), [arm.links()], 0
    _plan(session, "plan")
    for press in range(PRESSES):
        if session.follower is None or session.mode != "following":
            break
        _hold(session, arm, press, hasty)
        rows.append(arm.links())
        if "replan" in session.message:
            plans += 1
            _plan(session, "replan")
    done = session.message == "all moves are done"
    touched = not WORLD.motion_valid_batch(np.array(rows[:-1]), np.array(rows[1:])).all()
    end = PROBLEM.start if session.route is None else session.route.path.end
    away = float(np.linalg.norm(ROBOT.fk(arm.links()).translation - ROBOT.fk(end).translation))
    return Driven(done, session.message, plans, touched, away if done else np.nan)


def row(kind: str, hasty: bool, count: int) -> list[str]:
    """One row of the table."""
    found = [driven(KINDS[kind], seed, hasty) for seed in range(count)]
    done, touched = (100.0 * float(np.mean([getattr(each, word) for each in found])) for word in ("done", "touched"))
    away = 1e3 * np.array([each.away for each in found if each.done] or [np.nan])
    plans = float(np.mean([each.plans for each in found]))
    return [kind, "hasty" if hasty else "patient", str(count), f"{done:.0f}", f"{plans:.1f}", f"{touched:.0f}",
            f"{np.median(away):.1f}", f"{away.max():.1f}"]  # fmt: skip


def _plan(session: Session, verb: str) -> None:
    session.command(verb, session.time)
    if session.mode == "proposed":
        session.command("accept", session.time)


def _hold(session: Session, arm: WrongArm, press: int, hasty: bool) -> None:
    """Hold "next" until its move is made, or the arm is at rest for a second; let go, and wait."""
    due, still, end = session.follower.current if session.follower else 0, 0, session.time + HOLD_SECONDS
    while still < 1.0 / STEP and session.time < end:
        if hasty and session.follower and session.follower.current != due:
            break
        before = arm.links()
        session.command("next", session.time, press=press)
        if session.held.over:
            break
        arm.advance(STEP)
        session.tick(session.time + STEP)
        still = still + 1 if np.array_equal(before, arm.links()) else 0
    session.command("release", session.time)
    for _ in range(REST):
        arm.advance(STEP)
        session.tick(session.time + STEP)


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--routes", type=int, default=20, help="of each arm and each kind of hands")
    add_options(parser, "wrong_arm.md")
    options = parser.parse_args()
    command = f"python bench/pilot/wrong_arm.py --routes {options.routes} --jobs {options.jobs}"
    report = Report("An arm that is wrong", command, processes(options.jobs))
    with Parts(options.out, options.jobs) as parts:
        rows = parts(row, [(kind, hasty, options.routes) for kind in KINDS for hasty in (False, True)])
    for cells in rows:
        if cells[0] in KNOWN:
            name = f"{cells[0]}, {cells[1]}: routes on which links touch something"
            report.bar(name, "0 %", f"{cells[5]} %", cells[5] == "0")
    report.table("What became of the routes", HEADS, rows)
    report.note("How", INTRO)
    report.finish(options.out)


if __name__ == "__main__":
    main()
