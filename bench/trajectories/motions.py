"""What is measured of timed paths: limits, jumps, switches, durations; of blended ones faults, proofs, distances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bench.trajectories.cases import Case, lines, planned, single_joint_moves
from rrtik_ompl import RateLimits, time_parameterize
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import Trajectory

BLEND = 0.2  # [rad] of the large table
BLENDS = (0.05, 0.1, 0.2, 0.4)  # of the proofs
PER_SECOND = 4000  # dense grid
OF_A_PART = 10  # lines, or routes of single-joint moves


class Measured(NamedTuple):
    """A path, timed with and without jerk limits.

    Attributes:
        above: By which share a limit is exceeded on a dense grid, 0 or more.
        jumps: Joints whose acceleration jumps with jerk limits.
        switches: Of the acceleration a second and joint, the most.
        jerk_ratio: Duration with jerk limits over that without.
        stop_ratio: Duration over that with a stop at each corner.
        duration: With jerk limits [s].
    """

    above: float
    jumps: int
    switches: float
    jerk_ratio: float
    stop_ratio: float
    duration: float


class Blended(NamedTuple):
    """The blended motions of a path, one for each of ``BLENDS``.

    Attributes:
        corners: How many were rounded, or stopped at.
        faults: Found by a dense check.
        proven: How many motions are proven free.
        provable: How many have a path that is proven free.
        apart: Largest distance from the path over the blend.
    """

    corners: int
    faults: int
    proven: int
    provable: int
    apart: float


class Paths(NamedTuple):
    """All that is measured of the paths of a part."""

    kind: str
    arm: str
    timed: list[Measured]
    blended: list[Blended]


def measured_planned(arm: str, file: str) -> Paths:
    """Of the path of a MotionBenchMaker problem."""
    return _paths("planned", arm, planned(arm, file), blends=True)


def measured_lines(arm: str, part: int) -> Paths:
    """Of lines of the tip."""
    return _paths("line of the tip", arm, lines(arm, part, OF_A_PART), blends=False)


def measured_moves(arm: str, part: int) -> Paths:
    """Of single-joint moves."""
    return _paths("single-joint moves", arm, single_joint_moves(arm, part, OF_A_PART), blends=True)


def _paths(kind: str, arm: str, cases: list[Case], *, blends: bool) -> Paths:
    return Paths(kind, arm, [_timed(case) for case in cases], [_blended(case) for case in cases if blends])


def _timed(case: Case) -> Measured:
    motion = time_parameterize(case.path, case.limits, blend=BLEND, world=case.world)
    brisk = time_parameterize(case.path, case.without_jerk, blend=BLEND, world=case.world)
    stopping = time_parameterize(case.path, case.limits)
    shown, quick = motion.report(case.limits), brisk.report(case.without_jerk)
    above = max(_above(motion, case.limits), _above(brisk, case.without_jerk), 0.0)
    often = max(float(shown.switches.max()), float(quick.switches.max()))
    ratios = (motion.duration / brisk.duration, motion.duration / stopping.duration)
    return Measured(above, int((shown.jump > 0.0).sum()), often, *ratios, motion.duration)


def _above(motion: Trajectory, limits: RateLimits) -> float:
    """By which share limits are exceeded on a dense grid; the jerk by that of every piece."""
    state = motion(np.linspace(0.0, motion.duration, int(PER_SECOND * motion.duration) + 2))
    shares = [
        np.abs(state.velocities).max(axis=0) / limits.velocity,
        np.abs(state.accelerations).max(axis=0) / limits.acceleration,
        np.abs(motion.jerks).max(axis=0) / limits.jerk,
    ]
    return float(np.max(shares)) - 1.0


def _blended(case: Case) -> Blended:
    """Blended motions looked at densely: do they touch anything, how far are they from their paths."""
    sure = bool(case.world.prove(case.path.waypoints).proven)
    faults, proven, apart = 0, 0, 0.0
    for blend in BLENDS:
        motion = time_parameterize(case.path, case.limits, blend=blend, world=case.world)
        faults += len(motion.faults(case.world))
        proven += int(sure and motion.prove(case.world).proven)
        apart = max(apart, _apart(motion, case.path) / blend)
    count = len(BLENDS)
    return Blended(count * (len(case.path.waypoints) - 2), faults, proven, count * sure, apart)


def _apart(motion: Trajectory, path: JointPath) -> float:
    points = motion(np.linspace(0.0, motion.duration, 600)).positions
    best = np.full(len(points), np.inf)
    for a, b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
        share = np.clip((points - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-300), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return float(best.max())
