"""The loop that moves a robot along its path while obstacles move; a tick is: read the scene, check, repair, step."""

from __future__ import annotations

import time
import warnings
from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, finite_number
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.base.choices import RunOutcome, TickEvent
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.model.goal import JOINT_TOLERANCE
from rrtik_ompl.model.scene import Scene, pairs_that_may_touch
from rrtik_ompl.model.shapes.shape import same_but_for_points
from rrtik_ompl.replanning.evading import evasion
from rrtik_ompl.replanning.faults import TIME_RESOLUTION, UNFORESEEN, Fault, FaultKind, FeedWarning, SceneMemory
from rrtik_ompl.replanning.feed import SILENCE_SECONDS, Snapshot, Watch
from rrtik_ompl.replanning.record import ReplanRun, joints_of
from rrtik_ompl.replanning.refuge import SPARE, Guard, Refuge, ticks_of
from rrtik_ompl.replanning.settings import PREDICTED_PLACES, ReplanSettings, make_planner
from rrtik_ompl.replanning.start_and_goals import GoalFeed, arm_alone, check_start, every_goal, goal_now, sampling_box
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.replanning.travels import (
    SPEED_WARNING_RATIO,
    MotionTracker,
    Travels,
    refuse_endless_turns,
    required_distances,
)
from rrtik_ompl.replanning.unavoidable import ROUNDING, ContactWarning, Reach, Unavoidable, way_out
from rrtik_ompl.world.clearances import CLEARANCE
from rrtik_ompl.world.moving_world import MovingWorld, check_held
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

Clock = Callable[[], float]

TOO_NEAR = "an obstacle is too near"
NO_WAY_LEFT = "a step would leave no way out"
NO_WAY_OUT = "no motion was found that nothing can reach in time"
BERTH_PAUSE = 1.0  # between tries to give obstacles a wide berth [s]
NEAR_STEPS = 3.0  # as far apart two places are one
REFUSED_SECONDS = 1.0  # after which steps that are refused at one place
STAY_SECONDS = 5.0  # are made for so long only to where the arm could stay
PROOF_TRIES = 3  # searches for a path that is proven
REACTION_TICKS = 6  # The arm evades a cloud that would be too near within so many ticks at its present speed.


class Loop:
    """The state of one run of replanning; :meth:`tick` advances it by one tick, :meth:`run_ticks` to its end.

    Attributes:
        q: The robot's configuration, shape (n,).
        run: The record so far.

    Apart from its parts (feed, tracker, planner, worlds) a loop keeps from tick to tick: the last snapshot; the
    distance that is required from each obstacle, see :meth:`_read_scene`; the goals, shape (g, n); and the distance to
    obstacles that was left at the end of the previous tick, which shows whether a cloud closes in.
    """

    def __init__(
        self,
        problem: Problem,
        feed: Watch,
        settings: ReplanSettings,
        goal_feed: GoalFeed | None,
        clock: Clock = time.perf_counter,
        patience: float = SILENCE_SECONDS,
    ) -> None:
        # Each reading is checked: a time that is no number would end no repair, and its record could not be read.
        self._clock: Clock = lambda: finite_number(clock(), "clock: what it gives")
        self._problem = problem
        self._feed = feed
        self._settings = settings
        self._goal_feed = goal_feed
        self._patience = patience

        robot = problem.robot
        self._memory = SceneMemory(patience, settings.speed_bound)
        self._warned_faults = set[FaultKind]()
        self._now = 0.0  # begin of the tick [s]
        self._snapshot = self._read_feed(0.0)[-1]
        scene = self._snapshot.scene
        refuse_endless_turns(scene)
        first_world = problem.world.with_accuracy("exact").with_scene(scene)
        self._rng = np.random.default_rng(settings.seed)
        self._max_change = settings.max_change(robot)

        # A search checks a motion only at steps. Keeping half a step more makes its answer hold between them too [m].
        half_resolution = 0.5 * first_world.motion_resolution
        self._proven_clearance = min(CLEARANCE, half_resolution) if settings.clearance is None else settings.clearance
        self._search_clearance = half_resolution + (settings.clearance or 0.0)
        self._required = settings.margin + self._search_clearance  # from each obstacle, whether it moves or not [m]
        self._make_worlds(first_world)

        self._tracker = MotionTracker(settings.speed_bound)
        self._travels = Travels(settings.tick, settings.speed_bound, self._tracker.speeds)

        self.q = problem.start
        if goal_feed is None:
            self._goals = every_goal(problem, self._world_of_arm, self._rng)
        else:
            self._goals = goal_now(robot, goal_feed, 0.0)

        self._first_poses = {o.name: o.pose for o in scene.obstacles}  # The record holds only poses that differ.
        self._has_warned = False  # whether a contact was said to be unavoidable
        self._cut_short = False  # whether the last search for a path has ended with its time
        self._distance_left_before = np.nan  # distance left at the end of the previous tick [m]
        self._required_distances: dict[str, float] = {}  # distance to keep from each obstacle now [m]
        self._berth: dict[str, float] = {}  # what paths keep from some obstacles beyond that [m]
        self._berth_after = 0.0  # when a wide berth may be tried (again) [s]
        self._refused: tuple[float, Vector] | None = None  # since when steps along a path are refused, and where
        self._last_refused = -np.inf  # [s]
        self._stays_until = 0.0  # until when the arm steps only to where it could stay [s]

        self.run = ReplanRun(
            problem.name, robot.name, robot.joint_names, settings.planner, settings.seed, settings.step, settings.rate,
            settings.margin, settings.speed_bound, clearance=self._proven_clearance,
            prismatic=joints_of(robot, robot.prismatic), continuous=joints_of(robot, robot.continuous),
        )  # fmt: skip

        self._note_faults(self._snapshot)
        self._read_scene(0.0)
        # The start is checked against present places only, since it may lie where an obstacle is merely predicted:
        # all copies of an obstacle are put where it is now.
        self._world.move(scene, inflation=self._required_distances)
        check_start(self.q, first_world, self._world)

        self._box = sampling_box(robot, np.vstack([self.q, self._goals]))
        self._planner = make_planner(settings, self._world, *self._box)
        self._required_distances = {}  # This makes the first tick enter the predicted places.

    def _make_worlds(self, first_world: World) -> None:
        """Make the worlds of a run and store them as attributes.

        ``_world`` serves searches and holds the predicted places of obstacles too. ``_world_of_obstacles`` ignores
        self-collision, so its clearance is that to obstacles. ``_world_of_arm`` has no obstacles. From then on
        obstacles are moved within the first two.
        """
        copies = PREDICTED_PLACES if self._settings.lookahead_ticks else 1
        self._world = MovingWorld(first_world, copies=copies)
        self._world_of_obstacles = MovingWorld(first_world, self_collision=False)
        self._moved_ahead = np.nan, 0  # the time [s] and the ticks ahead that this world was moved for
        self._world_of_arm = arm_alone(first_world)
        # With a bound on the speed of obstacles, motions are chosen that nothing can reach in time.
        self._guard: Guard | None = None
        if self._settings.speed_bound is not None:
            keep = self._settings.margin + self._proven_clearance
            self._guard = Guard(first_world, self._world_of_arm, self._settings, keep, self._max_change, self._rng)

    def run_ticks(self) -> ReplanRun:
        """Do ticks until the goal is reached, the feed ends the run or the time is up, and return the record."""
        for number in range(int(self._settings.seconds * self._settings.rate) + 1):
            if not self.tick(number):
                return self.run
        self.run.outcome = "out of time"
        refused = "" if self._guard is None else self._why_refused(self._guard)
        self.run.reason = refused or self.run.ticks[-1].reason or "still on its way"
        return self.run

    def tick(self, number: int) -> bool:
        """Do one tick, add it to the record and return whether the run goes on.

        A tick stops at once if the goal is reached. Otherwise it reads the scene, follows a moving goal, checks the
        path if anything has changed, looks for another path if it is blocked, and then goes on, waits or evades.

        Args:
            number: Number of the tick, from 0; it begins at this number times the length of a tick.
        """
        now = number * self._settings.tick
        self._now = now
        begin = self._clock()

        if self._arrived():
            self._record(now, self.q, "arrive", {}, 0, "")
            self.run.outcome = "arrived"
            return False

        if self._goal_feed is not None:
            self._goals = goal_now(self._problem.robot, self._goal_feed, now)

        seconds_of_part: dict[str, float] = {}
        changed = self._timed(seconds_of_part, "sense", self._read_scene, now)
        if self._tracker.fault:
            return self._give_up(now, "too fast", self._tracker.fault)
        if now - self._snapshot.time > self._patience:
            return self._give_up(now, "no scene", self._silence())
        self._timed(seconds_of_part, "retarget", self._follow_goal)

        checked_before = self._world.checked
        free = self._timed(seconds_of_part, "look", self._check) if changed or not self._planner.free else True
        checked = self._world.checked - checked_before

        event: TickEvent = "walk"
        if not free and not self._world.blocked:
            event = "repair" if self._planner.path is not None else "plan"
            path_before = self._planner.path
            free = self._timed(seconds_of_part, event, self._repair)
            event = "walk" if free and self._planner.path is path_before else event

        q_before = self.q
        safe_seconds: float | None = None
        lost: Unavoidable | None = None
        if self._guard is None:
            event, reason, q_after = self._early_evasion() or (self._go(event) if free else self._wait_or_evade())
            self._distance_left_before = self._distance_left(q_after)
        else:
            event, reason, q_after, safe_seconds, lost = self._guarded(self._guard, event, free)
            if lost is not None and not self._has_warned:
                self._has_warned = True
                warnings.warn(ContactWarning(f"at {now:.3g} s {lost.sentence}"), stacklevel=4)

        path = self._planner.path
        moves = (q_after != q_before).any()
        proven: bool | None = None
        if moves:
            proven = self._timed(seconds_of_part, "prove", self._proven_whatever_moves, q_before, q_after)

        seconds_of_part["all"] = self._clock() - begin
        told = {"proven": proven, "safe_seconds": safe_seconds, "unavoidable": lost}
        self._record(now, q_before, event, seconds_of_part, checked, reason, path, **told)
        self.q = q_after
        return True

    def _give_up(self, now: float, outcome: RunOutcome, reason: str) -> bool:
        """End the run where the arm is, since what the feed brings does not let it go on."""
        self._record(now, self.q, "wait", {}, 0, reason)
        self.run.outcome = outcome
        self.run.reason = reason
        return False

    def _silence(self) -> str:
        """Return the reason of a run that ends because the feed has nothing new."""
        silence = f"no scene since {self._snapshot.time:.3g} s: the scene feed has ended, or has been silent for longer"
        return f"{silence} than feed_patience ({self._patience:g} s)"

    def _read_feed(self, now: float) -> list[Snapshot]:
        """Return the snapshots since the last tick, or the last one, with what is remembered of unseen obstacles.

        Raises:
            InputError: If the arm holds other objects than in the problem.
        """
        latest = self._feed(now)
        return [self._known(seen) for seen in (*latest.passed, replace(latest, passed=()))]

    def _known(self, seen: Snapshot) -> Snapshot:
        """Return a snapshot with what is remembered of obstacles that it does not show."""
        check_held(seen.scene, self._problem.world.scene)
        if seen.stated:
            return seen
        known = self._memory.take(seen.time, seen.scene, seen.unseen)
        return replace(seen, scene=known.scene, unseen=known.unseen, faults=(*seen.faults, *known.faults))

    def _read_scene(self, now: float) -> bool:
        """Read the scene, move the obstacles of the worlds and return whether anything changed.

        A change of the required distances counts too: an obstacle may have gone on since it was seen. The distances
        that are required from each obstacle [m] are stored as attributes: ``_required_distances`` allows for the motion
        since the obstacle was seen and within the tick, and ``_required_if_moving`` also for obstacles at rest that may
        begin to move.
        """
        changed = False
        for snapshot in self._read_feed(now):
            self._note_faults(snapshot)
            changed |= self._tracker.update(snapshot)
            self._doubt_moves_since(self._tracker.faster_since)
            self._snapshot = snapshot
            self.run.see(snapshot)
            if self._tracker.fault:
                break

        snapshot = self._snapshot
        scene = snapshot.scene
        ages = snapshot.ages(now)
        changed |= self._renew_worlds(scene)

        self._scene_is_old = max(ages.values(), default=0.0) > self._settings.tick
        self._travels_since_seen = self._travels.since_seen(scene, ages)

        # The distance to keep from each obstacle [m] allows for its motion since it was seen and within the tick,
        travels_in_tick = self._travels.in_tick(scene)
        travels = {name: travel + self._travels_since_seen[name] for name, travel in travels_in_tick.items()}
        distances = required_distances(scene, self._required, travels)
        self._required_in_tick = distances
        berths = {name: distances[name] + berth for name, berth in self._berth.items() if name in distances}
        distances = distances | berths

        # and in proofs of moves for every motion that nothing rules out; None where no bound is known.
        self._possible_travels = self._travels.possible(snapshot, ages)
        required_if_moving: dict[str, float] | None = None
        if self._possible_travels is not None:
            required_if_moving = required_distances(scene, self._required, self._possible_travels)
        self._required_if_moving = required_if_moving
        if self._guard is not None and self._possible_travels is not None:
            may_move = frozenset(name for name, travel in self._possible_travels.items() if travel > 0.0)
            self._guard.see(scene, ages, may_move)

        if not changed and distances == self._required_distances:
            return False
        self._required_distances = distances

        predicted = (self._tracker.later(scene, seconds, ages) for seconds in self._lookahead())
        self._world.move(scene, *predicted, inflation=distances)
        return True

    def _renew_worlds(self, scene: Scene) -> bool:
        """Make new worlds and a new planner, with the path so far, if obstacles have come, gone or changed their shape.

        The same is done if the pairs that may touch have changed. Returns whether it was done.
        """
        if _same_solids(scene, self._world.scene):
            return False
        path = self._planner.path
        self._make_worlds(self._problem.world.with_accuracy("exact").with_scene(scene))
        self._planner = make_planner(self._settings, self._world, *self._box)
        self._planner.path = path
        return True

    def _note_faults(self, snapshot: Snapshot) -> None:
        """Record what is wrong with the feed, warn once of each kind, and doubt moves that could not know of it."""
        for fault in snapshot.faults:
            if fault.kind == "appears":
                fault = self._where_it_appears(fault, snapshot.scene)
            self.run.faults.append(fault)
            if fault.kind in UNFORESEEN:
                self._doubt_moves_since(self._snapshot.seen_at(fault.obstacle))
            if fault.kind not in self._warned_faults:
                self._warned_faults.add(fault.kind)
                warnings.warn(FeedWarning(f"scene feed: {fault}"), stacklevel=6)

    def _where_it_appears(self, fault: Fault, scene: Scene) -> Fault:
        """Return the fault that an obstacle appears on the arm if it does, and else the given one."""
        others = [o.name for o in scene.obstacles if o.name != fault.obstacle]
        alone = self._problem.world.with_accuracy("exact").with_scene(scene.without(*others))
        if alone.valid(self.q):
            return fault
        return replace(fault, kind="appears on the arm", detail=alone.explain(self.q))

    def _doubt_moves_since(self, time: float) -> None:
        """Mark the recorded moves that ended after a time [s] as not proven: an obstacle was faster than stated."""
        ticks = self.run.ticks
        for k in range(len(ticks) - 1, -1, -1):
            if ticks[k].time + self._settings.tick <= time:
                break
            if ticks[k].proven:
                ticks[k] = replace(ticks[k], proven=False)

    def _lookahead(self) -> list[float]:
        """Return the times from now [s] whose predicted obstacle places are avoided; none without a lookahead."""
        ticks = self._settings.lookahead_ticks
        last = PREDICTED_PLACES - 1
        return [ticks * self._settings.tick * k / last for k in range(1, PREDICTED_PLACES)] if ticks else []

    def _follow_goal(self) -> bool:
        """Reconnect the path to a goal that has moved away from its end; return whether that was done."""
        path = self._planner.path
        if self._goal_feed is None or path is None or self._world.blocked or (path[-1] == self._goals[0]).all():
            return False
        return self._planner.retarget(self._goals, self._world, self._budget_ends())

    def _check(self) -> bool:
        """Check the path again and return whether it is free."""
        return self._planner.check_path(self._world)

    def _repair(self) -> bool:
        """Look for a free path and return whether one was found.

        If there is none that avoids the predicted places of obstacles too, or gives them a wide berth, only their
        present places are avoided.
        """
        if self._new_proven_path():
            return True
        if not self._settings.lookahead_ticks and not self._berth:
            return False
        self._berth = {}
        self._required_distances = self._required_in_tick
        self._world.move(self._world.scene, inflation=self._required_distances)
        return self._planner.check_path(self._world) or self._new_proven_path()

    def _new_proven_path(self) -> bool:
        """Look for a free path and return whether one was found.

        The search is repeated up to ``PROOF_TRIES`` times until all motions of the path are proven; if none is, the
        path that was found last is taken.
        """
        planner = self._planner
        path_before = self._planner.path
        stop = self._budget_ends()
        new_path: Matrix | None = None

        for _ in range(PROOF_TRIES):
            if not self._new_path(stop):
                break
            new_path = planner.path
            if new_path is None or stop() or self._proven(new_path[:-1], new_path[1:]):
                return True
            planner.path = path_before
            planner.check_path(self._world)

        self._cut_short = new_path is None and bool(stop())
        if new_path is None:
            return False
        planner.path = new_path
        return planner.check_path(self._world)

    def _proven(self, starts: Matrix, ends: Matrix) -> bool:
        """Check whether motions keep margin and clearance, whatever obstacles that move do within a tick.

        Args:
            starts: Configurations where the motions begin, shape (m, n).
            ends: Configurations where they end, shape (m, n).
        """
        less = self._search_clearance - self._proven_clearance
        return bool(self._world.motions_proven(starts, ends, less=less).all())

    def _proven_whatever_moves(self, a: Vector, b: Vector) -> bool:
        """Check whether a motion keeps margin and clearance, whatever obstacles did since they were seen and do now.

        Unlike the search for a path, this allows for obstacles at rest that begin to move, and fails if an obstacle
        may reach the base.
        """
        # Without a bound on the travel of obstacles nothing can be proven.
        if self._possible_travels is None or self._required_if_moving is None:
            return False
        if not self._world.base_apart(self._possible_travels):
            return False
        inflation = None if self._required_if_moving == self._required_distances else self._required_if_moving
        less = self._search_clearance - self._proven_clearance
        return bool(self._world.motions_proven(a[None], b[None], less=less, inflation=inflation)[0])

    def _new_path(self, stop: Stop) -> bool:
        """Find a first path, repair the present one, or lead it to another goal if its goal is blocked.

        Returns whether there is a free path then.
        """
        planner = self._planner
        if planner.path is None:
            return planner.begin(self.q, self._goals, self._world, stop)
        if self._world.valid(planner.path[-1]):
            return planner.repair(self._world, stop)
        others = self._goals[(self._goals != planner.path[-1]).any(axis=1)]
        return planner.retarget(others, self._world, stop)

    def _early_evasion(self) -> tuple[TickEvent, str, Vector] | None:
        """Evade a cloud that closes in, before it is too near.

        Returns:
            Event, reason and next configuration, shape (n,); None if evading is not needed or not possible.
        """
        if self._world.blocked or not (self._closes_in() and self._world.valid(self.q)):
            return None
        q = self._evasion()
        return None if q is None else ("evade", "an obstacle closes in", q)

    def _go(self, event: TickEvent) -> tuple[TickEvent, str, Vector]:
        """Go along the free path.

        Args:
            event: The event if the robot moves: "walk", "plan" or "repair".

        Returns:
            Event, reason ("" unless the robot waits) and next configuration, shape (n,).
        """
        q, passed = self._next_on_path()
        if q is self.q:
            return "wait", "the goal is not free", q
        self._planner.advance(q, passed, self._world)
        return event, "", q

    def _next_on_path(self) -> tuple[Vector, int]:
        """Return the configuration after a step along the path, shape (n,), and how many waypoints it has passed.

        A step may cut across the corners of the path if the straight motion is free and proven; otherwise it ends at
        the first corner.
        """
        path = self._planner.path
        settings = self._settings
        if path is None or len(path) < 2:
            return self.q, 0

        q, passed = one_step(path, settings.step, self._max_change)
        round_corner = bool(passed) and self._world.motion_valid(self.q, q)
        if passed and not (round_corner and self._proven(self.q[None], q[None])):
            q, passed = to_first_corner(path, settings.step, self._max_change)
        return q, passed

    def _closes_in(self) -> bool:
        """Check whether a cloud will be too near within ``REACTION_TICKS`` ticks at its present speed.

        A cloud has no pose that changes, so only the shrinking distance shows that it moves.
        """
        distance_left = self._distance_left(self.q)
        return distance_left < REACTION_TICKS * (self._distance_left_before - distance_left)

    def _distance_left(self, q: Vector) -> float:
        """Return the clearance to obstacles less the required distance [m]; NaN if all their motion is predictable."""
        if not self._tracker.unforeseen(0.0):
            return np.nan
        return float(self._world_ahead(0).clearance(q[None])[0]) - self._required

    def _guarded(
        self, guard: Guard, event: TickEvent, free: bool
    ) -> tuple[TickEvent, str, Vector, float, Unavoidable | None]:
        """Go along the path if a way out is left then, or else where nothing can reach the arm for the longest time.

        While the scene is old, only proven steps are made along the path.

        Args:
            guard: Knows what obstacles can reach.
            event: The event if the robot goes along its path: "walk", "plan" or "repair".
            free: Whether the path is free.

        Returns:
            Event, reason, next configuration, shape (n,), how long the arm is safe [s], and the proof that no motion
            rules out a contact, or None.
        """
        path = self._planner.path
        if free and not self._world.blocked:
            q, passed = self._next_on_path()
            seconds = 0.0
            leaves_way_out = False
            if q is not self.q and path is not None:
                rest = np.vstack([q, path[passed + 1 :]])
                seconds, leaves_way_out = guard.seconds_after(self.q, rest, stays=self._now < self._stays_until)
            if leaves_way_out and not (self._scene_is_old and not self._proven_whatever_moves(self.q, q)):
                self._planner.advance(q, passed, self._world)
                return event, "", q, self._with_base(seconds), None
            self._note_refusal()
            self._give_wide_berth(guard)

        if self._world.blocked:
            refuge = Refuge(self.q, 0.0, moves=False)
            reason = self._world.blocked
        else:
            refuge = guard.refuge(self.q, path, self._world_ahead)
            reason = TOO_NEAR if refuge.moves else self._why_stay(free)

        lost: Unavoidable | None = None
        if self._with_base(refuge.seconds) < self._settings.tick - SPARE:
            found = self._way_out()
            reason = NO_WAY_OUT
            if isinstance(found, Unavoidable):
                lost = found
                reason = lost.sentence
            elif found is not None:
                refuge = Refuge(found, self._settings.tick, moves=bool((found != self.q).any()))
                reason = TOO_NEAR

        if refuge.moves:
            self._planner.rejoin(refuge.q)
        return "evade" if refuge.moves else "wait", reason, refuge.q, self._with_base(refuge.seconds), lost

    def _with_base(self, seconds: float) -> float:
        """Return until when nothing can touch the base either, which cannot give way: at most ``seconds`` [s]."""
        settings = self._settings
        speed = SPEED_WARNING_RATIO * (settings.speed_bound or 0.0)
        travels = {name: travel for name, travel in (self._possible_travels or {}).items() if travel > 0.0}

        def can_be_touched(ticks: int) -> bool:
            further = (ticks - 1) * settings.tick * speed
            return not self._world.base_apart({name: travel + further for name, travel in travels.items()})

        most = int(np.ceil(seconds / settings.tick - SPARE))
        if not can_be_touched(most):
            return seconds
        return settings.tick * bisect_left(range(1, most + 1), True, key=can_be_touched)

    def _give_wide_berth(self, guard: Guard) -> None:
        """Make further paths keep out of reach of obstacles, for as long as the guard asks for, where that is possible.

        It is beside obstacles that can reach neither the arm where it is nor the goal in that time.
        """
        path = self._planner.path
        if self._now < self._berth_after or path is None:
            return
        self._berth_after = self._now + BERTH_PAUSE
        berth = (guard.needed - self._settings.tick) * (self._settings.speed_bound or 0.0)
        rooms = self._rooms(np.vstack([self.q, path[-1]])).items()
        self._berth = {name: berth for name, room in rooms if min(room) > self._required_in_tick[name] + berth}

    def _rooms(self, rows: Matrix) -> dict[str, Vector]:
        """Return the distances from each obstacle that may move at configurations, shape (m, n) [m], shape (m,)."""
        found = self._exact_world().distances(rows)
        may_move = [name for name, travel in (self._possible_travels or {}).items() if travel > 0.0]
        columns = {name: [name in pair for pair in found.names] for name in may_move}
        return {name: found.values[:, own].min(axis=1) for name, own in columns.items() if any(own)}

    def _note_refusal(self) -> None:
        """Let the arm step only to where it could stay, for a while, if its steps were refused for long at one place.

        Else it would go to and fro.
        """
        self._last_refused = self._now
        near = NEAR_STEPS * self._settings.step
        if self._refused is None or float(np.linalg.norm(self.q - self._refused[1])) > near:
            self._refused = self._now, self.q
        elif self._now - self._refused[0] >= REFUSED_SECONDS:
            self._refused = None
            self._stays_until = self._now + STAY_SECONDS

    def _why_refused(self, guard: Guard) -> str:
        """Return which obstacle keeps the arm from going on, and with which bound on speeds it would go."""
        path = self._planner.path
        if path is None or self._now - self._last_refused > REFUSED_SECONDS:
            return ""
        rooms = self._rooms(np.vstack([path[-1], self._next_on_path()[0]]))
        for k, place in enumerate(("the goal", "the next step")):
            left = {name: room[k] - self._required - self._travels_since_seen[name] for name, room in rooms.items()}
            nearest = min(left, key=lambda name: left[name], default=None)
            if nearest is not None and (bound := guard.bound_for(left[nearest])) < (self._settings.speed_bound or 0.0):
                reach = f"'{nearest}' could reach the arm at {place} within {guard.needed:.3g} s"
                return f"{reach}; with a speed_bound of {bound:.3g} m/s it would go there"
        return NO_WAY_LEFT

    def _way_out(self) -> Vector | Unavoidable | None:
        """Return the end of a motion on which nothing can touch the arm in this tick, or a proof that there is none."""
        settings = self._settings
        after = self._possible_travels or {}
        way = settings.tick * (settings.speed_bound or 0.0)  # of an obstacle in a tick [m]
        before = {name: max(travel - way, 0.0) for name, travel in after.items()}

        # What is no faster than the bound but for rounding is not called faster.
        spare = ROUNDING + (SPEED_WARNING_RATIO - 1.0) * max(after.values(), default=0.0)
        spare += SPEED_WARNING_RATIO * TIME_RESOLUTION * (settings.speed_bound or 0.0)
        world = self._exact_world()
        reach = Reach(world, self.q, settings.step, self._max_change, settings.tick, before, after, spare)
        alone = self._world_of_arm
        return way_out(reach, lambda q: alone.motion_valid(self.q, q))

    def _exact_world(self) -> World:
        """Return a world for exact distances, with obstacles where they were seen."""
        return self._problem.world.with_accuracy("exact").with_scene(self._world.scene)

    def _why_stay(self, free: bool) -> str:
        """Return why the robot does not go along a path."""
        path = self._planner.path
        goals = self._goals if path is None else path[-1:]
        if not self._world.valid_batch(goals).any():
            return "the goal is not free"
        if not free:
            return self._why_no_path()
        return "what was seen is too old to go on" if self._scene_is_old else NO_WAY_LEFT

    def _wait_or_evade(self) -> tuple[TickEvent, str, Vector]:
        """Wait, or evade an obstacle that is too near, when there is no free path.

        Returns:
            Event, reason and next configuration, shape (n,).
        """
        if self._world.blocked:
            return "wait", self._world.blocked, self.q

        if self._world.valid(self.q):
            return "wait", self._why_stay(free=False), self.q

        q = self._evasion()
        if q is None:
            return "wait", f"{TOO_NEAR}, and every escape is blocked", self.q
        return "evade", TOO_NEAR, q

    def _why_no_path(self) -> str:
        """Return why the last search has found no path."""
        seconds = self._settings.repair_seconds
        return f"no path within repair_budget, {seconds:g} s a tick" if self._cut_short else "there is no path"

    def _evasion(self) -> Vector | None:
        """Return the configuration after an evasive tick, or None to stand still; the path then starts from there."""
        q = evasion(
            self.q, self._planner.path, step=self._settings.step, max_change=self._max_change,
            distance=self._required, ahead=self._world_ahead, alone=self._world_of_arm, rng=self._rng,
        )  # fmt: skip
        if q is not None:
            self._planner.rejoin(q)
        return q

    def _world_ahead(self, ticks: int) -> MovingWorld:
        """Move the world without self-collision to the scene predicted so many ticks ahead, and return it.

        Obstacles whose motion cannot be predicted are inflated by the distance that they may travel until then.
        """
        if self._moved_ahead == (self._now, ticks):
            return self._world_of_obstacles
        self._moved_ahead = self._now, ticks
        seconds = ticks * self._settings.tick
        scene_now = self._world.scene
        scene = self._tracker.later(scene_now, seconds) if ticks else scene_now
        unforeseen = self._tracker.unforeseen(seconds)
        inflation = {name: travel + unforeseen.get(name, 0.0) for name, travel in self._travels_since_seen.items()}
        self._world_of_obstacles.move(scene, inflation=inflation)
        return self._world_of_obstacles

    def _arrived(self) -> bool:
        """Check whether the robot is at one of its goals."""
        return bool((np.abs(self._goals - self.q).max(axis=1) <= JOINT_TOLERANCE).any())

    def _budget_ends(self) -> Stop:
        """Return a function that says whether a search that begins now has used up the repair budget."""
        clock = self._clock
        end = self._clock() + self._settings.repair_seconds
        return lambda: clock() > end

    def _timed(self, seconds_of_part: dict[str, float], name: str, work: Callable[..., bool], *arguments: Any) -> bool:
        """Call ``work(*arguments)``, write its duration [s] to ``seconds_of_part[name]`` and return its result."""
        begin = self._clock()
        result = work(*arguments)
        seconds_of_part[name] = self._clock() - begin
        return result

    def _record(
        self, now: float, q: Vector, event: TickEvent, seconds_of_part: Mapping[str, float], checked: int, reason: str,
        path: Matrix | None = None, **told: Any,
    ) -> None:  # fmt: skip
        # Only the poses of obstacles that have moved since the first tick are recorded.
        poses = {
            o.name: pose_row(o.pose)
            for o in self._world.scene.obstacles
            if o.name in self._first_poses and (o.pose.homogeneous != self._first_poses[o.name].homogeneous).any()
        }
        self.run.ticks.append(Tick(now, q, event, path, poses, seconds_of_part, checked, reason, **told))


def _same_solids(first: Scene, second: Scene) -> bool:
    """Check whether one world serves for two scenes: their names, shapes and pairs that may touch are the same.

    Clouds of points may have other points.
    """
    if first is second:
        return True
    shapes = {o.name: o.shape for o in first.obstacles}
    others = {o.name: o.shape for o in second.obstacles}
    return (
        shapes.keys() == others.keys()
        and all(same_but_for_points(shapes[name], others[name]) for name in shapes)
        and pairs_that_may_touch(first) == pairs_that_may_touch(second)
    )


def one_step(path: Matrix, step: float, max_change: Vector) -> tuple[Vector, int]:
    """Follow a path for one tick.

    Args:
        path: Waypoints, shape (k, n), k at least 2, the robot's configuration first.
        step: Length of a step [unit of the space].
        max_change: How far each joint can move in a tick [rad or m], shape (n,).

    Returns:
        The configuration after the tick, shape (n,), and how many waypoints behind the first one it has passed; the
        last waypoint never counts.
    """
    ticks_left = 1.0  # share of the tick that is left
    q = path[0]
    passed = 0

    for end in path[1:]:
        edge = end - q
        ticks_of_edge = float(ticks_of(edge[None], step, max_change)[0])
        if ticks_of_edge > ticks_left:
            return q + edge * (ticks_left / ticks_of_edge), passed
        ticks_left -= ticks_of_edge
        q = end
        passed += 1
    return q, passed - 1


def to_first_corner(path: Matrix, step: float, max_change: Vector) -> tuple[Vector, int]:
    """Follow a path for one tick like :func:`one_step`, but no farther than the next waypoint."""
    return one_step(path[:2], step, max_change)
