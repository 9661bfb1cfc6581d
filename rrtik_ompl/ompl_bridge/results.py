"""What a search of a planner brings back, and how a ``solve`` that could not be done is put into words."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field

from ompl import base as ob

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.ompl_bridge.inspection.graph import PlannerGraph


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """What a search brings back.

    Attributes:
        path: Start first, shape (k, n), or None if there is none.
        statistics: Plain counts of the search.
        difference: Distance from the end of the path to the goal [unit of the space]; 0 if the path is exact.
        reason: Why there is no exact path, if the search can say it.
        graph: What was grown, by :meth:`SafePlanner.grown`, if anybody wants to know.
        progress: Pairs of a time since the search began [s] and the length of the best path then; of one that improves.
    """

    path: Matrix | None
    statistics: Mapping[str, int | float] = field(default_factory=dict)
    difference: float = 0.0
    reason: str = ""
    graph: PlannerGraph | None = None
    progress: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a ``solve`` broke off.

    Attributes:
        refused: Whether the planner refused its options or what they mean for the problem: an InputError.
        summary: In one line, without the type of an InputError.
    """

    refused: bool
    summary: str


class IllPosed(Exception):
    """The problem definition gives nothing to search between."""

    def __init__(self, status: ob.PlannerStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status
        self.reason = reason


def failure_of(error: BaseException) -> Failure:
    """What an exception that left a search means."""
    if isinstance(error, InputError):
        return Failure(True, str(error))
    return Failure(False, f"{type(error).__name__}: {error}".removesuffix(": ") + _hint(error))


def _hint(error: BaseException) -> str:
    """What probably caused an exception of the bindings that does not say so."""
    if "bad_cast" not in str(error):
        return ""
    return "; a callback returned a value of the wrong type: a validity checker must return a Python bool"


def explained(error: BaseException) -> str:
    """An exception with its traceback; one of ours, which says what to do, in its line.

    Drops the frames, which would keep borrowed states of a callback alive.
    """
    known = isinstance(error, RrtikError)
    text = str(error) if known else "".join(traceback.format_exception(error)).strip() + _hint(error)

    link: BaseException | None = error
    while link is not None:
        link.__traceback__ = None
        link = link.__context__

    return text


def status_of(found: SearchResult) -> ob.PlannerStatus:
    """OMPL's word for what a search brought back."""
    if found.path is None:
        return ob.PlannerStatus.TIMEOUT
    return ob.PlannerStatus.APPROXIMATE_SOLUTION if found.difference > 0.0 else ob.PlannerStatus.EXACT_SOLUTION
