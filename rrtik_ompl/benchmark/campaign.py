"""Run a campaign: every planner of a suite on every problem, repeatedly, with failures recorded as results."""

from __future__ import annotations

import os
import platform
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

import numpy as np

from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.benchmark import records, run
from rrtik_ompl.benchmark.suite import Suite
from rrtik_ompl.many import spread

LIBRARIES = ("ompl", "pin", "coal", "numpy", "numba")


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a campaign: the number of completed runs, and of all runs."""

    done: int
    total: int


def run_campaign(
    suite: Suite,
    folder: Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    resume: bool = False,
    on_run: Callable[[Progress, Mapping[str, Any] | None], object] = lambda *_: None,
) -> Path:
    """Run all runs of a suite that the folder does not contain yet.

    The seed of a run depends only on its number, so the results do not depend on how runs are distributed, or how often
    the campaign was interrupted. (If the time limit ends a run, its result depends on the machine.)

    Args:
        suite: What to run.
        folder: Folder for the file of records.
        jobs: Number of concurrent runs on this machine.
        scheduler: Address of a Dask scheduler whose workers run the jobs instead.
        resume: Continue a campaign of the same suite that was interrupted.
        on_run: Called with the progress and the record, at the beginning (record None) and after every run.

    Returns:
        The file of records.

    Raises:
        InputError: If there are runs and ``resume`` is not set, they are of another suite, or cannot be read or
            written; if the scheduler cannot be used.

    Example:
        >>> from pathlib import Path
        >>> text = "{version: 1, problems: [planar3_boxes], planners: [bicrdt], runs: 1, seconds: 2}"
        >>> _ = Path("suite.yaml").write_text(text)
        >>> rrtik.benchmark.run_campaign(rrtik.benchmark.load_suite("suite.yaml"), Path("runs")).name
        'runs.jsonl'
    """
    require(suite, Suite, "suite of a campaign", "use load_suite(file)")
    file = folder / records.NAME
    about = machine(jobs, scheduler)
    done = _held(file, suite, about, resume)
    total = suite.total

    left = (job for job in all_jobs(suite) if records.key_of(job["run"]) not in done)
    on_run(Progress(len(done), total), None)

    with records.RecordFile(file, {"version": 1, "suite": suite.plain(), "machine": about}) as out:
        if len(done) == total:
            return file
        finished = spread.local(left, jobs) if scheduler is None else spread.cluster(left, scheduler)

        try:
            for number, record in enumerate(finished, start=len(done) + 1):
                out.append(record)
                on_run(Progress(number, total), record)
        finally:
            finished.close()
    return file


def all_jobs(suite: Suite) -> Iterator[dict[str, Any]]:
    """Yield every run as plain values; planners alternate, so that a slow phase of the machine affects all of them."""
    for source in suite.sources:
        for number in range(suite.runs):
            seed = int(np.random.SeedSequence([suite.seed, number]).generate_state(1, np.uint32)[0])
            for entrant in suite.entrants:
                yield {
                    "run": {
                        "problem": source.name,
                        "group": source.group,
                        "axis": source.axis,
                        "value": source.value,
                        "planner": entrant.label,
                        "run": number,
                        "seed": seed,
                    },
                    "module": run.__name__,
                    "source": source.plain(),
                    "planner": entrant.name,
                    "parameters": entrant.parameters,
                    "shorten": entrant.shorten,
                    "seconds": suite.seconds,
                    "patience": suite.patience,
                    "memory_mb": suite.memory_mb,
                    "seed": seed,
                }


def machine(jobs: int, scheduler: str | None) -> dict[str, Any]:
    """Return the information about machine and libraries that a reader needs to compare times."""
    from rrtik_ompl.base.version import __version__

    return {
        "rrtik-ompl": __version__,
        **{name: installed(name) for name in LIBRARIES},
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": os.cpu_count(),
        "at a time": "a cluster" if scheduler else jobs,
        "begun": time.strftime("%Y-%m-%d %H:%M:%S"),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def _held(file: Path, suite: Suite, about: Mapping[str, Any], resume: bool) -> set[records.Key]:
    """Return the runs that are already in the file, after a check that it belongs to the same suite."""
    if not os.path.isfile(file) or file.stat().st_size == 0:
        return set()

    head = records.read_head(file)
    done = {records.key_of(record) for record in records.read_records(file)}
    if not done:  # no run was completed, for example because a scheduler did not answer
        return done
    if not resume:
        raise InputError(f"{file}: holds {len(done)} runs already; continue with --resume, or choose another --out")

    before = head["suite"]
    now = records.json_like(suite.plain())
    changed = [key for key in now if before.get(key) != now[key] and key not in ("runs", "title")]
    if changed:
        raise InputError(f"{file}: was begun with another suite ({', '.join(changed)} differ); choose another --out")

    if len(done) < suite.total:
        _warn_of_change(file, head["machine"], about)
    return done


def _warn_of_change(file: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Warn if machine or libraries differ from those at the beginning, because reports name only the latter."""
    other = [f"{name} {before[name]}, now {now[name]}" for name in records.MACHINE[:-1] if before[name] != now[name]]
    if other:
        warnings.warn(f"{file}: was begun with {'; '.join(other)}: times may not compare", stacklevel=4)
