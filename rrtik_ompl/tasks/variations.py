"""Many instances of one task: things that stand elsewhere, are set down elsewhere, or another beginning."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, frozen
from rrtik_ompl.base.copies import as_value, changed, set_fields
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.base.poses import PoseLike, rigid
from rrtik_ompl.model.goal import Goal, GoalSet, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, MoveTo, Stage, Straight, every_stage
from rrtik_ompl.world.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """What differs in one instance of a task from the task as it is written.

    What the arm does at a thing goes along with it: a `MoveTo`, and the straight lines behind it, as the thing that is
    taken or set down next. Goals in joint values and postures stay as they are.

    Attributes:
        poses: T_world_obstacle at the beginning, by the names of obstacles.
        places: Where objects are set down: rigid motions of the world, by the names of objects. The goals on the way to
            the `Detach` of an object are moved by its motion.
        start: Configuration at the beginning, shape (dof,), or the name of a posture; None for that of the task.

    Raises:
        InputError: If a pose is none, or the start is no row of finite numbers.

    Example:
        >>> task = rrtik.Task.load("panda_pick_place")
        >>> farther = rrtik.Variation({"cup": [0.52, 0.22, 0.25]}, {"cup": [0.0, -0.03, 0.0]})
        >>> task.varied(farther).plan(seed=1).found
        True
    """

    poses: Mapping[str, pin.SE3] = field(default_factory=dict)
    places: Mapping[str, pin.SE3] = field(default_factory=dict)
    start: Vector | str | None = None

    __reduce__ = as_value

    def __init__(
        self,
        poses: Mapping[str, PoseLike] = MappingProxyType({}),
        places: Mapping[str, PoseLike] = MappingProxyType({}),
        start: ArrayLike | str | None = None,
    ) -> None:
        given = start if start is None or isinstance(start, str) else frozen(finite_array(start, (None,), "start"))
        set_fields(self, poses=_checked(poses, "poses"), places=_checked(places, "places"), start=given)


def _checked(poses: Mapping[str, PoseLike], what: str) -> Mapping[str, pin.SE3]:
    require(poses, Mapping, f"{what} of a variation", "use {name: pose}")
    return MappingProxyType({name: rigid(pose, f"{what} of a variation: '{name}'") for name, pose in poses.items()})


def moved_scene(scene: Scene, poses: Mapping[str, pin.SE3]) -> Scene:
    """Return a scene with obstacles elsewhere; without poses, the same object.

    Raises:
        UnknownNameError: If there is no obstacle of a name.
    """
    for name in poses:
        scene.obstacle(name)
    obstacles = [replace(each, pose=poses[each.name]) if each.name in poses else each for each in scene.obstacles]
    return changed(scene, obstacles=tuple(obstacles)) if poses else scene


def moved_stages(stages: tuple[Stage, ...], world: World, variation: Variation) -> tuple[Stage, ...]:
    """Return the stages of a task with their goals moved along with the things that are taken and set down.

    Args:
        stages: Of the task as it is written.
        world: Its world.
        variation: What is different.

    Raises:
        UnknownNameError: If no stage sets down an object that is to be set down elsewhere.
    """
    set_down = {each.object for each in every_stage(stages) if isinstance(each, Detach)}
    for name in variation.places:
        if name not in set_down:
            raise UnknownNameError("object that is set down", name, sorted(set_down), where="places of a variation")

    scene = world.scene
    changes = {name: pose * scene.obstacle(name).pose.inverse() for name, pose in variation.poses.items()}
    return _Moved(changes, variation.places).row(stages, ())


def next_handled(stages: Iterable[Stage]) -> Attach | Detach | None:
    """Return the stage that takes or sets down something next."""
    return next((each for each in every_stage(stages) if isinstance(each, Attach | Detach)), None)


class _Moved:
    """Moves the stages of a task, one after the other.

    Args:
        taken: How obstacles are moved, by name.
        places: How the places are moved at which objects are set down, by name.
    """

    def __init__(self, taken: Mapping[str, pin.SE3], places: Mapping[str, pin.SE3]) -> None:
        self._where = dict(taken)  # how each thing is moved now
        self._places = places
        self._change: pin.SE3 | None = None  # how the goals are moved that come next

    def row(self, stages: tuple[Stage, ...], after: tuple[Stage, ...]) -> tuple[Stage, ...]:
        """Return some stages moved; ``after`` are those that follow them."""
        return tuple(self._moved(stage, (*stages[k:], *after)) for k, stage in enumerate(stages))

    def _moved(self, stage: Stage, rest: tuple[Stage, ...]) -> Stage:
        """Return a stage moved; ``rest`` begins with it."""
        if isinstance(stage, Alternatives):
            where = self._where
            change = self._change
            rows = []
            for option in stage.options:
                self._where = dict(where)
                self._change = change
                rows.append(self.row(option, rest[1:]))
            return Alternatives(rows)
        if isinstance(stage, Detach):
            self._where[stage.object] = self._places.get(stage.object, pin.SE3.Identity())
        if isinstance(stage, MoveTo) or (isinstance(stage, Straight) and self._change is None):
            self._change = self._change_of(next_handled(rest))
        return stage if self._change is None else _stage_moved(stage, self._change)

    def _change_of(self, following: Attach | Detach | None) -> pin.SE3:
        """Return how goals on the way to a stage are moved."""
        if following is None:
            return pin.SE3.Identity()
        places = self._where if isinstance(following, Attach) else self._places
        return places.get(following.object, pin.SE3.Identity())


def _stage_moved(stage: Stage, change: pin.SE3) -> Stage:
    """Return a stage with its goal in the world moved."""
    if change == pin.SE3.Identity():
        return stage
    if isinstance(stage, MoveTo) and isinstance(stage.goal, Goal):
        return replace(stage, goal=_goal_moved(stage.goal, change))
    if isinstance(stage, Straight) and stage.by is not None:
        return Straight(by=change.rotation @ stage.by) if stage.frame == "world" else stage
    if isinstance(stage, Straight):
        return Straight(to=change * stage.to if isinstance(stage.to, pin.SE3) else change.act(np.array(stage.to)))
    return stage


def _goal_moved(goal: Goal, change: pin.SE3) -> Goal:
    """Return a goal of the tip moved; one in joint values stays.

    Raises:
        InputError: If the goal is of a kind that has no place.
    """
    if goal.q is not None:
        return goal
    if isinstance(goal, PoseGoal):
        return PoseGoal(change * goal.T_world_tip, *goal.tolerances)
    if isinstance(goal, PositionGoal):
        return PositionGoal(change.act(np.array(goal.position)), goal.tolerance)
    if isinstance(goal, TaskRegion):
        return replace(goal, T_world_w=change * goal.T_world_w)
    if isinstance(goal, GoalSet):
        return GoalSet([_goal_moved(each, change) for each in goal.members], goal.free_rotation_axis, goal.box)
    raise InputError(f"variation: a goal of the kind '{goal.title}' cannot be moved; give its joint values")
