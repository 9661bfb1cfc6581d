"""The settings of a world as one immutable value, from which every form of a world is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, MISSING, dataclass, field, fields
from functools import partial
from typing import Any, get_args

from rrtik_ompl.base.arrays import finite_array, not_negative
from rrtik_ompl.base.choices import Accuracy, one_of
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError, UnknownNameError, listed, require
from rrtik_ompl.base.poses import few_joints
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene

MOTION_RESOLUTION = 0.01  # [m]
ACCURACIES: tuple[Accuracy, ...] = get_args(Accuracy)
FINEST_RESOLUTION = 1e-5  # [m] least resolution; a motion across an arm's reach then takes some 100,000 checks


def _robot(robot: Robot) -> Robot:
    require(robot, Robot, "robot of a world", "use load_robot(name or file)")
    few_joints(robot.model)
    return robot


def _scene(scene: Scene) -> Scene:
    require(scene, Scene, "scene of a world", "use Scene(obstacles) or load_scene(file)")
    return scene


def _resolution(size: float) -> float:
    resolution = float(finite_array(size, (), "motion_resolution"))
    if resolution < FINEST_RESOLUTION:
        raise InputError(f"motion_resolution must be {FINEST_RESOLUTION:g} metres or more, got {size}")
    return resolution


def _optional_clearance(length: float | None) -> float | None:
    return None if length is None else not_negative(length, "clearance")


def _setting(check: Callable[[Any], Any], *, key: str = "", least: float = 0.0, unit: str = "") -> dict[str, Any]:
    """Return the metadata of a field of :class:`WorldSettings`.

    Args:
        check: Validates a value given by a user and returns the value to store, or raises.
        key: Description of the setting in the schema of problem files; "" if files have no such key.
        least: Least number that the key may have in files.
        unit: Unit with which the setting is printed.
    """
    return {"check": check, "key": key, "least": least, "unit": unit}


def _length(name: str, key: str = "") -> dict[str, Any]:
    """Return the metadata of a length of at least 0 [m], as :func:`_setting`."""
    return _setting(partial(not_negative, what=name), key=key, unit="m")


@dataclass(frozen=True, slots=True, eq=False)
class WorldSettings:
    """The settings of a :class:`rrtik_ompl.World`; ``dataclasses.replace`` changes some and keeps the others.

    To add a setting, add a field here and the code that obeys it. The arguments of a world, the keys of files, the
    printed form and the cases of the truth matrix are derived from the fields.

    Attributes:
        robot: The arm.
        scene: Its surroundings; moving obstacles are where they are at time 0.
        accuracy: "exact" or "conservative".
        motion_resolution: Largest step of any point of the arm between two checked configurations [m].
        self_margin: Distance that links and attached objects must keep from each other where they must not touch [m].
        clearance: Distance kept from obstacles on top of their margins [m].
        proving: Clearance with which motions must be proven to be valid [m]; None if no proof is required.
        inflation: Distance that collision checks keep on top of the clearance, for searches that leave room [m]. It
            has no effect on proofs, contacts and distances.
        constraints: Regions that a frame must not leave, placed in the world; only configurations and motions that
            keep them are valid. A :class:`rrtik_ompl.Problem` places those that are ``from_start``.

    Raises:
        InputError: If one of them is of the wrong type, or a length makes no sense.
        UnknownNameError: If there is no such accuracy.

    Example:
        >>> from dataclasses import replace
        >>> settings = rrtik.World(rrtik.load_robot("planar3")).with_clearance(0.05).settings
        >>> rrtik.World.of(replace(settings, accuracy="conservative")).settings.clearance
        0.05
    """

    robot: Robot = field(metadata=_setting(_robot))
    scene: Scene = field(default_factory=Scene, metadata=_setting(_scene))
    _: KW_ONLY
    accuracy: Accuracy = field(
        default="exact",
        metadata=_setting(
            partial(one_of, ACCURACIES, kind="accuracy"),
            key="exact, or conservative: what kernels cannot prove free counts as blocked",
        ),
    )
    motion_resolution: float = field(
        default=MOTION_RESOLUTION,
        metadata=_setting(
            _resolution,
            key="largest step of any point of the arm between two checked configurations [m]",
            least=FINEST_RESOLUTION,
            unit="m",
        ),
    )
    self_margin: float = field(
        default=0.0,
        metadata=_length(
            "self_margin", "[m] that links, and what they hold, keep from each other wherever they must not touch"
        ),
    )
    clearance: float = field(
        default=0.0, metadata=_length("clearance", "[m] that is kept from obstacles on top of their margins")
    )
    proving: float | None = field(
        default=None,
        metadata=_setting(
            _optional_clearance,
            key="[m] of clearance with which motions must be proven to count as free; in steps if absent",
            unit="m",
        ),
    )
    inflation: float = field(default=0.0, metadata=_length("inflation"))
    constraints: Sequence[TaskRegion] = field(default=(), metadata=_setting(partial(listed, what="path constraints")))

    __reduce__ = as_value

    def __post_init__(self) -> None:
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        for name, value in checked_settings(given).items():
            object.__setattr__(self, name, value)

    @property
    def required_clearance(self) -> float:
        """The clearance that every motion keeps from obstacles on top of their margins by default [m]."""
        return max(self.clearance, self.proving or 0.0)

    @property
    def summary(self) -> str:
        """Robot, scene, and all settings that are not the default, in one line."""
        return ", ".join([self.robot.name, str(self.scene), *self.unusual()])

    def unusual(self) -> Iterator[str]:
        """Yield a text ``name=value`` for each setting that is not the default, except robot and scene."""
        for each in fields(self):
            value = getattr(self, each.name)
            if each.default is MISSING or value == each.default:
                continue

            if each.name == "constraints":
                yield f"{len(value)} path constraint{'s' * (len(value) > 1)}"
            elif unit := each.metadata["unit"]:
                yield f"{each.name}={value:g} {unit}"
            else:
                yield f"{each.name}={value}"


SETTINGS_IN_FILES = tuple(each for each in fields(WorldSettings) if each.metadata["key"])
CHECKS: dict[str, Callable[[Any], Any]] = {each.name: each.metadata["check"] for each in fields(WorldSettings)}


def checked_settings(given: Mapping[str, Any]) -> dict[str, Any]:
    """Validate settings of a world given by a user, by their names, and return the values to store.

    Raises:
        InputError: If one of them is of the wrong type, or a length makes no sense.
        UnknownNameError: If there is no setting or no accuracy of a given name.
    """
    for name in given:
        if name not in CHECKS:
            raise UnknownNameError("setting of a world", name, CHECKS)
    return {name: CHECKS[name](value) for name, value in given.items()}
