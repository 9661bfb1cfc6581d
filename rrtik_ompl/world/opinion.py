"""Assessment of a path that another planner has found: proven, free in steps, or refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from numpy.typing import ArrayLike

from rrtik_ompl.model.path import JointPath
from rrtik_ompl.world.clearance_curve import clearance_along
from rrtik_ompl.world.problem import Problem, refuse_covered_goal
from rrtik_ompl.world.route_check import how_checked, violations_of
from rrtik_ompl.world.world import World

Said: TypeAlias = Literal["proven", "checked", "refused"]


@dataclass(frozen=True, slots=True)
class Opinion:
    """An assessment of a path.

    Attributes:
        verdict: "proven", "checked" (free in steps, but not proven) or "refused".
        text: The same as a line for a person.
    """

    verdict: Said
    text: str


def opinion_on(world: World, start: ArrayLike, goal: ArrayLike, waypoints: ArrayLike) -> Opinion:
    """Assess a path of another planner.

    Args:
        world: The world in which it has to be free.
        start: Where it has to begin, shape (dof,).
        goal: Where it has to end, shape (dof,).
        waypoints: The waypoints, shape (k, dof).

    Raises:
        InputError: If rows do not have one value per joint, or contain other things than numbers.
        ProblemError: If an end is in collision or outside the limits.
    """
    refuse_covered_goal(Problem(world, start, goal))
    path = JointPath.of(world.robot, waypoints)

    proof = world.prove(path.waypoints)
    faults = () if proof.proven else violations_of(world.checks, path.waypoints)  # a path that is proven has none
    if faults:
        return Opinion("refused", f"refused: move {faults[0].edge + 1}: {faults[0].reason}")
    if (path.start != start).any() or (path.end != goal).any():
        return Opinion("refused", "refused: the path does not lead from the start to the goal")

    text = how_checked(world.checks, path.waypoints, proof)
    if world.scene.obstacles:
        text += f"; {clearance_along(world.checks, path.waypoints)}"
    return Opinion("proven" if proof.proven else "checked", text)
