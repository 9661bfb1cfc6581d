"""What the joints between base and tip can do: their levers, and whether a pose of the tip leaves them freedom."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.planning.tip_motion.values import Leaning

POSE_JOINTS = 6  # with more of them a pose leaves some freedom
CENTRING = 2.0  # how much of its way to the middle of its limits a joint is drawn over a rail, if it is free


@lru_cache(maxsize=64)
def levers_of(robot: Robot) -> Vector:
    """How far the tip is from each joint between it and the base at most [m], shape (joints,): offsets in a row."""
    tip = tip_columns(robot)
    lengths = np.linalg.norm(tip.fixed[1:, :3, 3], axis=1)
    lower, upper = (np.where(np.isfinite(x), x, 0.0) for x in (robot.lower, robot.upper))
    strokes = np.abs(tip.gain) @ np.maximum(np.abs(lower), np.abs(upper)) + np.abs(tip.offset)
    return frozen(np.cumsum((lengths + np.where(tip.prismatic, strokes, 0.0))[::-1])[::-1])


@lru_cache(maxsize=64)
def moving_the_tip(robot: Robot) -> tuple[int, ...]:
    """Numbers of the joints of q that move the tip."""
    return tuple(np.flatnonzero((tip_columns(robot).gain != 0.0).any(axis=0)).tolist())


@lru_cache(maxsize=64)
def redundant(robot: Robot) -> bool:
    """Whether a pose of the tip leaves the joints some freedom."""
    return len(moving_the_tip(robot)) > POSE_JOINTS


@lru_cache(maxsize=64)
def centred(robot: Robot) -> Leaning:
    """Away from the limits, where the rail leaves that free [60]."""
    bounded = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    low, high = robot.finite_range()
    pull = np.zeros(robot.dof)
    if redundant(robot):
        pull[list(moving_the_tip(robot))] = CENTRING
    return Leaning(frozen(0.5 * (low + high)), frozen(np.where(bounded, pull, 0.0)))
