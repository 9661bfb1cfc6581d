"""A planning problem: a world, a start and a goal. Creating a `Problem` checks that its start is usable."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, dimensions, frozen
from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.base.copies import as_value, changed, in_notebook, in_print, restored
from rrtik_ompl.base.errors import InputError, ProblemError, listed, require
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.constraints.held_regions import HeldRegions, goal_regions, held_regions
from rrtik_ompl.constraints.residuals import contradiction
from rrtik_ompl.files.kinds import found, read, write
from rrtik_ompl.model.goal import Goal, GoalLike, JointGoal, PoseGoal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.world.route_check import verification_resolution
from rrtik_ompl.world.world import World, form_of, like


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Problem:
    """A planning problem: a start and a goal in a world.

    Joint values up to 1e-5 outside a limit are moved onto it. The goal values of continuous joints are shifted by whole
    turns to be nearest to the start, so that the straight motion goes the short way round.

    A goal that only obstacles with a stated motion cover is taken, since they may go away: :func:`rrtik_ompl.replan`
    and :func:`rrtik_ompl.replanning.plan_in_time` wait for it, and planners among obstacles at rest refuse it.

    A problem is plain data: it is copied, pickled and changed by its fields.

    Attributes:
        settings: The settings of its world: robot, scene, and how motions are checked.
        start: Start configuration, shape (dof,), read-only.
        goal: The goal; a :class:`JointGoal` has been checked to be free, but for obstacles that state their motion.
        name: Name used in messages and files.
        planner: Name of the planner that :func:`rrtik_ompl.plan` uses where none is named, or None.

    Args:
        world: Robot and scene, in which start and goal are checked.
        start: Configuration, shape (dof,), rad or m, or the name of a posture.
        goal: A goal, a configuration, the name of a posture, or a pose (``pinocchio.SE3`` or shape (4, 4)).
        name: Name used in messages and files.
        planner: One of :func:`rrtik_ompl.list_planners`; the name is only looked up when it is used.
        constraints: Regions that a frame must not leave on the whole path, in addition to those of ``world``. They are
            added to the world of the problem, where only motions that keep them are valid.

    Raises:
        ProblemError: If start or goal is in collision, within an obstacle's margin, outside the limits or outside the
            region of a constraint; pair, margin, joint, limit, or constraint and amount are named.
        InputError: If start or goal has the wrong number of joints or is not finite.
        UnknownNameError: If the robot has no posture of a given name.

    Example:
        >>> world = rrtik.World(rrtik.load_robot("panda"))
        >>> rrtik.Problem(world, "default", rrtik.PositionGoal([0.3, 0.5, 0.4])).start.shape
        (7,)
    """

    call = "Problem(World(robot, scene), start, goal)"

    settings: WorldSettings
    start: Vector
    goal: Goal
    name: str
    planner: str | None

    def __init__(
        self,
        world: World,
        start: ArrayLike | str,
        goal: GoalLike,
        *,
        name: str = "problem",
        planner: str | None = None,
        constraints: Iterable[TaskRegion] = (),
    ) -> None:
        require(world, World, "world of a problem", "use World(robot, scene)")
        require(planner, str | None, "planner of a problem", "use a name of list_planners()")
        start = world.robot.posture(start) if isinstance(start, str) else start
        goal = world.robot.posture(goal) if isinstance(goal, str) else goal
        checked_goal = _goal_of(goal)
        joints = {} if checked_goal.q is None else {"goal": checked_goal.q}
        ends = _usable_ends(world, {"start": start, **joints})
        checked_start = frozen(ends["start"])

        # Place the path constraints at the start, and add them to the world.
        known_regions = world.settings.constraints
        new_regions = [each for each in listed(constraints, "path constraints") if each not in known_regions]
        held_constraints = held_regions(world.robot, world.scene, (*known_regions, *new_regions), checked_start)
        regions = tuple(each.region for each in held_constraints.regions)
        if regions:
            world = form_of(world, constraints=regions)
            _check_held(world.robot, held_constraints, checked_start, "start")

        if isinstance(checked_goal, JointGoal):
            _check_held(world.robot, held_constraints, ends["goal"], "goal")
            checked_goal = changed(checked_goal, q=frozen(_nearest_turn(world, checked_start, ends["goal"])))
        elif any(_of_a_path(part.freedom) for part in checked_goal.parts if part.freedom is not None):
            raise InputError(
                "goal region: frame, from_start and allowances are for path constraints; a goal is of the tip"
            )

        if checked_goal.frames:
            goal_regions(world.robot, world.scene, checked_goal)  # refuses links that do not exist

        values = {
            "settings": world.settings,
            "start": checked_start,
            "goal": checked_goal,
            "name": name,
            "planner": planner,
        }
        for field, value in values.items():
            object.__setattr__(self, field, value)
        # Fills the cached property, so that the tables of the given world are used again.
        object.__setattr__(self, "world", world)

    __reduce__ = as_value
    _repr_html_ = in_notebook
    _repr_png_ = in_print

    def __repr__(self) -> str:
        return f"Problem('{self.name}', World({self.settings.summary}), to a {type(self.goal).__name__})"

    @cached_property
    def world(self) -> World:
        """Robot, scene and collision checks; made from the settings on first use."""
        return like(self.settings)

    @property
    def robot(self) -> Robot:
        """The robot of the world."""
        return self.settings.robot

    @property
    def constraints(self) -> tuple[TaskRegion, ...]:
        """Regions that a frame must not leave on the whole path; those ``from_start`` are placed in the world."""
        return tuple(self.settings.constraints)

    @staticmethod
    def load(
        file: str | os.PathLike[str],
        *,
        robot: Robot | str | os.PathLike[str] | None = None,
        trust_xacro: bool = False,
    ) -> Problem:
        """Load a shipped problem by name, a problem file, or a MotionBenchMaker pair, as `load_problem` does.

        Args:
            file: A name of `list_problems`, or a file.
            robot: A robot (or its name, or its URDF) to be used in place of the one that the file names.
            trust_xacro: Whether the macros of a robot's file are trusted, see `load_robot`.

        Raises:
            InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
            ProblemError: If start or goal is in collision or outside the limits.
        """
        return read(Problem, file, robot=robot, trust_xacro=trust_xacro)

    @staticmethod
    def schema() -> dict[str, Any]:
        """Return the JSON schema of problem files, for editors and validators.

        Example:
            >>> sorted(rrtik.Problem.schema()["required"])
            ['goal', 'robot', 'start', 'version']
        """
        schema: dict[str, Any] = found("problem_files.problem_values:problem_schema")()
        return schema

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the problem as YAML; if writing fails, no incomplete file is left.

        Numbers are read back bit for bit, rotations to the last digit or two. Angles are written in radians. Files
        (meshes, URDF) are named relative to the new file's folder.

        Raises:
            InputError: If the file cannot be written, or the format cannot express a part of the problem.

        Example:
            >>> problem = rrtik.load_problem("planar3_boxes")
            >>> problem.save("boxes.yaml")
            >>> rrtik.Problem.load("boxes.yaml").world.scene.names == problem.world.scene.names
            True
        """
        write(self, file)

    def with_resolution(self, motion_resolution: float) -> Problem:
        """Return the same problem with another motion resolution [m], see :meth:`World.with_resolution`."""
        return self.with_world(self.world.with_resolution(motion_resolution))

    def with_accuracy(self, accuracy: Accuracy) -> Problem:
        """Return the same problem with accuracy "exact" or "conservative" (:meth:`rrtik_ompl.World.with_accuracy`)."""
        return self.with_world(self.world.with_accuracy(accuracy))

    def with_world(self, world: World) -> Problem:
        """Return a problem with the same start and goal in another form of its world; neither is checked again.

        Raises:
            InputError: If ``world`` is not a world.
        """
        require(world, World, "world of a problem", "use World(robot, scene)")
        return problem_in(self, world)

    def reached(self, q: ArrayLike) -> bool:
        """Check whether a configuration, shape (dof,), satisfies the goal."""
        return bool(self.goal.satisfied(self.robot, self.robot.configuration(q)[None])[0])


def known_problem(
    world: World, start: Vector, goal: Goal | Vector, *, name: str = "problem", planner: str | None = None
) -> Problem:
    """Create a problem from a start and a goal that are known to be valid, without any checks.

    Args:
        world: The world.
        start: Shape (dof,).
        goal: A goal, or its configuration, shape (dof,); values of continuous joints must be nearest to the start.
        name: Name of the problem.
        planner: Name of its planner.
    """
    values = {
        "settings": world.settings,
        "start": frozen(start),
        "goal": goal if isinstance(goal, Goal) else JointGoal(goal),
        "name": name,
        "planner": planner,
        "world": world,
    }

    return restored(Problem, values)


def densely_checked(problem: Problem) -> Problem:
    """Return the same problem with its motions checked at the finer resolution of a path's second check."""
    world = problem.world
    return problem_in(problem, form_of(world, motion_resolution=verification_resolution(world.settings)))


def problem_in(problem: Problem, world: World) -> Problem:
    """Return the problem in another form of its world, as :meth:`Problem.with_world` but without a type check."""
    return changed(problem, settings=world.settings, world=world)


def refuse_covered_goal(problem: Problem) -> None:
    """Refuse a problem whose goal is not free at time 0, for planners that take moving obstacles to be at rest.

    Raises:
        ProblemError: If the goal is in collision or within an obstacle's margin; the message names the pair.
    """
    q = problem.goal.q
    if q is None or not _moving(problem.settings.scene):
        return
    try:
        usable_configuration(problem.world, q, "goal")
    except ProblemError as error:
        hint = "plan_in_time() and replan() wait until it is free"
        raise ProblemError(f"{error}; {hint}", error.contacts, part="goal") from None


def _usable_ends(world: World, ends: Mapping[str, ArrayLike]) -> dict[str, Vector]:
    """Validate start and goal as :func:`usable_configurations` does; moving obstacles may cover the goal."""
    try:
        return usable_configurations(world, ends)
    except ProblemError as error:
        moving = _moving(world.scene)
        if error.part != "goal" or not moving:
            raise
    world_at_rest = world.unheld.with_scene(world.scene.without(*moving))
    goal = usable_configuration(world_at_rest, ends["goal"], "goal")
    return usable_configurations(world, {"start": ends["start"]}) | {"goal": goal}


def _moving(scene: Scene) -> list[str]:
    """Return the names of the obstacles that state a motion."""
    return [o.name for o in scene.obstacles if o.motion is not None]


def usable_configuration(world: World, values: ArrayLike, what: str) -> Vector:
    """Validate one configuration, shape (dof,), as :func:`usable_configurations` does; ``what`` names it in errors."""
    return usable_configurations(world, {what: values})[what]


def usable_configurations(world: World, ends: Mapping[str, ArrayLike]) -> dict[str, Vector]:
    """Validate configurations of a user as start and goal: they have to be finite, inside the limits and free.

    Args:
        world: The world; its path constraints are not checked here.
        ends: Configurations, shape (dof,) each, by the names that errors give them, such as "start".

    Returns:
        The configurations by the same names, those slightly outside a limit moved onto it.

    Raises:
        ProblemError: If one is in collision, within an obstacle's margin or outside the limits.
        InputError: If one has the wrong number of joints or is not finite.
    """
    robot = world.robot
    configurations = {}
    for what, values in ends.items():
        q = robot.configuration(values, what)
        if fault := robot.limit_fault(q):
            raise ProblemError(f"{what}: {fault}{_unit_doubt(robot, q)}", part=what)
        configurations[what] = robot.onto_limits(q)

    rows = np.array(list(configurations.values()))
    world = world.unheld

    # Both checks must agree, because the second one will certify the path that begins and ends there.
    for opinion in (world.checks.free, world.checks.certified):
        for (what, q), free in zip(configurations.items(), opinion(rows).tolist(), strict=True):
            if not free:
                raise _not_free_error(world, q, what)
    return configurations


def _unit_doubt(robot: Robot, q: Vector) -> str:
    """Return a hint at units where a joint is more than a turn outside its limits; "" if none is."""
    turns = (np.abs(q - robot.clamp(q)) > TAU) & ~robot.prismatic
    return "; joint values are radians: for degrees write np.radians([..]), in files joints_deg" if turns.any() else ""


def _not_free_error(world: World, q: Vector, what: str) -> ProblemError:
    """Return the error for a start or goal that is in collision or too near, with a remedy."""
    touching = world.contacts(q)
    if not touching:
        return _not_proven_error(world, q, what)

    pairs = [(c.first, c.second) for c in touching]
    names_at_rest = {body.name for body in world.bodies if body.joint == 0}
    contacts_at_rest = [c for c in touching if {c.first, c.second} <= names_at_rest]
    if contacts_at_rest:
        remedy = "no joint moves either; move the obstacle or the base, or allow the pair"
        return ProblemError(f"{what} is in collision: {contacts_at_rest[0]}; {remedy}", pairs, part=what)

    if touching and all(c.distance > 0.0 for c in touching):
        any_padding = any(body.padding for body in world.bodies)
        lower = "lower the margin" + (" or the padding" if any_padding else "")
        remedy = f"move it or {lower}" + (", or allow the pair" if world.self_margin or any_padding else "")
        return ProblemError(f"{what} is too near: {world.explain(q)}; {remedy}", pairs, part=what)

    clouds = {each.name for each in world.scene.obstacles if each.shape.sensed}
    in_cloud = any(clouds & set(pair) for pair in pairs)
    remedy = "move it" + (", take the arm's own points out by without_robot()," if in_cloud else "")
    return ProblemError(f"{what} is in collision: {world.explain(q)}; {remedy} or allow the pair", pairs, part=what)


def _not_proven_error(world: World, q: Vector, what: str) -> ProblemError:
    """Return the error for a start or goal that touches nothing but is too near or not proven free."""
    pairs = [(c.first, c.second) for c in world.too_near(q)]
    if pairs:
        remedy = "move it, lower the clearance or allow the pair"
        return ProblemError(f"{what} is too near: {world.explain(q)}; {remedy}", pairs, part=what)
    nearest = world.closest(q, known_free=True)
    pairs = [] if nearest is None else [(nearest.first, nearest.second)]
    remedy = 'move it, or use accuracy="exact"' if world.accuracy == "conservative" else "move it"
    return ProblemError(f"{what} is not proven free: {world.explain(q)}; {remedy}", pairs, part=what)


def _of_a_path(region: TaskRegion) -> bool:
    """Check whether a region uses fields that are reserved for path constraints."""
    return bool(region.frame or region.from_start or region.position_allowance or region.orientation_allowance)


def _check_held(robot: Robot, constraints: HeldRegions, q: Vector, what: str) -> None:
    if fault := constraints.explain(q):
        remedy = contradiction(robot, constraints) or "move it, or widen the tolerance"
        raise ProblemError(f"{what} breaks {fault}; {remedy}", part=what)


def _goal_of(goal: GoalLike) -> Goal:
    """Convert a goal given by a user: a pose, as ``pinocchio.SE3`` or shape (4, 4), is for the tip.

    Everything else that is not a goal already is taken for a configuration.
    """
    if isinstance(goal, Goal):
        return goal
    pose = isinstance(goal, pin.SE3) or dimensions(goal) == 2
    return PoseGoal(rigid(goal, "goal")) if pose else JointGoal(goal)


def _nearest_turn(world: World, start: Vector, q: Vector) -> Vector:
    """Shift the continuous joints of the goal q by whole turns so that they are nearest to the start.

    The values are returned exactly as they are where no turn is needed.
    """
    turns = np.where(world.robot.continuous, np.round((start - q) / TAU), 0.0)
    nearest: Vector = q + turns * TAU
    return nearest


def fixed_ends(problem: Problem) -> dict[str, Vector]:
    """Return the configurations that every path of a problem passes, keyed by "start" and "goal"."""
    q = problem.goal.q
    return {"start": problem.start} | ({} if q is None else {"goal": q})


def planning_bounds(problem: Problem, goals: Matrix) -> tuple[Vector, Vector]:
    """Return finite lower and upper bounds to sample in, shapes (n,).

    They are the joint limits; a joint without limits is bounded to one turn beyond start and goals.

    Args:
        problem: The problem.
        goals: Goal configurations, shape (k, n).
    """
    robot = problem.world.robot
    if _has_limits(robot):
        return robot.lower, robot.upper

    ends = np.vstack([problem.start, goals])
    lower = np.where(np.isfinite(robot.lower), robot.lower, ends.min(axis=0) - TAU)
    upper = np.where(np.isfinite(robot.upper), robot.upper, ends.max(axis=0) + TAU)
    return frozen(lower), frozen(upper)


@kept_with
def _has_limits(robot: Robot) -> bool:
    """Check whether all joints of a robot have limits."""
    return bool(np.isfinite(robot.lower).all() and np.isfinite(robot.upper).all())
