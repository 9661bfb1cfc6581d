"""What OMPL's Benchmark cannot ask of a planner written in Python: its options, its graph, how its path got shorter."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from ompl import base as ob
from ompl import tools as ot

from rrtik_ompl.base.errors import InputError, PlannerError
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner

PROGRESS = ("best cost REAL", "time REAL")  # sorted, as OMPL writes the values of a row
MOMENTS = 101  # even ones of a run


class BenchmarkNotes:
    """Listens to the runs of a benchmark, and writes what it has heard into its records.

    The bindings of OMPL let no planner in Python answer for its parameters, its ``PlannerData`` or its progress. Make
    the notes before ``benchmark()``, and call :meth:`write` between that and ``saveResultsToFile()``: the log then has
    the options of our planners as common properties, the sizes of their graphs, and rows for Planner Arena's progress
    page. Planners of OMPL are left as they are.

    Args:
        benchmark: Its event after a run is taken; the planners are added to it as objects, not by allocators.

    Raises:
        InputError: If ``benchmark`` is none of OMPL's.

    Example:
        >>> notes = rrtik.BenchmarkNotes(benchmark)  # doctest: +SKIP
        >>> benchmark.benchmark(request)  # doctest: +SKIP
        >>> notes.write()  # doctest: +SKIP
        >>> benchmark.saveResultsToFile("mine.log")  # doctest: +SKIP
    """

    def __init__(self, benchmark: ot.Benchmark) -> None:
        if not isinstance(benchmark, ot.Benchmark):
            raise InputError(f"benchmark: expected an ompl.tools.Benchmark, got {type(benchmark).__name__}")

        self._benchmark = benchmark
        self._heard: list[_Run | None] = []
        heard = self._heard  # an event that held the notes would hold the benchmark, which holds the event
        benchmark.setPostRunEvent(lambda planner, _: heard.append(_heard_of(planner)))

    def write(self) -> None:
        """Write into the records of the benchmark, which has to be over.

        Raises:
            PlannerError: If other runs are recorded than were heard of.
        """
        data = self._benchmark.getRecordedExperimentData()
        if sum(len(each.runs) for each in data.planners) != len(self._heard):
            raise PlannerError("benchmark notes: make them before benchmark(), once a benchmark, and write after it")

        heard = iter(self._heard)
        for planner in data.planners:
            runs = [next(heard) for _ in planner.runs]
            ours = [run for run in runs if run is not None]
            if len(ours) == len(runs) > 0:
                _write_planner(planner, ours, float(data.maxTime))


class _Run:
    def __init__(self, planner: SafePlanner) -> None:
        self.options = planner.parameters()
        self.progress = planner.progress
        self.sizes = (0, 0)
        with suppress(PlannerError):  # it found nothing, or was refused
            graph = planner.graph()
            self.sizes = len(graph.vertices), len(graph.edges)


def _heard_of(planner: ob.Planner) -> _Run | None:
    return _Run(planner) if isinstance(planner, SafePlanner) else None


def _write_planner(planner: ot.PlannerExperiment, runs: list[_Run], seconds: float) -> None:
    common = planner.common
    for name, value in runs[0].options.items():
        common[name] = " ".join(str(value).split())

    for recorded, run in zip(planner.runs, runs, strict=True):
        recorded["graph states INTEGER"], recorded["graph motions INTEGER"] = map(str, run.sizes)

    planner.progressPropertyNames = list(PROGRESS)
    planner.runsProgressData = [_rows(run, seconds) for run in runs]


def _rows(run: _Run, seconds: float) -> list[dict[str, str]]:
    """The best cost of a run, when it fell and at even moments: Planner Arena fits curves to many points."""
    if not run.progress:
        return []

    times, costs = np.array(run.progress).T
    moments = np.union1d(times, np.linspace(0.0, max(seconds, times[-1]), MOMENTS))
    moments = moments[moments >= times[0]]
    best = costs[np.searchsorted(times, moments, side="right") - 1]

    rows = {f"{at:.6g}": f"{cost:.9g}" for at, cost in zip(moments, best, strict=True)}  # a time stands once
    return [dict(zip(PROGRESS, (cost, at), strict=True)) for at, cost in rows.items()]
