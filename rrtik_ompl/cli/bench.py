"""The command `rrtik bench`: planners of a suite on its problems, guarded, resumable, with reports."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.table import Table
from rrtik_ompl.cli.terminal import counter, note, progress, say, suggest


def bench(
    suite: Annotated[str, typer.Argument(help="A shipped suite (see: rrtik list suites) or a YAML file.")],
    runs: Annotated[
        int | None, typer.Option(help="Runs of each planner on each problem, in place of the suite's number.", min=1)
    ] = None,
    jobs: Annotated[int, typer.Option(help="Runs at the same time; with more than one, times get longer.", min=1)] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder for records and reports; bench-SUITE if left out.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted campaign.")] = False,
    problems: Annotated[
        Path | None, typer.Option(help="Folder of further problems: files, MotionBenchMaker pairs.")
    ] = None,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler to do the runs.")] = None,
    views: Annotated[int, typer.Option(help="Largest number of 3-D views.", min=0)] = 12,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
) -> int:
    """Compare planners on many problems.

    A run that crashes, hangs or takes too much memory counts as failed; the others go on. Exit code 1 if every run of
    some planner crashed or ended with an error, as with a parameter that it cannot use.
    """
    from rrtik_ompl.benchmark.campaign import Progress, run_campaign
    from rrtik_ompl.benchmark.report import write_report
    from rrtik_ompl.benchmark.statistics import always_refused
    from rrtik_ompl.benchmark.suite import load_suite
    from rrtik_ompl.benchmark.tables import OVERVIEW, failures, overview
    from rrtik_ompl.kernels import warm_up

    campaign = load_suite(suite, folder=problems, runs=runs)
    folder = Path(f"bench-{campaign.name}") if out is None else out
    if scheduler is None:
        warm_up(lambda _: None)  # compile once, before concurrent processes would all do so

    total = campaign.total
    outcomes: Counter[str] = Counter()
    so_far = Progress(0, total)
    with counter(campaign.name, total) as show:

        def on_run(now: Progress, record: Mapping[str, Any] | None) -> None:
            nonlocal so_far
            so_far = now
            outcomes.update([] if record is None else [record["status"]])
            show(now.done)

        try:
            file = run_campaign(campaign, folder, jobs=jobs, scheduler=scheduler, resume=resume, on_run=on_run)
        except KeyboardInterrupt:
            note(f"{so_far.done} of {total} runs are kept in {folder}; continue with --resume")
            raise

    with progress("reports"):
        results, files = write_report(file, views=views)

    if as_json:
        print(json.dumps({"runs": total, "outcomes": dict(outcomes), "files": [str(each) for each in files]}))
    else:
        counts = ", ".join(f"{number} {status}" for status, number in outcomes.items())
        table = Table(*OVERVIEW, right=range(2, len(OVERVIEW)), keys=2)
        for row in overview(results):
            table.add_row(*row)
        say(table, f"this round: {counts or 'no runs were left'}")
        say(*(f"{problem}, {planner}: {number} x {why}" for problem, planner, number, why in failures(results)))
        say(*(f"wrote {each}" for each in files))
        suggest(*(f"open {each}" for each in files if each.suffix == ".html"))
    return NOT_FOUND if always_refused(results) else FOUND
