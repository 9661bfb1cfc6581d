"""Assisted manoeuvre: check moves of one joint before they are made, and refuse those that are not free.

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

# Threshold on the quantities that vanish in a singular posture: sines of angles, or lever arms [m].
SINGULARITY_THRESHOLD = 0.05
CLEARANCE_WARNING = 0.02  # [m]; smaller clearances cause a warning
CLEARANCE_SAMPLES = 20  # configurations along a move whose clearance is measured
CLEARANCE_ERROR = 0.002  # [m]; largest error of the least distance found
SINGULARITY_SAMPLES = 60  # configurations along the range of a joint
# Steps, in multiples of the joint's tolerance, that are tried to get out of contact.
ESCAPE_STEPS = (1, 2, 3, 4, 6, 8)


Stretch = tuple[float, float, str]  # from, to [rad or m], name of the singular case


@dataclass(frozen=True, slots=True, eq=False)
class JointRange:
    """The free range of one joint while the others stand still.

    Attributes:
        low: Least value [rad or m].
        high: Largest value [rad or m].
        below: What ends the range at ``low``: "limit", "full turn" or the pair that touches.
        above: What ends the range at ``high``.
        singular: Intervals within the range in which the arm is near a singular posture, with its name ("" if unnamed).
    """

    low: float
    high: float
    below: str
    above: str
    singular: tuple[Stretch, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MoveCheck:
    """The result of checking a move.

    Attributes:
        allowed: Whether the move may be made.
        reason: Why not: the limit, or the pair that would touch and where; "" if it may.
        warnings: Small clearance, singular postures, a move that is not proven free between the steps checked.
        clearance: Least distance to anything at samples along the move [m]; -inf if it collides, inf if nothing can.
    """

    allowed: bool
    reason: str
    warnings: tuple[str, ...]
    clearance: float


def check_move(world: World, q: Vector, joint: int, target: float) -> MoveCheck:
    """Check a move of one joint.

    The move must respect the limits and be free of collisions. An arm that is in contact may only move out of it. A
    free move is also checked for small clearance, singular postures, and whether continuous freedom is proven.

    Args:
        world: Robot and surroundings.
        q: Present configuration, shape (dof,).
        joint: Number of the joint.
        target: Value at its end [rad or m].
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
    """Return how far towards a target a joint can move without contact and within its limits [rad or m].

    The end is found by bisection; the arm must be free at q.
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
    """Return why a move is refused, and how far the joint is free, in one line."""
    if not world.valid(q):
        return f"refused: {check.reason}"

    value, unit = reading(free_until(world, q, joint, target), joint_unit(world.robot.prismatic[joint]))
    return f"refused: {check.reason}; free until {value:.4g} {unit}"


def way_out(world: World, q: Vector, joint: int, sign: float) -> float:
    """Return the nearest value of a joint, in one direction, at which an arm in contact is free [rad or m].

    Args:
        world: Robot and surroundings.
        q: Present configuration, shape (dof,).
        joint: Number of the joint.
        sign: Direction, 1 or -1.

    Raises:
        InputError: If none of the `ESCAPE_STEPS` frees the arm.
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
    """Return the free range of a joint.

    The range is empty if the arm is in contact, and a full turn if the joint is endless and free.
    """
    robot = world.robot
    value = float(q[joint])
    if not world.valid(q):
        why = world.explain(q)
        return JointRange(value, value, why, why, ())
    low, below = _reach(world, q, joint, float(robot.lower[joint]), value - TAU)
    high, above = _reach(world, q, joint, float(robot.upper[joint]), value + TAU)
    return JointRange(low, high, below, above, _singular_stretches(robot, q, joint, low, high))


def _reach(world: World, q: Vector, joint: int, limit: float, turn: float) -> tuple[float, str]:
    """Return how far a joint can move in one direction, and what ends its range.

    Args:
        world: Robot and surroundings.
        q: Present configuration, shape (dof,).
        joint: Number of the joint.
        limit: Limit of the joint in this direction; infinite if it has none.
        turn: Value after a full turn in this direction, used if there is no limit.

    Returns:
        The last free value [rad or m], and "limit", "full turn" or the pair that touches.
    """
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
    """Return the intervals in the range of a joint in which the arm is near a singular posture."""
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
    """Return a move of one joint that frees an arm which is in contact.

    Of all joints and directions, the smallest step is returned, in multiples of each joint's tolerance.

    Returns:
        The number of the joint and its new value [rad or m]; None if no step in `ESCAPE_STEPS` frees the arm.
    """
    small_errors = slack(JointPath.of(world.robot, q[None]))
    for multiple in ESCAPE_STEPS:
        for joint, step in enumerate(multiple * small_errors):
            for target in (q[joint] + step, q[joint] - step):
                if check_move(world, q, joint, float(target)).allowed:
                    return joint, float(target)
    return None


def escape_advice(world: World, q: Vector) -> str:
    """Return how to free an arm that is in contact, in words; "" if it is not in contact."""
    if world.valid(q):
        return ""
    way_free = escape_move(world, q)
    if way_free is None:
        return "drive the arm out of it first"

    value, unit = reading(way_free[1], joint_unit(world.robot.prismatic[way_free[0]]))
    return f"{world.robot.joint_names[way_free[0]]} to {value:.4g} {unit} gets it free"


def _out_of_contact(world: World, start: Vector, end: Vector) -> MoveCheck:
    """Check a move of an arm that is in contact: the overlap must decrease steadily, then end, and the rest be free."""
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
    """Return the first configuration of a motion that is not free, shape (dof,); its end if none is found."""
    rows = start + np.linspace(0.0, 1.0, world.steps(start, end) + 1)[:, None] * (end - start)
    blocked_rows = np.flatnonzero(~world.valid_batch(rows))
    return np.array(rows[blocked_rows[0]] if len(blocked_rows) else end)


def _obstruction(world: World, start: Vector, end: Vector, joint: int) -> str:
    """Return which pair touches first along a move that is not free, and at which value of the joint, in words."""
    first = _first_blocked(world, start, end)
    value, unit = reading(float(first[joint]), joint_unit(world.robot.prismatic[joint]))
    why = world.explain(first) or "too close to tell"
    return f"{world.robot.joint_names[joint]} at {value:.3g} {unit}: {why}"


def closest_pair(world: World, rows: Matrix) -> Contact | None:
    """Return the pair with the least clearance (distance less margin) over several configurations.

    Only few rows have to be measured. A measured clearance bounds that of other rows from below, because two bodies
    approach each other by no more than twice the bound on the arm's displacement (``World.weights``). The next row
    measured is the one with the lowest bound, until no bound is below the best clearance by more than
    `CLEARANCE_ERROR`.

    Args:
        world: Robot and surroundings.
        rows: Configurations that are free, shape (m, dof), m > 0.

    Returns:
        None if no pair can collide.
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
    """Return, by name of the singular case, which configurations are near it, shape (m,).

    Robots without named cases are judged by the smallest singular value of the Jacobian, under the name "".
    """
    if has_closed_form(robot):
        return {case: np.asarray(size < SINGULARITY_THRESHOLD) for case, size in form_of(robot).nearness(rows).items()}

    smallest_singular = np.linalg.svd(robot.jacobian_batch(rows), compute_uv=False)[:, -1]
    return {"": np.asarray(smallest_singular < SINGULARITY_THRESHOLD)}
