"""What is random in a task, and instances of it that are drawn: objects, places to set them down, goals, the start."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, finite_array, frozen, not_negative
from rrtik_ompl.base.copies import as_value, set_fields
from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError, listed, require
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.model.goal_kind import COORDINATES, displacements
from rrtik_ompl.tasks.setting import Setting
from rrtik_ompl.tasks.stages import Detach, MoveTo, Stage, every_stage
from rrtik_ompl.tasks.variations import Variation, moved_scene, moved_stages, next_handled
from rrtik_ompl.tasks.worlds import Left, Worlds, worlds_from
from rrtik_ompl.world.problem import usable_configuration
from rrtik_ompl.world.world import World

if TYPE_CHECKING:
    from rrtik_ompl.model.robot import Robot
    from rrtik_ompl.tasks import Task

MOST_DRAWS = 100  # draws for one instance, of which the first usable one is taken
DEEPER = 1e-6  # [m] by how much two things may overlap more than in the task as it is written
STILL = frozen(np.zeros((6, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class Displacement:
    """Ranges from which a displacement is drawn, evenly, in the axes of the world.

    Attributes:
        bounds: Lowest and highest x, y, z [m] and roll, pitch, yaw about the fixed axes [rad], shape (6, 2).
        about: The point about which it is turned [m], shape (3,); None for the origin of the obstacle itself.
        along_with: Name of an obstacle whose own displacement comes on top, or None.

    Example:
        >>> aside = rrtik.demos.Displacement(x=(-0.1, 0.1), yaw=(-0.5, 0.5))
        >>> aside.bounds[5].tolist()
        [-0.5, 0.5]
    """

    bounds: Matrix
    about: Vector | None
    along_with: str | None

    __reduce__ = as_value

    def __init__(
        self,
        *,
        x: ArrayLike = (0.0, 0.0),
        y: ArrayLike = (0.0, 0.0),
        z: ArrayLike = (0.0, 0.0),
        roll: ArrayLike = (0.0, 0.0),
        pitch: ArrayLike = (0.0, 0.0),
        yaw: ArrayLike = (0.0, 0.0),
        about: ArrayLike | None = None,
        along_with: str | None = None,
    ) -> None:
        given = zip(COORDINATES, (x, y, z, roll, pitch, yaw), strict=True)
        rows = [_range(values, f"displacement: {name}") for name, values in given]
        for name, row in zip(COORDINATES[3:], rows[3:], strict=True):
            if np.abs(row).max() > TAU:
                raise InputError(f"displacement: {name}: {np.abs(row).max():g} rad is more than a turn; give radians")
        require(along_with, str | None, "along_with of a displacement", "name an obstacle")
        centre = None if about is None else frozen(finite_array(about, (3,), "displacement: about"))
        set_fields(self, bounds=frozen(rows), about=centre, along_with=along_with)

    @property
    def turns(self) -> bool:
        """Whether anything is turned."""
        return bool(self.bounds[3:].any())

    def drawn(self, rng: np.random.Generator, centre: Vector) -> pin.SE3:
        """Draw a rigid motion in the axes of the world.

        Args:
            rng: The generator.
            centre: The point about which it is turned where there is none of its own [m], shape (3,).
        """
        low, high = self.bounds.T
        shift = pin.SE3(displacements(rng.uniform(low, high)[None])[0])
        middle = np.array(centre if self.about is None else self.about)
        return pin.SE3(shift.rotation, middle + shift.translation - shift.rotation @ middle)


@dataclass(frozen=True, slots=True, eq=False)
class Randomness:
    """What is random in a task.

    Attributes:
        objects: Displacements of obstacles from where the scene has them, by name.
        places: Displacements of where objects are set down, by the names of the objects.
        goals: Displacement of the goals that lead neither to `Attach` nor to `Detach`; None if they stay.
        start: Lowest and highest value of each joint at the beginning, shape (dof, 2) [rad or m]; None for the start of
            the task.
        apart: How far the origins of two drawn things must be apart at least: two names of obstacles, and [m].
        instruction: What the arm does, in words, for whoever learns from demonstrations; "" for the name of the task.

    Example:
        >>> random = rrtik.demos.Randomness({"cup": rrtik.tasks.Displacement(y=(-0.05, 0.05))})
        >>> sorted(random.objects)
        ['cup']
    """

    objects: Mapping[str, Displacement]
    places: Mapping[str, Displacement]
    goals: Displacement | None
    start: Matrix | None
    apart: tuple[tuple[str, str, float], ...]
    instruction: str

    __reduce__ = as_value

    def __init__(
        self,
        objects: Mapping[str, Displacement] | None = None,
        places: Mapping[str, Displacement] | None = None,
        goals: Displacement | None = None,
        start: ArrayLike | None = None,
        apart: Iterable[tuple[str, str, float]] = (),
        instruction: str = "",
    ) -> None:
        require(instruction, str, "instruction of what is random")
        require(goals, Displacement | None, "goals of what is random")
        ranges = None
        if start is not None:
            ranges = frozen([_range(row, "start of what is random") for row in finite_array(start, (None, 2), "start")])
        set_fields(
            self,
            objects=_named(objects, "objects of what is random"),
            places=_named(places, "places of what is random"),
            goals=goals,
            start=ranges,
            apart=tuple(_pair(each) for each in listed(apart, "apart of what is random")),
            instruction=instruction,
        )


def _named(given: Mapping[str, Displacement] | None, what: str) -> Mapping[str, Displacement]:
    """Return displacements by the names of obstacles."""
    require(given, Mapping | None, what, "use {name: Displacement(...)}")
    for name, each in (given or {}).items():
        require(name, str, f"each name of {what}")
        require(each, Displacement, f"{what}: '{name}'")
    return MappingProxyType(dict(given or {}))


def _pair(given: tuple[str, str, float]) -> tuple[str, str, float]:
    """Return two names and the distance that is kept between them [m]."""
    first, second, distance = listed(given, "each entry of apart") if len(given) == 3 else (None, None, None)
    require(first, str, "first name of apart", 'use ("cup", "bowl", 0.1)')
    require(second, str, "second name of apart", 'use ("cup", "bowl", 0.1)')
    return first, second, not_negative(distance, "distance of apart")


def _range(values: ArrayLike, what: str) -> Vector:
    """Return a lowest and a highest value.

    Raises:
        InputError: If they are not two numbers in this order.
    """
    row = finite_array(values, (2,), what)
    if row[0] > row[1]:
        raise InputError(f"{what}: the lowest value comes first, got [{row[0]:g}, {row[1]:g}]; exchange them")
    return row


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """An instance of a task.

    Attributes:
        task: Its stages and start, in the world of the task as it is written; None if no draw was usable.
        poses: Where the drawn obstacles stand, T_world_obstacle, by name.
        rejected: How many draws were not usable, by the reason.
    """

    task: Task | None
    poses: Mapping[str, pin.SE3]
    rejected: Mapping[str, int]

    @property
    def reason(self) -> str:
        """Why there is no instance; "" if there is one."""
        if self.task is not None:
            return ""
        why, count = Counter(self.rejected).most_common(1)[0]
        return f"none of {sum(self.rejected.values())} draws was usable; {count} times: {why}"


class Draws:
    """Draws instances of a task.

    Args:
        task: A task with a world and a start of its own, and with something random.

    Attributes:
        task: The task.
        random: What is random in it.
        left: The worlds that earlier draws and plans have left to the next ones.

    Raises:
        InputError: If nothing is random in it, or what is random does not fit it.
        UnknownNameError: If there is no obstacle of a name, or the task does not set it down.
    """

    def __init__(self, task: Task) -> None:
        random = task.random
        if random is None:
            raise InputError(
                f"task '{task.name}': nothing is random in it, so all demonstrations would be the same; "
                "give its file a section random:"
            )
        self.task = task
        self.random = random
        check_random(random, task)
        self._start = task.world.robot.posture(task.start) if isinstance(task.start, str) else task.start
        self._pairs = self._measured_pairs(task.world)
        self._as_written = self._distances(task.world)
        self.left = Left()

    def __reduce__(self) -> tuple[type[Draws], tuple[Task]]:
        """Pickle the task alone: worlds do not go to another process."""
        return Draws, (self.task,)

    def draw(self, rng: np.random.Generator) -> Drawn:
        """Draw an instance; draws of which the scene or the start cannot be are counted and drawn anew."""
        rejected: Counter[str] = Counter()
        poses: Mapping[str, pin.SE3] = {}
        for _ in range(MOST_DRAWS):
            task, poses = self._instance(rng)
            fault = self._fault(task, poses)
            if not fault:
                return Drawn(task, poses, rejected)
            rejected[fault] += 1
        return Drawn(None, poses, rejected)

    def _instance(self, rng: np.random.Generator) -> tuple[Task, Mapping[str, pin.SE3]]:
        """Draw all that is random, in the order of the section; the instance as :class:`Drawn` has it."""
        scene = self.task.world.scene
        random = self.random
        moves = {name: each.drawn(rng, scene.obstacle(name).pose.translation) for name, each in random.objects.items()}
        places = {name: each.drawn(rng, np.zeros(3)) for name, each in random.places.items()}
        goals = None if random.goals is None else random.goals.drawn(rng, np.zeros(3))
        start = self._start if random.start is None else rng.uniform(*random.start.T)

        # An obstacle that goes along with another one is displaced with it once both are drawn.
        whole = {name: _on_top(move, random.objects[name], moves) for name, move in moves.items()}
        poses = {name: move * scene.obstacle(name).pose for name, move in whole.items()}
        set_down = {name: _on_top(move, random.places[name], moves) for name, move in places.items()}
        task = self.task
        stages = moved_stages(task.stages, task.world, Variation(poses, set_down))
        if random.goals is not None and goals is not None:
            stages = _with_goals_moved(stages, task.world, _on_top(goals, random.goals, moves))
        return type(task)(stages, task.world, start, name=task.name, constraints=task.constraints), poses

    def _fault(self, task: Task, poses: Mapping[str, pin.SE3]) -> str:
        """Return why an instance cannot be; "" if nothing speaks against it."""
        scene = moved_scene(task.world.scene, poses)
        for first, second, least in self.random.apart:
            away = scene.obstacle(first).pose.translation - scene.obstacle(second).pose.translation
            if np.linalg.norm(away) < least:
                return f"'{first}' and '{second}' are nearer than {least:g} m"

        with worlds_from(task.world, self.left) as worlds:
            return self._fault_in(worlds.of(task.world.robot, scene), worlds, task.start)

    def _fault_in(self, world: World, worlds: Worlds, start: ArrayLike | str) -> str:
        """Return what overlaps in the world of an instance, or why its start cannot be used; "" if nothing does."""
        for pair, before, now in zip(self._pairs, self._as_written, self._distances(world), strict=True):
            if now < min(before, 0.0) - DEEPER or now <= 0.0 < before - DEEPER:  # meshes have no depth
                first, second = (world.bodies[number].name for number in pair)
                return f"'{first}' overlaps '{second}'"

        try:
            q = world.robot.configuration(start, "start")
            usable_configuration(Setting.beginning(world, q, worlds).world, q, "start")
        except ProblemError as error:
            pairs = [f"'{first}' and '{second}'" for first, second in error.contacts]
            return f"start is in collision: {pairs[0]}" if pairs else str(error).partition(";")[0]
        return ""

    def _measured_pairs(self, world: World) -> list[tuple[int, int]]:
        """Return the pairs of bodies of which one is an obstacle that is displaced, and the other one an obstacle."""
        numbers: dict[str, list[int]] = {name: [] for name in world.scene.names}
        for number, body in enumerate(world.bodies):
            numbers.setdefault(body.name, []).append(number)

        names = [obstacle.name for obstacle in world.scene.obstacles]
        moved = [name for name in names if name in self.random.objects]
        pairs = {frozenset((a, b)) for a in moved for b in names if a != b}
        ordered = sorted(tuple(sorted(pair)) for pair in pairs)
        return [both for a, b in ordered for both in product(numbers[a], numbers[b])]

    def _distances(self, world: World) -> list[float]:
        """Return the distances of these pairs [m], negative where they overlap."""
        if not self._pairs:
            return []
        frames = world.robot.joint_frames(self._start[None])[0]
        return [contact.distance for contact in measured(world.bodies, self._pairs, frames, near_only=False)]


def _with_goals_moved(stages: tuple[Stage, ...], world: World, motion: pin.SE3) -> tuple[Stage, ...]:
    """Return the stages of a task with the goals moved that lead to nothing that is taken or set down."""
    last = max((k for k, stage in enumerate(stages) if next_handled([stage])), default=-1)
    first = next((k for k in range(last + 1, len(stages)) if isinstance(stages[k], MoveTo)), len(stages))

    # They are moved as they would be if something were set down behind them.
    behind = (*stages[first:], Detach("goals"))
    moved = moved_stages(behind, world, Variation(places={"goals": motion}))[:-1]
    return (*stages[:first], *moved)


def _on_top(move: pin.SE3, displacement: Displacement, moves: Mapping[str, pin.SE3]) -> pin.SE3:
    """Return a motion with that of the obstacle that it goes along with."""
    return move if displacement.along_with is None else moves[displacement.along_with] * move


def check_random(random: Randomness, task: Task) -> None:
    """Raise an error if what is random does not fit a task.

    Raises:
        InputError: If something is turned about an unknown point, or ranges of joints are not those of the robot.
        UnknownNameError: If there is no obstacle of a name, or the task does not set it down.
    """
    names = [obstacle.name for obstacle in task.world.scene.obstacles]
    set_down = [stage.object for stage in every_stage(task.stages) if isinstance(stage, Detach)]
    for name in (*random.objects, *(name for *pair, _ in random.apart for name in pair)):
        if name not in names:
            raise UnknownNameError("obstacle", name, names, where="random")
    for name in random.places:
        if name not in set_down:
            raise UnknownNameError("object that the task detaches", name, set_down, where="random: places")

    alone = [name for name, each in random.objects.items() if each.along_with is None]
    without_origin = {f"places: '{name}'": each for name, each in random.places.items()}
    if random.goals is not None:
        without_origin["goals"] = random.goals
    for where, each in without_origin.items():
        if each.turns and each.about is None:
            raise InputError(f"random: {where}: is turned; say about which point, about: [x, y, z]")
    for each in (*random.objects.values(), *without_origin.values()):
        if each.along_with is not None and each.along_with not in alone:
            raise UnknownNameError("obstacle that is displaced", each.along_with, alone, where="random: along_with")

    if random.start is not None:
        _check_start(random.start, task.world.robot)


def _check_start(ranges: Matrix, robot: Robot) -> None:
    """Raise an error if ranges of joints, shape (k, 2), are not those of a robot, or leave its limits."""
    if len(ranges) != robot.dof:
        raise InputError(f"random: start: expected ranges of {robot.dof} joints, got {len(ranges)}")
    for bound in ranges.T:
        if fault := robot.limit_fault(bound):
            raise InputError(f"random: start: {fault}")
