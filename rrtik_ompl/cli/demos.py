"""The command `rrtik demos`: demonstrations of a task for robot learning, resumable, on all cores or on a cluster."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.terminal import Seed, command, counter, note, plural, say, suggest


class Format(str, Enum):
    """Formats of datasets."""

    npz = "npz"
    hdf5 = "hdf5"
    lerobot = "lerobot"


def demos(
    task: Annotated[str, typer.Argument(help="A shipped task (see: rrtik list tasks) or a YAML file with random:.")],
    out: Annotated[Path, typer.Option(help="Folder of the demonstrations; the same command goes on with it.")],
    count: Annotated[int, typer.Option(help="Number of demonstrations.", min=1)] = 100,
    seed: Seed = 0,
    rate: Annotated[float, typer.Option(help="Ticks per second of the controller.")] = 30.0,
    share: Annotated[float, typer.Option(help="Share of the joints' limits, above 0 to 1: 0.5 is half as fast.")] = 1.0,
    pause: Annotated[
        float, typer.Option(help="Rest where a gripper moves or an object is taken or put down [s].")
    ] = 0.5,
    seconds: Annotated[float, typer.Option(help="Limit of wall time for planning one task [s].")] = 10.0,
    format: Annotated[
        Format, typer.Option(help="Arrays alone, one HDF5 file as robomimic has it, or a dataset of LeRobot (v3.0).")
    ] = Format.npz,
    camera: Annotated[
        list[str] | None,
        typer.Option(help="Pictures: front, side, top, or a file of a view; for several cameras, several times."),
    ] = None,
    size: Annotated[str, typer.Option(help="Of pictures, WIDTHxHEIGHT [px].")] = "320x240",
    jobs: Annotated[
        int | None, typer.Option(help="Processes; the number of cores if left out.", min=1, show_default=False)
    ] = None,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler whose workers plan.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Record demonstrations of a task at random.

    Instances are drawn, planned, proven and timed, one after the other until there are enough.

    What is done is kept when it is interrupted; the same seed gives the same data. Exit code 1 if too few attempts
    succeed.
    """
    from rrtik_ompl.demos.recording import Progress, record
    from rrtik_ompl.tasks import Task

    loaded = Task.load(task)
    pictures = None
    if camera:
        from rrtik_ompl.pilot.overlay.demo_pictures import DemoPictures

        pictures = DemoPictures(loaded, camera, size)
    now = Progress(0, count, 0)
    with counter(loaded.name, count) as show:

        def on_attempt(progress: Progress) -> None:
            nonlocal now
            now = progress
            show(now.done)

        try:
            made = record(
                loaded, count, out, seed=seed, rate=rate, share=share, pause=pause, seconds=seconds,
                format=format.value, jobs=jobs, scheduler=scheduler, pictures=pictures, on_attempt=on_attempt,
            )  # fmt: skip
        except KeyboardInterrupt:
            note(f"what is done is kept in {out}, {now.done} of {count}; the same command goes on")
            raise

    if as_json:
        said = {name: getattr(made, name) for name in ("count", "wanted", "attempts", "failures", "rejected", "reason")}
        print(json.dumps({**said, "dataset": str(made.dataset)}))
        return FOUND if made.complete else NOT_FOUND

    draws = plural(sum(made.rejected.values()), "draw")
    say(f"{loaded.name}: {made.count} demonstrations of {made.attempts} attempts; {draws} could not be used")
    say(*(f"  {number} failed: {why}" for why, number in made.failures.items()))
    say(*(f"  {number} drawn anew: {why}" for why, number in made.rejected.items()))
    say(f"wrote {made.dataset}")
    if not made.complete:
        note(f"{loaded.name}: {made.reason}")
    suggest(f"more of them: {command('demos', task, '--out', out, '--count', 10 * count)}")
    return FOUND if made.complete else NOT_FOUND
