"""The command `rrtik replan`: move a robot among moving obstacles, and replay recorded runs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.filming import Camera, FilmFile, Filming, Hide, PictureFile, Rate, Size
from rrtik_ompl.cli.terminal import PAGE_FORMATS, Seed, note, progress, say
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.replanning.record import ReplanRun
    from rrtik_ompl.replanning.scenario import Scenario as Chosen

PLANNER = "drrt-con"
REMEDIES = {  # remedies of plan_in_time(), and their replacements in this command
    "raise horizon": "raise --horizon, or call plan_in_time(), which has more options",
    "raise rate": "lower --clearance or the scenario's margin, or call plan_in_time(), which has a rate",
}
Scenario = Annotated[str, typer.Argument(help="A problem with a run: section, shipped or a YAML file.")]


def replan_scenario(
    scenario: Scenario,
    planner: Annotated[
        str | None, typer.Option(help=f"{PLANNER} if absent, or to compare with: rrt-connect, drrt.")
    ] = None,
    seed: Seed = 0,
    lookahead_ticks: Annotated[int | None, typer.Option(help="Predict obstacle motion this many ticks ahead.")] = None,
    foreseen: Annotated[
        bool, typer.Option("--foreseen", help="Plan in configuration and time: obstacles move as stated.")
    ] = False,
    clearance: Annotated[
        float | None, typer.Option(help="Distance that moves are proven to keep from obstacles on top of margins [m].")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Largest simulated time [s]; with --foreseen the limit of wall time; 20.")
    ] = None,
    horizon: Annotated[
        float | None, typer.Option(help="With --foreseen: latest arrival [s]; the scenario's seconds if left out.")
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Write the record of the run, on Ctrl-C too: .json.")] = None,
    replay: Annotated[Path | None, typer.Option(help="Show this record instead of a new run.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a self-contained page that replays the run.")] = None,
    film: FilmFile = None,
    picture: PictureFile = None,
    rate: Rate = None,
    size: Size = None,
    camera: Camera = "overview",
    hide: Hide = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Move a robot to its goal while obstacles move.

    In each tick: check the path, repair it, go a step. Exit code 1 if the goal was not reached.
    """
    check_target(html, PAGE_FORMATS)
    check_target(record, (".json",))
    filming = Filming(film, picture, rate, size, camera, hide)
    filming.check()

    options: dict[str, Any] = {
        "planner": planner,
        "lookahead_ticks": lookahead_ticks,
        "clearance": clearance,
        "seconds": seconds,
        "horizon": horizon,
        "record": record,
        "foreseen": foreseen or None,
    }
    given = {name: value for name, value in options.items() if value is not None}

    if replay is not None and given:
        raise InputError(
            f"--replay shows a run that is over: leave out --{next(iter(given)).replace('_', '-')}, or --replay"
        )

    if horizon is not None and not foreseen:
        raise InputError("--horizon is for --foreseen: give both, or --seconds alone")

    from rrtik_ompl.replanning.scenario import Scenario

    chosen = Scenario.load(scenario)
    if replay is None:
        made = _foreseen(chosen, seed, given) if foreseen else _new_run(chosen, seed, given)
        if isinstance(made, str):
            if as_json:
                print(
                    json.dumps({"problem": chosen.problem.name, "outcome": "not found", "found": False, "reason": made})
                )
            else:
                note(f"{chosen.problem.name}: not found: {made}")
            return NOT_FOUND
        run = made
    else:
        run = _recorded(replay, chosen.problem.name)

    if html is not None:
        from rrtik_ompl.viewer import view

        with progress("drawing"):
            view(chosen.problem, run=run, html=html)
    filmed = filming.write(chosen.problem, None, run=run)

    if as_json:
        print(json.dumps(_document(run)))
    else:
        say(run.summary())
        say(*(f"wrote {file}" for file in (record, html, *filmed) if file is not None))
    return FOUND if run.found else NOT_FOUND


def _document(run: ReplanRun) -> dict[str, Any]:
    """Return a run as plain values for JSON."""
    names = ("problem", "robot", "planner", "seed", "outcome", "found", "reason", "proven", "seconds")
    return {**{name: getattr(run, name) for name in names}, **run.statistics}


def _new_run(chosen: Chosen, seed: int, given: Mapping[str, Any]) -> ReplanRun:
    """Run the scenario with replanning on the way."""
    options = {"planner": PLANNER, **given}
    try:
        with progress(f"{chosen.problem.name} with {options['planner']}"):
            return chosen.run(seed=seed, **options)
    except KeyboardInterrupt:
        if "record" in given:
            note(f"{given['record']} holds the run as far as it went, if it had begun")
        raise


def _foreseen(chosen: Chosen, seed: int, given: Mapping[str, Any]) -> ReplanRun | str:
    """Plan a run in configuration and time before it begins; return why there is none if planning fails.

    Raises:
        InputError: If an option does not apply, or the goal moves.
    """
    from rrtik_ompl.replanning.in_time import plan_in_time

    others = [f"--{name.replace('_', '-')}" for name in ("planner", "lookahead_ticks") if name in given]
    if others:
        raise InputError(f"--foreseen: {others[0]} is for replanning; leave out one of them")
    if chosen.goal_feed is not None:
        raise InputError("--foreseen: the goal of this scenario moves; leave out --foreseen")

    changes = {name: given[name] for name in ("clearance",) if name in given}
    settings = replace(chosen.settings, **changes)
    limits = {"horizon": settings.seconds, **{name: given[name] for name in ("seconds", "horizon") if name in given}}

    with progress(f"{chosen.problem.name}, planned in time"):
        plan = plan_in_time(
            chosen.problem,
            speed=settings.step * settings.rate,
            margin=settings.margin,
            clearance=settings.clearance,
            limits=settings.limits,
            seed=seed,
            **limits,
        )

    if plan.motion is not None and "record" in given:
        plan.motion.save(given["record"])
    return _in_options(plan.reason) if plan.motion is None else plan.motion


def _in_options(reason: str) -> str:
    """Replace the remedy in a reason by the corresponding options of this command."""
    what, _, remedy = reason.partition("; ")
    here = next((ours for theirs, ours in REMEDIES.items() if remedy.startswith(theirs)), remedy)
    return f"{what}; {here}" if here else what


def _recorded(file: Path, problem: str) -> ReplanRun:
    """Load a recorded run, which must belong to the problem.

    Raises:
        InputError: If it is not, or is no record.
    """
    from rrtik_ompl.replanning.record import ReplanRun

    run = ReplanRun.load(file)
    if run.problem != problem:
        raise InputError(f"{file}: a run of '{run.problem}', not of '{problem}'; give the scenario that was run")
    return run
