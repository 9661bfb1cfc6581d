"""Chromosomes: 16 bits a joint, Gray code or natural binary, and the window of joint values that they encode.

Source: [2], equation 1. Every chromosome is a configuration inside its window, so that limits need no penalty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.robot import Robot

BITS = 16
LARGEST = 2**BITS - 1

Genes: TypeAlias = NDArray[np.uint16]  # shape (population, dof)


def to_gray(numbers: Genes) -> Genes:
    """Gray code of numbers: neighbours differ in one bit. Any shape."""
    codes: Genes = numbers ^ np.right_shift(numbers, 1, dtype=np.uint16)
    return codes


def from_gray(codes: Genes) -> Genes:
    """Numbers of Gray codes, the inverse of `to_gray`: bit k is the parity of the bits from k on. Any shape."""
    numbers: Genes = codes
    for shift in (8, 4, 2, 1):
        numbers = numbers ^ np.right_shift(numbers, shift, dtype=np.uint16)
    return numbers


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """The joint values among which is searched: ``centre`` and ``width`` [rad or m], shapes (dof,).

    ``gray``: whether the genes are Gray code; else natural binary.
    """

    centre: Vector
    width: Vector
    gray: bool = True

    def decode(self, genes: Genes) -> Matrix:
        """Configurations of chromosomes, shape (population, dof)."""
        numbers = from_gray(genes) if self.gray else genes
        q: Matrix = self.centre + (numbers / LARGEST - 0.5) * self.width
        return q

    def encode(self, Q: Matrix) -> Genes:
        """The chromosomes nearest to configurations, shape (m, dof); outside the window those at its edge."""
        share = (Q - self.centre) / np.where(self.width > 0.0, self.width, 1.0) + 0.5
        numbers = np.round(np.clip(share, 0.0, 1.0) * LARGEST).astype(np.uint16)
        return to_gray(numbers) if self.gray else numbers


def whole_range(robot: Robot, *, gray: bool = True) -> Window:
    """All values inside the limits; of a joint without limits one turn."""
    lower, upper = robot.finite_range()
    return Window(0.5 * (lower + upper), upper - lower, gray)


def around(robot: Robot, centre: Vector, width: float, *, gray: bool = True) -> Window:
    """A window of a width [rad or m] at a posture, moved inside the limits; at most as wide as these."""
    widths = np.minimum(width, robot.upper - robot.lower)
    return Window(np.clip(centre, robot.lower + 0.5 * widths, robot.upper - 0.5 * widths), widths, gray)


def random_genes(rng: np.random.Generator, population: int, dof: int) -> Genes:
    """Chromosomes drawn uniformly, shape (population, dof)."""
    return rng.integers(0, LARGEST + 1, (population, dof), dtype=np.uint16)
