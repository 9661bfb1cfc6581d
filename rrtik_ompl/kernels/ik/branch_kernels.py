"""Closed forms in kernels: all eight branches of many poses, one pose per lane, for kinds of six-joint arms.

Each gives what the readable form in a robot's folder gives, to rounding. A pose that is singular, or so nearly so that
rounding decides, is only marked as odd: that form answers it.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_checks import answer, check_branches, load, placed_entry, placed_origin
from rrtik_ompl.kernels.ik.branch_layout import ArmTable, CallTable
from rrtik_ompl.kernels.ik.parallel_axes import elbow, joints_of, shoulder, wrist, wrist_of
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    absolute,
    choose,
    larger,
    set_truths,
    set_wide_lanes,
    smaller,
    spread_wide,
    square_root,
)
from rrtik_ompl.kernels.simd.wide_angles import HALF_TURN, arc_tangent, opposite, wide_sine_and_cosine, within_half_turn


@inlined
def in_plane(x: Any, y: Any, c: Any, s: Any) -> Any:
    """A vector's parts along and across a vertical plane."""
    return x * c + y * s, y * c - x * s


@inlined
def two_links(first: float, second: float, x: Any, y: Any) -> Any:
    """How two links reach points: the angle of the first and the turn of the second, elbow up, then elbow down.

    Then the cosine of the turn, which says whether they do; see `rrtik_ompl.ik.analytic.analytic_solver.two_links`.
    """
    raw = (x * x + y * y - (first * first + second * second)) * (0.5 / (first * second))
    cosine = larger(smaller(raw, 1.0), -1.0)
    square = (1.0 - cosine) * (1.0 + cosine)
    sine = square_root(choose(square < branch_layout.DOUBLE_ROOT, spread_wide(0.0), square))

    along = first + second * cosine  # of the wrist, seen from the first link
    across = second * sine
    ax = along * x
    ay = along * y
    cx = across * x
    cy = across * y
    return arc_tangent(ay - cx, ax + cy), arc_tangent(ay + cx, ax - cy), arc_tangent(sine, cosine), raw


@inlined
def closes(raw: Any) -> Any:
    """Which targets are in reach, by the cosine of the elbow's turn."""
    return absolute(raw) <= 1.0 + branch_layout.REACH_TOLERANCE


@inlined
def put(call: CallTable, branch: int, block: int, real: Any, q: Any) -> None:
    """Write a branch: which targets it reaches, and its joint values."""
    out = call.q
    set_truths(call.real, WIDTH * answer(call, 0, branch, block), real)
    set_wide_lanes(out, answer(call, 0, branch, block), q[0])
    set_wide_lanes(out, answer(call, 1, branch, block), q[1])
    set_wide_lanes(out, answer(call, 2, branch, block), q[2])
    set_wide_lanes(out, answer(call, 3, branch, block), q[3])
    set_wide_lanes(out, answer(call, 4, branch, block), q[4])
    set_wide_lanes(out, answer(call, 5, branch, block), q[5])


@inlined
def parallel_side(arm: ArmTable, call: CallTable, block: int, side: int, theta1: Any, c: Any, s: Any) -> Any:
    """Four branches of an arm of parallel axes, its azimuth known; the sine h, and which triangles do not close."""
    a1 = arm.numbers[branch_layout.A1]
    a2 = arm.numbers[branch_layout.A2]
    d6 = arm.numbers[branch_layout.D6]
    a3 = arm.numbers[branch_layout.A3]
    a4 = arm.numbers[branch_layout.A4]
    uz = placed_entry(call, 2, 0)
    wz = placed_entry(call, 2, 2)
    x, s5 = in_plane(placed_entry(call, 0, 2), placed_entry(call, 1, 2), c, s)
    along, across = in_plane(placed_entry(call, 0, 0), placed_entry(call, 1, 0), c, s)
    radius, _ = in_plane(
        placed_origin(call, 0) - d6 * placed_entry(call, 0, 2),
        placed_origin(call, 1) - d6 * placed_entry(call, 1, 2),
        c,
        s,
    )
    h = square_root(x * x + wz * wz)
    least = larger(h, branch_layout.SINGULAR)
    missed = h < 0.0  # none yet
    for way in range(2):
        sigma = 1.0 - 2.0 * way
        branch = 4 * side + 2 * way
        cosine = sigma * x / least
        sine = sigma * wz / least
        psi = arc_tangent(sine, cosine)
        theta5 = arc_tangent(s5, sigma * h)

        roll = s5 * (along * cosine + uz * sine) - sigma * h * across
        theta6 = arc_tangent(roll, uz * cosine - along * sine)

        height = placed_origin(call, 2) - d6 * wz - a4 * sine
        up, down, turn, raw = two_links(a2, a3, radius - a1 - a4 * cosine, height)
        missed = missed | (absolute(raw) > 1.0 + branch_layout.REACH_TOLERANCE)
        real = closes(raw)
        put(call, branch, block, real, (theta1, up, turn, within_half_turn(psi - up - turn), theta5, theta6))
        put(call, branch + 1, block, real, (theta1, down, -turn, within_half_turn(psi - down + turn), theta5, theta6))
    return h, missed


@kernel
def solve_parallel(arm: ArmTable, call: CallTable, block: int) -> None:
    """All branches of a block for an arm whose joints 2, 3, 4 are parallel, with a wrist of yaw and roll behind them.

    Branches are (front, back) x (near, far) x (up, down).
    """
    d6 = arm.numbers[branch_layout.D6]
    slack = call.slack
    px = placed_origin(call, 0) - d6 * placed_entry(call, 0, 2)
    py = placed_origin(call, 1) - d6 * placed_entry(call, 1, 2)
    away = square_root(px * px + py * py)
    c = px / larger(away, branch_layout.SINGULAR)
    s = py / larger(away, branch_layout.SINGULAR)
    front = arc_tangent(py, px)

    h, missed = parallel_side(arm, call, block, 0, front, c, s)
    _, missed_too = parallel_side(arm, call, block, 1, opposite(front), -c, -s)
    normal = smaller(
        branch_layout.SINGULAR + branch_layout.ROUNDING / larger(away, branch_layout.SINGULAR), branch_layout.NORMAL
    )
    odd = (away < max(branch_layout.SINGULAR, slack)) | (h < larger(normal, slack))
    odd = odd | ((h < branch_layout.UNSURE) & (missed | missed_too))
    set_truths(call.odd, WIDTH * block, odd)


@kernel
def solve_parallel_arm(arm: ArmTable, call: CallTable, block: int) -> None:
    """All branches of a block for any arm whose axes 2, 3, 4 are parallel and whose axes 5, 6 meet.

    Branches are (shoulder +, -) x (wrist +, -) x (elbow +, -).
    """
    numbers = arm.numbers
    least = max(branch_layout.SINGULAR, call.slack)
    turn, place = wrist_of(
        numbers,
        (placed_entry(call, 0, 0), placed_entry(call, 0, 1), placed_entry(call, 0, 2)),
        (placed_entry(call, 1, 0), placed_entry(call, 1, 1), placed_entry(call, 1, 2)),
        (placed_entry(call, 2, 0), placed_entry(call, 2, 1), placed_entry(call, 2, 2)),
        (placed_origin(call, 0), placed_origin(call, 1), placed_origin(call, 2)),
    )
    odd = spread_wide(0.0) > 0.0  # none yet
    for side in range(2):
        first, seen, near, away = shoulder(numbers, turn, place, 1.0 - 2.0 * side)
        odd = odd | (away < least)
        for way in range(2):
            fifth, middle, sixth, bent, size = wrist(numbers, seen, 1.0 - 2.0 * way)
            odd = odd | (near & bent & (size < least))
            for bend in range(2):
                second, third, real = elbow(numbers, seen[0], middle, 1.0 - 2.0 * bend)
                q = joints_of(numbers, first, second, third, middle, fifth, sixth)
                put(call, 4 * side + 2 * way + bend, block, near & bent & real, q)
    set_truths(call.odd, WIDTH * block, odd)


@inlined
def ball_wrist(call: CallTable, block: int, branch: int, raw: Any, arm_angles: Any, c: Any, s: Any) -> Any:
    """Two branches of an arm with a ball wrist, its first three joints known; the sine of joint 5."""
    theta1, theta2, theta3 = arm_angles
    s23, c23 = wide_sine_and_cosine(theta2 + theta3)
    forward, y = in_plane(placed_entry(call, 0, 2), placed_entry(call, 1, 2), c, s)
    x = forward * c23 + placed_entry(call, 2, 2) * s23
    z = placed_entry(call, 2, 2) * c23 - forward * s23
    sine = square_root(x * x + y * y)
    c4 = -x / larger(sine, branch_layout.SINGULAR)
    s4 = -y / larger(sine, branch_layout.SINGULAR)
    ax = -s4 * c23 * c - c4 * s  # the axis of joint 5, backwards
    ay = -s4 * c23 * s + c4 * c
    az = -s4 * s23

    theta4 = arc_tangent(-y, -x)
    theta5 = arc_tangent(sine, z)
    theta6 = arc_tangent(
        ax * placed_entry(call, 0, 0) + ay * placed_entry(call, 1, 0) + az * placed_entry(call, 2, 0),
        ax * placed_entry(call, 0, 1) + ay * placed_entry(call, 1, 1) + az * placed_entry(call, 2, 1),
    )
    real = closes(raw)
    put(call, branch, block, real, (theta1, theta2, theta3, theta4, theta5, theta6))
    put(call, branch + 1, block, real, (theta1, theta2, theta3, opposite(theta4), -theta5, opposite(theta6)))
    return sine


@inlined
def ball_side(arm: ArmTable, call: CallTable, block: int, side: int, theta1: Any, radius: Any, short: Any) -> Any:
    """Four branches of an arm with a ball wrist, its azimuth known; which have a straight wrist."""
    base = arm.numbers[branch_layout.SHOULDER]
    a2 = arm.numbers[branch_layout.UPPER_ARM]
    forearm = arm.numbers[branch_layout.FOREARM]
    bend = arm.numbers[branch_layout.BEND]
    slack = call.slack
    branch = 4 * side

    up, down, turn, raw = two_links(a2, forearm, radius, placed_origin(call, 2) - base)
    raw = choose(short, spread_wide(2.0), raw)
    s, c = wide_sine_and_cosine(theta1)
    first = ball_wrist(call, block, branch, raw, (theta1, up, within_half_turn(turn - bend)), c, s)
    second = ball_wrist(call, block, branch + 2, raw, (theta1, down, within_half_turn(-turn - bend)), c, s)
    return smaller(first, second) < max(branch_layout.SINGULAR, slack)


@kernel
def solve_ball(arm: ArmTable, call: CallTable, block: int) -> None:
    """All branches of a block for an arm of azimuth, shoulder and elbow with a ball wrist.

    Branches are (front, back) x (up, down) x (near, flip).
    """
    px = placed_origin(call, 0)
    py = placed_origin(call, 1)
    d3 = arm.numbers[branch_layout.ASIDE]
    square = px * px + py * py - d3 * d3
    radius = square_root(choose(square < branch_layout.SHOULDER_ROOT, spread_wide(0.0), square))
    heading = arc_tangent(py, px)
    aside = arc_tangent(spread_wide(d3), radius)
    short = square < -branch_layout.REACH_TOLERANCE
    odd = ball_side(arm, call, block, 0, within_half_turn(heading + aside), radius, short)
    odd = odd | ball_side(arm, call, block, 1, within_half_turn(heading + HALF_TURN - aside), -radius, short)
    set_truths(call.odd, WIDTH * block, odd)


@entry
def parallel_axes(arm: ArmTable, call: CallTable) -> int:
    """Answer all targets of a call; see :func:`solve_parallel`."""
    for block in range(call.blocks):
        load(arm, call, block)
        solve_parallel(arm, call, block)
        check_branches(arm, call, block)
    return 0


@entry
def parallel_arm(arm: ArmTable, call: CallTable) -> int:
    """Answer all targets of a call; see :func:`solve_parallel_arm`."""
    for block in range(call.blocks):
        load(arm, call, block)
        solve_parallel_arm(arm, call, block)
        check_branches(arm, call, block)
    return 0


@entry
def ball_arm(arm: ArmTable, call: CallTable) -> int:
    """Answer all targets of a call; see :func:`solve_ball`."""
    for block in range(call.blocks):
        load(arm, call, block)
        solve_ball(arm, call, block)
        check_branches(arm, call, block)
    return 0
