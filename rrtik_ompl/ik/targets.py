"""Targets without freedom, drawn from a goal of the tip."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import TAU
from rrtik_ompl.goal import GoalPart, PoseGoal, PositionGoal, TipGoal, parts_of
from rrtik_ompl.task_region import TaskRegion


def targets(goal: TipGoal, most: int, rng: np.random.Generator) -> list[PoseGoal | PositionGoal]:
    """Goals without freedom: the goal itself, or up to ``most`` of a region's parts, with draws where they are free."""
    parts = parts_of(goal)
    if len(parts) > most:
        parts = tuple(parts[k] for k in rng.permutation(len(parts))[:most])
    count = most if any(leaves_freedom(part) for part in parts) else len(parts)
    return [_drawn(parts[k % len(parts)], rng) for k in range(count)]


def leaves_freedom(part: GoalPart) -> bool:
    """Whether there are further targets to be drawn from it."""
    return isinstance(part, TaskRegion) and bool(part.free.any())


def _drawn(part: GoalPart, rng: np.random.Generator) -> PoseGoal | PositionGoal:
    if not isinstance(part, TaskRegion):
        return part
    (pose,) = part.poses(part.drawn(1, rng))
    any_turn = (part.bounds[3:, 1] - part.bounds[3:, 0] >= TAU).all()
    if any_turn and not part.T_w_tip.translation.any():
        return PositionGoal(pose[:3, 3], part.position_tolerance)
    return PoseGoal(pose, part.position_tolerance, part.orientation_tolerance)
