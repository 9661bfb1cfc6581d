"""Runs of the genetic algorithm along the trajectories of [2], and what is read off them."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.genetic.published import INCH, POINTS, TOLERANCE, curve
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.genetic.options import GeneticOptions
from rrtik_ompl.ik.genetic.search import GeneticRun, follow_targets
from rrtik_ompl.model.robot import Robot

TRAJECTORIES = (1, 2, 3, 4)
JUMP = 10.0  # [deg]


@dataclass(frozen=True)
class TrajectoryRun:
    """One run along one trajectory; ``seconds`` are of the processor."""

    robot: Robot
    trajectory: int
    result: GeneticRun
    seconds: float

    @property
    def completed(self) -> float:
        """Points reached, in per cent."""
        return 100.0 * len(self.result.q) / POINTS

    @property
    def generations(self) -> int:
        """In all."""
        return self.result.generations

    @property
    def first(self) -> float:
        """Generations to the first point; NaN if it was not reached."""
        return float(self.result.cost_of_point[0]) if len(self.result.q) else np.nan

    @property
    def single(self) -> float:
        """Points that cost one generation, in per cent."""
        return 100.0 * float((self.result.cost_of_point == 1).mean()) if len(self.result.q) else 0.0

    @property
    def steps(self) -> np.ndarray:
        """Of each joint between consecutive points [deg]."""
        return np.degrees(np.abs(np.diff(self.result.q, axis=0)))

    @property
    def largest_step(self) -> float:
        """Of any joint between consecutive points [deg]."""
        return float(self.steps.max(initial=0.0))

    @property
    def jumps(self) -> int:
        """Points at which a joint moves farther than `JUMP`."""
        return int((self.steps > JUMP).any(axis=1).sum())

    @property
    def travel(self) -> float:
        """Of all joints together [deg]."""
        return float(self.steps.sum())

    @property
    def errors(self) -> np.ndarray:
        """Distances of the stored points from their targets [in]."""
        tips = self.robot.fk_batch(self.result.q)[:, :3, 3] / INCH
        errors: Vector = np.linalg.norm(tips - curve(self.trajectory)[: len(tips)], axis=1)
        return errors

    @property
    def off_branch(self) -> float:
        """Largest angle from that branch of the closed form that is nearest over the whole trajectory [deg]."""
        found = solutions(self.robot, curve(self.trajectory)[: len(self.result.q)] * INCH, check=False)
        away = np.abs(wrapped(found.branches - self.result.q[:, None])).max(axis=(0, 2))
        return float(np.degrees(away.min()))


def arm(joints: int, d7: float = 2.2) -> Robot:
    """The arm of three joints, or that of five with a last segment of ``d7`` inches."""
    return (
        rrtik.load_robot("puma560_3dof")
        if joints == 3
        else rrtik.load_robot("puma560_5dof", parameters={"lengths": {"d7": d7 * INCH}})
    )


def run(robot: Robot, trajectory: int, options: GeneticOptions, seed: int) -> TrajectoryRun:
    """Once along a published trajectory, to the published limit of generations."""
    goals = [rrtik.PositionGoal(point, TOLERANCE * INCH) for point in curve(trajectory) * INCH]
    limit = 10_000 if robot.dof == 3 else 20_000
    begin = time.process_time()
    result = follow_targets(robot, goals, replace(options, generations=limit), np.random.default_rng(seed))
    return TrajectoryRun(robot, trajectory, result, time.process_time() - begin)


def runs(robot: Robot, options: GeneticOptions, seeds: int) -> dict[int, list[TrajectoryRun]]:
    """By trajectory, one run per seed."""
    return {number: [run(robot, number, options, seed) for seed in range(seeds)] for number in TRAJECTORIES}


def mean(values: list[TrajectoryRun], what: str) -> float:
    """Of a property of `TrajectoryRun`."""
    return float(np.mean([getattr(each, what) for each in values]))


def median(values: list[TrajectoryRun], what: str) -> float:
    """Of a property of `TrajectoryRun`."""
    return float(np.median([getattr(each, what) for each in values]))
