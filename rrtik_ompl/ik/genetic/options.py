"""Options of the genetic algorithm, and named presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np

from rrtik_ompl.base.arrays import whole_number
from rrtik_ompl.base.choices import GeneticPreset
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import DEGREE


@dataclass(frozen=True, slots=True)
class GeneticOptions:
    """Options of the genetic algorithm; the defaults are those of [2] unless said otherwise.

    Attributes:
        population: Number of individuals, an even number.
        tournament: Number of individuals drawn for each parent, of which the best is taken.
        bit_mutation: Probability with which each bit is flipped.
        gene_mutation: Probability with which one random bit of a gene is flipped.
        window: Width of the search [rad or m] from the second point on; None searches the whole range throughout.
        gain: Gain of the extrapolation that places the window: 0 at the last point, 1 at the linear extrapolation of
            the last two. None means 1 for an arm with as many joints as the task has dimensions, and 0 for one with
            more (where nothing would brake a motion that leaves the tip at rest).
        generations: Largest number of generations for the whole trajectory.
        stall: Number of generations without an improvement by 1 % after which the population is drawn again; None for
            never.
        start_over: Number of generations without reaching a point after which the trajectory is begun again; None for
            never.
        refined: Number of the best individuals that take a damped Newton step each generation (not in [2]).
        orientation_weight: Weight of the angle in the cost [m/rad].
        motion_weight: Weight of the joints' motion from the last point in the cost [m/rad].
        largest_step: Largest motion of a joint between two points [rad or m]; individuals farther away are not taken.
            None for any.
        singularity_weight: Weight of manipulability, with lengths in units of the reach, which lowers the cost [m].
        gray: Whether genes are Gray code, which [2] found faster; natural binary otherwise.
    """

    population: int = 100
    tournament: int = 15
    bit_mutation: float = 0.01
    gene_mutation: float = 0.0
    window: float | None = 5.0 * DEGREE
    gain: float | None = None
    generations: int = 20_000
    stall: int | None = 60
    start_over: int | None = 300
    refined: int = 0
    orientation_weight: float = 0.1
    motion_weight: float = 0.0
    largest_step: float | None = None
    singularity_weight: float = 0.0
    gray: bool = True

    def __post_init__(self) -> None:
        for name in ("population", "tournament", "generations", "stall", "start_over", "refined"):
            if getattr(self, name) is not None:
                whole_number(getattr(self, name), f"genetic: {name}", least=name != "refined")

        if self.population < 2 or self.population % 2:
            raise InputError(f"genetic: population must be an even number of at least 2, got {self.population}")
        if not 0 <= self.refined <= self.population:
            raise InputError(f"genetic: refined must lie between 0 and the population, got {self.refined}")

        for name in ("window", "largest_step"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError(f"genetic: {name} must be greater than 0, got {value}")
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise InputError(f"genetic: {field.name} must be finite and not negative, got {value}")
        for name in ("bit_mutation", "gene_mutation"):
            if getattr(self, name) > 1.0:
                raise InputError(f"genetic: {name} is a probability, at most 1, got {getattr(self, name)}")


STANDARD = GeneticOptions()
# Fitted to the published counts afterwards: about two bits are flipped per generation in the whole population.
HISTORICAL = GeneticOptions(bit_mutation=0.0, gene_mutation=0.007, stall=1500, start_over=None)
# A small weight on motion keeps joints at rest that the target leaves free, and keeps the extrapolation stable.
REFINED = GeneticOptions(refined=10, motion_weight=0.005)
PRESETS: Mapping[GeneticPreset, GeneticOptions] = MappingProxyType(
    {"standard": STANDARD, "historical": HISTORICAL, "refined": REFINED}
)
