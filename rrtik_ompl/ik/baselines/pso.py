"""Particle swarm optimisation, several swarms at once: with velocities, or with particles resampled in each iteration.

Sources: [29] (constriction); [30] (no velocity: a particle is drawn from a normal distribution around the middle of its
own best place and the swarm's).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot

PARTICLES = 32  # particles of a swarm
ITERATIONS = 400
CONSTRICTION = 0.7298  # factor on the last motion, with which [29] makes swarms come to rest
ATTRACTION = 1.49618  # largest factor on the way to a particle's best place, and on that to the swarm's
ORIENTATION_WEIGHT = 0.3  # [m/rad]; with 0.1 or 1 swarms of TITAN-4 and Panda arrived half as often

Swarms: TypeAlias = NDArray[np.float64]  # shape (swarms, particles, dof)
Move: TypeAlias = Callable[[np.random.Generator, Swarms, Swarms, Swarms, Swarms], Swarms]


def pso(robot: Robot, goal: Target, starts: Matrix) -> tuple[Matrix, int]:
    """Search for a goal by swarms with velocities; arguments and results are those of `swarm`."""
    return swarm(robot, goal, starts, _with_velocity)


def resampled_pso(robot: Robot, goal: Target, starts: Matrix) -> tuple[Matrix, int]:
    """Search for a goal by swarms whose particles are resampled; arguments and results are those of `swarm`."""
    return swarm(robot, goal, starts, _drawn)


def swarm(
    robot: Robot, goal: Target, starts: Matrix, move: Move, *, iterations: int = ITERATIONS
) -> tuple[Matrix, int]:
    """Let swarms search for a goal until one of them is there.

    Args:
        robot: The arm.
        goal: A pose, or a position with any orientation.
        starts: First configurations, shape (m, dof); `PARTICLES` of them make a swarm. They also seed the random
            numbers.
        move: Function from the random generator, places, places before, each particle's best places and the swarms'
            best places to the next places.
        iterations: Largest number of iterations.

    Returns:
        The best configuration of each swarm, shape (swarms, dof), and the number of iterations taken.
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
    """Return the next places of particles with a velocity that are attracted by their best place and the leader's."""
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
    """Return places drawn from a normal distribution around the middle of each particle's best place and the leader's.

    Its standard deviation is the distance between these two, joint by joint.
    """
    del places_before
    drawn: Swarms = 0.5 * (best_places + leader) + np.abs(best_places - leader) * rng.standard_normal(places.shape)
    return drawn


def _cost(robot: Robot, goal: Target, Q: Matrix) -> NDArray[np.float64]:
    """Return distance plus weighted angle from the goal [m] for configurations, shape (m, dof); shape (m,)."""
    distance, angle = goal.errors(robot, Q)
    return distance + ORIENTATION_WEIGHT * angle
