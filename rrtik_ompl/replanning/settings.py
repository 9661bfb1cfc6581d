"""How a robot replans: steps, ticks, distances and limits, checked once and frozen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import TAU, Vector, not_negative, positive, seed_of, whole_number
from rrtik_ompl.base.choices import Replanner, one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning.connecting import KERNELS, KernelCuts, TreeOptions
from rrtik_ompl.replanning.drrt_con import DrrtCon, FromScratch, KernelDrrtCon
from rrtik_ompl.replanning.single_tree import SingleTree
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_ompl.world.moving_world import MovingWorld

REPLANNERS: dict[Replanner, type[DrrtCon]] = {each.name: each for each in (DrrtCon, FromScratch, SingleTree)}
PLANNERS: tuple[Replanner, ...] = tuple(REPLANNERS)
MAX_RATE = 1e5  # [Hz]
# The least max_edge, as a share of the usual one. A path is checked in pieces of half max_edge, and all of them must
# fit into memory.
MIN_EDGE_SHARE = 1e-3
PREDICTED_PLACES = 3  # number of places of an obstacle that are avoided at once if its motion is predicted

_POSITIVE = {
    "step": "how far to go in a tick [rad or m]",
    "max_edge": "the longest edge of the trees [rad or m]",
    "speed_bound": "metres a second",
    "seconds": "how long the run may last",
    "repair_budget": "how long a repair may take [s]",
}
_OPTIONAL = ("max_edge", "speed_bound", "repair_budget")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReplanSettings:
    """How a robot replans.

    Attributes:
        step: How far the robot goes in a tick [rad, metres counted alike], unless its joints are too slow.
        rate: Number of ticks per second [Hz].
        planner: One of ``PLANNERS``.
        max_edge: Longest edge of the trees [unit of ``step``]; a length that suits the robot's range if None.
        margin: Distance to obstacles that is always kept [m].
        clearance: Distance to obstacles that proven motions keep in addition to ``margin`` [m]; if None, 1 mm or half
            the world's motion resolution, whichever is less. If it is given, searches keep it too.
        speed_bound: Speed that no point of an obstacle exceeds [m/s]. If one does, the run ends, with
            a ``SpeedWarning``.
        limits: Speed limits of the joints; those of the robot if None. Accelerations are not considered.
        lookahead_ticks: How many ticks ahead the motion of obstacles is predicted, by the motion that the scene states
            or else by the measured velocity. Obstacles are then avoided where they are now, where they will be then,
            and at half that time. 0 means no prediction, as published.
        seconds: Largest simulated time [s].
        repair_budget: Time that a repair may take [s]; one tick if None.
        seed: The same seed gives the same run, as long as no repair is cut short by its budget. None draws one.

    Raises:
        InputError: If a number is out of range; the message names the setting and the remedy.
        UnknownNameError: If there is no planner of that name.
    """

    step: float
    rate: float
    planner: Replanner = DrrtCon.name
    max_edge: float | None = None
    margin: float = 0.0
    clearance: float | None = None
    speed_bound: float | None = None
    limits: RateLimits | None = None
    lookahead_ticks: int = 0
    seconds: float = 60.0
    repair_budget: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.limits is not None:
            require(self.limits, RateLimits, "limits", "use RateLimits(velocity, acceleration)")

        one_of(PLANNERS, self.planner, "replanner")
        rate = positive(self.rate, "rate", "give ticks a second, such as 50")
        if rate > MAX_RATE:
            raise InputError(f"rate must be {MAX_RATE:g} Hz or less, got {rate:g}")

        checked: dict[str, float | None] = {"rate": rate}
        checked["seed"] = seed_of(self.seed)
        checked["lookahead_ticks"] = whole_number(self.lookahead_ticks, "lookahead_ticks")
        checked["margin"] = not_negative(self.margin, "margin")
        checked["clearance"] = None if self.clearance is None else not_negative(self.clearance, "clearance")
        for name, meaning in _POSITIVE.items():
            value = getattr(self, name)
            checked[name] = None if value is None and name in _OPTIONAL else positive(value, name, f"give {meaning}")

        for name, number in checked.items():
            object.__setattr__(self, name, number)

    @property
    def tick(self) -> float:
        """Length of a tick [s]."""
        return 1.0 / self.rate

    @property
    def repair_seconds(self) -> float:
        """Time that a repair may take [s]."""
        return self.tick if self.repair_budget is None else self.repair_budget

    def max_change(self, robot: Robot) -> Vector:
        """Return how far each joint of a robot can move in a tick [rad or m], shape (n,).

        Raises:
            InputError: If the limits are for another number of joints.
        """
        rates = RateLimits.of(robot) if self.limits is None else self.limits.for_joints(robot.dof)
        return rates.velocity / self.rate

    def edge_length(self, robot: Robot) -> float:
        """Return the longest edge of the trees for a robot [unit of the space].

        Raises:
            InputError: If ``max_edge`` is far too small for the robot's range.
        """
        lower = np.clip(robot.lower, -TAU, TAU)
        upper = np.clip(robot.upper, -TAU, TAU)
        usual, _ = connect_lengths(lower, upper, None, None, turning=np.ones(robot.dof, dtype=bool))
        if self.max_edge is None:
            return usual
        if self.max_edge < MIN_EDGE_SHARE * usual:
            fault = f"max_edge must be at least {MIN_EDGE_SHARE * usual:.3g}, got {self.max_edge:g}"
            raise InputError(f"{fault}; {usual:.3g} suits this robot")
        return self.max_edge


def make_planner(settings: ReplanSettings, world: MovingWorld, lower: Vector, upper: Vector) -> DrrtCon:
    """Make the replanner that the settings name, in kernels where the world has them.

    Args:
        settings: Name, seed and longest edge of the replanner.
        world: The world that checks motions.
        lower: Lower corner of the box to sample in, shape (n,).
        upper: Upper corner of the box to sample in, shape (n,).
    """
    options = TreeOptions(lower, upper, settings.edge_length(world.robot), settings.seed)
    kind = REPLANNERS[settings.planner]
    cuts = KernelCuts(world, settings.seed) if has_kernels(world, *KERNELS) else None
    if cuts is not None and kind.repairs_in_kernels:
        return KernelDrrtCon(world, options, forgetting=kind.forgetting)
    return kind.with_trees(options, cuts)
