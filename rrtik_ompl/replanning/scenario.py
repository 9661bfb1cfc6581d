"""A scenario: a problem, obstacles that move, and how to replan among them; from a file or from a seed."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from typing import Any

from rrtik_ompl.base.arrays import seed_of
from rrtik_ompl.base.choices import Replanner
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import read_yaml
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.problem_files.problem_values import ProblemFile, problem_path
from rrtik_ompl.problem_files.run import RunSection
from rrtik_ompl.replanning.feed import Source
from rrtik_ompl.replanning.loop import Clock
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan_with
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.replanning.start_and_goals import GoalFeed
from rrtik_ompl.world.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A problem among moving obstacles, with the settings to replan in it.

    Attributes:
        problem: Robot, scene with its motions, start and goal.
        settings: Steps, ticks, distances and limits.
        goal_feed: Function from a time [s] to the configuration of a moving goal, or None.

    Example:
        >>> scenario = rrtik.replanning.Scenario.load("replan_planar_arm")
        >>> scenario.problem.robot.dof > 1
        True
    """

    problem: Problem
    settings: ReplanSettings
    goal_feed: GoalFeed | None = None

    def run(  # noqa: D417 - the settings are described in one place
        self,
        scene_feed: Source | None = None,
        *,
        step: float | None = None,
        rate: float | None = None,
        planner: Replanner | None = None,
        max_edge: float | None = None,
        margin: float | None = None,
        clearance: float | None = None,
        speed_bound: float | None = None,
        limits: RateLimits | None = None,
        lookahead_ticks: int | None = None,
        seconds: float | None = None,
        repair_budget: float | None = None,
        seed: int | None = 0,
        record: str | os.PathLike[str] | None = None,
        clock: Clock = time.perf_counter,
        feed_patience: float | None = None,
    ) -> ReplanRun:
        """Replan as :func:`rrtik_ompl.replan`, with the scenario's settings in place of those that are None.

        Args:
            scene_feed: The scene over time; this and all other arguments are described there.
            seed: The same seed gives the same run, as long as no repair is cut short by its budget. None draws one.

        Raises:
            InputError: See :func:`rrtik_ompl.replan`.
        """
        given = {
            "step": step,
            "rate": rate,
            "planner": planner,
            "max_edge": max_edge,
            "margin": margin,
            "clearance": clearance,
            "speed_bound": speed_bound,
            "limits": limits,
            "lookahead_ticks": lookahead_ticks,
            "seconds": seconds,
            "repair_budget": repair_budget,
        }
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        settings = replace(self.settings, seed=seed_of(seed), **changes)
        return replan_with(
            settings, self.problem, scene_feed, goal_feed=self.goal_feed, record=record, clock=clock,
            feed_patience=feed_patience,
        )  # fmt: skip

    @staticmethod
    def load(file: str | os.PathLike[str], *, trust_xacro: bool = False) -> Scenario:
        """Load a shipped scenario by name, or from a problem file that has a ``run:`` section.

        Args:
            file: A name that is shipped, or a file.
            trust_xacro: Whether the macros of a robot's file are trusted, see `load_robot`.

        Raises:
            InputError: If the file cannot be used or has no such section; the message has file, key and remedy in one
                line.
            ProblemError: If start or goal is in collision or outside the limits.

        Example:
            >>> rrtik.replanning.Scenario.load("replan_ur5").problem.robot.name
            'ur5'
        """
        return read(Scenario, file, trust_xacro=trust_xacro)


def read_scenario(file: str | os.PathLike[str], *, trust_xacro: bool = False) -> Scenario:
    """Read a scenario; see :meth:`Scenario.load`.

    Raises:
        InputError: If the file cannot be used or has no section ``run``.
        ProblemError: If start or goal is in collision or outside the limits.
    """
    path = problem_path(file)
    document = read_yaml(path)
    entry = parse(document, ProblemFile).run
    if entry is None:
        raise InputError(f"{path}: a scenario needs the key 'run'; add for instance  run: {{step: 0.05, rate: 50}}")
    problem = load_problem(path, trust_xacro=trust_xacro)
    with document.at(("run",)):
        return Scenario(problem, _settings(entry, problem.robot), entry.goal_motion(problem.robot))


def _settings(entry: RunSection, robot: Robot) -> ReplanSettings:
    """Return the settings of a file's ``run:`` section, with limits for the given robot.

    Raises:
        InputError: If a setting does not fit the robot.
    """
    return ReplanSettings(
        step=entry.step,
        rate=entry.rate,
        margin=entry.margin,
        clearance=entry.clearance,
        speed_bound=entry.speed_bound,
        max_edge=entry.max_edge,
        lookahead_ticks=entry.lookahead_ticks,
        repair_budget=entry.repair_budget,
        seconds=entry.seconds,
        limits=None if entry.velocity is None else RateLimits.of(robot, velocity=entry.velocity),
    )
