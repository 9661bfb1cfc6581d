"""Closed-form inverse kinematics: 100,000 configurations of every arm, singular ones too, and its speed beside EAIK.

Round trip: forward kinematics of a random configuration inside the joint limits, all branches of that pose, forward
kinematics of all of them. Only branches inside the limits count.
Speed: process CPU time of one thread in batches of 10,000 poses, median of interleaved repeats. EAIK is optional
(``pip install eaik``); it is asked through its batch call with one worker.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Annotated, Any

import numpy as np
from typer import Option

from bench.peers.libraries.eaik import eaik_robot, turned_back
from bench.shared.run import Run
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl import load_robot
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.branches import reference_branches
from rrtik_ompl.ik.analytic.closed_form import form_of, solutions
from rrtik_ompl.model.robot import Robot
from rrtik_robots.puma560 import singular_samples as puma_samples
from rrtik_robots.titan4 import singular_samples as titan_samples

COUNT = 100_000
BATCH = 10_000
EXACT = 1e-8  # rad
SAME = 1e-5  # rad; a stretched elbow is a double root, known to the square root of the rounding


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """What became of one kind of configurations."""

    count: int
    solved: float
    exact: float
    original: float
    flagged: float
    asked_near: float
    position: float
    angle: float


def round_trip(robot: Robot, Q: np.ndarray) -> RoundTrip:
    poses = robot.fk_batch(Q)
    found, near = solutions(robot, poses), solutions(robot, poses, near=Q, check=False)
    errors, asked = nearest_branch(found, Q), nearest_branch(near, Q) < SAME
    assert found.residuals is not None
    return RoundTrip(
        len(Q),
        float(found.valid.any(axis=1).mean()),
        float((errors < EXACT).mean()),
        float(((errors < SAME) | (found.singular > 0)).mean()),
        float((found.singular > 0).mean()),
        float(asked.mean()),
        float(found.residuals[found.valid][:, 0].max(initial=0.0)),
        float(found.residuals[found.valid][:, 1].max(initial=0.0)),
    )


def nearest_branch(found: Any, Q: np.ndarray) -> np.ndarray:
    errors = np.abs(wrapped(found.branches - Q[:, None])).max(axis=2)
    least: np.ndarray = np.where(found.valid, errors, np.inf).min(axis=1)
    return least


def cases(count: int, rng: np.random.Generator) -> list[tuple[Robot, str, np.ndarray]]:
    """Configurations inside the limits: half of them generic, the others in equal shares singular."""
    titan, puma = load_robot("titan4"), load_robot("puma560")
    rows = []
    for case in titan_samples.CASES:
        share = count // 2 if case == "generic" else -(-count // 2 // (len(titan_samples.CASES) - 1))
        inside = titan_samples.configurations_inside(case, share, rng, (titan.lower, titan.upper))
        rows.append((titan, case, inside))
    for case in puma_samples.CASES:
        share = count // 2 if case == "generic" else -(-count // 2 // (len(puma_samples.CASES) - 1))
        rows.append((puma, case, puma_samples.singular_configurations(puma, case, share, rng)))
    for name in ("puma560_3dof", "planar3"):
        robot = load_robot(name)
        rows.append((robot, "generic", rng.uniform(robot.lower, robot.upper, (count, robot.dof))))
    return rows


def speeds(robot: Robot, repeats: int, rng: np.random.Generator) -> dict[str, float]:
    """Poses per second of CPU time."""
    poses = robot.fk_batch(rng.uniform(robot.lower, robot.upper, (BATCH, robot.dof)))
    work: dict[str, Callable[[], Any]] = {
        "all branches, limits": partial(solutions, robot, poses, check=False),
        "and residuals of all": partial(solutions, robot, poses),
        "in numpy": partial(reference_branches, robot, form_of(robot), poses, None, 0.0, True),
    }
    if find_spec("eaik") is not None and robot.dof == 6:
        other, at_zero = eaik_robot(robot)
        work["EAIK"] = partial(other.IK_batched, turned_back(poses, at_zero), 1)
    times: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(repeats + 1):
        for name, run in work.items():
            begin = time.process_time()
            run()
            times[name].append(time.process_time() - begin)
    return {name: BATCH / float(np.median(values[1:])) for name, values in times.items()}


def agreement(robot: Robot, count: int, rng: np.random.Generator) -> str:
    """How our branches and EAIK's compare on random poses."""
    other, at_zero = eaik_robot(robot)
    poses = robot.fk_batch(rng.uniform(robot.lower, robot.upper, (count, robot.dof)))
    found = solutions(robot, poses, check=False)
    turned = poses.copy()
    turned[:, :3, :3] = poses[:, :3, :3] @ at_zero.T
    missed = extra = 0
    for k, answer in enumerate(other.IK_batched(turned, 1)):
        exact = [q for q, approximate in zip(answer.Q, answer.is_LS, strict=True) if not approximate]
        theirs, ours = np.array(exact).reshape(-1, robot.dof), found.branches[k][found.real[k]]
        gaps = np.abs(wrapped(theirs[:, None] - ours[None])).max(axis=2)
        extra += int((gaps.min(axis=0, initial=np.inf) > 1e-6).sum())
        missed += int((gaps.min(axis=1, initial=np.inf) > 1e-6).sum())
    return f"{count} poses: {missed} solutions of EAIK that we do not have, {extra} of ours that EAIK does not have"


def main(run: Run, *, quick: Annotated[bool, Option(help="Fewer configurations.")] = False) -> Report:
    """Measure."""
    rng = np.random.default_rng(0)
    about = f"{versions('numpy', 'eaik')}; seed 0."
    page = run.report("Closed-form inverse kinematics", intro=about)
    shown = ("robot", "case", "configurations", "solved", "exact", "same or flagged", "flagged", "asked near")
    rows = []
    for robot, case, Q in cases(5_000 if quick else COUNT, rng):
        done = round_trip(robot, Q)
        shares = (done.solved, done.exact, done.original, done.flagged, done.asked_near)
        worst = f"{done.position:.1e}", f"{done.angle:.1e}"
        rows.append([robot.name, case, str(done.count), *(f"{share:.3%}" for share in shares), *worst])
    page.table("Round trip", (*shown, "[m]", "[rad]"), rows, text=ROUND_TRIP)
    rows = []
    for name, branches in (("titan4", 8), ("puma560", 8), ("puma560_3dof", 4), ("planar3", 2)):
        got = speeds(load_robot(name), 3 if quick else 9, rng)
        rows.append([name, str(branches), *(f"{got[each]:,.0f}" if each in got else "-" for each in WORK)])
    heads = ("robot", "branches", "all branches, limits", "and residuals of all", "this in numpy", "EAIK")
    page.table("Speed", heads, rows, text=SPEED)
    if find_spec("eaik") is not None:
        count = 500 if quick else 5_000
        lines = [f"- {name}, {agreement(load_robot(name), count, rng)}." for name in ("titan4", "puma560")]
        page.note("The same solutions as EAIK", "\n".join(lines))
    return page


ROUND_TRIP = (
    "All configurations are drawn inside the joint limits, and only branches inside them count. Solved: a branch "
    "reaches the pose. Exact: the configuration is among the branches within 1e-8 rad. Same or flagged: it is among "
    "them within 1e-5 rad (at a stretched elbow, a double root, an angle is known to the square root of the "
    "rounding), or the pose is flagged as singular and answered by its representatives. Asked near: with `near=` the "
    "original that itself is found, within 1e-5 rad. The residuals are the worst of all these branches."
)
WORK = ("all branches, limits", "and residuals of all", "in numpy", "EAIK")
SPEED = (
    f"Poses per second of CPU time, one thread, batches of {BATCH}.\n\nOf arms with six joints kernels do the work; "
    "beside them the same in numpy, which arms without a kernel use."
)
