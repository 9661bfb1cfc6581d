"""Replanning: a robot on its way to a goal while obstacles move, by DRRT-Con or, to compare with, by two others."""

from __future__ import annotations

import os
import time

from rrtik_ompl.errors import InputError, require
from rrtik_ompl.files.text import check_target, file_name
from rrtik_ompl.problem import Problem
from rrtik_ompl.replanning.feed import Source, SpeedWarning, feed_of
from rrtik_ompl.replanning.loop import Clock, GoalFeed, Loop
from rrtik_ompl.replanning.run import Run, Tick, load_run
from rrtik_ompl.replanning.settings import PLANNERS, settings
from rrtik_ompl.trajectory.limits import RateLimits

__all__ = ["PLANNERS", "Run", "SpeedWarning", "Tick", "load_run", "replan"]


def replan(
    problem: Problem,
    scene_feed: Source | None = None,
    *,
    step: float,
    rate: float,
    planner: str = "drrt-con",
    eps: float | None = None,
    margin: float = 0.0,
    speed_bound: float | None = None,
    limits: RateLimits | None = None,
    predict: int = 0,
    seconds: float = 60.0,
    slot: float | None = None,
    seed: int = 0,
    goal_feed: GoalFeed | None = None,
    record: str | os.PathLike[str] | None = None,
    clock: Clock = time.perf_counter,
) -> Run:
    """Move a robot to its goal while obstacles move: source DRRT-Con paper.

    In each tick the scene is looked at; if anything has moved the path is checked again, in one call; if it is hit, it
    is repaired; then the robot goes one step, and only where that step is free now. Nothing is assumed of what
    obstacles will do, unless ``predict`` says so. Where there is no path the robot waits; where an obstacle comes
    nearer than allowed it goes out of its way.

    No contact can happen in a step along the path if no obstacle is faster than ``speed_bound``: the robot stays
    ``margin`` and as far as an obstacle comes in a tick away from what moves, and ``margin`` from all else. What moves
    is what states a motion or was seen to; an obstacle of a feed that sets off beside the robot comes unannounced, and
    a robot that is cornered can still be run over.

    Args:
        problem: Robot, scene at the begin, start and goal. Of a pose, position or region all configurations are goals:
            if one is blocked another one is tried.
        scene_feed: What is seen over time: a scene whose obstacles state their motion, a function of time [s], or
            pairs of a time and a scene; the problem's scene if None. The obstacles' names and shapes stay the same.
            What is seen less often than once a tick moves in jumps, whose speed is that of the one tick.
        step: How far the robot goes in a tick [rad, metres counted alike], unless its joints are too slow.
        rate: Ticks a second [Hz].
        planner: One of ``PLANNERS``.
        eps: Longest motion of the trees [as step]; what suits the robot's range if None.
        margin: Distance to obstacles that is always kept [m].
        speed_bound: No point of an obstacle is faster [m/s]. One that is gives a :class:`SpeedWarning`.
        limits: Of the joints' speeds; those of the robot if None. Accelerations are not looked at.
        predict: Ticks ahead: obstacles are also where they will be then and half-way, by the motion that the scene
            states or else by their velocity. 0: not predictive, as published.
        seconds: Simulated time at most [s].
        slot: Time that a repair may take [s]; one tick if None.
        seed: The same seed gives the same run, as long as no repair is cut short by its slot.
        goal_feed: A goal that moves: the configuration at a time [s], in place of the problem's goal.
            It is reached when the robot is where it was at the begin of the last tick.
        record: A ``.json`` file for the record; it is written on Ctrl-C and errors too, once there is a tick.
        clock: What the times of the ticks and the ``slot`` are taken with [s]; ``time.process_time`` counts the
            processor's, on a machine that does other things too.

    Raises:
        InputError: If a number is out of range, times go backwards, an obstacle begins in contact with the robot, or
            no configuration reaches the goal.
        UnknownNameError: If there is no planner of that name.
    """
    require(problem, Problem, "problem to replan", "use Problem(world, start, goal) or load_scenario(name)")
    if limits is not None:
        require(limits, RateLimits, "limits", "use RateLimits(velocity, acceleration)")
    if goal_feed is not None and not callable(goal_feed):
        raise InputError(f"goal_feed: expected a function of time [s], got {type(goal_feed).__name__}")
    if not callable(clock):
        raise InputError(f"clock: expected a function that gives a time [s], got {type(clock).__name__}")
    if record is not None:
        check_target(file_name(record), (".json",))
    chosen = settings(
        problem.robot, step=step, rate=rate, planner=planner, eps=eps, margin=margin, speed_bound=speed_bound,
        limits=limits, predict=predict, seconds=seconds, slot=slot, seed=seed,
    )  # fmt: skip
    feed = feed_of(problem.world.scene if scene_feed is None else scene_feed)
    loop = Loop(problem, feed, chosen, goal_feed, clock)
    try:
        for number in range(int(chosen.seconds * chosen.rate) + 1):
            if not loop.tick(number):
                loop.run.outcome = "arrived"
                return loop.run
        loop.run.outcome, loop.run.reason = "out of time", loop.run.ticks[-1].reason or "still on its way"
        return loop.run
    finally:
        if record is not None and loop.run.ticks:
            loop.run.save(record)
