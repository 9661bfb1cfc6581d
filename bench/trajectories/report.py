"""Timed motions: limits, chatter, durations beside toppra and ruckig, torques, blends, the steered tip.

Usage: ``python bench/trajectories/report.py FOLDER [--per-family 29]``. FOLDER holds the unpacked MotionBenchMaker sets
``mbm_panda`` and ``mbm_ur5`` (see bench/README.md). toppra and ruckig, which judge, come with the extra ``test``.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.shared.pages import add_out
from bench.trajectories import judges
from bench.trajectories.cases import Case, lines, planned, single_joint_moves
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl import RateLimits, motion_report, time_parameterize
from rrtik_ompl.path import JointPath
from rrtik_ompl.trajectory import Trajectory
from rrtik_ompl.trajectory.blending import blended
from rrtik_ompl.trajectory.corners import vertices

BLEND = 0.2  # [rad] of the large table
BLENDS = (0.05, 0.1, 0.2, 0.4)  # of the proofs
PER_SECOND = 4000  # dense grid
ROUNDS = 7  # of a measurement of time; the least counts


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--per-family", type=int, default=29, help="planned paths of each family of each arm")
    parser.add_argument("--others", type=int, default=300, help="lines of the tip, and as many single-joint moves")
    add_out(parser, "trajectories.md")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    routes = list(planned(given.folder, given.per_family))
    report = Report("Timed motions", "python bench/trajectories/report.py FOLDER")
    report.intro = (
        f"Times are processor times, the least of {ROUNDS}; {versions('numpy', 'toppra', 'ruckig')}. The Panda has its "
        "published limits. The UR5 has the velocities of its URDF, full speed after 0.5 s, and 10 times the "
        f"acceleration a second as jerk. Blend {BLEND} rad, all motions proven free in their worlds."
    )
    kept(report, [*routes, *lines(given.others), *single_joint_moves(given.others)])
    blends(report, routes)
    judges.by_toppra(report, routes)
    judges.by_ruckig(report)
    judges.by_inverse_dynamics(report)
    judges.steered(report)
    times(report)
    return report.finish(given.out)


def kept(report: Report, cases: list[Case]) -> None:
    """Limits, jumps, chatter and durations of all paths, with and without jerk limits."""
    rows, over, jumps, often, late, ratios = [], 0.0, 0.0, 0.0, 0, []
    for kind, arm in dict.fromkeys((case.kind, case.arm) for case in cases):
        some = [case for case in cases if (case.kind, case.arm) == (kind, arm)]
        found = np.array([_measured(case) for case in some])
        over, jumps = max(over, found[:, 0].max()), max(jumps, found[:, 1].max())
        often, late = max(often, found[:, 2].max()), late + int((found[:, 4] > 1.0 + 1e-9).sum())
        ratios += found[:, 3].tolist()
        middle = np.median(found, axis=0)
        cells = [f"{found[:, 0].max():.1e}", f"{found[:, 1].max():.0f}", f"{middle[2]:.1f}, {found[:, 2].max():.1f}"]
        rows.append([kind, arm, str(len(some)), *cells, *(f"{middle[k]:.3f}" for k in (3, 4, 5))])
        print(rows[-1], file=sys.stderr)
    report.bar(f"limits on a dense grid, {len(cases)} paths", "<= 1e-6 above", f"{over:.1e}", over <= 1e-6)
    report.bar("jumps of the acceleration with jerk limits", "none", f"{jumps:.0f}", jumps == 0)
    report.bar("switches a second and joint", "<= 20", f"{often:.1f} at most", often <= 20.0)
    middle_ratio = float(np.median(ratios))
    report.bar(
        "duration with jerk limits over that without",
        "<= 1.15 in the median",
        f"{middle_ratio:.3f}",
        middle_ratio <= 1.15,
    )
    report.bar("slower than stopping at every corner", "never", f"{late} of {len(cases)}", late == 0)
    heads = (
        "paths",
        "arm",
        "",
        "above limits",
        "jumps",
        "switches a second",
        "jerk/none",
        "blend/stop",
        "duration [s]",
    )
    report.table("Paths", heads, rows, text="Medians; of switches the most too. Ratios of durations: see the bars.")


def _measured(case: Case) -> tuple[float, ...]:
    motion = time_parameterize(case.path, case.limits, blend=BLEND, world=case.world)
    brisk = time_parameterize(case.path, case.without_jerk, blend=BLEND, world=case.world)
    stopping = time_parameterize(case.path, case.limits)
    shown, quick = motion_report(motion, case.limits), motion_report(brisk, case.without_jerk)
    above = max(_above(motion, case.limits), _above(brisk, case.without_jerk), 0.0)
    often = max(float(shown.switches.max()), float(quick.switches.max()))
    ratios = (motion.duration / brisk.duration, motion.duration / stopping.duration, motion.duration)
    return (above, float((shown.jump > 0.0).sum()), often, *ratios)


def _above(motion: Trajectory, limits: RateLimits) -> float:
    """By which share limits are exceeded on a dense grid; the jerk by that of every piece."""
    state = motion(np.linspace(0.0, motion.duration, int(PER_SECOND * motion.duration) + 2))
    shares = [
        np.abs(state.velocities).max(axis=0) / limits.velocity,
        np.abs(state.accelerations).max(axis=0) / limits.acceleration,
        np.abs(motion.jerks).max(axis=0) / limits.jerk,
    ]
    return float(np.max(shares)) - 1.0


def blends(report: Report, cases: list[Case]) -> None:
    """Blended motions looked at densely: do they touch anything, how far are they from their paths."""
    count = faults = proven = provable = 0
    farthest = 0.0
    for case in cases:
        sure = case.world.prove(case.path.waypoints).proven
        for blend in BLENDS:
            motion = time_parameterize(case.path, case.limits, blend=blend, world=case.world)
            count += len(case.path.waypoints) - 2
            faults += len(motion.faults(case.world))
            provable += sure
            proven += sure and motion.prove(case.world).proven
            farthest = max(farthest, _apart(motion, case.path) / blend)
    motions = len(cases) * len(BLENDS)
    report.bar(f"dense check of {count} corners, {motions} motions", "0 faults", f"{faults} faults", faults == 0)
    report.bar("blended motions of proven paths proven free", "all", f"{proven} of {provable}", proven == provable)
    report.bar("distance from the path over the blend", "<= 0.22", f"{farthest:.3f}", farthest <= 0.22)


def _apart(motion: Trajectory, path: JointPath) -> float:
    points = motion(np.linspace(0.0, motion.duration, 600)).positions
    best = np.full(len(points), np.inf)
    for a, b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
        share = np.clip((points - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-300), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return float(best.max())


def times(report: Report) -> None:
    """How long timing takes, without checks."""
    turn = np.linspace(0.0, 1.0, 100)[:, None]
    rng = np.random.default_rng(1)
    routes = {
        "a smooth curve": np.sin(turn * [1, 2, 3, 2, 1, 4, 2]) * 0.8,
        "99 corners": np.cumsum(0.1 * rng.normal(size=(100, 7)), axis=0),
    }
    rows = []
    for name, waypoints in routes.items():
        path, limits = JointPath(waypoints), judges.PANDA
        brisk = RateLimits(limits.velocity, limits.acceleration)
        slack = RateLimits(limits.velocity, limits.acceleration, 10.0 * limits.acceleration)
        spent = [1e3 * least(lambda p=path, r=rates: _timed(p, r)) for rates in (brisk, limits, slack)]  # type: ignore[misc]
        rows.append([name, *(f"{ms:.2f}" for ms in spent)])
        report.bar(f"{name} of 100 waypoints, 7 joints", "<= 1 ms", f"{spent[0]:.2f} ms", spent[0] <= 1.0)
        report.bar(f"{name}, with jerk limits", "<= 5 ms", f"{max(spent[1:]):.2f} ms", max(spent[1:]) <= 5.0)
    heads = ("100 waypoints, 7 joints", "no jerk limit", "published jerk", "10 times the acceleration")
    report.table(
        "Time to compute [ms]", heads, rows, text="Timing alone, from waypoints to a trajectory; proofs aside."
    )


def _timed(path: JointPath, limits: RateLimits) -> Trajectory | None:
    return blended(
        path, vertices(path.waypoints), limits, 0.1, np.inf, lambda motion, off_path: np.zeros(0, dtype=np.int64)
    )


def least(work: Callable[[], object]) -> float:
    """Least processor time of a few rounds [s]."""
    spent = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return min(spent)


if __name__ == "__main__":
    sys.exit(main())
