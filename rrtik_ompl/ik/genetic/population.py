"""A population of chromosomes, the window of joint values that they encode, and how a generation follows another.

A chromosome has 16 bits for each joint, in Gray code or natural binary. Source: [2], equation 1. Every chromosome is a
configuration inside its window, so that limits need no penalty. The steps are a tournament, uniform crossover of bits,
and mutation; there is no elitism.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.genetic.options import GeneticOptions
from rrtik_ompl.model.robot import Robot

BITS = 16
LARGEST = 2**BITS - 1

Genes: TypeAlias = NDArray[np.uint16]  # shape (population, dof)


def to_gray(numbers: Genes) -> Genes:
    """Return the Gray codes of numbers, in which neighbouring numbers differ in one bit; any shape."""
    codes: Genes = numbers ^ np.right_shift(numbers, 1, dtype=np.uint16)
    return codes


def from_gray(codes: Genes) -> Genes:
    """Return the numbers of Gray codes, the inverse of `to_gray`; any shape.

    Bit k of a number is the parity of the code's bits from k on.
    """
    numbers: Genes = codes
    for shift in (8, 4, 2, 1):
        numbers = numbers ^ np.right_shift(numbers, shift, dtype=np.uint16)
    return numbers


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """The box of joint values that chromosomes encode.

    Attributes:
        centre: Centre of the box [rad or m], shape (dof,).
        width: Widths of the box [rad or m], shape (dof,).
        gray: Whether the genes are Gray code; natural binary otherwise.
    """

    centre: Vector
    width: Vector
    gray: bool = True

    def decode(self, genes: Genes) -> Matrix:
        """Return the configurations of chromosomes, shape (population, dof)."""
        numbers = from_gray(genes) if self.gray else genes
        q: Matrix = self.centre + (numbers / LARGEST - 0.5) * self.width
        return q

    def encode(self, Q: Matrix) -> Genes:
        """Return chromosomes nearest to configurations, shape (m, dof); values outside are clipped to the window."""
        share = (Q - self.centre) / np.where(self.width > 0.0, self.width, 1.0) + 0.5
        numbers = np.round(np.clip(share, 0.0, 1.0) * LARGEST).astype(np.uint16)
        return to_gray(numbers) if self.gray else numbers


def whole_range(robot: Robot, *, gray: bool = True) -> Window:
    """Return the window of all values inside the limits; one turn for a joint without limits."""
    lower, upper = robot.finite_range()
    return Window(0.5 * (lower + upper), upper - lower, gray)


def around(robot: Robot, centre: Vector, width: float, *, gray: bool = True) -> Window:
    """Return a window of a width [rad or m] around a configuration, moved inside the limits and no wider than these."""
    widths = np.minimum(width, robot.upper - robot.lower)
    return Window(np.clip(centre, robot.lower + 0.5 * widths, robot.upper - 0.5 * widths), widths, gray)


def random_genes(rng: np.random.Generator, population: int, dof: int) -> Genes:
    """Return chromosomes drawn uniformly, shape (population, dof)."""
    return rng.integers(0, LARGEST + 1, (population, dof), dtype=np.uint16)


def children(rng: np.random.Generator, genes: Genes, cost: Vector, options: GeneticOptions) -> Genes:
    """Breed a new population of the same size.

    Args:
        rng: Source of random numbers.
        genes: The population, shape (population, dof).
        cost: Costs of the individuals, shape (population,).
        options: Size of the tournament and rates of mutation.
    """
    parents = genes[_winners(rng, cost, options.tournament)]

    half = len(genes) // 2
    mother = parents[:half]
    father = parents[half:]
    exchange = rng.integers(0, LARGEST + 1, mother.shape, dtype=np.uint16) & (mother ^ father)
    brood = np.concatenate([mother ^ exchange, father ^ exchange])

    if options.bit_mutation:
        _flip_bits(rng, brood, options.bit_mutation)
    if options.gene_mutation:
        _flip_genes(rng, brood, options.gene_mutation)

    return brood


def _winners(rng: np.random.Generator, cost: Vector, size: int) -> np.ndarray:
    """Return indices of tournament winners, as many as individuals: each the best of ``size`` random individuals."""
    ranks = np.empty(len(cost), dtype=np.int64)
    order = np.argsort(cost, kind="stable")
    ranks[order] = np.arange(len(cost))
    drawn = rng.integers(0, len(cost), (len(cost), size))
    winners: np.ndarray = order[ranks[drawn].min(axis=1)]
    return winners


def _flip_bits(rng: np.random.Generator, genes: Genes, rate: float) -> None:
    """Flip every bit with a probability, in place: draw the number of flips, then different places for them."""
    bits = genes.size * BITS
    places = rng.choice(bits, rng.binomial(bits, rate), replace=False, shuffle=False)
    np.bitwise_xor.at(genes.reshape(-1), places // BITS, _bit(places % BITS))


def _flip_genes(rng: np.random.Generator, genes: Genes, rate: float) -> None:
    """Flip one random bit of every gene with a probability, in place."""
    flipped = np.flatnonzero(rng.random(genes.size) < rate)
    genes.reshape(-1)[flipped] ^= _bit(rng.integers(0, BITS, len(flipped)))


def _bit(places: np.ndarray) -> Genes:
    bits: Genes = np.left_shift(1, places).astype(np.uint16)
    return bits
