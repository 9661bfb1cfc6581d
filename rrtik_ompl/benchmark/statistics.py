"""Statistics of a campaign, as in the reference evaluation: counts, mean, quartiles, 95 % quantile."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from rrtik_ompl.benchmark.run import ERROR, INVALID, SOLVED
from rrtik_ompl.many.guard import CRASH

# Key, displayed name and unit of each quantity. Lengths are Euclidean in joint space; moves are called transitions.
QUANTITIES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "plan_seconds": ("planning", "s"),
        "shorten_seconds": ("shortening", "s"),
        "total_seconds": ("total", "s"),
        "iterations": ("iterations", ""),
        "vertices": ("vertices", ""),
        "edges": ("edges", ""),
        "checked_states": ("checked states", ""),
        "checked_motions": ("checked motions", ""),
        "initial_length": ("initial length", "rad, m"),
        "length": ("final length", "rad, m"),
        "initial_transitions": ("initial transitions", ""),
        "transitions": ("final transitions", ""),
        "initial_clearance": ("initial clearance", "m"),
        "clearance": ("final clearance", "m"),
        "memory_mb": ("memory", "MB"),
    }
)
HEAVY = ("waypoints",)  # large entries of a record that statistics do not need


class Spread(NamedTuple):
    """Statistics of a quantity over runs."""

    mean: float
    std: float
    least: float
    q25: float
    median: float
    q75: float
    p95: float
    most: float


@dataclass(slots=True)
class Result:
    """All runs of one planner on the problems of one label.

    Attributes:
        label: Problems that are reported together: a group, or one problem of a scaling family.
        planner: Label of the planner.
        group, axis, value: As in a record.
        runs: Records without their large entries.
    """

    label: str
    planner: str
    group: str
    axis: str
    value: float
    runs: list[dict[str, Any]] = field(default_factory=list)

    @property
    def total(self) -> int:
        """Number of runs."""
        return len(self.runs)

    @property
    def solved(self) -> int:
        """Number of runs that returned a path."""
        return sum(run["status"] in (SOLVED, INVALID) for run in self.runs)

    @property
    def valid(self) -> int:
        """Number of runs whose path passed a second, denser check."""
        return sum(run["status"] == SOLVED for run in self.runs)

    def values(self, quantity: str) -> list[float]:
        """Return a quantity of the runs with a valid path, in their order; runs that did not measure it are skipped."""
        found = (measured(run, quantity) for run in self.runs if run["status"] == SOLVED)
        return [value for value in found if value is not None]

    def spread(self, quantity: str) -> Spread | None:
        """Return the statistics over the runs with a valid path; None if there are none."""
        return spread(self.values(quantity))


def measured(record: Mapping[str, Any], quantity: str) -> float | None:
    """Return a quantity of a record; None if it was not measured."""
    if quantity == "total_seconds":
        return float(record["plan_seconds"] + record.get("shorten_seconds", 0.0)) if "plan_seconds" in record else None

    counts = record.get("counts", {})
    if quantity == "free_share":
        motions = counts.get("checked_motions", 0)
        return float(counts["free_motions"] / motions) if motions and "free_motions" in counts else None

    value = record.get(quantity, counts.get(quantity))
    return None if value is None else float(value)


def spread(values: Sequence[float]) -> Spread | None:
    """Return the statistics of a list of values; None if it is empty."""
    if not values:
        return None
    low, q25, median, q75, p95, high = np.quantile(values, (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)).tolist()
    return Spread(float(np.mean(values)), float(np.std(values)), low, q25, median, q75, p95, high)


def results(records: Iterable[Mapping[str, Any]]) -> list[Result]:
    """Group records by problem and planner, in the order of first appearance; the runs of each group are sorted."""
    found: dict[tuple[str, str], Result] = {}
    for record in records:
        label = record["problem"] if record["axis"] else record["group"]
        place = Result(label, record["planner"], record["group"], record["axis"], record["value"])
        light = {key: value for key, value in record.items() if key not in HEAVY}
        found.setdefault((label, record["planner"]), place).runs.append(light)

    for result in found.values():
        result.runs.sort(key=lambda run: (run["problem"], run["run"]))

    return list(found.values())


def always_refused(found: Iterable[Result]) -> list[str]:
    """Return the planners whose every run ended with an error, for example of a parameter, or with a crash."""
    statuses: dict[str, set[str]] = {}
    for result in found:
        statuses.setdefault(result.planner, set()).update(run["status"] for run in result.runs)
    return [planner for planner, each in statuses.items() if each and each <= {ERROR, CRASH}]


def by_label(found: Iterable[Result]) -> dict[str, list[Result]]:
    """Group results by label."""
    sorted_by: dict[str, list[Result]] = {}
    for result in found:
        sorted_by.setdefault(result.label, []).append(result)
    return sorted_by
