"""The paths that are timed: MotionBenchMaker paths, lines of the tip, single-joint moves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from rrtik_ompl import RateLimits, load_robot, plan
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik import solve_trajectory
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker
from rrtik_ompl.world.world import World

ARMS = ("panda", "ur5")
JERK_SHARE = 10.0  # times the acceleration a second, where no jerk limit is published
LINE_POINTS = (27, 60, 100, 200, 500)


@dataclass(frozen=True, eq=False)
class Case:
    """A path, its world and limits of its arm."""

    kind: str
    arm: str
    path: JointPath
    world: World
    limits: RateLimits

    @property
    def without_jerk(self) -> RateLimits:
        """The limits, but for the jerk."""
        return RateLimits(self.limits.velocity, self.limits.acceleration)


@cache
def limits_of(arm: str) -> RateLimits:
    """Published limits of the Panda; of the UR5 velocities of its URDF, else defaults, with the jerk of this report."""
    found = RateLimits.of(load_robot(arm))
    if arm == "panda":
        return found
    return RateLimits(found.velocity, found.acceleration, JERK_SHARE * found.acceleration)


def planned_files(folder: Path, per_family: int) -> list[tuple[str, str]]:
    """Arms and MotionBenchMaker problems, so many of each family and arm."""
    found = []
    for arm in ARMS:
        for family in sorted((folder / f"mbm_{arm}" / "problems").iterdir()):
            files = sorted(family.glob("scene*.yaml"))
            found += [(arm, str(file)) for file in files[:: max(1, len(files) // per_family)][:per_family]]
    return found


def planned(arm: str, file: str) -> list[Case]:
    """The path of ``plan()`` for a MotionBenchMaker problem; none if it finds none."""
    problem = load_motion_bench_maker(file, robot=Path(file).parents[2] / f"{arm}.urdf")
    found = plan(problem, seed=1, seconds=20.0)
    return [] if found.path is None else [Case("planned", arm, found.path, problem.world, limits_of(arm))]


def lines(arm: str, part: int, count: int) -> list[Case]:
    """Straight lines of the tip, of 27 to 500 points, from random postures."""
    rng, world, made = np.random.default_rng([11, part]), World(load_robot(arm)), list[Case]()
    low, high = world.robot.finite_range()
    while len(made) < count:
        start = rng.uniform(0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high)
        rows = _line(world.robot, start, rng, LINE_POINTS[len(made) % len(LINE_POINTS)])
        if rows is not None and not JointPath.of(world.robot, rows).violations(world):
            made.append(Case("line of the tip", arm, JointPath.of(world.robot, rows), world, limits_of(arm)))
    return made


def _line(robot: Robot, start: Matrix, rng: np.random.Generator, points: int) -> Matrix | None:
    poses = np.repeat(robot.fk_batch(start[None]), points, axis=0)
    way = rng.normal(size=3)
    poses[:, :3, 3] += np.linspace(0.0, rng.uniform(0.1, 0.3), points)[:, None] * way / np.linalg.norm(way)
    found = solve_trajectory(robot, poses, near=start, position_tolerance=1e-6, orientation_tolerance=1e-5)
    return found.q if found.found and not found.jumps else None


def single_joint_moves(arm: str, part: int, count: int) -> list[Case]:
    """Three to ten moves of one joint each."""
    rng, world, made = np.random.default_rng([12, part]), World(load_robot(arm)), list[Case]()
    robot = world.robot
    low, high = robot.finite_range()
    while len(made) < count:
        rows = [rng.uniform(0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high)]
        for _ in range(int(rng.integers(3, 11))):
            joint = int(rng.integers(robot.dof))
            rows.append(rows[-1].copy())
            rows[-1][joint] = rng.uniform(0.7 * low[joint] + 0.3 * high[joint], 0.3 * low[joint] + 0.7 * high[joint])
        path = JointPath.of(robot, np.array(rows))
        if not path.violations(world):
            made.append(Case("single-joint moves", arm, path, world, limits_of(arm)))
    return made
