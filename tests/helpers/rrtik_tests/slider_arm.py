"""Problems of single-joint searches: shipped ones, and an arm with sliding, continuous and mimic joints."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem

NAMES = ("env_e", "planar3_a", "planar3_c", "planar3_boxes", "planar6_c", "titan4_prisms", "titan4_sdu", "cut_two_ls")


class Plain:
    """A world without its kernels."""

    def __init__(self, world: Any) -> None:
        self.valid, self.motion_valid = world.valid, world.motion_valid
        self.motion_valid_batch, self.robot = world.motion_valid_batch, world.robot


@cache
def shipped(name: str) -> Problem:
    """A problem of ours, its goal a configuration."""
    problem = load_problem(name)
    aims = goal_configurations(problem, np.random.default_rng(0))
    return Problem(problem.world, problem.start, aims.rows[0])
