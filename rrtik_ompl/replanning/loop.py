"""The loop that moves a robot along its path while obstacles move: look, repair, step; one tick after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import TAU, Matrix, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.goal import JOINT_TOLERANCE, JointGoal
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.poses import quaternion_xyzw
from rrtik_ompl.problem import Problem
from rrtik_ompl.replanning.evading import evasion
from rrtik_ompl.replanning.feed import Feed, Watch, rooms
from rrtik_ompl.replanning.run import Run, Tick
from rrtik_ompl.replanning.settings import COPIES, Settings, planner_of
from rrtik_ompl.replanning.walking import one_step, to_first_corner
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Scene
from rrtik_ompl.world import World
from rrtik_ompl.world.motion_queries import Stop
from rrtik_ompl.world.moving_world import MovingWorld

GoalFeed = Callable[[float], ArrayLike]
Clock = Callable[[], float]


class Loop:
    """One run; :meth:`tick` does one tick.

    Attributes:
        q: Where the robot is, shape (n,).
        run: The record so far.
    """

    def __init__(
        self,
        problem: Problem,
        feed: Feed,
        chosen: Settings,
        goal_feed: GoalFeed | None,
        clock: Clock = time.perf_counter,
    ) -> None:
        self._clock = clock
        robot, scene = problem.robot, feed(0.0)
        self._problem, self._feed, self._chosen, self._goal_feed = problem, feed, chosen, goal_feed
        first = World(robot, scene, motion_resolution=problem.world.motion_resolution)
        self._world = MovingWorld(first, copies=COPIES if chosen.predict else 1)
        self._near = MovingWorld(first, self_collision=False)
        empty = Scene((), scene.attached, _held_pairs(scene))
        self._alone = World(robot, empty, motion_resolution=first.motion_resolution, accuracy="conservative")
        self._watch = Watch(scene, chosen.speed_bound)
        self._rng = np.random.default_rng(chosen.seed)
        self.q = problem.start
        self._goals = _goals(problem, self._alone, self._rng) if goal_feed is None else _goal(robot, goal_feed, 0.0)
        self._first = {o.name: o.pose for o in scene.obstacles}
        self._see(0.0)
        self._world.move(scene, inflation=self._room)  # a start may stand where something is only expected
        _check_start(self.q, scene, first, self._world)
        ends = np.vstack([self.q, self._goals])
        lower = np.where(np.isfinite(robot.lower), robot.lower, ends.min(axis=0) - TAU)
        upper = np.where(np.isfinite(robot.upper), robot.upper, ends.max(axis=0) + TAU)
        self._planner = planner_of(chosen, self._world, lower, upper)
        self.run = Run(
            problem.name, robot.name, robot.joint_names, chosen.planner, chosen.seed, chosen.step, chosen.rate,
            chosen.margin, chosen.speed_bound,
        )  # fmt: skip

    def tick(self, number: int) -> bool:
        """Do one tick and write it down; False when the goal is reached."""
        now, begin = number * self._chosen.tick, self._clock()
        if self._arrived():
            self._note(now, self.q, "arrive", {}, 0, "")
            return False
        if self._goal_feed is not None:
            self._goals = _goal(self._problem.robot, self._goal_feed, now)
        spent: dict[str, float] = {}
        changed = self._timed(spent, "sense", self._see, now)
        self._timed(spent, "retarget", self._follow_goal)
        checked = self._world.checked
        free = self._timed(spent, "look", self._look) if changed or not self._planner.free else True
        checked, event, reason = self._world.checked - checked, "walk", ""
        if not free and not self._world.blocked:
            event, before = "repair" if self._planner.path is not None else "plan", self._planner.path
            free = self._timed(spent, event, self._repair)
            event = "walk" if free and self._planner.path is before else event
        here = self.q
        if free:
            place = self._walk()
            event, reason = (event, "") if place is not here else ("wait", "the goal is not free")
        else:
            event, reason, place = self._stand_by()
        path = self._planner.path
        self._note(now, here, event, {**spent, "all": self._clock() - begin}, checked, reason, path)
        self.q = place
        return True

    def _see(self, now: float) -> bool:
        """Take in the scene; whether anything has moved."""
        scene = self._feed(now)
        if not self._watch.see(now, scene):
            return False
        chosen = self._chosen
        clear = chosen.margin + 0.5 * self._world.motion_resolution  # between two looks at a motion too
        self._room = rooms(scene, clear, chosen.tick, chosen.speed_bound, self._watch.speeds)
        ahead = [chosen.predict * chosen.tick * k / (COPIES - 1) for k in range(1, COPIES)] if chosen.predict else []
        self._world.move(scene, *(self._watch.later(scene, seconds) for seconds in ahead), inflation=self._room)
        return True

    def _follow_goal(self) -> bool:
        """Where the goal has moved away from the end of the path, reconnect it, as far as that is free."""
        path = self._planner.path
        if self._goal_feed is None or path is None or self._world.blocked or (path[-1] == self._goals[0]).all():
            return False
        return self._planner.retarget(self._goals, self._world, self._slot_ends())

    def _look(self) -> bool:
        return self._planner.look(self._world)

    def _repair(self) -> bool:
        """A free path, by whatever way; without the predicted places of obstacles if there is none with them."""
        if self._new_path():
            return True
        if not self._chosen.predict:
            return False
        self._world.move(self._world.scene, inflation=self._room)
        return self._planner.look(self._world) or self._new_path()

    def _new_path(self) -> bool:
        stop, planner = self._slot_ends(), self._planner
        if planner.path is None:
            return planner.begin(self.q, self._goals, self._world, stop)
        if self._world.valid(planner.path[-1]):
            return planner.repair(self._world, stop)
        others = self._goals[(self._goals != planner.path[-1]).any(axis=1)]
        return planner.retarget(others, self._world, stop)

    def _walk(self) -> Vector:
        """Go a step along the path, round corners if that is free; the place of the robot then."""
        path, chosen = self._planner.path, self._chosen
        if path is None or len(path) < 2:
            return self.q
        place, passed = one_step(path, chosen.step, chosen.most)
        if passed and not self._world.motion_valid(self.q, place):
            place, passed = to_first_corner(path, chosen.step, chosen.most)
        self._planner.advance(place, passed, self._world)
        return place

    def _stand_by(self) -> tuple[str, str, Vector]:
        """No path: wait, or go out of the way of what comes too near. Event, reason, place."""
        if self._world.blocked:
            return "wait", self._world.blocked, self.q
        if self._world.valid(self.q):
            path = self._planner.path
            goals = self._goals if path is None else path[-1:]
            reason = "there is no way" if self._world.valid_batch(goals).any() else "the goal is not free"
            return "wait", reason, self.q
        chosen, way = self._chosen, self._planner.path
        room = max(self._room.values())
        place = evasion(self.q, chosen.step, chosen.most, room, self._near, self._later, self._alone, self._rng, way)
        if place is None:
            return "wait", "an obstacle is too near, and there is nowhere to go", self.q
        self._planner.rejoin(place)
        return "evade", "an obstacle is too near", place

    def _later(self, ticks: int) -> Scene:
        return self._watch.later(self._world.scene, ticks * self._chosen.tick) if ticks else self._world.scene

    def _arrived(self) -> bool:
        return bool((np.abs(self._goals - self.q).max(axis=1) <= JOINT_TOLERANCE).any())

    def _slot_ends(self) -> Stop:
        """When a search that begins now has to end."""
        clock, end = self._clock, self._clock() + self._chosen.slot
        return lambda: clock() > end

    def _timed(self, spent: dict[str, float], name: str, work: Callable[..., bool], *arguments: float) -> bool:
        begin = self._clock()
        result = work(*arguments)
        spent[name] = self._clock() - begin
        return result

    def _note(
        self, now: float, q: Vector, event: str, spent: Mapping[str, float], checked: int, reason: str,
        path: Matrix | None = None,
    ) -> None:  # fmt: skip
        poses = {
            o.name: np.concatenate([o.pose.translation, quaternion_xyzw(o.pose)])
            for o in self._world.scene.obstacles
            if not np.array_equal(o.pose.homogeneous, self._first[o.name].homogeneous)
        }
        self.run.ticks.append(Tick(now, q, event, path, poses, spent, checked, reason))


def _check_start(q: Vector, scene: Scene, world: World, moving: MovingWorld) -> None:
    """Refuse a run that begins in contact, or nearer to it than can be told apart from it.

    Raises:
        InputError: It names the pair.
    """
    if not world.valid(q):
        found = f"scene feed: at its begin the robot is in collision: {world.explain(q)}"
        raise InputError(f"{found}; move the obstacle or lower its margin")
    if not moving.valid(q):
        nearest = world.closest(q)
        pair = "" if nearest is None else f" ('{nearest.first}' to '{nearest.second}': {nearest.distance:.3g} m)"
        raise InputError(f"start: nearer to contact than the margin{pair}; lower margin or speed_bound, or raise rate")


def _goals(problem: Problem, alone: World, rng: np.random.Generator) -> Matrix:
    """Every configuration that may be the goal, whatever stands in its way now, shape (g, n).

    Raises:
        InputError: If there is none.
    """
    if isinstance(problem.goal, JointGoal):
        return problem.goal.q[None]
    found = goal_configurations(Problem(alone, problem.start, problem.goal), rng)
    if len(found.rows) == 0:
        raise InputError(f"goal: {found.reason}")
    return found.rows


def _goal(robot: Robot, goal_feed: GoalFeed, now: float) -> Matrix:
    """Where a moving goal is, shape (1, n).

    Raises:
        InputError: If that is no configuration of the robot, or outside the limits.
    """
    q = robot.configuration(goal_feed(now), f"goal at {now:g} s")
    if fault := robot.limit_fault(q):
        raise InputError(f"goal at {now:g} s: {fault}")
    return q[None]


def _held_pairs(scene: Scene) -> tuple[tuple[str, str], ...]:
    """Allowed collisions that do not concern obstacles."""
    gone = {o.name for o in scene.obstacles}
    return tuple(pair for pair in scene.allowed_collisions if not gone & set(pair))
