"""Many queries by several threads: the same paths, and how much sooner they are there."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from bench.scale.clouds import _panda
from bench.shared.problems import goal_joints
from rrtik_ompl import JointPath, plan_many, solve_ik_many
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

ROUNDS = 5

Made = TypeVar("Made")


@dataclass(frozen=True)
class Spread:
    """The same work by one thread and by two.

    ``ratios``: wall time of one over that of two, each pair one after the other; ``rate``: of the quickest run of two
    threads [1/s]; ``alike``: whether both found the same; ``load``: of the machine beside it.
    """

    count: int
    ratios: list[float]
    rate: float
    alike: bool
    found: int
    load: float


def _wall(work: partial[Made]) -> tuple[float, Made]:
    begin = time.perf_counter()
    made = work()
    return time.perf_counter() - begin, made


def plans_in_threads(folder: str, count: int) -> Spread:
    """Queries of a Panda in front of a bookshelf, between configurations at the shelf and others."""
    file = min((Path(folder) / "problems").glob("bookshelf_small*/scene*.yaml"))
    problem = load_motion_bench_maker(file, robot=_panda(folder))
    rng = np.random.default_rng(3)
    rows = rng.uniform(*problem.robot.finite_range(), (4 * count, problem.robot.dof))
    free = rows[problem.world.valid_batch(rows)]
    starts, goals = free[rng.integers(len(free), size=(2, count))]
    starts[::2], goals[1::2] = problem.start, goal_joints(problem)
    ask = partial(plan_many, problem.world, starts, goals, seed=1)
    ratios, rate, alike, found = [], 0.0, True, 0
    for _ in range(ROUNDS):
        (alone, one), (together, two) = (_wall(partial(ask, threads=n)) for n in (1, 2))
        ratios.append(alone / together)
        rate, found = max(rate, count / together), sum(each.found for each in one)
        alike = alike and all(_same(a.path, b.path) for a, b in zip(one, two, strict=True))
    return Spread(count, ratios, rate, alike, found, os.getloadavg()[0])


def _same(one: JointPath | None, other: JointPath | None) -> bool:
    if one is None or other is None:
        return one is other
    return np.array_equal(one.waypoints, other.waypoints)


def poses_in_threads(count: int) -> Spread:
    """Inverse kinematics of many poses of a UR5."""
    from rrtik_ompl import load_robot

    robot = load_robot("ur5")
    rows = np.random.default_rng(1).uniform(*robot.finite_range(), (count, robot.dof))
    ask = partial(solve_ik_many, robot, robot.fk_batch(rows))
    ratios, rate, alike, found = [], 0.0, True, 0
    for _ in range(ROUNDS):
        (alone, one), (together, two) = (_wall(partial(ask, threads=n)) for n in (1, 2))
        ratios.append(alone / together)
        rate, found = max(rate, count / together), int(one.found.sum())
        alike = alike and np.array_equal(one.q, two.q, equal_nan=True)
    return Spread(count, ratios, rate, alike, found, os.getloadavg()[0])
