"""What a world is made from, as one frozen value: every other form of a world is made from its settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, get_args

from rrtik_ompl.base.arrays import finite_array, not_negative
from rrtik_ompl.base.choices import Accuracy, one_of
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError, UnknownNameError, listed, require
from rrtik_ompl.base.poses import few_joints
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.task_region import TaskRegion

MOTION_RESOLUTION = 0.01  # [m]
ACCURACIES: tuple[Accuracy, ...] = get_args(Accuracy)
FINEST_RESOLUTION = 1e-5  # [m]; a motion across an arm's reach is then some hundred thousand checks
LENGTH = {"unit": "m"}


@dataclass(frozen=True, slots=True, eq=False)
class WorldSettings:
    """What a :class:`rrtik_ompl.World` is made from; ``dataclasses.replace`` changes some of it, and forgets nothing.

    Attributes:
        robot: The arm.
        scene: Its surroundings; moving obstacles are where they are at time 0.
        accuracy: "exact" or "conservative".
        motion_resolution: Largest step of any point of the arm between two checked configurations [m].
        self_margin: How far links, and what they hold, must stay from each other where they must not touch [m].
        clearance: What is kept from obstacles on top of their margins [m].
        proving: Motions must be proven too, with this clearance [m]; None if they need not be.
        inflation: What checks keep on top of the clearance, for searches that leave room [m]; no other answer does.
        constraints: Regions that a frame must not leave, placed in the world.

    Raises:
        InputError: If one of them is of the wrong type, or a length makes no sense.
        UnknownNameError: If there is no such accuracy.

    Example:
        >>> from dataclasses import replace
        >>> settings = rrtik.World(rrtik.load_robot("planar3")).with_clearance(0.05).settings
        >>> rrtik.World.of(replace(settings, accuracy="conservative")).settings.clearance
        0.05
    """

    robot: Robot
    scene: Scene = field(default_factory=Scene)
    accuracy: Accuracy = "exact"
    motion_resolution: float = field(default=MOTION_RESOLUTION, metadata=LENGTH)
    self_margin: float = field(default=0.0, metadata=LENGTH)
    clearance: float = field(default=0.0, metadata=LENGTH)
    proving: float | None = field(default=None, metadata=LENGTH)
    inflation: float = field(default=0.0, metadata=LENGTH)
    constraints: tuple[TaskRegion, ...] = ()

    __reduce__ = as_value

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in CHECKS}
        for name, value in checked_settings(given).items():
            object.__setattr__(self, name, value)

    @property
    def kept(self) -> float:
        """What every motion keeps from obstacles on top of their margins, where nobody asks for more [m]."""
        return max(self.clearance, self.proving or 0.0)

    @property
    def summary(self) -> str:
        """Robot, scene, and what is not as usual, in one line."""
        return ", ".join([self.robot.name, str(self.scene), *self.unusual()])

    def unusual(self) -> Iterator[str]:
        """Each setting beside robot and scene that is not the default, as ``name=value``."""
        for each in fields(self):
            value = getattr(self, each.name)
            if each.default is MISSING or value == each.default:
                continue

            if each.name == "constraints":
                yield f"{len(value)} path constraint{'s' * (len(value) > 1)}"
            elif "unit" in each.metadata:
                yield f"{each.name}={value:g} {each.metadata['unit']}"
            else:
                yield f"{each.name}={value}"


def checked_settings(given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a world given by a user, by their names, as a world keeps them.

    Raises:
        InputError: If one of them is of the wrong type, or a length makes no sense.
        UnknownNameError: If there is no setting, or no accuracy, of a name.
    """
    for name in given:
        if name not in CHECKS:
            raise UnknownNameError("setting of a world", name, CHECKS)
    return {name: CHECKS[name](value) for name, value in given.items()}


def _robot(robot: Robot) -> Robot:
    require(robot, Robot, "robot of a world", "use load_robot(name or file)")
    few_joints(robot.model)
    return robot


def _scene(scene: Scene) -> Scene:
    require(scene, Scene, "scene of a world", "use Scene(obstacles) or load_scene(file)")
    return scene


def _accuracy(accuracy: Accuracy) -> Accuracy:
    return one_of(ACCURACIES, accuracy, "accuracy")


def _resolution(size: float) -> float:
    resolution = float(finite_array(size, (), "motion_resolution"))
    if resolution < FINEST_RESOLUTION:
        raise InputError(f"motion_resolution must be {FINEST_RESOLUTION:g} metres or more, got {size}")
    return resolution


def _self_margin(length: float) -> float:
    return not_negative(length, "self_margin")


def _clearance(length: float) -> float:
    return not_negative(length, "clearance")


def _proving(length: float | None) -> float | None:
    return None if length is None else not_negative(length, "clearance")


def _inflation(length: float) -> float:
    return not_negative(length, "inflation")


def _constraints(regions: Iterable[TaskRegion]) -> tuple[TaskRegion, ...]:
    return listed(regions, "path constraints")


CHECKS: dict[str, Callable[[Any], Any]] = {  # of what a user gives, in the order of the fields
    "robot": _robot,
    "scene": _scene,
    "accuracy": _accuracy,
    "motion_resolution": _resolution,
    "self_margin": _self_margin,
    "clearance": _clearance,
    "proving": _proving,
    "inflation": _inflation,
    "constraints": _constraints,
}
