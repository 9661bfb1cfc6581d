"""A tip that follows a rail, in numpy: the reference implementation of :mod:`rrtik_ompl.kernels.ik.rail_kernels`."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.reference_descent import LARGEST_STEP, PER_CHORD
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.kernels.ik.rail_layout import (
    ARRIVED,
    DAMPING,
    LARGEST_CHANGE,
    LARGEST_GROWTH,
    NEWTON_STEPS,
    REMAINDER,
    ROOM,
    SMALLEST_SHRINKING,
)
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.tip_distance import reach_of
from rrtik_ompl.planning.tip_motion.freedom import levers_of, redundant
from rrtik_ompl.planning.tip_motion.rails import Rail
from rrtik_ompl.planning.tip_motion.values import FIRST_STEP, MOST_ROWS, SMALLEST_STEP, Followed, Leaning, Tolerance


def follow_plainly(robot: Robot, rail: Rail, q: Vector, tolerance: Tolerance, leaning: Leaning) -> Followed:
    """Follow a rail from a configuration at its beginning, shape (dof,), until its end or as far as possible."""
    rows = [robot.clamp(q)]
    shares = [0.0]
    step = FIRST_STEP
    while shares[-1] < 1.0 - SMALLEST_STEP and len(rows) < MOST_ROWS and step >= SMALLEST_STEP:
        share_left = 1.0 - shares[-1]
        tried_step = share_left if step >= share_left - SMALLEST_STEP else step
        trial = _correct(
            robot, rail, shares[-1] + tried_step, _guess(robot, rows, shares, tried_step, leaning), tolerance
        )
        deviation = (
            np.inf
            if trial is None
            else _deviation_bound(robot, rail, rows[-1], trial, (shares[-1], tried_step), tolerance)
        )

        if trial is not None and deviation <= 1.0 - ROOM:
            rows.append(trial)
            shares.append(shares[-1] + tried_step)
        change = 0.9 / np.sqrt(deviation) if deviation > 0.0 else LARGEST_GROWTH
        step = tried_step * min(max(change, SMALLEST_SHRINKING), LARGEST_GROWTH)
    return Followed(np.array(rows), np.array(shares))


def _guess(robot: Robot, rows: list[Vector], shares: list[float], step: float, leaning: Leaning) -> Vector:
    """The configuration with which a step begins."""
    share = step / (1.0 - shares[-1]) if leaning.homing else step
    guess = rows[-1] + share * leaning.pull * (leaning.reference - rows[-1])
    if len(rows) > 1 and not redundant(robot):
        guess = guess + step / (shares[-1] - shares[-2]) * (rows[-1] - rows[-2])
    return robot.clamp(guess)


def _correct(robot: Robot, rail: Rail, share: float, q: Vector, tolerance: Tolerance) -> Vector | None:
    """Bring the tip to a point of the rail by Newton's method, inside the limits; None if it does not get there."""
    aim = rail.poses(share)[0]
    scale = np.repeat([1.0 / reach_of(robot), PER_CHORD], 3)
    for k in range(NEWTON_STEPS + 1):
        tip, jacobian = (x[0] for x in robot.fk_jacobian_batch(q))
        error = _residual(aim, tip)
        distance = np.linalg.norm(error[:3])
        chord = np.linalg.norm(error[3:])
        if distance <= ARRIVED * tolerance.deviation and chord <= ARRIVED * tolerance.chord:
            return q
        if k < NEWTON_STEPS:
            q = robot.clamp(q + _newton_step(robot, q, jacobian * scale[:, None], error * scale))
    return None


def _residual(aim: Matrix, tip: Matrix) -> Vector:
    """From a tip to a pose, in world axes: [m], and the turn's axis times its chord, shape (6,)."""
    turn = aim[:3, :3] @ tip[:3, :3].T
    skew = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    half = np.sqrt(max(0.25 * (1.0 + np.trace(turn)), 1e-24))
    return np.concatenate([aim[:3, 3] - tip[:3, 3], skew / half])


def _newton_step(robot: Robot, q: Vector, jacobian: Matrix, error: Vector) -> Vector:
    """The shortest step that removes a residual, without joints at a limit that would go on beyond it."""
    pull = jacobian.T @ error
    pinned = ((q <= robot.lower) & (pull < 0.0)) | ((q >= robot.upper) & (pull > 0.0))
    free = np.where(pinned, 0.0, jacobian)
    change: Vector = free.T @ np.linalg.solve(free @ free.T + DAMPING * np.eye(6), error)
    return change * (LARGEST_STEP / max(float(np.abs(change).max()), LARGEST_STEP))


def _deviation_bound(
    robot: Robot, rail: Rail, q: Vector, trial: Vector, at: tuple[float, float], tolerance: Tolerance
) -> float:
    """How far the tip leaves the rail on a motion at most, 1 is what it may; ``at``: share and step."""
    if np.abs(trial - q).max() > LARGEST_CHANGE:
        return float(np.inf)
    share, step = at
    error = _residual(rail.poses(share + 0.5 * step)[0], robot.fk_batch(0.5 * (q + trial))[0])

    tip = tip_columns(robot)
    change = np.abs(tip.gain) @ np.abs(trial - q)
    turning = np.where(tip.prismatic, 0.0, change)
    slid = change[tip.prismatic].sum()
    turn = turning.sum()
    swept = turning @ levers_of(robot)

    third = turn**2 * (swept + 3.0 * slid) + abs(step * rail.arc_angle) ** 3 * rail.arc_radius
    third_turn = turn**3 + abs(step * rail.turn_angle) ** 3
    distance = np.linalg.norm(error[:3]) + REMAINDER * third
    chord = np.linalg.norm(error[3:]) + np.sqrt(1.5) * REMAINDER * third_turn
    return float(max(distance / tolerance.deviation, chord / tolerance.chord))
