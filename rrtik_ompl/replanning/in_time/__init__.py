"""Planning in configuration and time: where the course of what moves is known, a motion that is free at every time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, not_negative, positive, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import TickEvent
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import at_most, require
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning.drrt_con import without_points_between
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds
from rrtik_ompl.replanning.in_time.search import Ends, Pace, TimeSearch
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.start_and_goals import every_goal, held_pairs, refuse_constraints, sampling_box
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.replanning.travels import refuse_endless_turns
from rrtik_ompl.world.clearances import CLEARANCE
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.proof import PROOF_KERNELS

NAME = "in-time"  # of the planner, in records
MOST_SLOTS = 10_000
SLOWEST = 1e-300  # [rad or m] in a slot: a number by which can be divided
ROUNDING = 1e-9
WAITS = "what moves has to pass first"


@dataclass(frozen=True, slots=True, eq=False)
class TimedPlan:
    """A motion among obstacles whose course is known.

    Attributes:
        run: The motion, a tick for each slot of time, as :func:`rrtik_ompl.replan` records it: it can be saved, drawn
            and judged. None if none was found.
        reason: Why there is none, or "".
        least_seconds: Sooner no motion can arrive, by the limits of speed alone [s].
        iterations: Of the search.
        seconds: That it took [s].

    Example:
        >>> scenario = rrtik.load_scenario("replan_planar_arm")
        >>> plan = rrtik.plan_in_time(scenario.problem, rate=5.0, horizon=0.4)
        >>> plan.found, plan.reason.startswith("speeds allow no arrival")
        (False, True)
    """

    run: ReplanRun | None
    reason: str
    least_seconds: float
    iterations: int
    seconds: float

    __repr__ = in_one_line

    @property
    def found(self) -> bool:
        """Whether there is a motion."""
        return self.run is not None

    @property
    def arrival(self) -> float:
        """When the goal is reached [s]; inf if no motion was found."""
        return float("inf") if self.run is None else self.run.ticks[-1].time


def plan_in_time(
    problem: Problem,
    *,
    rate: float = 10.0,
    horizon: float = 30.0,
    speed: float | None = None,
    margin: float = 0.0,
    clearance: float | None = None,
    limits: RateLimits | None = None,
    iterations: int = 6000,
    seconds: float = 20.0,
    seed: int = 0,
) -> TimedPlan:
    """Plan in configuration and time: a motion to the goal among obstacles that do what their motions state.

    [1, ch. 5.2] names the space, configurations at times from 0 on in which a path never goes backwards in time, for
    scenes that are fully predictable, and leaves it for DRRT-Con, which assumes nothing. The search follows [70].

    The motion is straight at constant speed in every slot of time, no joint faster than its limit; between slots speeds
    jump, accelerations are not considered, as in :func:`rrtik_ompl.replan`. It is **proven** at every time, not at
    steps: in a slot the arm keeps from the place of an obstacle in the middle of the slot as far as any of its points
    travels until an end of it, beside margins and the clearance. What kernels cannot prove counts as blocked. The arm
    arrives before an obstacle reaches what no joint moves, or not at all. The proof is worth as much as the stated
    courses: an obstacle that strays farther than margin and clearance can be hit. Nothing is promised after the
    arrival.

    Args:
        problem: Robot, scene whose obstacles state their motions, start and goal. Of a pose, position or region all
            configurations are goals.
        rate: Slots a second [Hz]. With more of them the arm comes nearer to what is fast, and searches take longer.
        horizon: The latest arrival [s].
        speed: The configuration's, all joints counted alike [rad/s or m/s]; None: the joints' limits alone.
        margin: Distance to obstacles that is always kept, beside their own margins [m].
        clearance: What is proven beside it [m]; 1 mm if None, or as much as the world asks proofs for.
        limits: Of the joints' speeds; those of the robot if None.
        iterations: Of the search at most; it goes on for earlier arrivals until it finds no more for a while.
        seconds: That the search may take by the clock [s].
        seed: The same seed gives the same motion, as long as the clock does not cut in.

    Raises:
        InputError: If a number is out of range, no configuration reaches the goal, an obstacle without an end turns, or
            the problem has path constraints.

    Example:
        >>> scenario = rrtik.load_scenario("replan_planar_arm")
        >>> plan = rrtik.plan_in_time(scenario.problem, rate=5.0, speed=1.6, seed=1)
        >>> plan.found and len(set(plan.run.moves)) == 1  # all moves are proven
        True
    """
    require(problem, Problem, "problem to plan in time", "use Problem(world, start, goal) or load_scenario(name)")
    refuse_constraints(problem, "plan in time")
    refuse_endless_turns(problem.world.scene)

    settings = problem.world.settings
    wanted_clearance = CLEARANCE if clearance is None else not_negative(clearance, "clearance")
    options = _Options(
        slot=1.0 / positive(rate, "rate", "give slots a second, such as 10"),
        horizon=positive(horizon, "horizon", "give the latest arrival [s]"),
        speed=float("inf") if speed is None else positive(speed, "speed", "give it in rad/s or m/s"),
        margin=not_negative(margin, "margin"),
        clearance=max(wanted_clearance, (settings.proving or 0.0) - settings.clearance),
        limits=limits,
        budget=Budget(
            whole_number(seed, "seed"), positive(seconds, "seconds"), whole_number(iterations, "iterations", least=1)
        ),
    )
    at_most(options.horizon / options.slot, MOST_SLOTS, "slots of time", "lower horizon or rate")

    search, reaches_base = _search(problem, options)
    reason = _why_impossible(search, options, reaches_base)
    # kernels may have been compiled and goals been looked for until now
    rows = None if reason else search.run(options.budget.begun_now())
    if rows is None and not reason:
        reason = _why_not_found(search, reaches_base)

    run = None if rows is None else _record(problem, search, rows, options)
    return TimedPlan(run, reason, options.slot * search.least_slots, search.iterations, options.budget.elapsed)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Options:
    """What was asked for; see :func:`plan_in_time`."""

    slot: float
    horizon: float
    speed: float
    margin: float
    clearance: float
    limits: RateLimits | None
    budget: Budget


def _search(problem: Problem, options: _Options) -> tuple[TimeSearch, str]:
    """The search of a problem, and a line that says when an obstacle reaches the base before the horizon, or ""."""
    robot = problem.robot
    scene = problem.world.scene
    rng = np.random.default_rng(options.budget.seed)

    if options.limits is not None:
        require(options.limits, RateLimits, "limits", "use RateLimits(velocity, acceleration)")
    rates = RateLimits.of(robot) if options.limits is None else options.limits.for_joints(robot.dof)

    world_of_arm = problem.world.with_accuracy("conservative").with_scene(Scene((), scene.attached, held_pairs(scene)))
    goals = every_goal(problem, world_of_arm, rng)
    lower, upper = sampling_box(robot, np.vstack([problem.start, goals]))

    worlds = ForeseenWorlds(problem.world, options.slot, options.margin + options.clearance)
    base_reached_at, reaches_base = worlds.base_reached(options.horizon)
    last_slot = int(min(options.horizon, base_reached_at) / options.slot + ROUNDING)

    pace = Pace(np.maximum(rates.velocity * options.slot, SLOWEST), max(options.speed * options.slot, SLOWEST))
    return TimeSearch(worlds, pace, Ends(problem.start, goals, lower, upper, last_slot), rng), reaches_base


def _why_impossible(search: TimeSearch, options: _Options, reaches_base: str) -> str:
    """Why a search need not begin, or ""."""
    if library(PROOF_KERNELS) is None:
        return "motions in time are proven by kernels, and there are none here; install numba"
    if options.slot * search.least_slots > options.horizon + ROUNDING:
        return f"speeds allow no arrival before {options.slot * search.least_slots:g} s; raise horizon, speed or rate"
    if search.least_slots > search.ends.last:
        return f"{reaches_base}, before the goal can be reached"
    if not search.worlds.free(0, search.ends.start, search.ends.start):
        return "the start is not proven free in the first slot of time; raise rate, or lower margin or clearance"
    return ""


def _why_not_found(search: TimeSearch, reaches_base: str) -> str:
    """Why a search has ended with nothing."""
    if search.blocked_arrivals:
        what = f"the goal is not proven free at any of the {search.blocked_arrivals} arrivals that were tried"
        remedy = "raise horizon, or lower margin or clearance"
    else:
        what = f"no way was found in {search.iterations} iterations"
        remedy = "raise horizon, rate, iterations or seconds"
    return f"{what}, and {reaches_base}" if reaches_base else f"{what}; {remedy}"


def _record(problem: Problem, search: TimeSearch, rows: Matrix, options: _Options) -> ReplanRun:
    """The motion as a run: a tick for each slot, obstacles where they are when it begins."""
    robot = problem.robot
    slot = options.slot
    step = min(search.pace.step, float(np.linalg.norm(search.pace.change)))

    run = ReplanRun(
        problem.name, robot.name, robot.joint_names, NAME, options.budget.seed, step, 1.0 / slot, options.margin, None,
        clearance=options.clearance,
    )  # fmt: skip

    run.see(Snapshot(0.0, search.worlds.scene_at(0.0), stated=True))
    first_poses = {o.name: o.pose for o in search.worlds.scene_at(0.0).obstacles}  # stated poses may be others

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
        proven = search.worlds.free(number, q, rows_left[1]) if is_moving else None
        path = without_points_between(rows_left) if len(rows_left) > 1 else None
        run.ticks.append(Tick(slot * number, q, event, path, poses, {}, 0, "" if event != "wait" else WAITS, proven))

    run.outcome = "arrived"
    return run
