"""Particle swarms: several at once, with velocities, or fully resampled: every particle drawn anew each time.

Sources: [29] (constriction); [30] (no velocity: a particle is drawn from the normal distribution between its own best
place and the swarm's).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot

PARTICLES = 32  # of a swarm
ITERATIONS = 400
CONSTRICTION = 0.7298  # of the motion before, with which [29] makes swarms come to rest
ATTRACTION = 1.49618  # most of the way to the own best place, and to the swarm's
ORIENTATION_WEIGHT = 0.3  # [m/rad]; with 0.1 or 1 swarms of TITAN-4 and Panda arrived half as often

Swarms: TypeAlias = NDArray[np.float64]  # shape (swarms, particles, dof)
Move: TypeAlias = Callable[[np.random.Generator, Swarms, Swarms, Swarms, Swarms], Swarms]


def pso(robot: Robot, goal: Target, starts: Matrix) -> tuple[Matrix, int]:
    """Swarms with velocities. As `swarm`."""
    return swarm(robot, goal, starts, _with_velocity)


def resampled_pso(robot: Robot, goal: Target, starts: Matrix) -> tuple[Matrix, int]:
    """Swarms without velocities, all particles drawn anew each iteration. As `swarm`."""
    return swarm(robot, goal, starts, _drawn)


def swarm(
    robot: Robot, goal: Target, starts: Matrix, move: Move, *, iterations: int = ITERATIONS
) -> tuple[Matrix, int]:
    """Let swarms search for a goal, until one of them is there.

    Args:
        robot: The arm.
        goal: A pose, or a position with any orientation.
        starts: First places, shape (m, dof); `PARTICLES` of them make a swarm. The random numbers follow from them.
        move: From random numbers, places, places before, own best places and the swarms' best to the next places.
        iterations: At most.

    Returns:
        The best place of each swarm, shape (swarms, dof), and the iterations taken.
    """
    rng = np.random.default_rng(np.frombuffer(np.ascontiguousarray(starts).tobytes(), dtype=np.uint32))
    swarms = max(1, len(starts) // PARTICLES)
    places = robot.clamp(starts[: len(starts) // swarms * swarms]).reshape(swarms, -1, robot.dof)

    places_before = places
    best_places = places
    best_costs = np.full(places.shape[:2], np.inf)
    each = np.arange(swarms)

    for iteration in range(iterations):
        cost = _cost(robot, goal, places.reshape(-1, robot.dof)).reshape(best_costs.shape)
        better = cost < best_costs
        best_places = np.where(better[..., None], places, best_places)
        best_costs = np.minimum(cost, best_costs)
        leader = best_places[each, np.argmin(best_costs, axis=1)]

        if goal.satisfied(robot, leader).any():
            return leader, iteration

        moved = robot.clamp(move(rng, places, places_before, best_places, leader[:, None]))
        places_before = places
        places = moved

    return leader, iterations


def _with_velocity(
    rng: np.random.Generator, places: Swarms, places_before: Swarms, best_places: Swarms, leader: Swarms
) -> Swarms:
    """Where particles move that have a velocity and are drawn to their own best place and to the leader's."""
    to_best, to_leader = rng.uniform(0.0, ATTRACTION, (2, *places.shape))
    moved: Swarms = (
        places
        + CONSTRICTION * (places - places_before)
        + to_best * (best_places - places)
        + to_leader * (leader - places)
    )
    return moved


def _drawn(
    rng: np.random.Generator, places: Swarms, places_before: Swarms, best_places: Swarms, leader: Swarms
) -> Swarms:
    """Where particles move that are drawn anew, about the middle of their own best place and the leader's."""
    del places_before
    drawn: Swarms = 0.5 * (best_places + leader) + np.abs(best_places - leader) * rng.standard_normal(places.shape)
    return drawn


def _cost(robot: Robot, goal: Target, Q: Matrix) -> NDArray[np.float64]:
    """Distance from the goal [m], the angle weighted, of configurations, shape (m, dof); shape (m,)."""
    distance, angle = goal.errors(robot, Q)
    return distance + ORIENTATION_WEIGHT * angle
