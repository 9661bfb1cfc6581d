"""What can be set in the genetic algorithm, and the settings that have a name."""

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
    """Settings, those of [2] unless said otherwise.

    Attributes:
        population: Individuals, an even number.
        tournament: Individuals drawn for each parent, of which the best is taken.
        bit_mutation: Probability with which each bit is flipped.
        gene_mutation: Probability with which one bit of a gene, drawn at random, is flipped.
        window: Width of the search [rad or m] from the second point on; None searches the whole range throughout.
        gain: Of the extrapolation that places the window: 0 at the last point, 1 at its continuation along the last
            two. None: 1 for an arm with as many joints as the task has dimensions, 0 for one with more (where
            nothing would brake the motion that leaves the tip at rest).
        generations: Limit for the whole trajectory.
        stall: Generations without an improvement by 1 % after which the population is drawn anew; None: never.
        start_over: Generations without a point gained after which the trajectory begins anew; None: never.
        refined: How many of the best individuals take a damped Newton step each generation (not in [2]).
        orientation_weight: What an angle counts [m/rad] beside the distance.
        motion_weight: What the joints' motion from the last point counts [m/rad].
        largest_step: Of any joint between two points [rad or m]; individuals farther away are not taken. None: any.
        singularity_weight: What manipulability counts in favour of a posture [m]; lengths in units of the reach.
        gray: Whether genes are Gray code; natural binary if not, beside which [2] found it faster.
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
# fitted to the published counts after the fact: about two flipped bits a generation in the whole population
HISTORICAL = GeneticOptions(bit_mutation=0.0, gene_mutation=0.007, stall=1500, start_over=None)
# a little weight on motion keeps joints at rest that the target leaves free, and the extrapolation from running away
REFINED = GeneticOptions(refined=10, motion_weight=0.005)
PRESETS: Mapping[GeneticPreset, GeneticOptions] = MappingProxyType(
    {"standard": STANDARD, "historical": HISTORICAL, "refined": REFINED}
)
