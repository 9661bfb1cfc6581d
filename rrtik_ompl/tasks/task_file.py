"""Read and write task files (YAML, ``version: 1``): robot, scene, start and stages of a `Task`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.catalog import list_problems, robot_from_entry, task_files
from rrtik_ompl.description.xacro_text import expanding
from rrtik_ompl.files.pose_entry import PoseEntry, pose_data
from rrtik_ompl.files.sections import (
    NAME,
    NOT_NEGATIVE,
    POSITIVE,
    TEXT,
    VECTOR2,
    VECTOR3,
    VERSION,
    WHOLE,
    Choice,
    Kind,
    Later,
    Listed,
    Mapped,
    Number,
    Refused,
    Section,
    ToldApart,
    key,
    parse,
)
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml, write_yaml
from rrtik_ompl.files.text import file_name
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.problem_files.goal import (
    GOAL,
    START,
    JointValues,
    Posture,
    TipTarget,
    build_goal,
    goal_data,
)
from rrtik_ompl.problem_files.path_constraints import CONSTRAINT, build_constraints, constraint_data
from rrtik_ompl.problem_files.problem_values import WorldKeys, world_data
from rrtik_ompl.problem_files.robot import ROBOT, robot_data
from rrtik_ompl.problem_files.scene import SceneEntry, scene_data
from rrtik_ompl.tasks import Task
from rrtik_ompl.tasks.grasps import grasps
from rrtik_ompl.tasks.program import check_program, steps_of
from rrtik_ompl.tasks.randomness import Displacement, Randomness, check_random
from rrtik_ompl.tasks.setting import Setting, placed_constraints
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, Gripper, MoveTo, Stage, Straight, holding
from rrtik_ompl.world.problem import usable_configuration
from rrtik_ompl.world.world import World

NUMBER = re.compile(r"stage (\d+)")
DISPLACED = ("x", "y", "z", "roll_deg", "pitch_deg", "yaw_deg")
OF_TASKS = ("task", "goals")  # A task file has exactly one of these keys.


class StageEntry(Section):
    """A stage."""

    def build(self, world: World) -> Stage:
        """Build the stage."""
        raise NotImplementedError


class MoveToEntry(StageEntry):
    """Move to a goal by any way that is free."""

    move_to = key(GOAL)
    path_constraints = key(Listed(CONSTRAINT), "regions that a frame must not leave on the way", default=[])

    def build(self, world: World) -> MoveTo:
        """Build the stage."""
        return _move_to(self.move_to, world.robot, [section.build(world.robot) for section in self.path_constraints])


def _move_to(section: JointValues | TipTarget, robot: Robot, constraints: Iterable[TaskRegion]) -> MoveTo:
    """Return the stage for a goal of a file; postures are kept by name."""
    goal = section.posture if isinstance(section, Posture) else build_goal(section, robot)
    return MoveTo(goal, tuple(constraints))


class LineEntry(Section):
    """Where a straight line ends."""

    by = key(VECTOR3, "shift of the tip [m], its orientation kept", default=None)
    to = key(PoseEntry, "pose of the tip", default=None)
    frame = key(Choice("world", "tip"), "whose axes the shift is in", default="world")

    def check_together(self) -> None:
        """Refuse both or none."""
        self.only_one(("by", "to"), "a straight line")


class StraightEntry(StageEntry):
    """Move the tip in a straight line."""

    straight = key(LineEntry)

    def build(self, world: World) -> Straight:
        """Build the stage."""
        del world
        line = self.straight
        return Straight(line.by, None if line.to is None else line.to.build(), line.frame)


class HoldEntry(Section):
    """An obstacle, the link that holds it, and what it may touch."""

    object = key(NAME)
    link = key(NAME)
    allow = key(Listed(NAME), "links and obstacles that it may touch while it is held", default=[])
    padding = key(
        NOT_NEGATIVE, "what it keeps while it is held from all else [m]; that of the link if absent", default=None
    )


class AttachEntry(StageEntry):
    """An obstacle moves with a link from now on."""

    attach = key(HoldEntry)

    def build(self, world: World) -> Attach:
        """Build the stage."""
        del world
        return Attach(self.attach.object, self.attach.link, tuple(self.attach.allow), self.attach.padding)


class DetachEntry(StageEntry):
    """What is held stays where it is from now on."""

    detach = key(NAME)

    def build(self, world: World) -> Detach:
        """Build the stage."""
        del world
        return Detach(self.detach)


class GripperEntry(StageEntry):
    """Open or close the gripper."""

    gripper = key(Choice("open", "close"))
    width = key(NOT_NEGATIVE, "how far apart the fingers are afterwards [m]", default=None)
    opening = key(NOT_NEGATIVE, "or how far its joints are open, 0 to 1", default=None)

    def build(self, world: World) -> Gripper:
        """Build the stage."""
        del world
        return Gripper(self.gripper, self.width, self.opening)


class GraspEntry(Section):
    """An obstacle that two fingers take, and how grasps of it are sampled; see rrtik_ompl.grasps."""

    object = key(NAME)
    count = key(WHOLE, "how many grasps the task may choose from", default=8)
    friction = key(POSITIVE, "coefficient of friction between fingers and object", default=0.5)
    clearance = key(NOT_NEGATIVE, "what arm and open hand keep from obstacles [m]", default=0.002)
    approach = key(NOT_NEGATIVE, "length of the straight way to the grasp [m]", default=0.1)
    opened = key(Number(0.0, 1.0), "how far the gripper is open before it closes", default=1.0)
    seed = key(WHOLE, "the same seed gives the same grasps", default=0)


class GraspsEntry(StageEntry):
    """Take an obstacle, where the scene has it, by any of several grasps that are sampled."""

    grasp = key(GraspEntry)

    def build(self, world: World) -> Alternatives:
        """Build the stage."""
        how = self.grasp
        found = grasps(
            world,
            how.object,
            count=how.count,
            friction=how.friction,
            clearance=how.clearance,
            approach=how.approach,
            opened=how.opened,
            seed=how.seed,
        )
        if not found:
            raise InputError(f"grasp: no grasp of '{how.object}' is found that the arm reaches; say how it is taken")
        return Alternatives([grasp.stages() for grasp in found])


class AlternativesEntry(StageEntry):
    """Any of several rows of stages."""

    alternatives = key(Listed(Listed(Later(lambda: STAGE), 1), 1))

    def build(self, world: World) -> Alternatives:
        """Build the stage."""
        return Alternatives([[stage.build(world) for stage in row] for row in self.alternatives])


OF_MOTIONS: dict[str, type[StageEntry]] = {"move_to": MoveToEntry, "straight": StraightEntry}
MOVING_STAGE: Kind[StageEntry] = ToldApart("the stage of a motion", OF_MOTIONS)
STAGE: Kind[StageEntry] = ToldApart(
    "a stage",
    {
        **OF_MOTIONS,
        "attach": AttachEntry,
        "detach": DetachEntry,
        "gripper": GripperEntry,
        "grasp": GraspsEntry,
        "alternatives": AlternativesEntry,
    },
)


class DisplacementEntry(Section):
    """Ranges from which a displacement is drawn, evenly, in the axes of the world."""

    x = key(VECTOR2, "lowest and highest displacement [m]", default=[0.0, 0.0])
    y = key(VECTOR2, "[m]", default=[0.0, 0.0])
    z = key(VECTOR2, "[m]", default=[0.0, 0.0])
    roll_deg = key(VECTOR2, "lowest and highest turn about the fixed x axis [deg]", default=[0.0, 0.0])
    pitch_deg = key(VECTOR2, "about the fixed y axis, after roll [deg]", default=[0.0, 0.0])
    yaw_deg = key(VECTOR2, "about the fixed z axis, after roll and pitch [deg]", default=[0.0, 0.0])
    about = key(VECTOR3, "point about which it is turned [m]; of an obstacle its own origin if absent", default=None)
    along_with = key(NAME, "obstacle whose own displacement comes on top", default=None)

    def build(self) -> Displacement:
        """Return the displacement."""
        return Displacement(
            x=self.x,
            y=self.y,
            z=self.z,
            roll=np.radians(self.roll_deg),
            pitch=np.radians(self.pitch_deg),
            yaw=np.radians(self.yaw_deg),
            about=self.about,
            along_with=self.along_with,
        )


class RandomStartEntry(Section):
    """Ranges of the joints at the beginning."""

    within = key(POSITIVE, "how far each joint is from the start at most [rad; m]", default=None)
    within_deg = key(POSITIVE, "the same for joints that turn [deg]; others stay", default=None)
    joints = key(Listed(VECTOR2, 1), "lowest and highest value of each joint [rad; m]", default=None)
    joints_deg = key(Listed(VECTOR2, 1), "the same, in degrees where they turn [deg; m]", default=None)

    def check_together(self) -> None:
        """Refuse none or several."""
        self.only_one(("within", "within_deg", "joints", "joints_deg"), "a random start")

    def build(self, robot: Robot, start: Vector) -> Matrix:
        """Return the ranges, shape (dof, 2) [rad or m]."""
        if self.joints is not None or self.joints_deg is not None:
            name = "joints" if self.joints is not None else "joints_deg"
            configuration = robot.configuration if name == "joints" else robot.configuration_deg
            ranges = np.array(getattr(self, name))
            return np.stack([configuration(bound, f"random: start: {name}") for bound in ranges.T], axis=1)
        reach = np.full(robot.dof, self.within)
        if self.within_deg is not None:
            reach = np.where(robot.prismatic, 0.0, np.radians(self.within_deg))
        return np.stack([robot.clamp(start - reach), robot.clamp(start + reach)], axis=1)


class ApartEntry(Section):
    """Two obstacles whose origins stay apart."""

    pair = key(Listed(NAME, 2, 2))
    least = key(NOT_NEGATIVE, "[m]")


class RandomEntry(Section):
    """What is drawn anew for each demonstration (rrtik demos)."""

    objects = key(Mapped(DisplacementEntry), "obstacles, displaced from where the scene has them", default={})
    places = key(Mapped(DisplacementEntry), "where objects are set down, by the names of the objects", default={})
    goals = key(DisplacementEntry, "goals that lead neither to attach nor to detach", default=None)
    start = key(RandomStartEntry, default=None)
    apart = key(Listed(ApartEntry), "distances that drawn obstacles keep between their origins", default=[])
    instruction = key(TEXT, "what the arm does, in words, for whoever learns from it", default="")

    def build(self, robot: Robot, start: Vector) -> Randomness:
        """Return what is random."""
        return Randomness(
            {name: entry.build() for name, entry in self.objects.items()},
            {name: entry.build() for name, entry in self.places.items()},
            None if self.goals is None else self.goals.build(),
            None if self.start is None else self.start.build(robot, start),
            [(entry.pair[0], entry.pair[1], entry.least) for entry in self.apart],
            self.instruction,
        )


class TaskFile(WorldKeys):
    """A task. Lengths in metres; angles in radians, in degrees where a key ends in _deg."""

    version = key(VERSION)
    robot = key(ROBOT)
    scene = key(SceneEntry, default=SceneEntry())
    start = key(START)
    task = key(Listed(STAGE, 1), default=None)
    goals = key(Listed(GOAL, 1), "in place of task: goals that are reached one after the other", default=None)
    path_constraints = key(
        Listed(CONSTRAINT), "regions that a frame must not leave on the way through all goals", default=[]
    )
    random = key(RandomEntry, default=None)

    def check_together(self) -> None:
        """Refuse both or none, and constraints that belong to stages."""
        if self.only_one(OF_TASKS, "a task") == "task" and self.path_constraints:
            raise Refused("path_constraints of a task stand beside its move_to stages")


def list_tasks() -> tuple[str, ...]:
    """Return the names of the tasks that packages ship.

    Example:
        >>> "panda_pick_place" in rrtik.list_tasks()
        True
    """
    return tuple(sorted(task_files()))


def read_task(file: str | os.PathLike[str], *, trust_xacro: bool = False) -> Task:
    """Load a task; see :meth:`Task.load`.

    Raises:
        UnknownNameError: If it is a single word but not a known name.
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
    """
    with expanding(trusted=trust_xacro):
        return _task(file)


def _task(name_or_file: str | os.PathLike[str]) -> Task:
    """Load a task as :func:`read_task` does.

    The robot, the scene, the start and the stages are built in this order, so that errors name the line of their key.
    """
    path = file_name(name_or_file)
    if isinstance(name_or_file, str) and not path.suffix and len(path.parts) == 1:
        shipped = task_files()
        if name_or_file not in shipped:
            if name_or_file in list_problems():
                raise InputError(f"'{name_or_file}' is a problem, not a task; use rrtik plan {name_or_file}")
            raise UnknownNameError("task", name_or_file, shipped)
        path = shipped[name_or_file]

    document = read_yaml(path)
    entry = parse(document, TaskFile)
    with document.at(("robot",)):
        robot = robot_from_entry(document.data["robot"], document.path.parent)
    scene = entry.scene.build(document)
    with document.at(("scene",)):
        world = World.of(entry.settings(robot, scene))
    with document.at(("start",)):
        given = entry.start.configuration(robot)
        begun = Setting.beginning(world, robot.configuration(given, "start"))
        start = usable_configuration(begun.world, given, "start")

    with document.at(("random",)):
        random = None if entry.random is None else entry.random.build(robot, start)
    task = Task(_stages(document, entry, world, start), world, start, name=path.stem, random=random)
    for name in OF_TASKS:
        if getattr(entry, name) is not None:
            _check(document, name, task, world)
    if random is not None:
        with document.at(("random",)):
            check_random(random, task)
    return task


def write_task(task: Task, file: str | os.PathLike[str]) -> None:
    """Write a task; see :meth:`Task.save`.

    Raises:
        InputError: If the task has no world or start, the format cannot express a part of it, or the file cannot be
            written.
    """
    write_yaml(file, task_data(task, file_name(file).parent))


def task_data(task: Task, folder: Path) -> dict[str, Any]:
    """Return the content of a task file in a folder.

    Raises:
        InputError: If the task has no world or start, or the format cannot express a part of it.
    """
    world = task.world
    start = {"posture": task.start} if isinstance(task.start, str) else {"joints": task.start.tolist()}
    if world.constraints is not None:
        raise InputError("task: its world has path constraints, which the file has no key for; give MoveTo them")

    data: dict[str, Any] = {"version": 1, "robot": robot_data(world.robot.source, folder)}
    scene = scene_data(world.scene, folder)
    data |= {"scene": scene} if scene else {}
    stages = holding(task.stages, placed_constraints(world, task.start, task.constraints))
    data |= {"start": start, **world_data(world.settings), "task": [stage_data(stage) for stage in stages]}
    return data | ({} if task.random is None else {"random": _random_data(task.random)})


def _random_data(random: Randomness) -> dict[str, Any]:
    """Return the section of a task file for what is random."""
    objects = {name: _displacement_data(each) for name, each in random.objects.items()}
    places = {name: _displacement_data(each) for name, each in random.places.items()}
    data: dict[str, Any] = {name: group for name, group in (("objects", objects), ("places", places)) if group}
    data |= {} if random.goals is None else {"goals": _displacement_data(random.goals)}
    data |= {} if random.start is None else {"start": {"joints": random.start.tolist()}}
    apart = [{"pair": [first, second], "least": least} for first, second, least in random.apart]
    data |= {"apart": apart} if apart else {}
    return data | ({"instruction": random.instruction} if random.instruction else {})


def _displacement_data(displacement: Displacement) -> dict[str, Any]:
    """Return the entry of a task file for a displacement."""
    rows = dict(zip(DISPLACED, [*displacement.bounds[:3], *np.degrees(displacement.bounds[3:])], strict=True))
    data: dict[str, Any] = {name: row.tolist() for name, row in rows.items() if row.any()}
    data |= {} if displacement.about is None else {"about": displacement.about.tolist()}
    return data | ({} if displacement.along_with is None else {"along_with": displacement.along_with})


def _check(document: YamlDocument, key: str, task: Task, world: World) -> None:
    """Raise an error, with the line of the stage, if a stage can never be done."""
    try:
        check_program(steps_of(task.stages), world)
    except InputError as error:
        first = NUMBER.match(str(error))
        with document.at((key, int(first[1]) - 1) if first else (key,)):
            raise


def _stages(document: YamlDocument, entry: TaskFile, world: World, start: Vector) -> list[Stage]:
    """Return the stages that a file lists, or one stage for each of its goals."""
    if entry.task is not None:
        listed_stages: list[Stage] = []
        taken: frozenset[str] = frozenset()
        for number, stage in enumerate(entry.task):
            with document.at(("task", number)):
                taken = _taken_after(taken, stage)
                listed_stages.append(stage.build(world))
        return listed_stages

    constraints = build_constraints(document, entry.path_constraints, world.robot)
    with document.at(("path_constraints",)):
        placed_regions = placed_constraints(world, start, constraints)

    stages: list[Stage] = []
    for number, goal in enumerate(entry.goals or ()):
        with document.at(("goals", number)):
            stages.append(_move_to(goal, world.robot, placed_regions))
    return stages


def _taken_after(taken: frozenset[str], entry: StageEntry) -> frozenset[str]:
    """Return the obstacles that may have been taken after a stage, from those before it.

    Raises:
        InputError: If it is grasps of one of these, which need not be where the scene has it.
    """
    if isinstance(entry, AlternativesEntry):
        return taken.union(*(reduce(_taken_after, row, taken) for row in entry.alternatives))
    if isinstance(entry, AttachEntry):
        return taken | {entry.attach.object}
    if isinstance(entry, GraspsEntry):
        name = entry.grasp.object
        if name in taken:
            raise InputError(f"grasp: '{name}' was taken before; say how it is taken where it is then")
        return taken | {name}
    return taken


def stage_data(stage: Stage) -> dict[str, Any]:
    """Return the entry of a task file for a stage.

    Raises:
        InputError: If the format cannot express the stage's goal.
    """
    if isinstance(stage, Alternatives):
        return {"alternatives": [[stage_data(each) for each in row] for row in stage.options]}
    if isinstance(stage, MoveTo):
        regions = [constraint_data(region) for region in stage.constraints]
        return {"move_to": _goal_data(stage.goal)} | ({"path_constraints": regions} if regions else {})
    if isinstance(stage, Straight):
        if stage.by is not None:
            return {"straight": {"by": stage.by.tolist(), "frame": stage.frame}}
        if isinstance(stage.to, np.ndarray):
            raise InputError("Straight: a task file cannot say to=[x, y, z]; give a pose, or by=[dx, dy, dz]")
        return {"straight": {"to": pose_data(stage.to)}}
    if isinstance(stage, Attach):
        padding = {} if stage.padding is None else {"padding": stage.padding}
        return {"attach": {"object": stage.object, "link": stage.link, "allow": list(stage.allow), **padding}}
    if isinstance(stage, Detach):
        return {"detach": stage.object}
    assert isinstance(stage, Gripper)
    said = {"width": stage.width, "opening": stage.opening}
    return {"gripper": stage.state} | {key: value for key, value in said.items() if value is not None}


def _goal_data(goal: Goal | Vector | str) -> dict[str, Any]:
    """Return the entry of a task file for the goal of a stage."""
    if isinstance(goal, str):
        return {"posture": goal}
    return {"joints": goal.tolist()} if isinstance(goal, np.ndarray) else goal_data(goal)
