"""What every result of a search answers, whatever was searched for: whether it was found, or why not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar, runtime_checkable

from rrtik_ompl.base.errors import NotFoundError
from rrtik_ompl.model.path import JointPath

Kind = TypeVar("Kind")
Kind_co = TypeVar("Kind_co", covariant=True)


@runtime_checkable
class Result(Protocol[Kind_co]):
    """The result of a search, which may have found nothing: `Plan`, `TaskPlan`, `TipMotion`, `IkResult` and others.

    Not finding anything is a result and no error, until :meth:`require` is called. `Followed` is none of these: an arm
    that has followed a motion has searched for nothing. Where many are answered at once (`IkBatch`), ``found`` is a
    mask and every other attribute has one entry for each too.
    """

    @property
    def found(self) -> bool:
        """Whether what was asked for was found, all of it."""

    @property
    def reason(self) -> str:
        """Why it was not found; for a path that was found, what is not proven of it; "" if all is well."""

    @property
    def seconds(self) -> float:
        """Wall time that was taken [s]."""

    @property
    def statistics(self) -> Mapping[str, Any]:
        """Counts and measurements of the search, by name."""

    def require(self) -> Kind_co:
        """Return what was asked for.

        Raises:
            NotFoundError: If it was not found; the message is one line with the reason.
        """


@runtime_checkable
class PathResult(Result[Kind_co], Protocol[Kind_co]):
    """The result of a search for a motion: `Plan`, `TaskPlan`, `TipMotion`, `TimedPlan`, `ReplanRun`."""

    @property
    def path(self) -> JointPath | None:
        """The configurations through which the motion leads; None if there is none."""

    @property
    def proven(self) -> bool | None:
        """Whether the whole motion is proven free; None if there is none, or nothing was proved."""


def required(value: Kind | None, what: str, reason: str) -> Kind:
    """Return a value that was found.

    Args:
        value: The value; None if it was not found.
        what: What was not found, for the message: "no path".
        reason: Why not.

    Raises:
        NotFoundError: If it was not found.
    """
    if value is None:
        raise NotFoundError(f"{what}: {reason}" if reason else what)
    return value
