"""Timed motions: limits, chatter, durations beside toppra and ruckig, torques, blends, the steered tip.

toppra and ruckig, which judge, come with the extra ``test``.
"""

from __future__ import annotations

import warnings
from typing import Annotated

import numpy as np
from typer import Option

from bench.shared.clocks import least
from bench.shared.parts import Parts
from bench.shared.run import Run, Sets
from bench.trajectories import judges
from bench.trajectories.cases import ARMS, planned_files
from bench.trajectories.motions import BLEND, OF_A_PART, Paths, measured_lines, measured_moves, measured_planned
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl import RateLimits
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.motion.trajectory.blending import blended
from rrtik_ompl.motion.trajectory.corners import Polyline, vertices

ROUNDS = 25  # of a measurement of time; the least counts


def main(
    run: Run,
    parts: Parts,
    folder: Sets,
    *,
    per_family: Annotated[int, Option(help="Planned paths of each family of each arm.")] = 29,
    others: Annotated[int, Option(help="Lines of the tip, and as many single-joint moves.")] = 300,
) -> Report:
    """Measure."""
    warnings.simplefilter("ignore")
    report = run.report("Timed motions")
    report.intro = (
        f"Times are processor times, the least of {ROUNDS}; {versions('numpy', 'toppra', 'ruckig')}. The Panda has its "
        "published limits. The UR5 has the velocities of its URDF, full speed after 0.5 s, and 10 times the "
        f"acceleration a second as jerk. Blend {BLEND} rad, all motions proven free in their worlds."
    )
    files = planned_files(folder, per_family)
    further = [(arm, part) for part in range(others // OF_A_PART // len(ARMS)) for arm in ARMS]
    found = [
        *parts(measured_planned, files),
        *parts(measured_lines, further),
        *parts(measured_moves, further),
    ]
    kept(report, found)
    blends(report, found)
    judges.by_toppra(report, parts, files)
    judges.by_ruckig(report, parts)
    judges.by_inverse_dynamics(report, parts)
    judges.steered(report, parts)
    times(report)
    return report


def kept(report: Report, paths: list[Paths]) -> None:
    """Limits, jumps, chatter and durations of all paths, with and without jerk limits."""
    rows = []
    for kind, arm in dict.fromkeys((some.kind, some.arm) for some in paths):
        found = np.array([row for some in paths if (some.kind, some.arm) == (kind, arm) for row in some.timed])
        middle = np.median(found, axis=0)
        cells = [f"{found[:, 0].max():.1e}", f"{found[:, 1].max():.0f}", f"{middle[2]:.1f}, {found[:, 2].max():.1f}"]
        rows.append([kind, arm, str(len(found)), *cells, *(f"{middle[k]:.3f}" for k in (3, 4, 5))])
    every = np.array([row for some in paths for row in some.timed])
    over, jumps, often = every[:, :3].max(axis=0)
    ratio, late = float(np.median(every[:, 3])), int((every[:, 4] > 1.0 + 1e-9).sum())
    report.bar(f"limits on a dense grid, {len(every)} paths", "<= 1e-6 above", f"{over:.1e}", over <= 1e-6)
    report.bar("jumps of the acceleration with jerk limits", "none", f"{jumps:.0f}", jumps == 0)
    report.bar("switches a second and joint", "<= 20", f"{often:.1f} at most", often <= 20.0)
    wanted = "<= 1.15 in the median"
    report.bar("duration with jerk limits over that without", wanted, f"{ratio:.3f}", ratio <= 1.15)
    report.bar("slower than stopping at every corner", "never", f"{late} of {len(every)}", late == 0)
    timing = ("jerk/none", "blend/stop", "duration [s]")
    heads = ("paths", "arm", "", "above limits", "jumps", "switches a second", *timing)
    report.table("Paths", heads, rows, text="Medians; of switches the most too. Ratios of durations: see the bars.")


def blends(report: Report, paths: list[Paths]) -> None:
    """Blended motions of planned paths and of single-joint moves, looked at densely."""
    found = np.array([row for some in paths for row in some.blended])
    count, faults, proven, provable = (int(total) for total in found[:, :4].sum(axis=0))
    farthest = float(found[:, 4].max())
    report.bar(f"dense check of {count} rounded corners", "0 faults", f"{faults} faults", faults == 0)
    report.bar("blended motions of proven paths proven free", "all", f"{proven} of {provable}", proven == provable)
    report.bar("distance from the path over the blend", "<= 0.22", f"{farthest:.3f}", farthest <= 0.22)


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
        spent = [1e3 * least(lambda p=path, r=rates: _timed(p, r), ROUNDS)[0] for rates in (brisk, limits, slack)]  # type: ignore[misc]
        rows.append([name, *(f"{ms:.2f}" for ms in spent)])
        report.bar(f"{name} of 100 waypoints, 7 joints", "<= 1 ms", f"{spent[0]:.2f} ms", spent[0] <= 1.0)
        report.bar(f"{name}, with jerk limits", "<= 5 ms", f"{max(spent[1:]):.2f} ms", max(spent[1:]) <= 5.0)
    heads = ("100 waypoints, 7 joints", "no jerk limit", "published jerk", "10 times the acceleration")
    report.table(
        "Time to compute [ms]", heads, rows, text="Timing alone, from waypoints to a trajectory; proofs aside."
    )


def _timed(path: JointPath, limits: RateLimits) -> Trajectory | None:
    return blended(
        path,
        Polyline.of(vertices(path.waypoints)),
        limits,
        0.1,
        np.inf,
        lambda motion, off_path: np.zeros(0, dtype=np.int64),
    )
