"""What goes into following a rail and what comes out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector

MOST_ROWS = 4096  # of one rail
FIRST_STEP = 0.05  # share of the rail
SMALLEST_STEP = 1e-6  # share of the rail: where it has to be smaller, the arm cannot go on


@dataclass(frozen=True, slots=True, eq=False)
class Leaning:
    """Where what a rail leaves free is drawn.

    Attributes:
        reference: Configuration, shape (dof,).
        pull: Share of the way there for a whole rail, by joint, shape (dof,).
        homing: Whether the reference is to be reached at the end of the rail.
    """

    reference: Vector
    pull: Vector
    homing: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Tolerance:
    """How far the tip may leave a rail: ``deviation`` [m], ``turn`` [rad]."""

    deviation: float
    turn: float

    @property
    def chord(self) -> float:
        """The turn as 2 sin(angle / 2)."""
        return float(2.0 * np.sin(0.5 * self.turn))


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Configurations along a rail, shape (k, dof), the first one given, and the share of the rail at each, (k,)."""

    rows: Matrix
    shares: Vector

    @property
    def complete(self) -> bool:
        """Whether the end of the rail is reached."""
        return bool(self.shares[-1] >= 1.0 - SMALLEST_STEP)
