"""Following of a rail by the joints, as far as they can: in kernels, or in numpy if there are none.

:func:`follow_plainly` is the reference implementation of :mod:`rrtik_ompl.kernels.ik.rail_kernels`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.ik.kernel_tables import KernelCall, limb_of
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.kernels.ik import rail_layout
from rrtik_ompl.kernels.ik.ik_layout import AIM_FLOATS, CHORD_TOLERANCE, FREE_TURN, NO_TURN, POSITION_TOLERANCE
from rrtik_ompl.kernels.ik.rail_layout import (
    ARRIVED,
    DAMPING,
    LARGEST_CHANGE,
    LARGEST_GROWTH,
    NEWTON_STEPS,
    REMAINDER,
    ROOM,
    SMALLEST_SHRINKING,
    RailTable,
)
from rrtik_ompl.kernels.reference.descent import LARGEST_STEP, PER_CHORD
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of
from rrtik_ompl.model.robot import Robot, reach_of
from rrtik_ompl.planning.tip_motion.rails import Rail

MOST_ROWS = 4096  # limit of the configurations along one rail
FIRST_STEP = 0.05  # share of the rail
SMALLEST_STEP = 1e-6  # share of the rail; if a step has to be smaller, the arm cannot go on
POSE_JOINTS = 6  # an arm with more joints than this is redundant for a pose
CENTRING = 2.0  # pull of a free joint towards the middle of its limits, see `Leaning`


@dataclass(frozen=True, slots=True, eq=False)
class Leaning:
    """A reference configuration towards which a redundant arm is pulled while it follows a rail.

    Attributes:
        reference: Configuration, shape (dof,).
        pull: For each joint the share of the distance from the reference that is covered over a whole rail, shape
            (dof,).
        homing: Whether the reference is to be reached at the end of the rail.
    """

    reference: Vector
    pull: Vector
    homing: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Tolerance:
    """How far the tip may deviate from a rail.

    Attributes:
        deviation: In position [m].
        turn: In orientation [rad].
        arrived: Share of both within which the tip is at a point of the rail, up to `ARRIVED`.
    """

    deviation: float
    turn: float
    arrived: float = ARRIVED

    @property
    def chord(self) -> float:
        """The turn as chord of the unit circle, 2 sin(angle / 2)."""
        return float(2.0 * np.sin(0.5 * self.turn))


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Configurations along a rail.

    Attributes:
        rows: Configurations, shape (k, dof), beginning with the given one.
        shares: Share of the rail at each configuration, shape (k,).
    """

    rows: Matrix
    shares: Vector

    @property
    def complete(self) -> bool:
        """Whether the end of the rail was reached."""
        return bool(self.shares[-1] >= 1.0 - SMALLEST_STEP)


@kept_with
def levers_of(robot: Robot) -> Vector:
    """Return the greatest distance of the tip from each joint between it and the base [m], shape (joints,).

    It is the sum of the lengths and strokes from the joint to the tip, as if the arm were stretched.
    """
    tip = tip_columns(robot)
    lengths = np.linalg.norm(tip.fixed[1:, :3, 3], axis=1)
    lower, upper = (np.where(np.isfinite(x), x, 0.0) for x in (robot.lower, robot.upper))
    strokes = np.abs(tip.gain) @ np.maximum(np.abs(lower), np.abs(upper)) + np.abs(tip.offset)
    return frozen(np.cumsum((lengths + np.where(tip.prismatic, strokes, 0.0))[::-1])[::-1])


@kept_with
def moving_the_tip(robot: Robot) -> tuple[int, ...]:
    """Return the indices of the joints that move the tip."""
    return tuple(np.flatnonzero((tip_columns(robot).gain != 0.0).any(axis=0)).tolist())


@kept_with
def redundant(robot: Robot) -> bool:
    """Check whether a pose of the tip leaves the joints some freedom."""
    return len(moving_the_tip(robot)) > POSE_JOINTS


@kept_with
def centred(robot: Robot) -> Leaning:
    """Return the leaning away from the joint limits, towards the middle of each range [60]."""
    bounded = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    low, high = robot.finite_range()
    pull = np.zeros(robot.dof)
    if redundant(robot):
        pull[list(moving_the_tip(robot))] = CENTRING
    return Leaning(frozen(0.5 * (low + high)), frozen(np.where(bounded, pull, 0.0)))


def follow(robot: Robot, rail: Rail, q: Vector, tolerance: Tolerance, leaning: Leaning) -> Followed:
    """Follow a rail from a configuration at its beginning, shape (dof,), to its end or as far as possible.

    Args:
        robot: The arm.
        rail: The rail.
        q: Configuration at the beginning of the rail, shape (dof,).
        tolerance: Allowed deviation of the tip.
        leaning: Where a redundant arm is pulled.
    """
    kernels = library(rail_layout.KERNELS)
    limb = limb_of(robot)
    if kernels is None or limb is None:
        return follow_plainly(robot, rail, q, tolerance, leaning)

    aim = np.zeros((1, AIM_FLOATS))
    aim[0, POSITION_TOLERANCE] = tolerance.arrived * tolerance.deviation
    aim[0, CHORD_TOLERANCE] = tolerance.arrived * tolerance.chord
    aim[0, FREE_TURN] = NO_TURN
    call = KernelCall(limb, aim, robot.clamp(q)[None], rail_layout.NEWTON_STEPS, rail_layout.NEWTON_STEPS + 1)
    table = packed_rail(robot, rail, q, tolerance, leaning)

    kernels.follow(limb.address, call.address, table.address)
    count = table.count
    return Followed(table.q.reshape(-1, robot.dof)[:count].copy(), table.shares[:count].copy())


def packed_rail(robot: Robot, rail: Rail, q: Vector, tolerance: Tolerance, leaning: Leaning) -> RailTable:
    """Return the table of arguments and results of one kernel call, see :mod:`rrtik_ompl.kernels.ik.rail_layout`."""
    levers = levers_of(robot)
    table = RailTable(PlannedTable(_plan(robot.dof, len(levers))))
    table.rail[:] = rail.numbers()
    table.q[: robot.dof] = robot.clamp(q)
    table.shares[0] = 0.0
    table.levers[:] = levers
    table.reference[:] = leaning.reference
    table.pull[:] = leaning.pull
    table.deviation = tolerance.deviation
    table.chord = tolerance.chord
    table.smallest = SMALLEST_STEP
    table.first_step = FIRST_STEP
    table.homing = int(leaning.homing)
    table.momentum = int(not redundant(robot))
    return table


@lru_cache(maxsize=64)
def _plan(dof: int, joints: int) -> TablePlan:
    """Sizes of the arrays in the table of a kernel call, for an arm with so many joints."""
    return sizes_of(
        RailTable,
        rail=rail_layout.RAIL_NUMBERS,
        q=MOST_ROWS * dof,
        shares=MOST_ROWS,
        levers=joints,
        reference=dof,
        pull=dof,
        trial=dof,
        middle=dof,
        capacity=MOST_ROWS,
        count=1,
    )


def follow_plainly(robot: Robot, rail: Rail, q: Vector, tolerance: Tolerance, leaning: Leaning) -> Followed:
    """Follow a rail from a configuration at its beginning, shape (dof,), to its end or as far as possible.

    Each step guesses the next configuration, corrects it by Newton's method so that the tip is on the rail, and bounds
    the deviation of the motion from the rail. A step that deviates too much is repeated with a smaller size; the size
    of the next step follows from the bound.
    """
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

        # Accept the step if it deviates little enough.
        if trial is not None and deviation <= 1.0 - ROOM:
            rows.append(trial)
            shares.append(shares[-1] + tried_step)
        # The deviation grows with the square of the step, so a next step of this size stays within the tolerance.
        change = 0.9 / np.sqrt(deviation) if deviation > 0.0 else LARGEST_GROWTH
        step = tried_step * min(max(change, SMALLEST_SHRINKING), LARGEST_GROWTH)
    return Followed(np.array(rows), np.array(shares))


def _guess(robot: Robot, rows: list[Vector], shares: list[float], step: float, leaning: Leaning) -> Vector:
    """Return the initial guess of a step, shape (dof,): the last configuration, pulled towards the reference.

    An arm that is not redundant is extrapolated from its last two configurations.
    """
    share = step / (1.0 - shares[-1]) if leaning.homing else step
    guess = rows[-1] + share * leaning.pull * (leaning.reference - rows[-1])
    if len(rows) > 1 and not redundant(robot):
        guess = guess + step / (shares[-1] - shares[-2]) * (rows[-1] - rows[-2])
    return robot.clamp(guess)


def _correct(robot: Robot, rail: Rail, share: float, q: Vector, tolerance: Tolerance) -> Vector | None:
    """Move the tip to a point of the rail by Newton's method, inside the limits; None if it does not converge.

    Args:
        robot: The arm.
        rail: The rail.
        share: Place on the rail, from 0 to 1.
        q: Initial guess, shape (dof,).
        tolerance: Allowed deviation, of which only the share ``arrived`` is used up here.
    """
    aim = rail.poses(share)[0]
    scale = np.repeat([1.0 / reach_of(robot), PER_CHORD], 3)
    for k in range(NEWTON_STEPS + 1):
        tip, jacobian = (x[0] for x in robot.fk_jacobian_batch(q))
        error = _residual(aim, tip)
        distance = np.linalg.norm(error[:3])
        chord = np.linalg.norm(error[3:])
        if distance <= tolerance.arrived * tolerance.deviation and chord <= tolerance.arrived * tolerance.chord:
            return q
        if k < NEWTON_STEPS:
            q = robot.clamp(q + _newton_step(robot, q, jacobian * scale[:, None], error * scale))
    return None


def _residual(aim: Matrix, tip: Matrix) -> Vector:
    """Return the residual from a tip to a pose in world axes, shape (6,): shift [m], turn's axis times its chord."""
    turn = aim[:3, :3] @ tip[:3, :3].T
    skew = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    half = np.sqrt(max(0.25 * (1.0 + np.trace(turn)), 1e-24))
    return np.concatenate([aim[:3, 3] - tip[:3, 3], skew / half])


def _newton_step(robot: Robot, q: Vector, jacobian: Matrix, error: Vector) -> Vector:
    """Return the shortest step that removes a residual, without joints at a limit that would go beyond it."""
    pull = jacobian.T @ error
    pinned = ((q <= robot.lower) & (pull < 0.0)) | ((q >= robot.upper) & (pull > 0.0))
    free = np.where(pinned, 0.0, jacobian)
    change: Vector = free.T @ np.linalg.solve(free @ free.T + DAMPING * np.eye(6), error)
    return change * (LARGEST_STEP / max(float(np.abs(change).max()), LARGEST_STEP))


def _deviation_bound(
    robot: Robot, rail: Rail, q: Vector, trial: Vector, at: tuple[float, float], tolerance: Tolerance
) -> float:
    """Bound the deviation of the tip from the rail during a motion, relative to the tolerance: at most 1 is allowed.

    The bound is the deviation in the middle of the motion, plus the remainder of a Taylor expansion.

    Args:
        robot: The arm.
        rail: The rail.
        q: Begin of the motion, shape (dof,).
        trial: End of the motion, shape (dof,).
        at: Share of the rail at the begin, and length of the step as a share.
        tolerance: Allowed deviation.
    """
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
