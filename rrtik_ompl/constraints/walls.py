"""Proofs that a held orientation separates two configurations: values that a joint cannot take ("walls").

The orientation of a frame depends on the revolute joints alone; consecutive joints with parallel axes count as one. To
test a value of one joint, the angles of the others are divided into boxes. Within a box the frame turns away from its
orientation at the middle by at most the sum of the half sides, so a box may be shown to contain no configuration of the
region. If this is shown for all boxes, the value is a wall, and no path that keeps the region passes it. This is a
proof.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.constraints.held_region import HeldRegion, Turning
from rrtik_ompl.constraints.held_regions import HeldRegions

GRID = np.radians(15.0)  # [rad] spacing of the joint values that are tested
PARALLEL = 1e-9  # axes are parallel if the sine of the angle between them is below this
MOST_ANGLES = 3  # largest number of angles that are divided into boxes
MOST_BOXES = 200_000  # number of boxes at which a test is given up
ROUNDING = 1e-6  # [rad] added to the tolerances
Rotations = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Turn:
    """Consecutive joints that turn about parallel axes: a fixed rotation, then one about an axis.

    Attributes:
        before: The fixed rotation, shape (3, 3).
        axis: The unit axis, shape (3,).
        joints: Indices of the joints in the chain.
        signs: For each joint 1, or -1 where its axis points the other way.
    """

    before: Rotations
    axis: Vector
    joints: tuple[int, ...]
    signs: tuple[float, ...]


def separation(constraints: HeldRegions, start: Vector, goals: Matrix) -> str:
    """Return a line that says why a start cannot be connected with any goal; "" if that is not proven.

    Args:
        constraints: The path constraints.
        start: Shape (dof,).
        goals: Shape (g, dof).
    """
    said = ""
    for goal in goals:
        line = next((line for region in constraints.regions if (line := _between(region, start, goal))), "")
        if not line:
            return ""
        said = said or line
    return said


def _between(region: HeldRegion, start: Vector, goal: Vector) -> str:
    """Return a line about a wall of one region between two configurations, shape (dof,) each; "" if none is found.

    For joints without limits there have to be walls on both ways round.
    """
    if region.turning not in (Turning.AXIS, Turning.BALL) or region.joint == 0:
        return ""

    turns, end = _turns(region)
    for place, turn in enumerate(turns):
        first, last = (_angle_of(region, turn, q) for q in (start, goal))
        if _turns_without_limits(region, turn):  # the goal can be reached both ways round
            there = first + (last - first) % TAU
            ways = [(first, there), (there, first + TAU)]
        else:
            ways = [(min(first, last), max(first, last))]

        walls = [_walls(region, turns, end, place, *way) for way in ways]
        if all(map(len, walls)):
            passed = " or ".join(f"{np.degrees(each[0]):.1f}" for each in walls)
            return (
                f"{region.label} keeps start and goal apart: {_named(region, turn)} {np.degrees(first):.1f} degrees at "
                f"the start and {np.degrees(last):.1f} at the goal, and cannot pass {passed} while "
                f"frame '{region.frame}' is kept; take a goal of the same branch"
            )
    return ""


def _walls(region: HeldRegion, turns: list[Turn], end: Rotations, place: int, low: float, high: float) -> Vector:
    """Return the walls of one turn's angle between two values, those a whole turn apart only once.

    Args:
        region: The region.
        turns: All turns, see :func:`_turns`.
        end: The fixed rotation behind the last turn, shape (3, 3).
        place: Index of the turn.
        low: Lower angle [rad].
        high: Upper angle [rad].

    Returns:
        The walls [rad], shape (n,).
    """
    values = GRID * np.arange(np.floor(low / GRID) + 1, np.ceil(high / GRID))
    values = values[np.unique(np.round((values % TAU) / GRID) % round(TAU / GRID), return_index=True)[1]]
    walls: Vector = values[_blocked(region, turns, end, place, values)]
    return walls


def _turns_without_limits(region: HeldRegion, turn: Turn) -> bool:
    """Check whether a joint of a turn has no limits, so that a posture is reached both ways round."""
    moving = (region.robot.chain.gain[list(turn.joints)] != 0.0).any(axis=0)
    return bool((moving & region.robot.continuous).any())


def _angle_of(region: HeldRegion, turn: Turn, q: Vector) -> float:
    """Return the angle of a turn at a configuration, shape (dof,) [rad]."""
    rows = list(turn.joints)
    return float(np.array(turn.signs) @ region.robot.joint_values(q)[0, rows])


def _named(region: HeldRegion, turn: Turn) -> str:
    """Return the names of a turn's joints with the verb that follows them in a message."""
    gains = np.array(turn.signs) @ region.robot.chain.gain[list(turn.joints)]
    moving = [(region.robot.joint_names[k], gains[k]) for k in np.flatnonzero(gains)]
    if len(moving) == 1:
        return f"joint '{moving[0][0]}' is at"
    total = " ".join(f"{'+' if gain > 0.0 else '-'} '{name}'" for name, gain in moving)
    return f"the sum of joints {total.removeprefix('+ ')} is"


def _turns(region: HeldRegion) -> tuple[list[Turn], Rotations]:
    """Split the rotation from the base to the constrained frame into turns about axes.

    Returns:
        The turns from base to frame that affect the constraint, and the fixed rotation behind the last one, shape (3,
        3).
    """
    chain = region.robot.chain
    turns = list[Turn]()
    after = np.eye(3)
    for row in region.rows:
        after = after @ chain.placement[row][:3, :3]
        if chain.prismatic[row]:
            continue
        axis = after @ chain.axis[row]
        if turns and np.linalg.norm(np.cross(turns[-1].axis, axis)) < PARALLEL:
            last = turns[-1]
            sign = 1.0 if turns[-1].axis @ axis > 0.0 else -1.0
            turns[-1] = Turn(last.before, last.axis, (*last.joints, row), (*last.signs, sign))
        else:
            turns.append(Turn(after, chain.axis[row], (row,), (1.0,)))
            after = np.eye(3)

    end = after @ region.T_joint_d[:3, :3]
    if region.turning == Turning.AXIS:
        turns, end = _without_idle_turns(region, turns, end)
    return turns, end


def _without_idle_turns(region: HeldRegion, turns: list[Turn], end: Rotations) -> tuple[list[Turn], Rotations]:
    """Remove turns that cannot change the direction of the constrained axis.

    These are a last turn about the constrained axis itself, and a first turn about the direction where it has to point.

    Args:
        region: The region, whose constraint is AXIS.
        turns: The turns from base to frame.
        end: The fixed rotation behind the last turn, shape (3, 3).

    Returns:
        The remaining turns and the fixed rotation behind the last one, shape (3, 3).
    """
    if turns and np.linalg.norm(np.cross(turns[-1].axis, end[:, 2])) < PARALLEL:
        end = turns[-1].before @ end
        turns = turns[:-1]

    direction = region.T_world_w[:3, :3] @ region.direction
    if turns and np.linalg.norm(np.cross(turns[0].before @ turns[0].axis, direction)) < PARALLEL:
        first = turns[0].before
        turns = turns[1:]
        if turns:
            turns[0] = replace(turns[0], before=first @ turns[0].before)
        else:
            end = first @ end
    return turns, end


def _blocked(region: HeldRegion, turns: list[Turn], end: Rotations, place: int, values: Vector) -> Mask:
    """Test which values of one turn's angle are walls.

    The box of all other angles is halved in all directions as long as it is undecided: a box whose middle is in the
    region shows that the value is no wall; a box whose frames are all outside is dropped. A value is a wall if all its
    boxes are dropped. If there are too many boxes, no value is.

    Args:
        region: The region.
        turns: All turns, see :func:`_turns`.
        end: The fixed rotation behind the last turn, shape (3, 3).
        place: Index of the turn.
        values: Angles of the turn [rad], shape (k,).

    Returns:
        Which are walls, shape (k,).
    """
    others = [number for number in range(len(turns)) if number != place]
    blocked = np.zeros(len(values), dtype=bool)
    if len(others) > MOST_ANGLES or len(values) == 0:
        return blocked

    limit = region.tolerances[1] + region.allowances[1] + ROUNDING
    if not others:  # there is only one turn, as of a planar arm, and nothing to divide
        blocked |= _angles(region, turns, end, values[:, None]) > limit
        return blocked

    spans = np.array([_span(region, turns[number]) for number in others])
    middles = np.tile(spans.mean(axis=1), (len(values), 1))
    halves = 0.5 * (spans[:, 1] - spans[:, 0])
    owners = np.arange(len(values))
    passed = np.zeros(len(values), dtype=bool)
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * len(others))).reshape(len(others), -1).T

    while len(owners) and len(owners) < MOST_BOXES:
        # Drop the boxes of values that are no walls, and those without configurations of the region.
        angles = np.insert(middles, place, values[owners], axis=1)
        away = _angles(region, turns, end, angles)
        passed[owners[away <= limit]] = True
        left = (away - halves.sum() <= limit) & ~passed[owners]
        owners = owners[left]
        middles = middles[left]
        # Halve the remaining boxes in all directions.
        middles = (middles[:, None] + corners * halves).reshape(-1, len(others))
        owners = np.repeat(owners, len(corners))
        halves = 0.5 * halves

    if len(owners) == 0:
        blocked = ~passed
    return blocked


def _span(region: HeldRegion, turn: Turn) -> tuple[float, float]:
    """Return the range of a turn's angle [rad]: a whole turn, or less if it is a single joint with narrower limits."""
    chain = region.robot.chain
    robot = region.robot
    row = turn.joints[0]
    moving = np.flatnonzero(chain.gain[row])

    if (
        len(turn.joints) == 1
        and len(moving) == 1
        and np.isfinite([robot.lower[moving[0]], robot.upper[moving[0]]]).all()
    ):
        k = int(moving[0])
        low, high = sorted(chain.gain[row, k] * np.array([robot.lower[k], robot.upper[k]]) + chain.offset[row])
        if high - low < TAU:
            return float(low), float(high)
    return -np.pi, np.pi


def _angles(region: HeldRegion, turns: list[Turn], end: Rotations, angles: Matrix) -> Vector:
    """Compute how far the frame is from the held orientation.

    Args:
        region: The region.
        turns: All turns, see :func:`_turns`.
        end: The fixed rotation behind the last turn, shape (3, 3).
        angles: Angles of all turns [rad], shape (m, turns).

    Returns:
        Angles [rad], shape (m,).
    """
    R = np.broadcast_to(region.T_w_world[:3, :3], (len(angles), 3, 3))
    for turn, values in zip(turns, angles.T, strict=True):
        R = R @ turn.before @ _rotations(turn.axis, values)
    R = R @ end

    if region.turning == Turning.AXIS:
        cosines = R[:, :, 2] @ region.direction
    else:
        cosines = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    away: Vector = np.arccos(np.clip(cosines, -1.0, 1.0))
    return away


def _rotations(axis: Vector, values: Vector) -> Rotations:
    """Compute rotations about a unit axis by angles [rad], (m,) -> (m, 3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine = np.sin(values)[:, None, None]
    cosine = np.cos(values)[:, None, None]
    made: Rotations = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    return made
