"""Planning in configuration and time: motions that are free at every time, among obstacles whose motion is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, not_negative, positive, seed_of, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import TickEvent
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError, at_most, require
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.result import required
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.motion.trajectory.motion import Trajectory
from rrtik_ompl.replanning.drrt_con import without_points_between
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds
from rrtik_ompl.replanning.in_time.pace import Pace, Timing
from rrtik_ompl.replanning.in_time.search import Ends, TimeSearch
from rrtik_ompl.replanning.record import ReplanRun, joints_of
from rrtik_ompl.replanning.start_and_goals import arm_alone, every_goal, refuse_constraints, sampling_box
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.replanning.travels import refuse_endless_turns
from rrtik_ompl.world.clearances import CLEARANCE
from rrtik_ompl.world.problem import Problem

NAME = "in-time"  # of the planner, in records
MOST_SLOTS = 10_000
SLOWEST = 1e-300  # least motion in a slot [rad or m], and its growth, so that they can be divided by
ROUNDING = 1e-9
WAITS = "what moves has to pass first"


@dataclass(frozen=True, slots=True, eq=False)
class TimedPlan:
    """A motion among obstacles whose motion is known, or the reason why there is none.

    Attributes:
        motion: The motion, one tick for each slot of time, as :func:`rrtik_ompl.replan` records it: it can be saved,
            drawn and judged. None if no motion was found.
        reason: Why no motion was found, or "".
        least_seconds: Lower bound on the time of arrival by the limits of speed and acceleration alone [s].
        seconds: Wall time of the search [s].
        statistics: "iterations", the number of iterations of the search.
        free_until: Until when the arm may stay where the motion ends [s]: by then it is proven to keep margins and
            clearance; inf if for ever, at most the horizon if an obstacle never comes to rest. 0 if there is no motion.
        trajectory: The motion to be executed, which keeps the limits of speed and acceleration at every time; None if
            there is none. ``motion`` has its configurations at the begin of each slot.

    Example:
        >>> scenario = rrtik.replanning.Scenario.load("replan_planar_arm")
        >>> plan = rrtik.replanning.plan_in_time(scenario.problem, rate=5.0, horizon=0.4)
        >>> plan.found, plan.reason.startswith("limits allow no arrival")
        (False, True)
    """

    motion: ReplanRun | None
    reason: str
    least_seconds: float
    seconds: float
    statistics: Mapping[str, int]
    free_until: float = 0.0
    trajectory: Trajectory | None = None

    __repr__ = in_one_line

    @property
    def found(self) -> bool:
        """Whether a motion was found."""
        return self.motion is not None

    @property
    def path(self) -> JointPath | None:
        """The configurations of the motion from slot to slot, without their times; None if no motion was found."""
        return None if self.motion is None else self.motion.path

    @property
    def proven(self) -> bool | None:
        """Whether all of the motion is proven free, as it always is; None if there is none, or it never moves."""
        return None if self.motion is None else self.motion.proven

    @property
    def arrival(self) -> float:
        """When the goal is reached [s]; inf if no motion was found."""
        return float("inf") if self.motion is None else self.motion.ticks[-1].time

    def require(self) -> ReplanRun:
        """Return the motion.

        Raises:
            NotFoundError: If there is none.

        Example:
            >>> scenario = rrtik.replanning.Scenario.load("replan_planar_arm")
            >>> rrtik.replanning.plan_in_time(scenario.problem, rate=5.0, speed=1.6, seed=1).require().outcome
            'arrived'
        """
        return required(self.motion, "no motion in time", self.reason)


def plan_in_time(
    problem: Problem,
    *,
    goal: ArrayLike | None = None,
    rate: float = 10.0,
    horizon: float = 30.0,
    speed: float | None = None,
    margin: float = 0.0,
    clearance: float | None = None,
    limits: RateLimits | None = None,
    iterations: int = 6000,
    seconds: float = 20.0,
    seed: int | None = 0,
) -> TimedPlan:
    """Plan a motion in configuration and time to the goal, among obstacles that move as they state.

    [1, ch. 5.2] describes this space, configurations at times from 0 on in which a path never goes backwards in time,
    for fully predictable scenes, and prefers DRRT-Con, which assumes nothing. The search follows [70].

    The motion consists of straight stretches from rest to rest and of waits. In a stretch the speed grows evenly,
    stays, and falls evenly, and no joint exceeds its limits of speed and acceleration. The motion is **proven**
    free at every time, not only at steps: in each slot the arm keeps margins, clearance, and the largest travel of any
    point of an obstacle between the middle of the slot and its ends from that obstacle's place in the middle, or the
    same of some slots together. So it does not matter at which speed the arm goes from the begin to the end of a slot.
    Motions that kernels cannot prove count as blocked. The arm arrives before an obstacle reaches a part that no joint
    moves, or there is no plan. The proof holds as far as obstacles follow their stated motions: one that deviates by
    more than margin and clearance can be hit. After the arrival the arm is proven free where it stands until
    ``free_until`` of the plan.

    Args:
        problem: Robot, scene whose obstacles state their motions, start and goal. If the goal is a pose, position or
            region, all configurations that reach it are goals.
        goal: A configuration to reach in place of the problem's goal, shape (n,). Obstacles that move may stand at
            either at first; the arm waits until it is free.
        rate: Number of slots per second [Hz]. With more slots the arm can pass nearer to fast obstacles, and searches
            take longer.
        horizon: The latest arrival [s].
        speed: Largest speed of the configuration, all joints counted alike [rad/s or m/s]; if None only the joints'
            limits apply.
        margin: Distance to obstacles that is always kept, in addition to their own margins [m].
        clearance: Distance that is proven in addition to ``margin`` [m]; if None 1 mm, or as much as the world asks
            proofs for if that is more.
        limits: Limits of speed and acceleration of the joints; those of the robot if None. Jerks are not limited.
        iterations: Largest number of iterations; the search goes on for earlier arrivals until it has found no more for
            a while.
        seconds: Largest wall time of the search [s].
        seed: The same seed gives the same motion, as long as the time limit does not end the search. None draws one.

    Raises:
        InputError: If a number is out of range, no configuration reaches the goal, an unbounded obstacle turns, or the
            problem has path constraints.

    Example:
        >>> scenario = rrtik.replanning.Scenario.load("replan_planar_arm")
        >>> plan = rrtik.replanning.plan_in_time(scenario.problem, rate=5.0, speed=1.6, seed=1)
        >>> plan.found and len(set(plan.motion.moves)) == 1  # all moves are proven
        True
    """
    require(problem, Problem, "problem to plan in time", "use Problem(world, start, goal) or Scenario.load(name)")
    refuse_constraints(problem, "plan in time")
    refuse_endless_turns(problem.world.scene)

    settings = problem.world.settings
    wanted_clearance = CLEARANCE if clearance is None else not_negative(clearance, "clearance")
    options = _Options(
        slot=1.0 / positive(rate, "rate", "give slots a second, such as 10"),
        goal=None if goal is None else _goal(problem.robot, goal),
        horizon=positive(horizon, "horizon", "give the latest arrival [s]"),
        speed=float("inf") if speed is None else positive(speed, "speed", "give it in rad/s or m/s"),
        margin=not_negative(margin, "margin"),
        clearance=max(wanted_clearance, (settings.proving or 0.0) - settings.clearance),
        limits=limits,
        budget=Budget(seed_of(seed), positive(seconds, "seconds"), whole_number(iterations, "iterations", least=1)),
    )
    at_most(options.horizon / options.slot, MOST_SLOTS, "slots of time", "lower horizon or rate")

    search, reaches_base = _search(problem, options)
    reason = _why_impossible(search, options, reaches_base)
    # The time limit begins here, after kernels were compiled and goals were looked for.
    timing = None if reason else search.run(options.budget.begun_now())
    if timing is None and not reason:
        reason = _why_not_found(search, reaches_base)

    counts = {"iterations": search.iterations}
    least = options.slot * search.least_slots
    if timing is None:
        return TimedPlan(None, reason, least, options.budget.elapsed, counts)
    motion = _record(problem, search, timing.each_slot(search.pace), options)
    trajectory = _trajectory(problem, search.pace, timing, options)
    free_until = search.worlds.rest_ends(timing.rows[-1], motion.ticks[-1].time, options.horizon)
    return TimedPlan(motion, "", least, options.budget.elapsed, counts, free_until, trajectory)


def _trajectory(problem: Problem, pace: Pace, timing: Timing, options: _Options) -> Trajectory:
    """Return the motion with its speeds and accelerations."""
    robot = problem.robot
    path = JointPath(timing.rows, robot.joint_names, robot.prismatic, robot.name)
    return timing.trajectory(pace, options.slot, path)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Options:
    """The checked arguments of :func:`plan_in_time`; ``slot`` is the length of a slot [s]."""

    slot: float
    goal: Matrix | None
    horizon: float
    speed: float
    margin: float
    clearance: float
    limits: RateLimits | None
    budget: Budget


def _goal(robot: Robot, goal: ArrayLike) -> Matrix:
    """Return a configuration to reach, shape (1, n).

    Raises:
        InputError: If it is no configuration of the robot, or outside the limits.
    """
    q = robot.configuration(goal, "goal")
    if fault := robot.limit_fault(q):
        raise InputError(f"goal: {fault}")
    return robot.onto_limits(q)[None]


def _search(problem: Problem, options: _Options) -> tuple[TimeSearch, str]:
    """Prepare the search of a problem: goals, sampling box, worlds and the last slot in which to arrive.

    Returns:
        The search, and a line that says when an obstacle reaches the fixed base before the horizon, or "".
    """
    robot = problem.robot
    rng = np.random.default_rng(options.budget.seed)

    if options.limits is not None:
        require(options.limits, RateLimits, "limits", "use RateLimits(velocity, acceleration)")
    rates = RateLimits.of(robot) if options.limits is None else options.limits.for_joints(robot.dof)

    goals = every_goal(problem, arm_alone(problem.world), rng) if options.goal is None else options.goal
    lower, upper = sampling_box(robot, np.vstack([problem.start, goals]))

    worlds = ForeseenWorlds(problem.world, options.slot, options.margin + options.clearance)
    base_reached_at, reaches_base = worlds.base_reached(options.horizon)
    last_slot = int(min(options.horizon, base_reached_at) / options.slot + ROUNDING)

    change, rise = rates.velocity * options.slot, rates.acceleration * options.slot**2
    pace = Pace(np.maximum(change, SLOWEST), np.maximum(rise, SLOWEST), max(options.speed * options.slot, SLOWEST))
    return TimeSearch(worlds, pace, Ends(problem.start, goals, lower, upper, last_slot), rng), reaches_base


def _why_impossible(search: TimeSearch, options: _Options, reaches_base: str) -> str:
    """Return the reason why there cannot be a plan, so that the search need not begin, or ""."""
    if options.slot * search.least_slots > options.horizon + ROUNDING:
        return f"limits allow no arrival before {options.slot * search.least_slots:g} s; raise horizon, speed or rate"
    if search.least_slots > search.ends.last:
        return f"{reaches_base}, before the goal can be reached"
    if not search.worlds.free(0, search.ends.start, search.ends.start):
        return "the start is not proven free in the first slot of time; raise rate, or lower margin or clearance"
    return ""


def _why_not_found(search: TimeSearch, reaches_base: str) -> str:
    """Return the reason why a search has found no plan."""
    if search.blocked_arrivals:
        what = f"the goal is not proven free at any of the {search.blocked_arrivals} arrivals that were tried"
        remedy = "raise horizon, or lower margin or clearance"
    else:
        what = f"no way was found in {search.iterations} iterations"
        remedy = "raise horizon, rate, iterations or seconds"
    return f"{what}, and {reaches_base}" if reaches_base else f"{what}; {remedy}"


def _record(problem: Problem, search: TimeSearch, rows: Matrix, options: _Options) -> ReplanRun:
    """Return the motion as a record of a run, one tick for each slot.

    Args:
        problem: The problem that was planned.
        search: The finished search, whose worlds give the obstacles' poses at the begin of each slot.
        rows: The configuration at the begin of each slot, shape (k, n).
        options: The arguments of the plan.
    """
    robot = problem.robot
    slot = options.slot
    step = min(search.pace.step, float(np.linalg.norm(search.pace.change)))

    run = ReplanRun(
        problem.name, robot.name, robot.joint_names, NAME, options.budget.seed, step, 1.0 / slot, options.margin, None,
        clearance=options.clearance, prismatic=joints_of(robot, robot.prismatic),
        continuous=joints_of(robot, robot.continuous),
    )  # fmt: skip

    run.see(Snapshot(0.0, search.worlds.scene_at(0.0), stated=True))
    # The poses at time 0 can differ from those that the scene holds.
    first_poses = {o.name: o.pose for o in search.worlds.scene_at(0.0).obstacles}

    for number, q in enumerate(rows):
        rows_left = rows[number:]
        is_moving = len(rows_left) > 1 and bool((rows_left[1] != q).any())
        event: TickEvent = "walk" if number else "plan"
        if len(rows_left) == 1:
            event = "arrive"
        elif not is_moving:
            event = "wait"

        obstacles = search.worlds.scene_at(slot * number).obstacles
        poses = {
            o.name: pose_row(o.pose) for o in obstacles if (o.pose.homogeneous != first_poses[o.name].homogeneous).any()
        }
        proven = True if is_moving else None  # as the search has proven every stretch
        path = without_points_between(rows_left) if len(rows_left) > 1 else None
        run.ticks.append(Tick(slot * number, q, event, path, poses, {}, 0, "" if event != "wait" else WAITS, proven))

    run.outcome = "arrived"
    return run
