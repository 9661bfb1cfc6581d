"""A tip that follows a rail, in kernels: Newton's method [22] at points of the rail, steps as long as they may be.

Between two points the joints move in a straight line, and the tip leaves the rail. By how much is bounded, not sampled:
its distance is 0 at both ends, it is measured in the middle, and by the remainder of quadratic interpolation
[61, ch. 2.1] it is no more elsewhere than there plus ``REMAINDER`` times a bound of its third derivative.
:mod:`rrtik_ompl.planning.tip_motion.reference_follow` is the same in numpy.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.ik import ik_layout, rail_layout
from rrtik_ompl.kernels.ik.ik_accessors import (
    aim_at,
    column_of,
    configuration_at,
    dof_of,
    error_of,
    gain_of,
    joint_count_of,
    lower_of,
    pose_column,
    pose_origin,
    set_pose_entry,
    set_pose_origin,
    sliding_of,
    upper_of,
)
from rrtik_ompl.kernels.ik.ik_kernels import fill_square, hold_at_limits, solve_square, step
from rrtik_ompl.kernels.ik.ik_kinematics import differentiate, measure, move_tip, see_from, weigh
from rrtik_ompl.kernels.ik.ik_layout import Aim, CallTable, Configuration, LimbTable
from rrtik_ompl.kernels.ik.rail_accessors import (
    arc_angle_of,
    arc_axis_of,
    arc_radius_of,
    begin_of,
    capacity_of,
    centre_of,
    levers_of,
    middle_of,
    pull_of,
    rail_of,
    reference_of,
    row_count_of,
    rows_of,
    set_row_count,
    setting,
    shares_of,
    slide_of,
    trial_of,
    turn_angle_of,
    turn_axis_of,
)
from rrtik_ompl.kernels.ik.rail_layout import (
    DAMPING,
    LARGEST_CHANGE,
    LARGEST_GROWTH,
    NEWTON_STEPS,
    REMAINDER,
    ROOM,
    SMALLEST_SHRINKING,
    RailTable,
)
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, int_at, set_double

TOO_FAR = 1e300  # of a step that cannot be taken


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
    rail = rail_of(table)
    begin, centre, slide = begin_of(rail), centre_of(rail), slide_of(rail)
    angle = share * arc_angle_of(rail)
    lever = (
        pose_origin(begin, 0) - centre[0],
        pose_origin(begin, 1) - centre[1],
        pose_origin(begin, 2) - centre[2],
    )
    x, y, z = turned(arc_axis_of(rail), math.cos(angle), math.sin(angle), lever)
    set_pose_origin(aim, 0, centre[0] + x + share * slide[0])
    set_pose_origin(aim, 1, centre[1] + y + share * slide[1])
    set_pose_origin(aim, 2, centre[2] + z + share * slide[2])
    angle = share * turn_angle_of(rail)
    cosine, sine = math.cos(angle), math.sin(angle)
    for column in range(3):
        x, y, z = turned(turn_axis_of(rail), cosine, sine, pose_column(begin, column))
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
    dof, trial, far = dof_of(limb), trial_of(table), share
    now = configuration_at(rows_of(table), dof, row)
    at = double_at(shares_of(table), row)
    if setting(table, rail_layout.HOMING) > 0.0:
        far = share / (1.0 - at)
    again = 0.0
    before = now
    if row > 0 and setting(table, rail_layout.MOMENTUM) > 0.0:
        before = configuration_at(rows_of(table), dof, row - 1)
        again = share / (at - double_at(shares_of(table), row - 1))
    for k in range(dof):
        value = double_at(now, k)
        drawn = far * double_at(pull_of(table), k) * (double_at(reference_of(table), k) - value)
        value += drawn + again * (value - double_at(before, k))
        low, high = double_at(lower_of(limb), k), double_at(upper_of(limb), k)
        set_double(trial, k, min(max(value, low), high))


@kernel
def bent(limb: LimbTable, table: RailTable, now: Configuration, share: float) -> Any:
    """Bounds of the third derivatives of the tip's distance [m] and turn over a step to the trial configuration."""
    turn, swept, slid = 0.0, 0.0, 0.0
    for joint in range(joint_count_of(limb)):
        column = int_at(column_of(limb), joint)
        change = double_at(gain_of(limb), joint) * (double_at(trial_of(table), column) - double_at(now, column))
        if int_at(sliding_of(limb), joint) != 0:
            slid += abs(change)
        else:
            turn += abs(change)
            swept += abs(change) * double_at(levers_of(table), joint)
    rail = rail_of(table)
    arc, own = abs(share * arc_angle_of(rail)), abs(share * turn_angle_of(rail))
    return turn * turn * (swept + 3.0 * slid) + arc * arc * arc * arc_radius_of(
        rail
    ), turn * turn * turn + own * own * own


@kernel
def strayed(limb: LimbTable, call: CallTable, table: RailTable, row: int, share: float) -> float:
    """How far the tip leaves the rail on the way to the trial configuration at most; 1 is what it may."""
    dof, trial, middle = dof_of(limb), trial_of(table), middle_of(table)
    now, aim = configuration_at(rows_of(table), dof, row), aim_at(call, 0)
    for k in range(dof):
        a, b = double_at(now, k), double_at(trial, k)
        if abs(b - a) > LARGEST_CHANGE:
            return TOO_FAR
        set_double(middle, k, 0.5 * (a + b))
    place_aim(table, aim, double_at(shares_of(table), row) + 0.5 * share)
    see_from(limb, call, aim)
    measure(call, aim, move_tip(limb, call, middle))
    error, away, chord = error_of(call), 0.0, 0.0
    for k in range(3):
        away += double_at(error, ik_layout.LINEAR + k) ** 2
        chord += double_at(error, ik_layout.ANGULAR + k) ** 2
    third, third_turn = bent(limb, table, now, share)
    distance = math.sqrt(away) + REMAINDER * third
    turn = math.sqrt(chord) + math.sqrt(1.5) * REMAINDER * third_turn  # columns' distances, as a chord
    worst: float = max(distance / setting(table, rail_layout.DEVIATION), turn / setting(table, rail_layout.CHORD))
    return worst


@kernel
def advance(limb: LimbTable, call: CallTable, table: RailTable, row: int, share: float) -> float:
    """Try a step from a row; how far it strays, 1 at most if it was taken."""
    dof, aim = dof_of(limb), aim_at(call, 0)
    at = double_at(shares_of(table), row) + share
    guess(limb, table, row, share)
    place_aim(table, aim, at)
    if not correct(limb, call, aim, trial_of(table)):
        return TOO_FAR
    far = strayed(limb, call, table, row, share)
    if far <= 1.0 - ROOM:
        after = configuration_at(rows_of(table), dof, row + 1)
        for k in range(dof):
            set_double(after, k, double_at(trial_of(table), k))
        set_double(shares_of(table), row + 1, at)
        set_row_count(table, row + 2)
    return far


@entry
def follow(limb: LimbTable, call: CallTable, table: RailTable) -> int:
    """Follow the rail from the last row as far as possible; 1 at its end, 2 if there is no room left, 0 elsewhere."""
    share = setting(table, rail_layout.FIRST_STEP)
    smallest = setting(table, rail_layout.SMALLEST)
    while True:
        row = row_count_of(table) - 1
        left = 1.0 - double_at(shares_of(table), row)
        if left <= smallest:
            return 1
        if row_count_of(table) >= capacity_of(table):
            return 2
        tried = left if share >= left - smallest else share
        far = advance(limb, call, table, row, tried)
        change = 0.9 / math.sqrt(far) if far > 0.0 else LARGEST_GROWTH
        share = tried * min(max(change, SMALLEST_SHRINKING), LARGEST_GROWTH)
        if share < smallest:
            return 0
