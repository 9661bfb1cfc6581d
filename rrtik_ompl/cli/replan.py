"""The command of `rrtik` that moves a robot among moving obstacles, and replays what happened."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rrtik_ompl.cli.terminal import note, progress, say
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.replanning import ReplanRun

Scenario = Annotated[str, typer.Argument(help="A problem with a run: section, shipped or a YAML file.")]


def replan_scenario(
    scenario: Scenario,
    planner: Annotated[str, typer.Option(help="drrt-con, or to compare with: rrt-connect, drrt.")] = "drrt-con",
    seed: Annotated[int, typer.Option(help="The same seed gives the same run.")] = 0,
    lookahead_ticks: Annotated[int | None, typer.Option(help="Predict obstacle motion this many ticks ahead.")] = None,
    predict: Annotated[int | None, typer.Option(hidden=True)] = None,
    clearance: Annotated[
        float | None, typer.Option(help="What the moves are proven to keep from obstacles beside margins [m].")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Simulated time at most [s].")] = None,
    record: Annotated[Path | None, typer.Option(help="Keep everything, on Ctrl-C too: .json.")] = None,
    replay: Annotated[Path | None, typer.Option(help="Show this record instead of a new run.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a self-contained page that replays the run.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Move a robot to its goal while obstacles move.

    In each tick: check the path, repair it, go a step. Exit code 1 if the goal was not reached.
    """
    if predict is not None:
        raise InputError("--predict is now called --lookahead-ticks; use that")
    check_target(html, (".html", ".htm"))
    check_target(record, (".json",))
    options: dict[str, Any] = {
        "lookahead_ticks": lookahead_ticks,
        "clearance": clearance,
        "seconds": seconds,
        "record": record,
    }
    given = {name: value for name, value in options.items() if value is not None}
    if replay is not None and given:
        raise InputError(
            f"--replay shows a run that is over: leave out --{next(iter(given)).replace('_', '-')}, or --replay"
        )
    from rrtik_ompl.replanning.scenario import load_scenario

    chosen = load_scenario(scenario)
    if replay is None:
        try:
            with progress(f"{chosen.problem.name} with {planner}"):
                run = chosen.run(planner=planner, seed=seed, **given)
        except KeyboardInterrupt:
            if record is not None:
                note(f"{record} holds the run as far as it went, if it had begun")
            raise
    else:
        run = _recorded(replay, chosen.problem.name)
    if html is not None:
        from rrtik_ompl.viewer import view

        with progress("drawing"):
            view(chosen.problem, run=run, html=html)
    if as_json:
        print(json.dumps(run.figures()))
    else:
        say(run.summary())
        say(*(f"wrote {file}" for file in (record, html) if file is not None))
    return 0 if run.arrived else 1


def _recorded(file: Path, problem: str) -> ReplanRun:
    """The run of a record, which must be one of the problem.

    Raises:
        InputError: If it is not, or is no record.
    """
    from rrtik_ompl.replanning import load_run

    run = load_run(file)
    if run.problem != problem:
        raise InputError(f"{file}: a run of '{run.problem}', not of '{problem}'; give the scenario that was run")
    return run
