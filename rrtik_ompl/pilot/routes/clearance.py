"""The clearance of free motions, what of it is proven, and whether they stay free if moves end with small errors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.world.world import World

FARTHEST = 256  # [mm] of a proven clearance; what is farther away is not near
CLEARANCE_ERROR = 0.002  # [m]; the least distance that is found is at most this much too large


def closest_pair(world: World, rows: Matrix) -> Contact | None:
    """The pair that is nearest to its margin or to contact at some free configuration; None if nothing can collide.

    Few rows have to be measured. The next one is that with the lowest bound from the rows before it: two bodies
    approach each other by no more than twice the bound on the arm's displacement (``World.weights``).

    Args:
        world: Robot and surroundings.
        rows: Configurations that are free, shape (m, dof), m > 0.
    """
    lower_bounds = np.full(len(rows), -np.inf)
    best = None
    while True:
        row = int(np.argmin(lower_bounds))
        if best is not None and lower_bounds[row] >= best.clearance - CLEARANCE_ERROR:
            return best

        closest = world.closest(rows[row], known_free=True)
        if closest is None:
            return None
        if best is None or closest.clearance < best.clearance:
            best = closest

        lower_bounds = np.maximum(lower_bounds, closest.clearance - 2.0 * np.abs(rows - rows[row]) @ world.weights)
        lower_bounds[row] = np.inf


def proven_clearance(parts: Iterable[tuple[World, Matrix]]) -> float:
    """What the motions of a route are proven to keep from every obstacle beside its margin, in whole millimetres [m].

    0 also if the motions are not proven free; +inf if everything is more than a quarter of a metre away. Obstacles that
    may be touched, as what is grasped, do not count.

    Args:
        parts: Waypoints, shape (k, dof), each with the world that they are proven in.
    """
    parts = [(world, rows) for world, rows in parts if len(rows) > 1]

    def is_proven(millimetres: int) -> bool:
        return all(world.prove(rows, clearance=1e-3 * millimetres).proven for world, rows in parts)

    if is_proven(FARTHEST):
        return float("inf")

    low = 0
    high = FARTHEST
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_proven(middle) else (low, middle)
    return 1e-3 * low


def executions(path: JointPath, slack: Vector, count: int, rng: np.random.Generator) -> Matrix:
    """Corners of a path of single-joint moves as a pilot makes them: every move ends with an error up to ``slack``.

    Args:
        path: One joint at a time.
        slack: Largest error of each joint, shape (dof,) [rad or m].
        count: How many executions.
        rng: For the errors, which are uniform.

    Returns:
        Shape (count, moves + 1, dof).
    """
    names = list(path.joint_names)
    moves = path.moves()

    rows = np.tile(path.start, (count, len(moves) + 1, 1))
    for number, move in enumerate(moves, start=1):
        joint = names.index(move.joint)
        errors = rng.uniform(-slack[joint], slack[joint], (count, 1))
        rows[:, number:, joint] = move.end + errors
    return rows


def forgiving(world: World) -> World:
    """The same world where what is in contact is not compared: only to count what else errors would touch."""
    scene = world.scene
    pairs = (*scene.allowed_collisions, *(contact.names for contact in scene.contacts))
    return world.with_scene(replace(scene, contacts=(), allowed_collisions=pairs)) if scene.contacts else world


def free_rows(world: World, rows: Matrix) -> NDArray[np.bool_]:
    """Which of some `executions` touch nothing; a joint that stops at its limit is no fault. Shape (count,)."""
    if rows.shape[1] < 2:
        return np.ones(len(rows), dtype=bool)

    within_limits = world.robot.clamp(rows.reshape(-1, rows.shape[-1])).reshape(rows.shape)
    starts, ends = (part.reshape(-1, rows.shape[-1]) for part in (within_limits[:, :-1], within_limits[:, 1:]))
    return np.asarray(world.motion_valid_batch(starts, ends).reshape(len(rows), -1).all(axis=1))
