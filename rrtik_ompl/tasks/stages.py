"""Define the stages of a task: what the arm does, one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, dimensions, finite_array, frozen, not_negative
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.copies import set_fields
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.base.poses import PoseLike, rigid
from rrtik_ompl.model.goal import Goal, GoalLike, PoseGoal
from rrtik_ompl.model.goal_kind import TaskRegion

LineFrame: TypeAlias = Literal["world", "tip"]
GripperState: TypeAlias = Literal["open", "close"]
NO_LENGTH = 1e-9  # [m] A shorter shift counts as none.


class Stage:
    """A stage of a task: MoveTo, Straight, Attach, Detach, Gripper or Alternatives.

    Example:
        >>> stages: list[rrtik.Stage] = [rrtik.MoveTo("ready"), rrtik.Straight(by=[0.0, 0.0, 0.1])]
        >>> all(isinstance(stage, rrtik.Stage) for stage in stages)
        True
    """

    __slots__ = ()


@dataclass(frozen=True, slots=True, eq=False)
class MoveTo(Stage):
    """Move to a goal along any free path.

    Attributes:
        goal: A goal, the name of a posture, a configuration, shape (dof,), or a pose of the tip as ``SE3`` or matrix.
        constraints: Regions that a frame must not leave on the way; those ``from_start`` refer to where this stage
            begins; see :class:`rrtik_ompl.Problem`.

    Example:
        >>> rrtik.MoveTo("ready").goal
        'ready'
    """

    goal: Any
    constraints: tuple[TaskRegion, ...]

    def __init__(self, goal: GoalLike, constraints: Iterable[TaskRegion] = ()) -> None:
        regions = checked_regions(constraints, "MoveTo")

        if isinstance(goal, pin.SE3) or (not isinstance(goal, Goal | str) and dimensions(goal) == 2):
            goal = PoseGoal(rigid(goal, "goal of MoveTo"))
        elif not isinstance(goal, Goal | str):
            if dimensions(goal) != 1:
                kinds = "a goal such as PoseGoal, the name of a posture, a configuration, or a pose of the tip"
                raise InputError(f"goal of MoveTo: expected {kinds}, got {type(goal).__name__}")
            goal = frozen(finite_array(goal, (None,), "goal of MoveTo"))
        set_fields(self, goal=goal, constraints=regions)

    def __str__(self) -> str:
        return "MoveTo"


@dataclass(frozen=True, slots=True, eq=False)
class Straight(Stage):
    """Move the tip in a straight line: by a shift, or to a pose.

    Attributes:
        by: Shift of the tip [m], shape (3,), with constant orientation.
        to: Pose of the tip at the end, as :func:`rrtik_ompl.tip.straight` takes it.
        frame: Axes of the shift: "world", or "tip" as it is at the beginning.

    Example:
        >>> rrtik.Straight(by=[0.0, 0.0, -0.1], frame="tip").by.tolist()
        [0.0, 0.0, -0.1]
    """

    by: Vector | None = None
    to: Any = None
    frame: LineFrame = "world"

    def __init__(self, by: ArrayLike | None = None, to: PoseLike | None = None, frame: LineFrame = "world") -> None:
        if (by is None) == (to is None):
            raise InputError("Straight: give its end, by=[dx, dy, dz] or to=POSE, and only one of them")

        shift = None if by is None else frozen(finite_array(by, (3,), "Straight: by"))
        if shift is not None and np.linalg.norm(shift) < NO_LENGTH:
            raise InputError("Straight: by=[0, 0, 0] leads nowhere; give a shift, or leave the stage out")
        end = None if to is None else rigid(to, "Straight: to")
        place_alone = to is not None and not isinstance(to, pin.SE3) and np.shape(to) == (3,)

        object.__setattr__(self, "by", shift)
        object.__setattr__(self, "to", frozen(end.translation) if end is not None and place_alone else end)
        object.__setattr__(self, "frame", one_of(get_args(LineFrame), frame, "frame of Straight"))

    def __str__(self) -> str:
        return "Straight"

    def goal(self, tip: pin.SE3) -> pin.SE3:
        """Return the pose of the tip at the end (SE3), from its pose at the beginning."""
        require(tip, pin.SE3, "pose of the tip", "use robot.fk(q)")
        if self.by is not None:
            shift = tip.rotation @ self.by if self.frame == "tip" else self.by
            return pin.SE3(tip.rotation, tip.translation + shift)
        return self.to if isinstance(self.to, pin.SE3) else pin.SE3(tip.rotation, np.array(self.to))


@dataclass(frozen=True, slots=True, eq=False)
class Attach(Stage):
    """Attach an obstacle to a link, with which it moves from now on.

    Attributes:
        object: Name of the obstacle.
        link: Name of the link that holds it.
        allow: Names of further links and obstacles that it may touch while it is held.
        padding: Distance that it keeps while it is held from everything that it may not touch, in addition to its
            margin [m]; None for that of the link (``padding`` of :func:`rrtik_ompl.load_robot`).

    Example:
        >>> rrtik.Attach("box", "panda_hand", allow=["table"], padding=0.005).allow
        ('table',)
    """

    object: str
    link: str
    allow: tuple[str, ...]
    padding: float | None

    def __init__(self, object: str, link: str, allow: str | Iterable[str] = (), padding: float | None = None) -> None:
        require(object, str, "object of Attach")
        require(link, str, "link of Attach")
        own_padding = None if padding is None else not_negative(padding, "padding of Attach")
        set_fields(self, object=object, link=link, allow=_names(allow, "allow of Attach"), padding=own_padding)

    def __str__(self) -> str:
        return f"Attach '{self.object}'"


@dataclass(frozen=True, slots=True, eq=False)
class Detach(Stage):
    """Detach an object, which stays where it is from now on.

    Attributes:
        object: Name of the object.

    Example:
        >>> print(rrtik.Detach("box"))
        Detach 'box'
    """

    object: str

    def __post_init__(self) -> None:
        require(self.object, str, "object of Detach")

    def __str__(self) -> str:
        return f"Detach '{self.object}'"


@dataclass(frozen=True, slots=True, eq=False)
class Gripper(Stage):
    """Open or close the gripper.

    The motion of the fingers is checked against the scene and what is held, like any other motion. Fingers may press on
    objects that are attached before the arm moves on.

    Attributes:
        state: "open" or "close".
        width: Distance between the fingers afterwards [m]; None for wide open or shut.
        opening: In place of the width, which is not known of jaws that turn: how far its joints are open afterwards, 0
            shut to 1 wide open.

    Example:
        >>> rrtik.Gripper("close", width=0.04).width
        0.04
        >>> print(rrtik.Gripper("close", opening=0.25))
        Gripper 'close' to 25 %
    """

    state: GripperState
    width: float | None = None
    opening: float | None = None

    def __post_init__(self) -> None:
        one_of(get_args(GripperState), self.state, "state of a gripper")
        if self.width is not None:
            not_negative(self.width, "width of Gripper")
        if self.opening is not None and not_negative(self.opening, "opening of Gripper") > 1.0:
            raise InputError(f"opening of Gripper: expected 0 (shut) to 1 (wide open), got {self.opening:g}")
        if self.width is not None and self.opening is not None:
            raise InputError("Gripper: give its width or its opening, not both")

    def __str__(self) -> str:
        width = "" if self.width is None else f" to {1e3 * self.width:g} mm"
        opening = "" if self.opening is None else f" to {100.0 * self.opening:g} %"
        return f"Gripper '{self.state}'{width}{opening}"


@dataclass(frozen=True, slots=True, eq=False)
class Alternatives(Stage):
    """Do any one of several rows of stages.

    Attributes:
        options: The rows of stages.

    Example:
        >>> grasps = [[rrtik.MoveTo("up")], [rrtik.MoveTo("home"), rrtik.Attach("box", "tool0")]]
        >>> len(rrtik.Alternatives(grasps).options)
        2
    """

    options: tuple[tuple[Stage, ...], ...]

    def __init__(self, options: Iterable[Iterable[Stage]]) -> None:
        rows = tuple(_row(option) for option in listed(options, "options of Alternatives"))
        if not rows or not all(rows):
            raise InputError("Alternatives: needs lists of stages, none of them empty: Alternatives([[...], [...]])")
        object.__setattr__(self, "options", rows)

    def __str__(self) -> str:
        return f"Alternatives ({len(self.options)})"


KINDS = MoveTo | Straight | Attach | Detach | Gripper | Alternatives


def checked_stages(stages: object, what: str) -> tuple[Stage, ...]:
    """Check a row of stages and return it.

    Raises:
        InputError: If it is empty, or contains something else.
    """
    row = _row(stages)
    if not row:
        raise InputError(f"{what}: needs at least one stage, such as MoveTo(goal)")
    return row


def checked_regions(constraints: object, what: str) -> tuple[TaskRegion, ...]:
    """Check path constraints and return them.

    Raises:
        InputError: If they are no list of regions.
    """
    regions = listed(constraints, f"constraints of {what}")
    for region in regions:
        require(region, TaskRegion, f"each constraint of {what}", "use upright, on_plane, on_line or inside")
    return regions


def holding(stages: Iterable[Stage], regions: tuple[TaskRegion, ...]) -> tuple[Stage, ...]:
    """Return the same stages, with every `MoveTo` also holding some placed regions."""
    changed: list[Stage] = []
    for stage in stages:
        if isinstance(stage, Alternatives):
            changed.append(Alternatives([holding(row, regions) for row in stage.options]))
        elif isinstance(stage, MoveTo):
            changed.append(replace(stage, constraints=(*stage.constraints, *regions)))
        else:
            changed.append(stage)
    return tuple(changed)


def every_stage(stages: Iterable[Stage]) -> Iterator[Stage]:
    """Yield stages, and in place of alternatives those of all their rows."""
    for stage in stages:
        if isinstance(stage, Alternatives):
            for row in stage.options:
                yield from every_stage(row)
        else:
            yield stage


def _row(stages: object) -> tuple[Stage, ...]:
    row = listed(stages, "stages of a task")
    for stage in row:
        require(stage, KINDS, "each stage of a task")
    return row


def _names(names: str | Iterable[str], what: str) -> tuple[str, ...]:
    row = (names,) if isinstance(names, str) else listed(names, what)
    for name in row:
        require(name, str, f"each name of {what}")
    return row
