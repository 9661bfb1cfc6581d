"""What goes beyond [2], with figures: restarts, small motion, gains, refinement, poses, obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_bench.genetic.published import INCH, TOLERANCE, curve
from rrtik_bench.genetic.runs import TRAJECTORIES, TrajectoryRun, arm, mean, median, run, runs
from rrtik_bench.report.page import Report
from rrtik_ompl.ik.genetic.objective import manipulability
from rrtik_ompl.ik.genetic.options import REFINED, STANDARD
from rrtik_ompl.model.shapes import Sphere

FREE = replace(STANDARD, gain=0.0)  # for five joints
GAIN = (
    "With five joints a gain of 0.8 still brings all runs to the end on trajectories 2 and 4 at d7 = 2.2 in, in up to "
    "twice the generations; the sources saw it diverge. A gain of 1 does."
)
SINGULARITY = (
    "It pulls weakly: a point counts as soon as somebody is there, so that there is little time to choose in. Over the "
    "runs it helps on trajectories 2 and 4; on 1 and 3 the branch that was found first matters more."
)
PER_DEGREE = INCH * 180.0 / np.pi  # from inches per degree to metres per radian


def extensions(report: Report, seeds: int) -> None:
    """All of them."""
    restarts(report, seeds)
    small_motion(report, seeds)
    gains(report, max(2, seeds - 2))
    refinement(report, seeds)
    away_from_singularities(report, seeds)
    poses(report, 4 * seeds)
    obstacles(report, seeds)


def _complete(each: list[TrajectoryRun]) -> str:
    return f"{sum(one.completed == 100.0 for one in each)} of {len(each)}"


def restarts(report: Report, seeds: int) -> None:
    rows = []
    for label, options in (
        ("none", replace(FREE, stall=None, start_over=None)),
        ("new population after 60 generations without 1 %", replace(FREE, start_over=None)),
        ("and from the first point after 300 without a point", FREE),
    ):
        cells = [[run(arm(5, 4.0), number, options, seed) for seed in range(2 * seeds)] for number in (1, 2)]
        rows.append([label, *(f"{_complete(each)}, {median(each, 'generations'):.0f}" for each in cells)])
    head = ["restarts", "trajectory 1: runs complete, median generations", "trajectory 2"]
    report.table("Restarts: five joints, d7 = 4 in", head, rows)


def small_motion(report: Report, seeds: int) -> None:
    rows = []
    for weight in (0.0, 0.01, 0.05):
        done = runs(arm(5, 4.0), replace(FREE, motion_weight=weight * PER_DEGREE), 2 * seeds)
        cells = [f"{median(done[n], 'travel'):.0f} ({median(done[n], 'generations'):.0f})" for n in TRAJECTORIES]
        rows.append([str(weight), *cells])
    head = ["weight [in/deg]", *(f"trajectory {n}" for n in TRAJECTORIES)]
    title = (
        f"Small joint motion: five joints, d7 = 4 in, travel of all joints [deg] (generations), median of {2 * seeds}"
    )
    report.table(title, head, rows)


def gains(report: Report, seeds: int) -> None:
    rows = []
    for joints, values in ((3, (0.0, 0.5, 1.0)), (5, (0.0, 0.25, 0.5, 0.8))):
        for gain in values:
            done = [
                [run(arm(joints), n, replace(FREE, gain=gain, start_over=None), s) for s in range(seeds)]
                for n in (2, 4)
            ]
            cells = [f"{mean(each, 'generations'):.0f}, {mean(each, 'completed'):.0f} %" for each in done]
            rows.append([str(joints), f"{gain}", *cells])
    head = ["joints", "gain", "trajectory 2: mean generations, points", "trajectory 4"]
    report.table("Damped extrapolation, no new start of the trajectory", head, rows)
    report.note("Where this differs from the sources", GAIN)


def refinement(report: Report, seeds: int) -> None:
    rows = []
    for joints, gain in ((3, 1.0), (5, 0.0)):
        done = runs(arm(joints), replace(REFINED, gain=gain), seeds)
        for number in TRAJECTORIES:
            each = done[number]
            rows.append(
                [
                    str(joints),
                    str(number),
                    _complete(each),
                    f"{mean(each, 'generations'):.0f}",
                    f"{mean(each, 'first'):.0f}",
                    f"{mean(each, 'single'):.0f}",
                    f"{max(one.generations for one in each)}",
                ]
            )
    head = [
        "joints",
        "trajectory",
        "complete",
        "generations",
        "first point",
        "in one generation [%]",
        "most generations",
    ]
    report.table("Refinement: the ten best take a damped Newton step each generation", head, rows)


def away_from_singularities(report: Report, seeds: int) -> None:
    rows = []
    robot = arm(5, 4.0)
    for weight in (0.0, 0.3, 1.0):
        done = runs(robot, replace(FREE, singularity_weight=weight), seeds)
        cells = []
        for number in TRAJECTORIES:
            least = [manipulability(robot, one.result.q, True).min() for one in done[number]]
            middle = [manipulability(robot, one.result.q, True).mean() for one in done[number]]
            cells.append(f"{np.mean(least):.4f}, {np.mean(middle):.4f} ({_complete(done[number])})")
        rows.append([str(weight), *cells])
    head = ["weight [m]", *(f"trajectory {n}" for n in TRAJECTORIES)]
    title = "Singularities: five joints, d7 = 4 in: least and mean manipulability (lengths in reaches) along the way"
    report.table(title, head, rows)
    report.note("What the singularity term does", SINGULARITY)


def poses(report: Report, count: int) -> None:
    """Straight lines in joint space, 60 poses each, given as poses: position and orientation."""
    rows = []
    for name in ("puma560", "titan4", "ur5", "panda"):
        robot = rrtik.load_robot(name)
        lines = [_line(robot, seed) for seed in range(count)]
        for method in ("genetic", "numeric", "closed-form"):
            if method == "closed-form" and robot.closed_form is None:
                continue
            done = [
                rrtik.solve_ik_trajectory(robot, line, method=method, seconds=5.0, seed=k)
                for k, line in enumerate(lines)
            ]
            whole = [each for each in done if each.found]
            rows.append(
                [
                    name,
                    method,
                    f"{len(whole)} of {count}",
                    str(sum(len(each.jumps) for each in whole)),
                    f"{np.median([each.iterations for each in done]):.0f}",
                    f"{np.median([each.seconds for each in done]):.2f}",
                    f"{max(each.residuals[:, 0].max() for each in whole):.1e}",
                    f"{max(each.residuals[:, 1].max() for each in whole):.1e}",
                ]
            )
    head = ["robot", "method", "complete within 5 s", "jumps in these", "iterations", "seconds", "[m]", "[rad]"]
    report.table("Poses: 60 along a line in joint space, tolerances 1 mm and 0.01 rad", head, rows)


def _line(robot: rrtik.Robot, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    lower, upper = robot.finite_range()
    begin = rng.uniform(lower, upper)
    end = np.clip(begin + rng.uniform(-0.5, 0.5, robot.dof), lower, upper)
    return robot.fk_batch(begin + np.linspace(0.0, 1.0, 60)[:, None] * (end - begin))


def obstacles(report: Report, seeds: int) -> None:
    """A ball where the elbow of one of the two branches passes: the other branch, or the redundancy, goes free."""
    robot = arm(5, 8.0)
    begun = run(robot, 1, FREE, 0).result.q
    elbow = robot.fk_batch(begun[len(begun) // 2][None], "link3")[0, :3, 3]
    world = rrtik.World(robot, rrtik.Scene((rrtik.Obstacle("ball", Sphere(0.12), pin.SE3(np.eye(3), elbow)),)))
    rows = []
    for label, given in (("not told", None), ("told", world)):
        done = [
            rrtik.solve_ik_trajectory(
                robot,
                curve(1) * INCH,
                method="genetic",
                world=given,
                position_tolerance=TOLERANCE * INCH,
                options=FREE,
                seed=seed,
            )
            for seed in range(2 * seeds)
        ]
        hits = [int((~world.valid_batch(each.q)).sum()) for each in done if each.found]
        complete = sum(each.found for each in done)
        rows.append(
            [
                label,
                f"{complete} of {len(done)}",
                f"{sum(hit > 0 for hit in hits)}",
                f"{np.mean(hits):.0f}",
                f"{np.median([each.iterations for each in done]):.0f}",
                f"{np.median([each.seconds for each in done]):.2f}",
            ]
        )
    head = ["the ball", "complete", "runs in collision", "points in collision a run", "generations", "seconds"]
    report.table(
        "Obstacles: five joints, d7 = 8 in, trajectory 1, a ball of 0.12 m at the elbow of one branch", head, rows
    )
