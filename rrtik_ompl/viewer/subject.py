"""Subjects of a page: a problem with or without a path, a world, a robot alone, or a scene alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.judgement import ClearanceCurve, PathContact, Verdict
from rrtik_ompl.model.path import JointPath, fitted
from rrtik_ompl.model.robot import Robot, require_joints
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.viewer.drawing.marks import Mark
from rrtik_ompl.viewer.run_actors import actors_of
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

FINGER_DIGITS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Fingers:
    """Motion of gripper fingers over time, relative to the poses at which they are drawn.

    Attributes:
        poses: For each body, by the nodes of its joint and its own, its pose on the joint in each motion times the
            inverse of the drawn pose: x, y, z and quaternion x, y, z, w, shape (motions, 7).
        at: For each tick the number of the motion whose fingers are shown, shape (ticks,); fractions while they move.
    """

    poses: Mapping[tuple[str, str], Matrix]
    at: Vector

    def story(self) -> dict[str, Any]:
        """Return the motion as plain values for the page."""
        bodies = [
            {"joint": joint, "name": name, "poses": np.round(rows, FINGER_DIGITS).tolist()}
            for (joint, name), rows in self.poses.items()
        ]
        return {"bodies": bodies, "at": np.round(self.at, FINGER_DIGITS).tolist()}


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """The parts of what is shown.

    Attributes:
        name: Name for display.
        robot: The arm; None if only a scene is shown.
        scene: Its surroundings.
        goal: Goal of the problem, or None.
        waypoints: Configurations to play, shape (k, dof); a single row if there is no path, (0, 0) without a robot.
        is_path: Whether the waypoints are a path, as opposed to a single configuration.
        before: Waypoints of a path for comparison, shape (m, dof), or None.
        ghosts: Configurations drawn transparently, shape (m, dof), or None.
        marks: Further bodies.
        run: The run whose ticks are the waypoints, or None.
        verdict: What is proven of the motion; None without a motion, or without a world.
        curve: Clearance along the path, or None if it is not known.
        times: Times of the waypoints of a timed motion [s], shape (k,), or None.
        held: Regions of path constraints, and the configurations, shape (dof,), at which they begin to hold.
        fingers: For a task, the motion of the gripper's fingers in the ticks of the run, or None.
        contacts: Contacts along the waypoints, which are drawn in red.
    """

    name: str
    robot: Robot | None
    scene: Scene
    goal: Goal | None
    waypoints: Matrix
    is_path: bool
    before: Matrix | None = None
    ghosts: Matrix | None = None
    marks: tuple[Mark, ...] = ()
    run: ReplanRun | None = None
    verdict: Verdict | None = None
    curve: ClearanceCurve | None = None
    times: Vector | None = None
    held: tuple[tuple[HeldRegion, Vector], ...] = ()
    fingers: Fingers | None = None
    contacts: tuple[PathContact, ...] = ()

    @property
    def start(self) -> Vector | None:
        """Configuration of the start ghost, shape (dof,), or None."""
        among = self.ghosts is not None and self.end is None
        wanted = not among and (self.is_path or self.goal is not None)
        start: Vector | None = self.waypoints[0] if wanted else None
        return start

    @property
    def tips(self) -> tuple[str, ...]:
        """Links whose trails are drawn: those of a goal for several, or the robot's tip."""
        if self.robot is None:
            return ()
        named = () if self.goal is None else self.goal.frames
        return named or (self.robot.tip,)

    @property
    def end(self) -> Vector | None:
        """Configuration of the goal ghost, shape (dof,): end of the path or the goal's joint values, or None.

        With ghosts there is no goal ghost, unless the goal is one of them: then this one can be dragged.
        """
        q = None if self.goal is None else self.goal.q
        if self.ghosts is not None:
            return q if q is not None and (self.ghosts == q).all(axis=1).any() else None
        if not self.is_path or (self.run is not None and not self.run.found):
            return q

        end: Vector = self.waypoints[-1]
        return end


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """An arm at a configuration, its surroundings and a goal; it is shown like a problem, but not checked.

    Attributes:
        robot: The arm.
        scene: Its surroundings.
        goal: A goal to draw, or None.
        start: The configuration, shape (dof,).
        contacts: Contacts of its bodies, which are drawn in red.
    """

    robot: Robot
    scene: Scene
    goal: Goal | None
    start: Vector
    contacts: tuple[PathContact, ...] = ()


Showable: TypeAlias = Problem | Shown | World | Robot | Scene
ShownPath: TypeAlias = JointPath | Trajectory | ArrayLike


def subject_of(
    shown: Showable,
    path: ShownPath | None = None,
    before: ShownPath | None = None,
    ghosts: ArrayLike | None = None,
    marks: tuple[Mark, ...] = (),
) -> Subject:
    """Return the subject for the input of `view`.

    Args:
        shown: A ``Problem``, a ``World``, a ``Robot`` or a ``Scene``.
        path: A ``JointPath``, a ``Trajectory``, or waypoints of shape (k, dof) with k at least 1 [rad or m].
        before: Another path to compare with.
        ghosts: Configurations, shape (m, dof).
        marks: Further bodies.

    Raises:
        InputError: If ``shown`` is none of these, or the path does not fit the robot, or there is one to compare with
            but none to show.
    """
    if before is not None and path is None:
        raise InputError("view: there is a path before, but none after it; give the path to show too")

    marks = _drawn(marks)
    if isinstance(shown, Scene):
        if path is not None or ghosts is not None:
            raise InputError("view: a path needs a robot; show a problem, a world or a robot instead of a scene alone")
        return Subject("Scene", None, shown, None, frozen(np.empty((0, 0))), False, marks=marks)

    if isinstance(shown, Robot):
        robot = shown
        scene = Scene()
    else:
        world: Any = getattr(shown, "world", shown)
        if not isinstance(getattr(world, "robot", None), Robot) or not isinstance(getattr(world, "scene", None), Scene):
            raise InputError(f"view: cannot show a {type(shown).__name__}; give a problem, world, robot or scene")
        robot = world.robot
        scene = world.scene

    subject = replace(_posture(shown, robot, scene), marks=marks)
    if ghosts is not None:
        subject = replace(subject, ghosts=_path(robot, ghosts).waypoints)

    if path is None:
        return subject

    earlier = None if before is None else _path(robot, before).waypoints
    return replace(_moving(subject, getattr(shown, "world", shown), path), before=earlier)


def _drawn(marks: tuple[Mark, ...]) -> tuple[Mark, ...]:
    """Check marks, and return those that are not empty."""
    for mark in marks:
        require(mark, Mark, "mark of a view", "see rrtik_ompl.viewer.drawing.marks")
    return tuple(mark for mark in marks if len(mark.faces))


def _posture(shown: Showable, robot: Robot, scene: Scene) -> Subject:
    """Return the subject of a robot at its start, with its goal."""
    named = getattr(shown, "name", "problem")
    name = robot.name if named == "problem" else str(named)
    start = getattr(shown, "start", None)
    posture = robot.clamp(np.zeros(robot.dof)) if start is None else robot.configuration(start, "start")

    world = getattr(shown, "world", shown)
    regions = () if not isinstance(world, World) or world.constraints is None else world.constraints.regions

    return Subject(
        name,
        robot,
        scene,
        getattr(shown, "goal", None),
        frozen(posture[None]),
        False,
        held=tuple((region, posture) for region in regions),
        contacts=shown.contacts if isinstance(shown, Shown) else (),
    )


def _moving(subject: Subject, world: object, path: ShownPath) -> Subject:
    """Return a subject on a path or a timed motion, with the verdict on it if there is a world."""
    robot = subject.robot
    assert robot is not None, "a path has one"
    if isinstance(path, Trajectory):
        require_joints(robot, path.joint_names, "trajectory")
        motion: JointPath | Trajectory = path
    else:
        motion = _path(robot, path)

    played = motion.played(world if isinstance(world, World) else None)
    found = replace(
        subject,
        waypoints=played.waypoints,
        is_path=True,
        times=played.times,
        held=tuple((region, played.waypoints[0]) for region, _ in subject.held),
    )

    judged = played.judged
    if judged is None:
        return found
    return replace(found, verdict=judged.verdict, curve=judged.curve, contacts=judged.contacts)


def _path(robot: Robot, path: ShownPath) -> JointPath:
    """Return a path of a robot; if it names its joints, these must be the robot's."""
    given: Any = path
    for part in ("motion", "path", "trajectory"):
        if isinstance(getattr(given, part, None), JointPath | Trajectory | ReplanRun):
            raise InputError(f"view: cannot play a {type(given).__name__}; give its {part}")

    rows = finite_array(getattr(given, "waypoints", given), (None, None), "path")
    if len(rows) == 0 or rows.shape[1] != robot.dof:
        raise InputError(
            f"path: robot '{robot.name}' has {robot.dof} joints ({', '.join(robot.joint_names)}), "
            f"but the path has shape {rows.shape}"
        )
    if isinstance(path, JointPath):
        return fitted(path, robot)
    return JointPath(rows, robot.joint_names, robot.prismatic, robot.name, robot.continuous)


def subject_of_run(problem: Showable, run: ReplanRun) -> Subject:
    """Return the subject of a run: the robot in every tick, and every obstacle where it was first.

    Raises:
        InputError: If it is no run, or not one of that problem.
    """
    subject = replayed(problem, run)
    if isinstance(problem, Problem) and not np.allclose(run.configurations[0], problem.start):
        raise InputError(f"run to show: one of '{run.problem}', which has another start; give the problem that was run")
    drawn = Scene([each.drawn for each in actors_of(run, subject.scene)])
    for name in set[str]().union(*(tick.poses for tick in run.ticks)):
        drawn.obstacle(name)  # raises if the run belongs to another problem
    still = tuple(replace(o, motion=None) for o in drawn.at(0.0).obstacles)
    scene = Scene(still, subject.scene.attached)

    judged = run.judged(problem if isinstance(problem, Problem) else None)
    return replace(subject, scene=scene, verdict=judged.verdict, contacts=judged.contacts)


def replayed(shown: Showable, run: ReplanRun) -> Subject:
    """Return a subject whose robot is at its configuration in each tick of a run, in the scene that is shown.

    Raises:
        InputError: If it is no run, or not one of that robot.
    """
    require(run, ReplanRun, "run to show", "use replan() or ReplanRun.load(file)")
    if len(run.ticks) == 0:
        raise InputError("run to show: it has no tick")

    subject = subject_of(shown)
    robot = subject.robot
    rows = run.configurations
    if robot is None or robot.joint_names != run.joint_names:
        raise InputError(f"run to show: one of robot '{run.robot}' with other joints; give the problem that was run")

    held = tuple((region, rows[0]) for region, _ in subject.held)
    return replace(subject, waypoints=_path(robot, rows).waypoints, is_path=True, run=run, held=held)
