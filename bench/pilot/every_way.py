"""What an arm that does not do what it is told moves, and when it is named, by every way of driving it.

Without a page and without a clock on the wall: the arm errs from one step to the next, and the session reads it 30
times a second. Where the joints truly are says the arm itself.
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.pilot.scene import NAME, PLACE, PROBLEM, ROBOT, VALVE, seen_at
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.pilot.motion.supervisor import FAULTS
from rrtik_ompl.pilot.session import Session

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "helpers"))
HostileArm: Any = import_module("rrtik_tests.hostile_arm").HostileArm
SimulatedArm: Any = import_module("rrtik_ompl.pilot.devices.arm").SimulatedArm

WAYS = ("jog", "go", "next", "together", "servo", "lead", "tool")
ERRS = {
    "other": "moves other joints",
    "reverse": "goes the wrong way",
    "jump": "jumps in its readings",
    "dead": "stands still",
    "runaway": "does not stop",
    "fast": "is five times as fast",
    "frozen": "reads always the same",
    "offset": "reads 34 deg too much",
}
STEP, BEFORE, PATIENCE = 1.0 / 30.0, 15, 60  # [s]; steps before it errs, and steps at most after that
MOST_DEGREES, MOST_SECONDS = 1.0, 0.5
WANTED = {
    "runaway": f"named {MOST_SECONDS:g} s after the release",
    "fast": f"<= {MOST_DEGREES:g} deg more than its rate allows, or named in {MOST_SECONDS:g} s",
}
NAMED = "|".join(re.sub(r"\\\{.*?\\\}", ".*", re.escape(words)) for words in FAULTS.values()) + "|off the route"


class Case(NamedTuple):
    """An arm that erred: its way since then [deg], the time until it was named and stopped [s], and what was said."""

    degrees: float
    seconds: float
    said: str
    stopped: bool


def erring(way: str, fault: str) -> Case:
    """Drive an arm by one way, let it err, and hold on."""
    arm = HostileArm()
    master = SimulatedArm(ROBOT, PROBLEM.start)
    session = Session(PROBLEM, arm, seed=1, master=master)
    verb, arguments, seen = _ready(session, way)
    time, since, before = session.time, 0.0, arm._q.copy()
    for step in range(BEFORE + PATIENCE):
        if step == BEFORE:
            arm.fault, before, since = fault, arm._q.copy(), time
        session.see([seen], time)
        master._q = arm._q + np.deg2rad([2.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # ahead of the arm, as a hand is
        if fault == "runaway" and step > BEFORE + 2:
            since = time if step == BEFORE + 3 else since
            session.command("release", time)
        else:
            session.command(verb, time, press=1, **arguments)
        arm.advance(STEP)
        time += STEP
        session.tick(time)
        if step >= BEFORE and re.search(NAMED, session.message):
            break
    seconds = time - since
    arm.advance(2.0 * STEP)  # so long does a stop take to arrive
    degrees = np.degrees(np.abs(arm._q - before)).max()
    if fault == "fast":  # it does what it is told, but sooner
        degrees = max(degrees - np.degrees(session.means.rates.max()) * seconds, 0.0)
    return Case(float(degrees), seconds, session.message, not session.driving)


def good(fault: str, case: Case) -> bool:
    """Whether an arm was stopped and named in time; one that is only fast may also just be no farther than others."""
    in_time = bool(re.search(NAMED, case.said)) and case.stopped and case.seconds <= MOST_SECONDS + STEP
    near = case.degrees <= MOST_DEGREES
    if fault == "runaway":  # nobody can stop it
        return in_time
    return near or in_time if fault == "fast" else near and in_time


def _ready(session: Session, way: str) -> tuple[str, dict[str, float], Any]:
    """Bring a session to where a way can drive it; return the command to hold, its arguments, and what is seen."""
    seen = seen_at(PLACE)
    if way == "servo":
        goal = ROBOT.fk(PROBLEM.start)
        grasp = VALVE.grasp("aslant").levels[1]
        place = goal.copy()
        place.translation = goal.translation + goal.rotation @ np.array([0.02, 0.0, 0.08])
        seen = seen_at(place * grasp.inverse())
    session.see([seen], 0.0)
    session.command("grasp", 0.0, type="aslant", level=1)

    if way == "tool":
        return "tool", {"direction": -1.0}, seen
    if way == "jog":
        return "jog", {"direction": 1.0}, seen
    if way == "go":
        session.command("move", 0.0, target=float(PROBLEM.start[0]) + 0.4)
        return "go", {}, seen
    if way in ("next", "together"):
        session.command("plan", 0.0)
        if way == "together":
            session.command("together", 0.0)
        session.command("accept", 0.0)
        return "next", {}, seen
    return way, {}, seen


def main(run: Run) -> Report:
    """Measure."""
    report = run.report("An arm that errs, by every way of driving it")
    rows = []
    for fault, errs in ERRS.items():
        for way in WAYS:
            case = erring(way, fault)
            named = bool(re.search(NAMED, case.said))
            wanted = WANTED.get(fault, f"<= {MOST_DEGREES:g} deg, {MOST_SECONDS:g} s, named")
            measured = f"{case.degrees:.2f} deg, {case.seconds:.2f} s, {'named' if named else 'not named'}"
            report.bar(f"{errs}: {way}", wanted, measured, good(fault, case))
            rows.append([errs, way, f"{case.degrees:.2f}", f"{case.seconds:.2f}", case.said])
    report.table(f"{NAME}: what was said", ["the arm", "way of driving", "way [deg]", "time [s]", "said"], rows)
    report.note("How", str(__doc__).strip())
    return report
