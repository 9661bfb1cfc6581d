"""Assisted manoeuvre: moves of one joint are checked before they are made, and refused if they are not free.

Source: [1, ch. 6].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.routes.follower import slack
from rrtik_ompl.world.world import World

SINGULARITY_THRESHOLD = 0.05  # sine of an angle, or metres of a lever arm, that vanish in a singular posture
CLEARANCE_WARNING = 0.02  # [m]; a smaller clearance is warned of
CLEARANCE_SAMPLES = 20  # along a move
CLEARANCE_ERROR = 0.002  # [m]; the least distance that is found is at most this much too large
SINGULARITY_SAMPLES = 60  # along the range of a joint
ESCAPE_STEPS = (1, 2, 3, 4, 6, 8)  # multiples of a small error, by which a joint is driven to get out of contact


Stretch = tuple[float, float, str]  # from, to [rad or m], name of the singular case


@dataclass(frozen=True, slots=True, eq=False)
class JointRange:
    """How far one joint can be driven while the others stand still.

    Attributes:
        low: The least value [rad or m].
        high: The largest value.
        below: What ends the range at ``low``: "limit", "full turn" or the pair that touches.
        above: What ends the range at ``high``.
        singular: Stretches in between on which the arm is near a singular posture; its name is "" if it has none.
    """

    low: float
    high: float
    below: str
    above: str
    singular: tuple[Stretch, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MoveCheck:
    """The check of a move.

    Attributes:
        allowed: Whether it may be made.
        reason: Why not: the limit, or the pair that would touch and where; "" if it may.
        warnings: Small clearance, singular postures, a move that is only checked in steps.
        clearance: The least distance to anything along the move, at some samples [m]; -inf if it collides.
    """

    allowed: bool
    reason: str
    warnings: tuple[str, ...]
    clearance: float


def check_move(world: World, q: Vector, joint: int, target: float) -> MoveCheck:
    """Check a move of one joint.

    Args:
        world: Robot and surroundings.
        q: Where the arm is, shape (dof,).
        joint: Number of the joint.
        target: Where it is to go [rad or m].
    """
    robot = world.robot
    end = q.copy()
    end[joint] = target

    fault = robot.limit_fault(end)
    if fault:
        return MoveCheck(False, fault, (), -np.inf)

    end = robot.clamp(end)
    if not world.valid(q):
        return _out_of_contact(world, q, end)
    if not world.motion_valid(q, end):
        return MoveCheck(False, _obstruction(world, q, end, joint), (), -np.inf)

    share = np.linspace(0.0, 1.0, CLEARANCE_SAMPLES)[:, None]
    rows = q + share * (end - q)
    nearest = closest_pair(world, rows)
    clearance = np.inf if nearest is None else nearest.distance

    warnings = [*_singular(world, end)]
    if nearest is not None and clearance < CLEARANCE_WARNING:
        warnings.append(f"only {1e3 * max(clearance, 0.0):.0f} mm between {nearest.first} and {nearest.second}")
    if not world.motion_proven(q, end):
        warnings.append("free in steps, but not proven in between")
    return MoveCheck(True, "", tuple(warnings), float(clearance))


def free_until(world: World, q: Vector, joint: int, target: float) -> float:
    """How far towards a target a joint can go without touching anything or leaving its limits [rad or m].

    By bisection; the arm must be free at q.
    """
    robot = world.robot
    end = q.copy()
    end[joint] = min(max(target, float(robot.lower[joint])), float(robot.upper[joint]))
    if world.motion_valid(q, end):
        return float(end[joint])

    low = 0.0
    high = 1.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        if world.motion_valid(q, q + middle * (end - q)):
            low = middle
        else:
            high = middle

    return float(q[joint] + low * (end[joint] - q[joint]))


def move_refusal(world: World, q: Vector, joint: int, target: float, check: MoveCheck) -> str:
    """Why a move is refused, in one line, and how far the joint is free."""
    if not world.valid(q):
        return f"refused: {check.reason}"

    value, unit = reading(free_until(world, q, joint, target), joint_unit(world.robot.prismatic[joint]))
    return f"refused: {check.reason}; free until {value:.4g} {unit}"


def way_out(world: World, q: Vector, joint: int, sign: float) -> float:
    """Where a joint that is driven one way gets an arm that touches something free [rad or m].

    Raises:
        InputError: If it does not.
    """
    small_error = float(slack(JointPath.of(world.robot, q[None]))[joint])
    check = None
    for multiple in ESCAPE_STEPS:
        target = float(q[joint]) + sign * multiple * small_error
        check = check_move(world, q, joint, target)
        if check.allowed:
            return target
    raise InputError("refused" if check is None else f"refused: {check.reason}")


def joint_range(world: World, q: Vector, joint: int) -> JointRange:
    """How far a joint can be driven; nowhere if the arm touches something, a full turn if it is endless and free."""
    robot = world.robot
    value = float(q[joint])
    if not world.valid(q):
        why = world.explain(q)
        return JointRange(value, value, why, why, ())
    low, below = _reach(world, q, joint, float(robot.lower[joint]), value - TAU)
    high, above = _reach(world, q, joint, float(robot.upper[joint]), value + TAU)
    return JointRange(low, high, below, above, _singular_stretches(robot, q, joint, low, high))


def _reach(world: World, q: Vector, joint: int, limit: float, turn: float) -> tuple[float, str]:
    """How far a joint goes towards its limit, or round once, and what ends it: that, or the pair that touches."""
    end, end_name = (limit, "limit") if np.isfinite(limit) else (turn, "full turn")
    reached = free_until(world, q, joint, end)
    if reached == end:
        return end, end_name
    last_free = q.copy()
    end_posture = q.copy()
    last_free[joint] = reached
    end_posture[joint] = end

    touching = world.contacts(_first_blocked(world, last_free, end_posture))
    return reached, f"{touching[0].first} meets {touching[0].second}" if touching else "too close to tell"


def _singular_stretches(robot: Robot, q: Vector, joint: int, low: float, high: float) -> tuple[Stretch, ...]:
    """Where along the range of a joint the arm is near a singular posture."""
    values = np.linspace(low, high, SINGULARITY_SAMPLES)
    rows = np.tile(q, (len(values), 1))
    rows[:, joint] = values
    stretches: list[Stretch] = []
    for case, is_near in _near_singular(robot, rows).items():
        run_edges = np.flatnonzero(np.diff(np.concatenate([[False], is_near, [False]]).astype(int)))
        stretches += [
            (float(values[a]), float(values[b - 1]), case) for a, b in zip(run_edges[::2], run_edges[1::2], strict=True)
        ]
    return tuple(stretches)


def escape_move(world: World, q: Vector) -> tuple[int, float] | None:
    """The joint, and where to drive it [rad or m], that gets an arm that touches something free again; None if none.

    Of all single joints the one that has to go least far, a few small errors' width at most.
    """
    small_errors = slack(JointPath.of(world.robot, q[None]))
    for multiple in ESCAPE_STEPS:
        for joint, step in enumerate(multiple * small_errors):
            for target in (q[joint] + step, q[joint] - step):
                if check_move(world, q, joint, float(target)).allowed:
                    return joint, float(target)
    return None


def escape_advice(world: World, q: Vector) -> str:
    """How to get an arm that touches something free; "" if it touches nothing."""
    if world.valid(q):
        return ""
    way_free = escape_move(world, q)
    if way_free is None:
        return "drive the arm out of it first"

    value, unit = reading(way_free[1], joint_unit(world.robot.prismatic[way_free[0]]))
    return f"{world.robot.joint_names[way_free[0]]} to {value:.4g} {unit} gets it free"


def _out_of_contact(world: World, start: Vector, end: Vector) -> MoveCheck:
    """An arm that touches something may move so that the overlap decreases and then ends."""
    rows = start + np.linspace(0.0, 1.0, CLEARANCE_SAMPLES)[:, None] * (end - start)
    clearances = np.array([world.clearance(row) for row in rows])
    first_free = int(np.argmax(clearances > 0.0))
    if (
        clearances[-1] <= 0.0
        or (np.diff(clearances[: first_free + 1]) <= 0.0).any()
        or not world.motion_valid(rows[first_free], end)
    ):
        why = f"the arm touches something, and this does not get it free: {world.explain(start)}"
        return MoveCheck(False, why, (), -np.inf)
    return MoveCheck(True, "", ("out of contact",), float(clearances[-1]))


def _first_blocked(world: World, start: Vector, end: Vector) -> Vector:
    """The first configuration along a motion that is not free; its end if none is found. Shape (dof,)."""
    rows = start + np.linspace(0.0, 1.0, world.steps(start, end) + 1)[:, None] * (end - start)
    blocked_rows = np.flatnonzero(~world.valid_batch(rows))
    return np.array(rows[blocked_rows[0]] if len(blocked_rows) else end)


def _obstruction(world: World, start: Vector, end: Vector, joint: int) -> str:
    """Which pair touches first along a move that is not free, and at which value of the joint."""
    first = _first_blocked(world, start, end)
    value, unit = reading(float(first[joint]), joint_unit(world.robot.prismatic[joint]))
    why = world.explain(first) or "too close to tell"
    return f"{world.robot.joint_names[joint]} at {value:.3g} {unit}: {why}"


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


def _singular(world: World, q: Vector) -> list[str]:
    cases = [case for case, is_near in _near_singular(world.robot, q[None]).items() if is_near[0]]
    return [f"near the singular posture '{case}'" if case else "near a singular posture" for case in cases]


def _near_singular(robot: Robot, rows: Matrix) -> dict[str, Mask]:
    """Which configurations are near each singular case, shape (m,); by the Jacobian, "", if the robot names none."""
    if has_closed_form(robot):
        return {case: np.asarray(size < SINGULARITY_THRESHOLD) for case, size in form_of(robot).nearness(rows).items()}

    smallest_singular = np.linalg.svd(robot.jacobian_batch(rows), compute_uv=False)[:, -1]
    return {"": np.asarray(smallest_singular < SINGULARITY_THRESHOLD)}
