"""What the pilot's tool does with an arm that is wrong by stated amounts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np
from typer import Option

from bench.pilot.hands import follow_route
from bench.pilot.scene import PROBLEM, ROBOT, WORLD
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.pilot.devices.wrong_arm import Faults, WrongArm
from rrtik_ompl.pilot.motion.supervisor import FOLLOW_SECONDS
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
HEADS = ("the arm", "hands", "routes", "done [%]", "refused by name [%]", "plans anew, mean",
         "links touched something [%]", "tip from the end of its route [mm], median", "worst")  # fmt: skip
KNOWN = ("none", "lag 0.2 s", "lag 0.5 s", "sticks below 0.5 deg", "overshoot 0.5 deg", "overshoot 2 deg")
INTRO = (
    'TITAN-4 from the bay to the button. A simulated pilot holds "next" until the move is made (patient), or lets go '
    "1 degree before its end and has to press again (hasty), and plans anew where the tool asks for it. "
    "Judged by where the links truly are. Play and wrong angles are what an arm does not know of itself: the tool "
    "cannot see them, and only what is left free beside the route forgives them. An arm that follows later than "
    f"{FOLLOW_SECONDS:g} s is not driven: its presses end with a line that says so. A route that is not done, and "
    "during which that was said, is refused by name."
)


class Driven(NamedTuple):
    """How a route was followed: to its end, or refused by name, what was said last, plans anew, contacts, tip [m]."""

    done: bool
    refused: bool
    said: str
    plans: int
    touched: bool
    away: float


def driven(amounts: Mapping[str, float], seed: int, hasty: bool = False) -> Driven:
    """One route from the bay to the button; see `INTRO`."""
    arm = WrongArm(ROBOT, PROBLEM.start, Faults(**amounts))
    session = Session(PROBLEM, arm, seed=seed, past=True)
    followed = follow_route(session, arm, hasty=hasty)
    rows = followed.rows
    done = session.message.startswith("all moves are")
    touched = not WORLD.motion_valid_batch(rows[:-1], rows[1:]).all()
    end = PROBLEM.start if session.route is None else session.route.path.end
    away = float(np.linalg.norm(ROBOT.fk(arm.links()).translation - ROBOT.fk(end).translation))
    refused = not done and followed.refused > 0
    return Driven(done, refused, session.message, followed.plans, touched, away if done else np.nan)


def row(kind: str, hasty: bool, count: int) -> list[str]:
    """One row of the table."""
    found = [driven(KINDS[kind], seed, hasty) for seed in range(count)]
    words = ("done", "refused", "touched")
    shares = {word: f"{100.0 * np.mean([getattr(each, word) for each in found]):.0f}" for word in words}
    away = [1e3 * each.away for each in found if each.done]
    ends = [f"{np.median(away):.2f}", f"{max(away):.2f}"] if away else ["-", "-"]
    plans = float(np.mean([each.plans for each in found]))
    return [kind, "hasty" if hasty else "patient", str(count), shares["done"], shares["refused"], f"{plans:.1f}",
            shares["touched"], *ends]  # fmt: skip


def main(
    run: Run, parts: Parts, *, routes: Annotated[int, Option(help="Of each arm and each kind of hands.")] = 20
) -> Report:
    """Measure."""
    report = run.report("An arm that is wrong")
    rows = parts(row, [(kind, hasty, routes) for kind in KINDS for hasty in (False, True)])
    for cells in rows:
        if cells[0] == "none":
            ends = f"{cells[0]}, {cells[1]}: tip from the end of its route, worst"
            report.bar(ends, "<= 0.5 mm", f"{cells[8]} mm", cells[8] != "-" and float(cells[8]) <= 0.5)
        if cells[0] in KNOWN:
            name = f"{cells[0]}, {cells[1]}: routes on which links touch something"
            report.bar(name, "0 %", f"{cells[6]} %", cells[6] == "0")
            ends = f"{cells[0]}, {cells[1]}: routes done, or refused by name"
            late = KINDS[cells[0]].get("lag", 0.0) > FOLLOW_SECONDS
            measured = f"{cells[3]} % done, {cells[4]} % refused"
            report.bar(ends, "100 % refused" if late else "100 % done", measured, cells[4 if late else 3] == "100")
    report.table("What became of the routes", HEADS, rows)
    report.note("How", INTRO)
    return report
