"""Inverse kinematics methods in common use, as baselines for comparison."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType

from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.ik.baselines.damped import damped_least_squares, pinocchio_iteration
from rrtik_ompl.ik.baselines.one_joint import ccd, coupled_fault, fabrik, fabrik_misfit
from rrtik_ompl.ik.baselines.pso import PARTICLES, pso, resampled_pso
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse, Method, fits_all
from rrtik_ompl.ik.numeric.restarts import MAX_ROUNDS, STARTS, Walk, restarted
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot

SUFFICIENT_STARTS = 4  # number of starts whose arrival ends a round


def _walks(walk: Walk, starts: int = STARTS, rounds: int = MAX_ROUNDS) -> Callable[[IkRequest], IkResponse]:
    return partial(restarted, walk, starts=starts, rounds=rounds)


def _uncoupled(robot: Robot, target: Target) -> str:
    del target
    return coupled_fault(robot)


BASELINES: Mapping[IkMethod, Method] = MappingProxyType(
    {
        "damped": Method(fits_all, _walks(partial(damped_least_squares, enough=SUFFICIENT_STARTS))),
        "pinocchio": Method(fits_all, _walks(pinocchio_iteration, starts=1, rounds=64)),
        "ccd": Method(_uncoupled, _walks(partial(ccd, enough=SUFFICIENT_STARTS))),
        "fabrik": Method(fabrik_misfit, _walks(partial(fabrik, enough=SUFFICIENT_STARTS))),
        "pso": Method(fits_all, _walks(pso, starts=4 * PARTICLES)),
        "pso-resampled": Method(fits_all, _walks(resampled_pso, starts=4 * PARTICLES)),
    }
)
