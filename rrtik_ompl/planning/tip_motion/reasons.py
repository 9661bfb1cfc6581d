"""Why a tip cannot go on along a rail, in a line."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Mask, Vector
from rrtik_ompl.base.units import shown_unit
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.tip_distance import metres_per_radian
from rrtik_ompl.planning.tip_motion.rails import Rail
from rrtik_ompl.planning.tip_motion.values import MOST_ROWS, Followed
from rrtik_ompl.world.world import World

AT_LIMIT = 1e-3  # [rad] or [m]
CUT_OFF = 1e-6  # share of the largest singular value below which a direction counts as lost
LOST = 1e-3  # share of a twist that the joints cannot make, from which on they are too few
LOOKS = 16  # configurations of a motion at which contacts are looked for


def why_stopped(robot: Robot, rail: Rail, followed: Followed) -> str:
    """Why the joints cannot follow a rail farther than they did: the joint at its limit, or the singular posture."""
    if len(followed.rows) >= MOST_ROWS:
        return f"the line takes more than {MOST_ROWS} configurations: allow more deviation"
    q = followed.rows[-1]
    scale = np.repeat([1.0, metres_per_radian(robot)], 3)
    plain = robot.jacobian(q)
    jacobian = plain * scale[:, None]
    twist = rail.twist(float(followed.shares[-1])) * scale

    at_limit = np.zeros(robot.dof, dtype=bool)  # one at its limit leaves its part to others, which may get to theirs
    while (driven_beyond := _driven_beyond_limit(robot, q, jacobian, twist, at_limit)).any():
        at_limit |= driven_beyond

    if at_limit.any():
        return _limits_in_words(robot, q, at_limit)

    values = np.linalg.svd(plain, compute_uv=False)
    lost_twist = twist - jacobian @ (np.linalg.pinv(jacobian, CUT_OFF) @ twist)
    if np.linalg.norm(lost_twist) > LOST * np.linalg.norm(twist) and len(values) < 6:
        return f"{robot.dof} joint{'s' * (robot.dof > 1)} cannot move the tip like this"
    return f"singular posture, or the end of the reach: the smallest singular value is {values[-1]:.3g}"


def why_blocked(world: World, a: Vector, b: Vector, pair: tuple[str, str]) -> str:
    """Why a motion that is not proven free cannot be taken: the pair in contact, or the pair too near for a proof."""
    for share in np.linspace(0.0, 1.0, LOOKS):
        q = a + share * (b - a)
        if not world.checks.free(q[None])[0]:
            return f"contact: {world.explain(q)}"
    first, second = pair
    if not first:
        return "no proof that the motion is free: there are no kernels, or the bodies always touch"
    return f"'{first}' and '{second}' come too near to be proven apart"


def _driven_beyond_limit(robot: Robot, q: Vector, jacobian: Vector, twist: Vector, left_out: Mask) -> Mask:
    """Which joints at a limit a motion of the tip would drive beyond it, those held left out. Shape (dof,)."""
    change = np.zeros(robot.dof)
    change[~left_out] = np.linalg.pinv(jacobian[:, ~left_out], CUT_OFF) @ twist
    low = q <= robot.lower + AT_LIMIT
    high = q >= robot.upper - AT_LIMIT
    pushed: Mask = (low & (change < 0.0)) | (high & (change > 0.0))
    return pushed & ~left_out


def _limits_in_words(robot: Robot, q: Vector, at_limit: Mask) -> str:
    """Which joints are at a limit, and where they are, in words."""
    shown = []
    for joint in np.flatnonzero(at_limit):
        factor, unit = shown_unit(robot.prismatic[joint])
        shown.append(f"'{robot.joint_names[joint]}' ({factor * q[joint]:.4g} {unit})")
    return f"limit of joint{'s' * (len(shown) > 1)} {', '.join(shown)}"
