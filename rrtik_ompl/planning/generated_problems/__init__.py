"""Generated problems for any arm: a posture to be reached, obstacles of a family around it, and a start far from it.

A problem is kept if it is worth planning: the straight motion collides, no order of moving every joint once is free,
and a path is known to exist, because a planner found one within a number of iterations (a limit of time would make the
problem depend on the machine). These planners are those whose class has the trait ``proof_iterations``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector, whole_number
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.world_settings import MOTION_RESOLUTION
from rrtik_ompl.ompl_bridge.planner_traits import planners_with
from rrtik_ompl.planning.generated_problems.families import FAMILIES, obstacles
from rrtik_ompl.planning.moves.staircase import staircase_orders
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

__all__ = ["FAMILIES", "generated_problem"]

POSTURES = 512  # drawn at a time
DRAWS = 300  # of scenes, before a seed is given up
SPACE_PER_DRAW = 0.01  # more room with every draw
STARTS = 2  # tried in a scene
MIN_DISTANCE, MAX_DISTANCE = 0.4, 0.85  # of a goal's tip from the base, in reaches
MIN_HEIGHT = -0.25  # of a goal's tip above the base, in reaches
AWAY = 0.3  # the tip's least distance between start and goal, in reaches
OUTWARD = 0.3  # cosine of the forearm's angle to the way out, at least
PATIENCE = 60.0  # [s], never used up


def generated_problem(robot: Robot, family: str, seed: int, *, motion_resolution: float = MOTION_RESOLUTION) -> Problem:
    """A problem that has a solution and is not trivial; the same arguments give the same problem.

    Args:
        robot: Any arm.
        family: One of FAMILIES: panel, pipes, frame, slot_along, slot_across, clutter.
        seed: Number of the problem in its family, at least 0.
        motion_resolution: Of its world [m].

    Raises:
        UnknownNameError: If there is no such family.
        InputError: If the seed is negative, or nothing solvable turned up for this arm and seed.
    """
    require(robot, Robot, "robot of a generated problem", "use load_robot(name or file)")
    if family not in FAMILIES:
        raise UnknownNameError("family of generated problems", str(family), FAMILIES)
    whole_number(seed, "seed")

    rng = np.random.default_rng([list(FAMILIES).index(family), int(seed)])
    empty_world = World(robot)
    reach = _reach(robot)
    goals = _goals(empty_world, reach, rng)

    for number in range(DRAWS):
        goal, place = next(goals)
        scene = Scene(obstacles(family, rng, place, reach, 1.0 + SPACE_PER_DRAW * number))
        world = World(robot, scene, motion_resolution=motion_resolution)

        for start in _starts(world, goal, reach, rng):
            problem = Problem(world, start, goal, name=f"{robot.name}/{family}/{seed}")
            if _solvable(problem):
                return problem

    raise InputError(f"{family} {seed}: none of {DRAWS} scenes for robot '{robot.name}' is solvable; take another seed")


def _reach(robot: Robot) -> float:
    """The farthest tip of many random postures from the base [m]."""
    tips = robot.fk_batch(_postures(robot, 4 * POSTURES, np.random.default_rng(0)))[:, :3, 3]
    return float(np.linalg.norm(tips - _base(robot), axis=1).max())


def _base(robot: Robot) -> Vector:
    """Where the first joint is."""
    place: Vector = robot.joint_frames(np.zeros(robot.dof))[0, 1, :3, 3]
    return place


def _postures(robot: Robot, count: int, rng: np.random.Generator) -> Matrix:
    """Random configurations within half a turn of zero and within the limits, shape (count, dof)."""
    lower, upper = robot.finite_range()
    turning = ~robot.prismatic & (lower < np.pi) & (upper > -np.pi)
    lower = np.where(turning, np.maximum(lower, -np.pi), lower)
    upper = np.where(turning, np.minimum(upper, np.pi), upper)
    return np.asarray(rng.uniform(lower, upper, (count, robot.dof)))


def _goals(empty_world: World, reach: float, rng: np.random.Generator) -> Iterator[tuple[Vector, Any]]:
    """Postures in which the forearm points outwards, and the place of the tip; see the families. Without end."""
    robot = empty_world.robot
    base = _base(robot)
    while True:
        rows = _postures(robot, POSTURES, rng)
        rows = rows[empty_world.valid_batch(rows)]

        frames = robot.joint_frames(rows)
        tips = robot.fk_batch(rows)[:, :3, 3]
        elbow = frames[:, (len(robot.chain.parent) + 1) // 2, :3, 3]
        outwards = tips - base

        for row, tip, joint, outward, axis in zip(rows, tips, elbow, outwards, frames[:, 1, :3, 2], strict=True):
            forearm = tip - joint
            distance = float(np.linalg.norm(outward))
            length = np.linalg.norm(forearm)
            is_in_range = MIN_DISTANCE * reach < distance < MAX_DISTANCE * reach and outward[2] > MIN_HEIGHT * reach
            if is_in_range and length > 1e-3 * reach and forearm @ outward > OUTWARD * distance * length:
                yield row, pin.SE3(_axes(forearm, axis), tip)


def _axes(forward: Vector, upward: Vector) -> Matrix:
    """Axes of a place: x forward, z as near as can be to upward (to anything else if that lies forward too)."""
    x = forward / np.linalg.norm(forward)
    if np.linalg.norm(np.cross(upward, x)) < 0.1:
        upward = np.eye(3)[int(np.abs(x).argmin())]
    y = np.cross(upward, x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _starts(world: World, goal: Vector, reach: float, rng: np.random.Generator) -> list[Vector]:
    """Free configurations far from the goal from which no easy motion leads there; none if the goal is not free."""
    if not world.valid(goal) or not world.certify(goal[None])[0]:
        return []
    rows = _postures(world.robot, POSTURES, rng)
    tips = world.robot.fk_batch(rows)[:, :3, 3]
    target = world.robot.fk(goal).translation

    rows = rows[np.linalg.norm(tips - target, axis=1) > AWAY * reach]
    rows = rows[world.valid_batch(rows) & world.certify(rows)]
    rows = rows[~world.motion_valid_batch(rows, np.repeat(goal[None], len(rows), axis=0))]
    return [row for row in rows[:STARTS] if not staircase_orders(row, goal, world.motion_valid_batch)]


def _solvable(problem: Problem) -> bool:
    """Whether one of the planners that prove it finds a path."""
    return any(
        plan(
            problem,
            name,
            seconds=PATIENCE,
            seed=0,
            restarts=0,
            parameters={"max_iterations": max_iterations},
            proof="off",
        ).found
        for name, max_iterations in _proofs()
    )


@cache
def _proofs() -> tuple[tuple[str, int], ...]:
    """The planners that prove that a problem has a solution, and their iterations; the most first.

    Raises:
        InputError: If no package offers one.
    """
    found = planners_with(lambda traits: traits.proof_iterations)
    if not found:
        raise InputError("generated problems: no installed planner has proof_iterations; install rrtik-ompl whole")
    stated = ((name, traits.proof_iterations) for name, traits in found.items())
    return tuple(sorted(stated, key=lambda each: each[1], reverse=True))
