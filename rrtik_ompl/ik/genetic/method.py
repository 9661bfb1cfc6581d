"""The genetic algorithm as a method of `solve_ik`: one point, in the whole range, near a posture."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.ik.genetic.options import REFINED
from rrtik_ompl.ik.genetic.search import follow_targets
from rrtik_ompl.ik.method_interface import Answer, Question
from rrtik_ompl.ik.numeric.restarts import nearest_posture

ROUNDS = 64  # populations, after which it gives up
GENERATIONS = 40  # of each; most that reach the goal do so in ten


def genetic(question: Question) -> Answer:
    """One population after another, each until it reaches a target or stands still; the targets take turns."""
    options = replace(REFINED, generations=GENERATIONS, stall=None, start_over=None)
    found, generations = np.zeros((0, question.robot.dof)), 0
    for number in range(ROUNDS):
        target = question.targets[number % len(question.targets)]
        run = follow_targets(
            question.robot,
            (target,),
            options,
            question.rng,
            accept=question.accept,
            near=question.near,
            deadline=question.deadline,
        )
        found, generations = np.vstack([found, run.q]), generations + run.generations
        if len(found) and not question.all:
            return Answer(found, question.near, generations)
        if run.timed_out or time.monotonic() > question.deadline:
            return _given_up(question, found, generations, timed_out=True)
    return _given_up(question, found, generations, timed_out=False)


def _given_up(question: Question, found: Matrix, generations: int, *, timed_out: bool) -> Answer:
    """What there is, and a posture for the reason: if it is at the goal and will not do, that is the reason."""
    robot, nearest = question.robot, nearest_posture(question)
    row = nearest[None]
    at_goal = row[question.goal.satisfied(robot, row) & robot.within_limits(row)]
    return Answer(np.vstack([found, at_goal[~question.accept(at_goal)]]), nearest, generations, timed_out)
