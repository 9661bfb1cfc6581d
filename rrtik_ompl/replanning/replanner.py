"""Replanning: a robot moves to a goal while obstacles move, by DRRT-Con or, to compare with, by two other planners."""

from __future__ import annotations

import os
import time
from contextlib import ExitStack
from functools import partial

from rrtik_ompl.base.arrays import positive, seed_of
from rrtik_ompl.base.choices import Replanner
from rrtik_ompl.base.errors import called, require
from rrtik_ompl.files.text import check_target, file_name
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning.drrt_con import DrrtCon
from rrtik_ompl.replanning.feed import PATIENCE_SECONDS, SILENCE_SECONDS, PatientFeed, Source, Watch, feed_of
from rrtik_ompl.replanning.loop import Clock, Loop
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.replanning.start_and_goals import GoalFeed, refuse_constraints
from rrtik_ompl.world.problem import Problem


def replan(  # noqa: D417 - the settings are described in one place
    problem: Problem,
    scene_feed: Source | None = None,
    *,
    step: float,
    rate: float,
    planner: Replanner = DrrtCon.name,
    max_edge: float | None = None,
    margin: float = 0.0,
    clearance: float | None = None,
    speed_bound: float | None = None,
    limits: RateLimits | None = None,
    lookahead_ticks: int = 0,
    seconds: float = 60.0,
    repair_budget: float | None = None,
    seed: int | None = 0,
    goal_feed: GoalFeed | None = None,
    record: str | os.PathLike[str] | None = None,
    clock: Clock = time.perf_counter,
    feed_patience: float | None = None,
) -> ReplanRun:
    """Move a robot to its goal while obstacles move: DRRT-Con [1, ch. 5.2, algorithms 6 to 8].

    Each tick reads the scene, checks the path again in one call if anything has moved, repairs the path if it is
    blocked, and then moves the robot by one step, provided that this step is free now. Nothing is assumed about the
    future motion of obstacles unless ``lookahead_ticks`` is set. Where there is no path, the robot waits; where an
    obstacle comes nearer than allowed, it evades. The motion of a point cloud cannot be predicted, so a cloud is
    evaded as soon as it closes in.

    A scene has an age. The robot keeps the distance ``margin`` to every obstacle; to a moving one it also keeps the
    distance which that obstacle can have travelled since it was seen and can travel within the tick. An obstacle
    counts as moving if it states a motion or was seen to move. While the last scene is older than a tick, the robot
    makes only proven steps.

    A step is proven if the arm keeps ``margin`` and ``clearance`` at every time of it, whatever the obstacles did since
    they were seen and do in the tick (they may even begin to move just now), as long as none is faster than
    ``speed_bound``. The record says which steps are not proven (:attr:`Tick.proven`). Without a ``speed_bound`` no step
    is proven while there is an obstacle that may move and does not state its motion.
    With a ``speed_bound`` a step along the path is made only if after it a motion is left on which nothing can touch
    the arm for a while; else it waits or evades in such a way, where it can. :attr:`Tick.safe_seconds` says for how
    long nothing can. Where it is proven that no motion of the arm rules out a contact, :attr:`Tick.unavoidable` has the
    proof, and a ``ContactWarning`` is given. :meth:`ReplanRun.violations` judges a record.

    Args:
        problem: Robot, scene at the begin, start and goal. If the goal is a pose, position or region, all
            configurations that reach it are goals: if one is blocked, another one is tried.
        scene_feed: The scene over time: a scene whose obstacles state their motion, a function of time [s], or
            pairs of a time and a scene (or a :class:`Snapshot`); the problem's scene if None. Obstacles may come, go
            and change (:mod:`rrtik_ompl.replanning.faults` says what follows); the attached objects must stay those of
            the problem; each scene brings its own pairs that may touch. The times of pairs are counted from the first
            pair [s].
        step: This and all arguments that are not explained here: see :class:`ReplanSettings`.
        goal_feed: A goal that moves: the configuration at a time [s], in place of the problem's goal.
            It counts as reached when the robot is where the goal was at the begin of the last tick.
        record: A ``.json`` file for the record. Once there is a tick, it is written on Ctrl-C and on errors too.
        clock: Measures the times of the ticks and the ``repair_budget`` [s]. ``time.process_time`` counts processor
            time, which suits a machine that does other work too.
        feed_patience: Two limits [s]; 2 s and 30 s if None. The first is how long a stream of pairs may bring nothing
            new, in the time of the run; after that the run ends with the outcome "no scene". So long obstacles count
            that scenes no longer show, and so far scenes may be out of order. The second is how long a
            feed may take to answer, in wall time; after that the run ends with an error, and the record holds all
            ticks before it.

    Raises:
        InputError: If a number is out of range, the feed's times are impossible, a half-space turns, an obstacle begins
            in contact with the robot, no configuration reaches the goal, a feed does not answer, or the problem has
            path constraints.
        UnknownNameError: If there is no planner of that name.

    Example:
        >>> scenario = rrtik.replanning.Scenario.load("replan_walls")
        >>> run = rrtik.replan(scenario.problem, step=0.05, rate=20.0, seconds=2.0, seed=1)
        >>> run.problem
        'replan_walls'
    """
    settings = ReplanSettings(
        step=step, rate=rate, planner=planner, max_edge=max_edge, margin=margin, clearance=clearance,
        speed_bound=speed_bound, limits=limits, lookahead_ticks=lookahead_ticks, seconds=seconds,
        repair_budget=repair_budget, seed=seed_of(seed),
    )  # fmt: skip
    return replan_with(
        settings, problem, scene_feed, goal_feed=goal_feed, record=record, clock=clock, feed_patience=feed_patience
    )


def replan_with(
    settings: ReplanSettings,
    problem: Problem,
    scene_feed: Source | None = None,
    *,
    goal_feed: GoalFeed | None = None,
    record: str | os.PathLike[str] | None = None,
    clock: Clock = time.perf_counter,
    feed_patience: float | None = None,
) -> ReplanRun:
    """Replan like :func:`replan`, with the settings given as one object.

    Raises:
        InputError: See :func:`replan`.
    """
    require(settings, ReplanSettings, "settings", "use ReplanSettings(step=..., rate=...)")
    require(problem, Problem, "problem to replan", "use Problem(world, start, goal) or Scenario.load(name)")
    refuse_constraints(problem, "replan")
    if goal_feed is not None:
        called(goal_feed, "goal_feed", "time [s]")
    called(clock, "clock")
    if record is not None:
        check_target(file_name(record), (".json",))

    source = problem.world.scene if scene_feed is None else scene_feed
    answer_seconds = PATIENCE_SECONDS if feed_patience is None else positive(feed_patience, "feed_patience")
    silence_seconds = SILENCE_SECONDS if feed_patience is None else answer_seconds

    with ExitStack() as open_feeds:
        if isinstance(source, Scene):
            watch: Watch = feed_of(source)
        else:
            make_feed = partial(feed_of, source, silence_seconds)
            watch = open_feeds.enter_context(PatientFeed(make_feed, answer_seconds, "scene feed"))
        if (given_goal_feed := goal_feed) is not None:
            goal_feed = open_feeds.enter_context(PatientFeed(lambda: given_goal_feed, answer_seconds, "goal feed"))
        loop = Loop(problem, watch, settings, goal_feed, clock, silence_seconds)
        try:
            return loop.run_ticks()
        finally:  # The record is written even if an error ends the run.
            if record is not None and loop.run.ticks:
                loop.run.save(record)
