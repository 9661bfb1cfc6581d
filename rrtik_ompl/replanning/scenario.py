"""A scenario: a problem, obstacles that move, and how to replan among them; from a file or from a seed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rrtik_ompl.errors import InputError
from rrtik_ompl.files.sections import parse
from rrtik_ompl.files.strict_yaml import read_yaml
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_files.problem import ProblemFile, load_problem, problem_path
from rrtik_ompl.replanning import Run, replan
from rrtik_ompl.replanning.loop import GoalFeed
from rrtik_ompl.trajectory.limits import RateLimits


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """What is needed for a run.

    Attributes:
        problem: Robot, scene with its motions, start and goal.
        options: Keyword arguments of :func:`rrtik_ompl.replanning.replan`: step, rate, margin, ...
        goal_feed: A goal that moves, or None.
    """

    problem: Problem
    options: Mapping[str, Any] = field(default_factory=dict)
    goal_feed: GoalFeed | None = None

    def run(self, **changes: Any) -> Run:
        """Replan, with some options changed; see :func:`rrtik_ompl.replanning.replan`."""
        return replan(self.problem, goal_feed=self.goal_feed, **{**self.options, **changes})


def load_scenario(name_or_file: str | os.PathLike[str]) -> Scenario:
    """Load a shipped scenario by name, or from a problem file that has a ``run:`` section.

    Raises:
        InputError: If the file cannot be used or has no such section; one line with file, key and remedy.
        ProblemError: If start or goal is in collision or outside the limits.
    """
    path = problem_path(name_or_file)
    document = read_yaml(path)
    entry = parse(document, ProblemFile).run
    if entry is None:
        raise InputError(f"{path}: a scenario needs the key 'run'; add for instance  run: {{step: 0.05, rate: 50}}")
    problem = load_problem(path)
    options = entry.options()
    with document.at(("run",)):
        goal_feed = entry.goal_motion(problem.robot)
        if entry.velocity is not None:
            options["limits"] = RateLimits.of(problem.robot, velocity=entry.velocity)
    return Scenario(problem, options, goal_feed)
