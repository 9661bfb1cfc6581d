"""How far an arm moves after the pilot has let go, or when it does another thing than it is told.

A pilot without a browser holds a key through the real server, over a line with a delay, at an arm behind its own line;
where the joints truly are says the arm itself. The gamepad is one of a browser.
"""

from __future__ import annotations

import re
import sys
import time
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from bench.shared.parts import Parts
from rrtik_bench.report.page import Report
from rrtik_ompl.pilot.setup import SessionOptions

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "helpers"))
browsers: Any = import_module("rrtik_tests.browser")
hands: Any = import_module("rrtik_tests.pilot_hands")
hostile: Any = import_module("rrtik_tests.hostile_arm")

DELAYS = (0.0, 0.1, 0.3, 1.0, 3.0)  # each way [s]
FAULTS = {
    "other": "moves another joint",
    "reverse": "goes the wrong way",
    "jump": "jumps by 34 deg in its readings",
    "dead": "stands still",
    "runaway": "does not stop",
}
NAMED = {
    "other": "was driven",
    "reverse": "the wrong way",
    "jump": "jumped by",
    "dead": "does not move",
    "runaway": "after the stop|too far|the wrong way",
}
REFUSED = "refused: line too slow for driving"
LATE = ("the session", "the thread that reads the arm")
LATE_SECONDS = 0.1, 0.2  # between these, each time
REPEATS, REPLUGGED = 12, 8  # at full size
MOST = 1.0  # [deg]
TEXT = (
    "Each case drives a joint that is drawn, to where it has more room, at full speed. A line that takes more than "
    "0.3 s to the server and back drives nothing. Nobody can stop an arm that does not stop: it has to be named."
)


class Case(NamedTuple):
    """A key held and let go, or an arm that errs: the way [deg] before and after that, what was said, and when [s]."""

    before: float
    after: float
    said: str
    seconds: float


def section(parts: Parts, size: float) -> Report:
    """Lines of 0 to 3 s, arms that err, and a gamepad that is plugged in again."""
    report = Report("", "")
    count = max(round(REPEATS * size), 1)
    lines = {delay: parts(released, [(delay, seed) for seed in range(count)]) for delay in DELAYS}
    arms = {fault: parts(erring, [(fault, seed) for seed in range(count)]) for fault in FAULTS}
    unseen = {who: parts(erring_unseen, [(who, seed) for seed in range(count)]) for who in LATE}
    pads = parts(replugged, [(seed,) for seed in range(max(round(REPLUGGED * size), 1))])

    for delay, cases in lines.items():
        worst, moved = max(case.after for case in cases), max(case.before for case in cases)
        slow = 2.0 * delay > 0.3
        refused = all(case.said.startswith(REFUSED) for case in cases)
        held = worst <= MOST and (moved == 0.0 and refused if slow else moved > 0.0)
        wanted = "0 deg, refused in one line" if slow else f"at most {MOST:g} deg"
        report.bar(f"after the release, line of {delay:g} s each way", wanted, f"{worst:.2f} deg", held)
    for fault, cases in arms.items():
        worst, late = max(case.after for case in cases), max(case.seconds for case in cases)
        named = sum(bool(re.search(NAMED[fault], case.said)) for case in cases)
        near = worst <= MOST or fault == "runaway"
        wanted = "named" if fault == "runaway" else f"at most {MOST:g} deg, and named"
        measured = f"{worst:.2f} deg, {named} of {len(cases)} named, within {late:.2f} s"
        report.bar(f"an arm that {FAULTS[fault]}", wanted, measured, near and named == len(cases))
    for who, cases in unseen.items():
        worst = max(case.after for case in cases)
        name = f"an arm that {FAULTS['reverse']} while {who} is late by 0.1 to 0.2 s each time"
        report.bar(name, f"at most {MOST:g} deg", f"{worst:.2f} deg", 0.0 < worst <= MOST)
    worst = max(case.after for case in pads)
    drove = all(case.before > 0.0 for case in pads)
    report.bar("a gamepad plugged in again as it was", "0 deg", f"{worst:.2f} deg", worst == 0.0 and drove)

    rows = [_row(f"line of {delay:g} s", cases) for delay, cases in lines.items()]
    rows += [_row(FAULTS[fault], cases) for fault, cases in arms.items()]
    rows += [_row(f"{FAULTS['reverse']}, {who} is late", cases) for who, cases in unseen.items()]
    rows.append(_row("gamepad plugged in again", pads))
    heads = ("case", "runs", "driven before [deg], most", "after [deg], most", "said, in the first run")
    report.table("The pilot's hand", heads, rows, text=TEXT)
    return report


def _row(name: str, cases: list[Case]) -> tuple[str, ...]:
    before, after = max(case.before for case in cases), max(case.after for case in cases)
    return name, str(len(cases)), f"{before:.2f}", f"{after:.2f}", cases[0].said


def _ready(pilot: Any, seed: int) -> float:
    """Select a joint that is drawn; the direction in which it is driven: where it has more room."""
    rng = np.random.default_rng(seed)
    joint = int(rng.integers(6))
    pilot.say("select", joint=joint)
    while pilot.look(0.1)["selected"] != joint:
        pass
    room, value = pilot.look(0.05)["range"], pilot.look(0.05)["joints"][joint]["value"]
    return 1.0 if room["high"] - value > value - room["low"] else -1.0


def _way(arm: Any, since: Any) -> float:
    return float(np.degrees(np.abs(arm._q - since)).max())


def released(delay: float, seed: int) -> Case:
    """A joint is driven for a second over a line, and let go."""
    with hostile.Pilot(delay=delay, line=True) as pilot:
        pilot.look(0.3 + 2.0 * delay)  # nobody drives before the page has shown picture and arm
        direction, begin = _ready(pilot, seed), pilot.arm._q.copy()
        heard: list[str] = []

        def listen(state: dict[str, Any]) -> bool:
            """Hold on, whatever is said: a refusal may be followed by news before the key is let go."""
            heard.append(state["message"])
            return False

        pilot.hold(1.0 + 2.0 * delay, until=listen, direction=direction)
        there, at = pilot.arm._q.copy(), time.monotonic()
        said = next((message for message in heard if message.startswith(REFUSED)), heard[-1])
        pilot.release()
        pilot.look(1.0 + 2.0 * delay)
        before = float(np.degrees(np.abs(there - begin)).max())
        return Case(before, _way(pilot.arm, there), said, time.monotonic() - at)


def erring(fault: str, seed: int) -> Case:
    """An arm errs while a joint is driven; it stands still, and is named."""
    with hostile.Pilot(line=True) as pilot:
        direction, begin = _ready(pilot, seed), pilot.arm._q.copy()
        _drive(pilot, direction)
        there, at = pilot.arm._q.copy(), time.monotonic()
        pilot.arm.fault = fault
        if fault == "runaway":
            pilot.go_on(0.1)
            pilot.release()
        state = _held(pilot, direction) if fault != "runaway" else _await(pilot, 2.0)
        seconds = time.monotonic() - at
        pilot.look(0.5)
        return Case(float(np.degrees(np.abs(there - begin)).max()), _way(pilot.arm, there), state["message"], seconds)


def erring_unseen(who: str, seed: int) -> Case:
    """An arm goes the wrong way while a part of the session is late each time."""
    with hostile.Pilot(line=True) as pilot:
        direction, begin = _ready(pilot, seed), pilot.arm._q.copy()
        _drive(pilot, direction)
        owner, name = (pilot.session, "tick") if who == LATE[0] else (pilot.session.arm, "_exchange")
        work, rng = getattr(owner, name), np.random.default_rng(seed)

        def working_late(*given: Any) -> Any:
            time.sleep(rng.uniform(*LATE_SECONDS))
            return work(*given)

        setattr(owner, name, working_late)
        there, at = pilot.arm._q.copy(), time.monotonic()
        pilot.arm.fault = "reverse"
        state = _held(pilot, direction)
        seconds = time.monotonic() - at
        pilot.look(0.5)
        return Case(float(np.degrees(np.abs(there - begin)).max()), _way(pilot.arm, there), state["message"], seconds)


def _drive(pilot: Any, direction: float) -> None:
    """Drive for half a second; a machine that is too busy for it is given ten presses."""
    for _ in range(10):
        if pilot.hold(0.5, direction=direction)["driving"]:
            return
        pilot.look(0.3)


def _held(pilot: Any, direction: float) -> dict[str, Any]:
    """Hold on until the arm is named; a press that lapses on a busy machine is made again, as a pilot does."""
    end = time.monotonic() + 2.0
    state: dict[str, Any] = pilot.go_on(0.5, until=_named)
    while not _named(state) and time.monotonic() < end:
        state = pilot.go_on(0.3, until=_named)
        if not state["driving"] and not _named(state):
            pilot.look(0.1)
            state = pilot.hold(0.3, until=_named, direction=direction)
    return state


def _named(state: dict[str, Any]) -> bool:
    return _alarmed(state) and bool(re.search("|".join(NAMED.values()), state["message"]))


def _alarmed(state: dict[str, Any]) -> bool:
    return bool(state["level"] == "alarm")


def _await(pilot: Any, seconds: float) -> dict[str, Any]:
    """The state in which an alarm is said, or the last one."""
    end = time.monotonic() + seconds
    while not _alarmed(state := pilot.look(0.04)) and time.monotonic() < end:
        pass
    return dict(state)


def replugged(seed: int) -> Case:
    """A gamepad drives, is pulled out, and is plugged in again with stick and shoulder button as they were."""
    with TemporaryDirectory() as folder, browsers.Running(SessionOptions("titan4_sdu", seed=seed)) as running:
        browser = browsers.Browser(Path(folder))
        try:
            browser.open(running.server.url)
            browser.wait("state && state.lamps.length === 6 && role.role === 'pilot' && !state.trouble && picture")
            arm = running.opened.engine.session.arm
            begin, pad = arm.read(), hands.Gamepad(browser)
            push = "pad.axes[0] = 1"

            def press() -> None:
                """Anew each time: what was refused on a busy machine is not driven later."""
                browser.ask(f"pad.axes[0] = 0; push({hands.ENABLE}, false); 0")
                browser.wait("!padArmed && !held")
                pad._enable()
                browser.ask(push)

            browser.keep(press, lambda: None, "state.driving")
            time.sleep(0.5)
            browser.ask("window.pad = null; 0")
            browser.wait("!state.driving && byId('pad').hidden")
            time.sleep(0.3)
            there, at = arm.read(), time.monotonic()
            browser.ask(f"{hands.PAD} push({hands.ENABLE}, true); {push}")
            time.sleep(1.0)
            moved = [float(np.degrees(np.abs(arm.read() - q)).max()) for q in (begin, there)]
            return Case(moved[0], moved[1], browser.text("message"), time.monotonic() - at)
        finally:
            browser.close()
