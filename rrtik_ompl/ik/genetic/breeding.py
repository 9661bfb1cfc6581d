"""One generation from another: tournament, uniform crossover of bits, mutation. Nobody survives unchanged."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.ik.genetic.genes import BITS, LARGEST, Genes
from rrtik_ompl.ik.genetic.options import GeneticOptions


def children(rng: np.random.Generator, genes: Genes, cost: Vector, options: GeneticOptions) -> Genes:
    """A new population of the same size.

    Args:
        rng: Random numbers.
        genes: Shape (population, dof).
        cost: What is to be small, shape (population,).
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
    """One winner per place in the population: the best of ``size`` individuals drawn with replacement."""
    ranks = np.empty(len(cost), dtype=np.int64)
    order = np.argsort(cost, kind="stable")
    ranks[order] = np.arange(len(cost))
    drawn = rng.integers(0, len(cost), (len(cost), size))
    winners: np.ndarray = order[ranks[drawn].min(axis=1)]
    return winners


def _flip_bits(rng: np.random.Generator, genes: Genes, rate: float) -> None:
    """Flip every bit with a probability, in place: as many bits as that gives, at places drawn without repetition."""
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
