"""What a world says of a path or a motion, as values; and what may be asked to say it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot

TOUCHING = 1e-6  # [m] of overlap, below which bodies only touch: coal tells no less
FARTHEST = 2.0  # [m] of clearances that are told apart


@dataclass(frozen=True, slots=True, eq=False)
class Violation:
    """Why a path is not valid.

    Attributes:
        edge: Number of the edge, from 0; waypoint ``edge`` is its beginning.
        q: The offending configuration, shape (n,).
        reason: A line for a person: the pair in collision, or the joint and its limit.
    """

    edge: int
    q: Vector
    reason: str

    __reduce__ = as_value


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Two bodies that touch or are nearer than they may be, or the two that are nearest to that.

    Attributes:
        first, second: Names of link, obstacle or attached object.
        distance: Signed distance [m]: positive is a gap, negative a penetration depth.
        point_first, point_second: Witness points in the world [m], shape (3,).
        margin: Distance that must be kept between the two [m]; negative is a depth to which they may overlap.
    """

    first: str
    second: str
    distance: float
    point_first: Vector
    point_second: Vector
    margin: float = 0.0

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def clearance(self) -> float:
        """The distance less the margin [m]; what is not above 0 is not allowed."""
        return self.distance - self.margin

    def __str__(self) -> str:
        pair = f"'{self.first}' and '{self.second}'"
        if self.margin < self.distance < 0.0:
            return f"{pair} overlap by {-1e3 * self.distance:.3g} mm, and may by {-1e3 * self.margin:.3g} mm"
        if self.distance > self.margin:
            return f"{pair} are {1e3 * self.distance:.4g} mm apart"
        if self.distance > 0.0:
            return f"{pair} are {1e3 * self.distance:.4g} mm apart, within the margin of {1e3 * self.margin:.4g} mm"

        known = np.isfinite(self.point_first).all()
        if known and abs(self.distance) < TOUCHING:
            return f"{pair} touch"
        return f"{pair} overlap{f' by {1e3 * abs(self.distance):.3g} mm' if known else ''}"


@dataclass(frozen=True, slots=True, eq=False)
class PathContact:
    """A stretch of a path in which the same bodies touch, or are nearer than their margins allow.

    Attributes:
        begin, end: Where it begins and ends: number of the motion plus the share of it.
        deepest: The worst contact of it.
        names: Of all bodies that touch.
    """

    begin: float
    end: float
    deepest: Contact
    names: frozenset[str]


@dataclass(frozen=True, slots=True, eq=False)
class ClearanceCurve:
    """Distances from obstacles beyond their margins, at places along a path; proven, so the true ones are not smaller.

    Attributes:
        motions: Number of the motion that each place is on, shape (m,).
        shares: Where on it, from 0 to 1, shape (m,).
        distances: Shape (m,) [m]; ``FARTHEST`` if no obstacle is nearer, 0 if not even that is proven.
        pairs: Names of the two nearest bodies at each place; ("", "") if none is near.
        unproven: Numbers of the motions that are not proven free.
    """

    motions: NDArray[np.int64]
    shares: Vector
    distances: Vector
    pairs: tuple[tuple[str, str], ...]
    unproven: tuple[int, ...]

    __reduce__ = as_value

    @property
    def least(self) -> int:
        """Number of the place where the arm is nearest to an obstacle."""
        return int(self.distances.argmin())

    def __str__(self) -> str:
        k = self.least
        if self.distances[k] >= FARTHEST:
            return f"no obstacle within {FARTHEST:g} m"

        where = f"motion {self.motions[k] + 1} at {100.0 * self.shares[k]:.0f} % of it"
        return (
            f"least clearance {1e3 * self.distances[k]:.3g} mm, {where}: '{self.pairs[k][0]}' and '{self.pairs[k][1]}'"
        )


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a motion is proven free.

    Attributes:
        proven: All of it.
        text: The same for a person, in one line; with ``doubt`` what follows it.
        unproven: Numbers of the moves that are drawn on which it is not.
        doubt: How much is not proven, for a person, where that is told by the moves that are drawn; or "".
    """

    proven: bool
    text: str
    unproven: tuple[int, ...] = ()
    doubt: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A verdict with its pictures.

    Attributes:
        verdict: The verdict.
        curve: How far the motion stays from obstacles; None if none is near, or nothing is known of them.
        contacts: Where bodies touch.
    """

    verdict: Verdict
    curve: ClearanceCurve | None
    contacts: tuple[PathContact, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A motion as a picture plays it: all that a viewer is given of it.

    Attributes:
        waypoints: The configurations that are drawn, shape (k, dof).
        times: When each is reached [s], shape (k,); None for a path, which has no times.
        judged: What is said of it, by the moves between these configurations; None where there is no world for it.
    """

    waypoints: Matrix
    times: Vector | None
    judged: Judged | None

    __reduce__ = as_value


class Judge(ABC):
    """What a path asks about itself: a :class:`rrtik_ompl.World`, which is the only one.

    A value knows no engine, so that the methods of a path that need one hand the question on to what they are given.
    """

    @property
    @abstractmethod
    def robot(self) -> Robot:
        """Whose paths are judged."""

    @abstractmethod
    def violations(self, waypoints: ArrayLike, *, resolution: float | None = None) -> tuple[Violation, ...]:
        """Return the first violation of each motion between waypoints, shape (k, dof), that has one."""

    @abstractmethod
    def prove(
        self,
        waypoints: ArrayLike,
        *,
        clearance: float | None = None,
        slack: float = 0.0,
        seconds: float | None = None,
    ) -> Proof:
        """What is proven of the motions between waypoints, shape (k, dof)."""

    @abstractmethod
    def has_proven(self, proof: Proof) -> bool:
        """Check whether a proof covers every motion, keeps what has to be kept here, and was made here."""

    @abstractmethod
    def judged(self, waypoints: ArrayLike) -> Judged:
        """What is said of a path, waypoints of shape (k, dof), where it is drawn."""


def require_judge(world: object, what: str, *others: str) -> None:
    """Refuse what is no world; ``others`` names what else it may be, for the message.

    Raises:
        InputError: It says what was given.
    """
    if not isinstance(world, Judge):
        raise InputError(f"{what} must be of type {' or '.join(['World', *others])}, got {type(world).__name__}")
