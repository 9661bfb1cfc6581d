"""A tip that follows a rail, in kernels: Newton's method [22] at points of the rail, steps as long as they may be.

Between two points the joints move in a straight line, and the tip leaves the rail. By how much is bounded, not sampled:
its distance is 0 at both ends, it is measured in the middle, and by the remainder of quadratic interpolation
[61, ch. 2.1] it is no more elsewhere than there plus ``REMAINDER`` times a bound of its third derivative.
:mod:`rrtik_ompl.planning.tip_motion.following` is the same in numpy.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.ik import ik_layout, rail_layout
from rrtik_ompl.kernels.ik.ik_accessors import (
    aim_at,
    pose_column,
    pose_origin,
    set_pose_entry,
    set_pose_origin,
)
from rrtik_ompl.kernels.ik.ik_kernels import fill_square, hold_at_limits, solve_square, step
from rrtik_ompl.kernels.ik.ik_kinematics import differentiate, measure, move_tip, see_from, weigh
from rrtik_ompl.kernels.ik.ik_layout import Aim, CallTable, LimbTable
from rrtik_ompl.kernels.ik.rail_layout import (
    DAMPING,
    LARGEST_CHANGE,
    LARGEST_GROWTH,
    NEWTON_STEPS,
    REMAINDER,
    ROOM,
    SMALLEST_SHRINKING,
    Rail,
    RailTable,
)
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at

TOO_FAR = 1e300  # of a step that cannot be taken


@inlined
def three(rail: Rail, place: int) -> Any:
    """Three numbers of a rail."""
    return rail[place], rail[place + 1], rail[place + 2]


@inlined
def turned(axis: Any, cosine: float, sine: float, vector: Any) -> Any:
    """A vector turned about a unit axis: Rodrigues' formula."""
    a, b, c = axis
    x, y, z = vector
    along = (1.0 - cosine) * (a * x + b * y + c * z)
    return (
        cosine * x + sine * (b * z - c * y) + along * a,
        cosine * y + sine * (c * x - a * z) + along * b,
        cosine * z + sine * (a * y - b * x) + along * c,
    )


@kernel
def place_aim(table: RailTable, aim: Aim, share: float) -> None:
    """Set the pose of a goal to that of the rail at a share of it."""
    rail = table.rail
    centre = three(rail, rail_layout.CENTRE)
    slide = three(rail, rail_layout.SLIDE)
    angle = share * rail[rail_layout.ARC_ANGLE]
    lever = (
        pose_origin(rail, 0) - centre[0],
        pose_origin(rail, 1) - centre[1],
        pose_origin(rail, 2) - centre[2],
    )
    x, y, z = turned(three(rail, rail_layout.ARC_AXIS), math.cos(angle), math.sin(angle), lever)
    set_pose_origin(aim, 0, centre[0] + x + share * slide[0])
    set_pose_origin(aim, 1, centre[1] + y + share * slide[1])
    set_pose_origin(aim, 2, centre[2] + z + share * slide[2])
    angle = share * rail[rail_layout.TURN_ANGLE]
    cosine = math.cos(angle)
    sine = math.sin(angle)
    for column in range(3):
        x, y, z = turned(three(rail, rail_layout.TURN_AXIS), cosine, sine, pose_column(rail, column))
        set_pose_entry(aim, 0, column, x)
        set_pose_entry(aim, 1, column, y)
        set_pose_entry(aim, 2, column, z)


@kernel
def correct(limb: LimbTable, call: CallTable, aim: Aim, q: Configuration) -> bool:
    """Bring the tip to a goal near by, inside the limits; whether it is there."""
    see_from(limb, call, aim)
    for k in range(NEWTON_STEPS + 1):
        tip = move_tip(limb, call, q)
        if measure(call, aim, tip):
            return True
        if k < NEWTON_STEPS:
            weigh(call)
            differentiate(limb, call, aim, tip)
            hold_at_limits(limb, call, q)
            fill_square(limb, call, DAMPING)
            solve_square(call)
            step(limb, call, q)
    return False


@kernel
def guess(limb: LimbTable, table: RailTable, row: int, share: float) -> None:
    """Set the trial configuration with which a step of a share of the rail begins."""
    dof = limb.dof
    trial = table.trial
    far = share
    now = row_at(table.q, dof, row)
    at = table.shares[row]
    if table.homing != 0:
        far = share / (1.0 - at)
    again = 0.0
    before = now
    if row > 0 and table.momentum != 0:
        before = row_at(table.q, dof, row - 1)
        again = share / (at - table.shares[row - 1])
    for k in range(dof):
        value = now[k]
        drawn = far * table.pull[k] * (table.reference[k] - value)
        value += drawn + again * (value - before[k])
        low = limb.lower[k]
        high = limb.upper[k]
        trial[k] = min(max(value, low), high)


@kernel
def bent(limb: LimbTable, table: RailTable, now: Configuration, share: float) -> Any:
    """Bounds of the third derivatives of the tip's distance [m] and turn over a step to the trial configuration."""
    turn = 0.0
    swept = 0.0
    slid = 0.0
    for joint in range(limb.joints):
        column = limb.column[joint]
        change = limb.gain[joint] * (table.trial[column] - now[column])
        if limb.sliding[joint] != 0:
            slid += abs(change)
        else:
            turn += abs(change)
            swept += abs(change) * table.levers[joint]
    rail = table.rail
    arc = abs(share * rail[rail_layout.ARC_ANGLE])
    own = abs(share * rail[rail_layout.TURN_ANGLE])
    return turn * turn * (swept + 3.0 * slid) + arc * arc * arc * rail[
        rail_layout.ARC_RADIUS
    ], turn * turn * turn + own * own * own


@kernel
def strayed(limb: LimbTable, call: CallTable, table: RailTable, row: int, share: float) -> float:
    """How far the tip leaves the rail on the way to the trial configuration at most; 1 is what it may."""
    dof = limb.dof
    trial = table.trial
    middle = table.middle
    now = row_at(table.q, dof, row)
    aim = aim_at(call, 0)
    for k in range(dof):
        a = now[k]
        b = trial[k]
        if abs(b - a) > LARGEST_CHANGE:
            return TOO_FAR
        middle[k] = 0.5 * (a + b)
    place_aim(table, aim, table.shares[row] + 0.5 * share)
    see_from(limb, call, aim)
    measure(call, aim, move_tip(limb, call, middle))
    error = call.error
    away = 0.0
    chord = 0.0
    for k in range(3):
        away += error[ik_layout.LINEAR + k] ** 2
        chord += error[ik_layout.ANGULAR + k] ** 2
    third, third_turn = bent(limb, table, now, share)
    distance = math.sqrt(away) + REMAINDER * third
    turn = math.sqrt(chord) + math.sqrt(1.5) * REMAINDER * third_turn  # columns' distances, as a chord
    worst: float = max(distance / table.deviation, turn / table.chord)
    return worst


@kernel
def advance(limb: LimbTable, call: CallTable, table: RailTable, row: int, share: float) -> float:
    """Try a step from a row; how far it strays, 1 at most if it was taken."""
    dof = limb.dof
    aim = aim_at(call, 0)
    at = table.shares[row] + share
    guess(limb, table, row, share)
    place_aim(table, aim, at)
    if not correct(limb, call, aim, table.trial):
        return TOO_FAR
    far = strayed(limb, call, table, row, share)
    if far <= 1.0 - ROOM:
        after = row_at(table.q, dof, row + 1)
        for k in range(dof):
            after[k] = table.trial[k]
        table.shares[row + 1] = at
        table.count = row + 2
    return far


@entry
def follow(limb: LimbTable, call: CallTable, table: RailTable) -> int:
    """Follow the rail from the last row as far as possible; 1 at its end, 2 if there is no room left, 0 elsewhere."""
    share = table.first_step
    smallest = table.smallest
    while True:
        row = table.count - 1
        left = 1.0 - table.shares[row]
        if left <= smallest:
            return 1
        if table.count >= table.capacity:
            return 2
        tried = left if share >= left - smallest else share
        far = advance(limb, call, table, row, tried)
        change = 0.9 / math.sqrt(far) if far > 0.0 else LARGEST_GROWTH
        share = tried * min(max(change, SMALLEST_SHRINKING), LARGEST_GROWTH)
        if share < smallest:
            return 0
