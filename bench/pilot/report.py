"""The pilot's tool without a page: lamps, routes, refusals, a simulated pilot, times."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from typer import Option

from bench.pilot.hulls import GROWTH, hulls_of_links
from bench.pilot.pictures import registration, served, stages, state_rate
from bench.pilot.routes import REACTION_SECONDS, REPLANNING, panel_routes, simulated_pilot, small_errors
from bench.pilot.session import color_logic, preventive_checks, scripted_scenario
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, RED
from rrtik_ompl.pilot.routes.route_search import MIN_ROBUSTNESS

PUBLISHED = 1.08  # [s] of one route: search and shortening


def write_session(report: Report, part: int) -> None:
    """States, record, lamps, refusals."""
    modes, same = scripted_scenario()
    report.bar("scripted scenario without a page, all states", "visited", ", ".join(modes), len(modes) == 4)
    report.bar("its record, replayed", "same end", "same end" if same else "another end", same)
    count = 500 // part
    lit = color_logic(count)
    shares = ", ".join(f"{number} {color}" for color, number in lit.colors.items())
    text = f"{lit.wrong} wrong of {sum(lit.colors.values())} ({shares})"
    report.bar(f"red lamps of {count} random object poses against exhaustive IK", "0 wrong", text, lit.wrong == 0)
    text = f"{lit.planned[RED]} of {lit.colors[RED]}; {lit.planned[AMBER]} of {lit.colors[AMBER]} amber ones do"
    report.bar("red lamps whose grasp a route leads to", "0", text, lit.planned[RED] == 0)
    missing = lit.colors[GREEN] - lit.planned[GREEN]
    report.bar("green lamps without a route", "0", f"{missing} of {lit.colors[GREEN]}", missing == 0)
    text = f"{1e3 * lit.offset:.2f} mm, {np.degrees(lit.turn):.3f} deg the farthest"
    near = lit.offset <= 5e-4 and np.degrees(lit.turn) <= 0.1
    report.bar("end of a route from its grasp", "<= 0.5 mm, 0.1 deg", text, near)
    found = preventive_checks(100_000 // part)
    text = (
        f"{found.bad} ({found.accepted} of {found.commands} accepted; {found.judged} through check_move "
        f"{'agree' if found.agree else 'DISAGREE'}; {found.looks} looks by the independent check)"
    )
    report.bar("accepted beyond limits or into collision, random commands", "0", text, found.bad == 0 and found.agree)


def write_routes(report: Report, part: int) -> None:
    """Time, moves, errors."""
    made = panel_routes(60 // part)
    median, late = np.quantile(made.clock, [0.5, 0.95])
    processor, routes = float(np.median(made.processor)), made.found
    text = f"median {processor:.3f} s (by the clock {median:.3f} s, 95 % {late:.3f} s), "
    text += f"{len(routes)} of {len(made.clock)} found"
    report.bar("plan to list of moves, errors tried and clearance included", "<= 0.2 s median", text, processor <= 0.2)
    report.bar(
        "the same against the published 1.08 s", "<= 1.08 s median", f"{processor:.3f} s", processor <= PUBLISHED
    )
    one = all(route.path.one_joint_at_a_time for route in routes)
    report.bar("every move turns one joint", "always", "always" if one else "not always", one)
    free, warned = small_errors(60 // part)
    text = f"{100 * np.mean(free):.2f} % on the mean, {100 * min(free):.1f} % the worst of {len(free)} routes; "
    report.bar("executions with +-1 deg a move that stay free, 1000 of each route not warned of", ">= 99 %",
               f"{text}{warned} warned of", float(np.mean(free)) >= MIN_ROBUSTNESS)  # fmt: skip
    rows = [(len(route.path.moves()), np.rad2deg(route.travel), route.seconds) for route in routes]
    moves, degrees, seconds = np.mean(rows, axis=0)
    narrow = sum(route.robustness < MIN_ROBUSTNESS for route in routes)
    report.note(
        "Routes on the panel",
        f"On the mean {moves:.1f} moves, {degrees:.0f} deg, {seconds:.0f} s; {narrow} of {len(routes)} are warned of: "
        "with errors of 1 deg a move more than 1 of 100 executions touches something, or comes into the margin that an "
        "object has because nobody knows exactly where it is.",
    )


def write_pilot(report: Report, part: int) -> None:
    """The simulated pilot with the tool and without."""
    found = simulated_pilot(40 // part)
    share = found.tool.seconds / found.naive.seconds
    text = f"{100 * share:.0f} % ({found.tool.seconds:.0f} s, of {found.executions} executions, against "
    text += f"{found.naive.seconds:.0f} s, of {found.routes} routes)"
    report.bar("simulated pilot: time with the tool", "<= 50 % of naive order", text, share <= 0.5)
    text = f"{100 * found.tool.touching:.1f} % of executions touch something, {100 * found.naive.touching:.1f} % in"
    report.bar("simulated pilot: collisions with the tool", "<= 10 % of naive order", f"{text} naive order",
               found.tool.touching <= 0.1 * found.naive.touching)  # fmt: skip
    report.note(
        "Simulated pilot",
        f"From the bay to the button, usual rates. Reaction {REACTION_SECONDS} s a move or press. In naive order and "
        "by the bare list each move ends with an error of N(0, 1 deg). With the tool the pilot holds each move to its "
        "end, lets go a degree too early at every second press and has to press again, and at each of its stops the "
        "arm goes on by |N(0, 1 deg)|, drawn for each joint; a route is planned anew where the tool asks for it: "
        f"{found.plans:.1f} times on the mean, {REPLANNING:g} s each. The bare list, never checked on the way, takes "
        f"{found.bare.seconds:.0f} s, and {100 * found.bare.touching:.0f} % of its executions touch something.",
    )


def write_loop(report: Report, part: int) -> None:
    """States a second, clicks, pictures."""
    rate = state_rate()
    report.bar("state, lamps anew, the object moving in every picture", ">= 30 Hz", f"{rate:.0f} Hz", rate >= 30.0)
    rows = stages()
    report.table(
        "One step of the loop while the object moves [ms]",
        ["stage", "processor", "clock"],
        [[name, f"{1e3 * processor:.1f}", f"{1e3 * clock:.1f}"] for name, processor, clock in rows],
    )
    page = served(100 // part)
    able = 1.0 / page.processor
    text = f"{able:.0f} ({1e3 * page.processor:.0f} ms each, page and pictures included; by the clock {page.rate:.0f})"
    report.bar("states a second, the object moving, with a page that is served", ">= 30", text, able >= 30.0)
    median, late = np.quantile(1e3 * np.array(page.delays), [0.5, 0.95])
    report.bar("from a click on a lamp to its state, over the WebSocket, meanwhile", "< 50 ms median",
               f"median {median:.0f} ms, 95 % {late:.0f} ms of {len(page.delays)}", median < 50.0)  # fmt: skip
    away = registration(200 // part)
    text = f"mean {np.mean(away):.3f} px, worst {max(away):.3f} px of {len(away)} boxes"
    report.bar("drawn against projected directly", "< 1 px", text, max(away) < 1.0)


def write_hulls(report: Report) -> None:
    """Vertices of hulls, and what they are good for."""
    links = hulls_of_links()
    fewer = [[100.0 * (1.0 - count / link.vertices) for link in links for count in (getattr(link, kind),)]
             for kind in ("exact", "grown")]  # fmt: skip
    exact, grown = (f"{min(each):.0f} to {max(each):.0f} % fewer" for each in fewer)
    report.bar("hulls grown by 1 mm at most: vertices", ">= 80 % fewer", f"{grown}; exact hulls {exact}",
               min(fewer[1]) >= 80.0)  # fmt: skip
    outside = max(link.outside for link in links)
    report.bar("hulls: original vertices outside", "<= 1e-9 m", f"{outside:.1e} m", outside <= 1e-9)
    report.table(
        "Hulls of the links of UR5",
        ["link", "vertices", "of the exact hull", "of the grown hull", "checks faster by: exact", "grown"],
        [[link.name, str(link.vertices), str(link.exact), str(link.grown), f"{link.speed_exact:.1f}",
          f"{link.speed_grown:.1f}"] for link in links],
    )  # fmt: skip
    report.note(
        "What the hulls are",
        f"A grown hull is bounded by some of the exact hull's own planes, so it contains every point; no vertex of it "
        f"stands more than {1e3 * GROWTH:g} mm above any of them. The tool itself checks the links as they are.",
    )


def main(run: Run, *, quick: Annotated[bool, Option(help="A tenth of every count.")] = False) -> Report:
    """Measure."""
    report = run.report("The pilot's tool, measured without a page")
    report.note(
        "Times",
        "Processor times unless the clock is named, for the machine is shared; nearly all the work is in one thread.",
    )
    for write in (write_session, write_routes, write_pilot, write_loop):
        write(report, 10 if quick else 1)
    write_hulls(report)
    return report
