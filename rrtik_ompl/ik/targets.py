"""Targets without freedom, drawn from a goal of the tip."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix
from rrtik_ompl.model.goal import GoalPart, PoseGoal, PositionGoal, Target, TipGoal
from rrtik_ompl.model.task_region import TaskRegion, displacements


def targets(goal: TipGoal, max_count: int, rng: np.random.Generator) -> list[Target]:
    """Goals without freedom: the goal itself, or at most ``max_count``, drawn of its parts where they leave freedom."""
    parts, coordinates = _drawn(goal, max_count, rng)
    places = iter(displacements(coordinates))
    return [part if isinstance(part, Target) else _target(part.region(), next(places)) for part in parts]


def skip_targets(goal: TipGoal, max_count: int, rng: np.random.Generator) -> None:
    """Draw the random numbers of :func:`targets`, and make nothing of them."""
    _drawn(goal, max_count, rng)


def leaves_freedom(part: GoalPart) -> bool:
    """Whether there are further targets to be drawn from it."""
    return part.freedom is not None and bool(part.freedom.free.any())


def _drawn(goal: TipGoal, max_count: int, rng: np.random.Generator) -> tuple[list[GoalPart], Matrix]:
    """The parts of which targets are made, and for each region among them a displacement, shape (regions, 6)."""
    parts = goal.parts
    if len(parts) > max_count:
        parts = tuple(parts[k] for k in rng.permutation(len(parts))[:max_count])
    goal_leaves_freedom = any(leaves_freedom(part) for part in parts)
    count = max_count if goal_leaves_freedom else len(parts)
    drawn = [parts[k % len(parts)] for k in range(count)]
    bounds = np.array([part.freedom.bounds for part in drawn if part.freedom is not None]).reshape(-1, 6, 2)
    return drawn, rng.uniform(bounds[..., 0], bounds[..., 1])


def _target(part: TaskRegion, displacement: Matrix) -> Target:
    """The goal without freedom that a displacement of a region is, shape (4, 4)."""
    pose = part.T_world_w.homogeneous @ displacement @ part.T_w_tip.homogeneous
    any_turn = (part.bounds[3:, 1] - part.bounds[3:, 0] >= TAU).all()
    if any_turn and not part.T_w_tip.translation.any():
        return PositionGoal(pose[:3, 3], part.position_tolerance)
    return PoseGoal(pose, part.position_tolerance, part.orientation_tolerance)
