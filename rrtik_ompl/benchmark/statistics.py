"""What a campaign measured, in the figures of the reference evaluation: counts, mean, quartiles, 95 %."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from rrtik_ompl.benchmark.run import CRASH, ERROR, INVALID, SOLVED

# Name of each quantity, what to call it, its unit. Lengths are Euclidean in joint values; moves are transitions.
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
HEAVY = ("waypoints",)  # of a record; not needed for figures


class Spread(NamedTuple):
    """How a quantity is spread over runs."""

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
    """One planner on the problems of one label.

    Attributes:
        label: Problems that are reported together: a group, or one problem of a scaling family.
        planner: Its label.
        group, axis, value: As in a record.
        runs: Records without what is heavy.
    """

    label: str
    planner: str
    group: str
    axis: str
    value: float
    runs: list[dict[str, Any]] = field(default_factory=list)

    @property
    def total(self) -> int:
        """Runs."""
        return len(self.runs)

    @property
    def solved(self) -> int:
        """Runs that gave a path."""
        return sum(run["status"] in (SOLVED, INVALID) for run in self.runs)

    @property
    def valid(self) -> int:
        """Runs whose path was valid when it was checked again, densely."""
        return sum(run["status"] == SOLVED for run in self.runs)

    def values(self, quantity: str) -> list[float]:
        """Of the runs with a valid path, in the order of runs; runs that did not count this quantity are left out."""
        found = (measured(run, quantity) for run in self.runs if run["status"] == SOLVED)
        return [value for value in found if value is not None]

    def spread(self, quantity: str) -> Spread | None:
        """Over the runs with a valid path; None if there are none."""
        return spread(self.values(quantity))


def measured(record: Mapping[str, Any], quantity: str) -> float | None:
    """A quantity of a record, None if it was not counted."""
    if quantity == "total_seconds":
        return float(record["plan_seconds"] + record.get("shorten_seconds", 0.0)) if "plan_seconds" in record else None

    counts = record.get("counts", {})
    if quantity == "free_share":
        motions = counts.get("checked_motions", 0)
        return float(counts["free_motions"] / motions) if motions and "free_motions" in counts else None

    value = record.get(quantity, counts.get(quantity))
    return None if value is None else float(value)


def spread(values: Sequence[float]) -> Spread | None:
    """Figures of a list, None if it is empty."""
    if not values:
        return None
    low, q25, median, q75, p95, high = np.quantile(values, (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)).tolist()
    return Spread(float(np.mean(values)), float(np.std(values)), low, q25, median, q75, p95, high)


def results(records: Iterable[Mapping[str, Any]]) -> list[Result]:
    """Records by problems and planners, in the order in which these first appear, runs in order."""
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
    """Planners of which every run ended with an error, as with a parameter it cannot use, or ended its process."""
    statuses: dict[str, set[str]] = {}
    for result in found:
        statuses.setdefault(result.planner, set()).update(run["status"] for run in result.runs)
    return [planner for planner, each in statuses.items() if each and each <= {ERROR, CRASH}]


def by_label(found: Iterable[Result]) -> dict[str, list[Result]]:
    """Results of the same problems together."""
    sorted_by: dict[str, list[Result]] = {}
    for result in found:
        sorted_by.setdefault(result.label, []).append(result)
    return sorted_by
