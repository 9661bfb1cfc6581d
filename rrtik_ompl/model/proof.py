"""What is proven of the motions of a path, and where it is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.certificate import Certificate

NOWHERE = partial(float, "nan")


@dataclass(frozen=True, slots=True)
class Gap:
    """A place on a motion that is not proven free.

    Attributes:
        motion: Number of the motion.
        share: Where on it, from 0 at its start to 1 at its end; nan if the whole motion was not looked at.
        first, second: Names of the two bodies that are not proven apart. Without a second one, the first says what else
            is wrong; both are "" if there was no time to look.
    """

    motion: int
    share: float
    first: str
    second: str
    _measure: Callable[[], float] = field(default=NOWHERE, repr=False, compare=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return Gap, (self.motion, self.share, self.first, self.second, partial(float, self.distance))

    @property
    def pair(self) -> tuple[str, str]:
        """Names of the two bodies."""
        return self.first, self.second

    @property
    def distance(self) -> float:
        """How far the two are apart at that place, as coal measures it [m]; nan where there is no place or pair."""
        return self._measure()

    def __str__(self) -> str:
        if not self.second:
            return f"motion {self.motion}: {self.first or 'not looked at'}"
        text = f"motion {self.motion} at {self.share:.4f} of it: '{self.first}' and '{self.second}'"
        distance = self.distance
        return f"{text}, {1e3 * distance:.4g} mm apart" if distance >= 0.0 else text


class Maker(Protocol):
    """What has made a proof. It is asked again for what takes too long to be said with every proof."""

    @property
    def digest(self) -> str:
        """Of the geometry that its proofs are about."""

    def certificate(self, rows: Matrix, clearance: float) -> Certificate | None:
        """By what motions between waypoints, shape (k, dof), keep a clearance [m]; None if one of them does not."""


@dataclass(frozen=True, slots=True)
class Proof:
    """What is proven of the motions between waypoints.

    Attributes:
        motions: How many there are.
        clearance: What each keeps from every obstacle beside its margin [m].
        unproven: The places that are not proven, at most one of each motion.
        margin: The least margin of the obstacles [m]; every obstacle's own is kept.
        maker: What made it; None in another process.
    """

    motions: int
    clearance: float
    unproven: tuple[Gap, ...]
    margin: float = 0.0
    _digest: str = field(default="", repr=False, compare=False)
    maker: Maker | None = field(default=None, repr=False, compare=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return Proof, (self.motions, self.clearance, self.unproven, self.margin, self.digest)

    @property
    def digest(self) -> str:
        """Of the robot's and the scene's geometry that the motions are proven for: 32 digits in hexadecimal."""
        return self._digest if self.maker is None else self.maker.digest

    @property
    def proven(self) -> bool:
        """Whether every motion is proven free."""
        return not self.unproven


def certificate_by(proof: Proof | None, waypoints: Matrix) -> Certificate:
    """Return the certificate of a path, waypoints of shape (k, dof), for what is proven of it already.

    Raises:
        InputError: If that does not cover the path or was made by another process, or the scene has a cloud.
    """
    if proof is None:
        raise InputError("path to save with its proof: it has none; use path.proved(world)")
    if not proof.proven:
        raise InputError(f"path to save with its proof: it is not proven free: {proof.unproven[0]}")
    if proof.maker is None or (found := proof.maker.certificate(waypoints, proof.clearance)) is None:
        raise InputError("path to save with its proof: planes do not prove it here; use path.proved(world)")
    return found
