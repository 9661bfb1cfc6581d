"""What a run keeps to, checked: steps, ticks, distances and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.arrays import TAU, Vector, finite_array, positive, whole_number
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.fast.search.connect_lengths import connect_lengths
from rrtik_ompl.replanning.connecting import KERNELS, KernelCuts, PlainConnect
from rrtik_ompl.replanning.drrt_con import DrrtCon, FromScratch
from rrtik_ompl.replanning.kernel_drrt_con import KernelDrrtCon
from rrtik_ompl.replanning.single_tree import SingleTree
from rrtik_ompl.robot import Robot
from rrtik_ompl.trajectory.limits import RateLimits
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_ompl.world.moving_world import MovingWorld

PLANNERS = ("drrt-con", "rrt-connect", "drrt")
FASTEST = 1e5  # [Hz]
SHORTEST = 1e-3  # of the usual eps: a path is looked at in pieces of half of it, which must fit into memory
COPIES = 3  # places of an obstacle that are heeded at once where its motion is predicted


@dataclass(frozen=True, slots=True, eq=False)
class Settings:
    """See :func:`rrtik_ompl.replanning.replan`.

    Attributes:
        most: How far each joint can move in a tick [rad or m], shape (n,).
    """

    step: float
    rate: float
    planner: str
    eps: float
    margin: float
    speed_bound: float | None
    most: Vector
    predict: int
    seconds: float
    slot: float
    seed: int

    @property
    def tick(self) -> float:
        """Length of a tick [s]."""
        return 1.0 / self.rate


def settings(
    robot: Robot,
    *,
    step: float,
    rate: float,
    planner: str,
    eps: float | None,
    margin: float,
    speed_bound: float | None,
    limits: RateLimits | None,
    predict: int,
    seconds: float,
    slot: float | None,
    seed: int,
) -> Settings:
    """Check what a caller asks for.

    Raises:
        InputError: If a number is out of range; it names the argument and the remedy.
        UnknownNameError: If there is no planner of that name.
    """
    if planner not in PLANNERS:
        raise UnknownNameError("replanner", str(planner), PLANNERS)
    frequency = positive(rate, "rate", "give ticks a second, such as 50")
    if frequency > FASTEST:
        raise InputError(f"rate must be {FASTEST:g} Hz or less, got {frequency:g}")
    for value, name in ((predict, "predict"), (seed, "seed")):
        whole_number(value, name)
    distance = float(finite_array(margin, (), "margin"))
    if distance < 0.0:
        raise InputError(f"margin must not be negative, got {distance:g} m")
    rates = RateLimits.of(robot) if limits is None else limits.for_joints(robot.dof)
    lower, upper = (np.clip(ends, -TAU, TAU) for ends in (robot.lower, robot.upper))
    usual, _ = connect_lengths(lower, upper, None, None)
    return Settings(
        step=positive(step, "step", "give how far to go in a tick [rad or m]"),
        rate=frequency,
        planner=planner,
        eps=usual if eps is None else _long_enough(eps, usual),
        margin=distance,
        speed_bound=None if speed_bound is None else positive(speed_bound, "speed_bound", "give metres a second"),
        most=rates.velocity / frequency,
        predict=int(predict),
        seconds=positive(seconds, "seconds", "give how long the run may last"),
        slot=1.0 / frequency if slot is None else positive(slot, "slot", "give how long a repair may take [s]"),
        seed=int(seed),
    )


def planner_of(chosen: Settings, world: MovingWorld, lower: Vector, upper: Vector) -> DrrtCon:
    """The replanner of the name, for a world and a box of configurations to sample in."""
    if chosen.planner == SingleTree.name:
        post = KernelCuts(world, chosen.seed) if has_kernels(world, *KERNELS) else None
        return SingleTree(lower, upper, chosen.eps, chosen.seed, post=post)
    forgetting, in_kernels = chosen.planner == FromScratch.name, has_kernels(world, *KERNELS)
    if in_kernels:
        return KernelDrrtCon(world, lower, upper, chosen.eps, chosen.seed, forgetting=forgetting)
    kind = FromScratch if forgetting else DrrtCon
    return kind(PlainConnect(lower, upper, chosen.eps, chosen.seed), chosen.eps)


def _long_enough(eps: float, usual: float) -> float:
    number = positive(eps, "eps", "give the longest motion of the trees [rad or m]")
    if number < SHORTEST * usual:
        raise InputError(f"eps must be at least {SHORTEST * usual:.3g}, got {number:g}; {usual:.3g} suits this robot")
    return number
