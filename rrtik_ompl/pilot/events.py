"""What happens to a session, what it wants done, and what it says: the words of its state machine.

An event is given to `machine.handle`. An effect is carried out by `Session`; one that asks for something has a
``then``, which is called with the answer (the event `Reply`) before the next effect is carried out. What is said to the
pilot is an `Answer`: a line with its level, by which the page shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeAlias

import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.pilot.interlock import Sight
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.pilot.routes.route_search import NoRoute
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.world import World

if TYPE_CHECKING:
    from rrtik_ompl.pilot.state import Means, State

Then: TypeAlias = "Callable[[Means, State, Any], State]"  # the last is the answer; gives the next state


# --- events ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """The pilot commands.

    Attributes:
        verb: One of `machine.VERBS`, or what a page has sent in its place.
        time: Now [s].
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        sight: What the page had shown; None without a page.
        arguments: As they came.
    """

    verb: str
    time: float
    arm_lost: str = ""
    sight: Sight | None = None
    arguments: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The arm was read: its joints, shape (dof,), at a time [s], and why the connection to it is lost."""

    q: Vector
    time: float
    arm_lost: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """The supervisor has compared the arm with what it was told.

    Attributes:
        fault: What the arm has done that it was not told; "" if nothing.
        standing: A driven joint that does not move, by how much it has moved, and in what time; None if none.
    """

    fault: str
    standing: tuple[int, float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A picture of a time [s] shows objects, or none."""

    objects: Sequence[SeenObject]
    time: float


@dataclass(frozen=True, slots=True, eq=False)
class TipSeen:
    """A picture of a time [s] shows the tip, with its covariance, shape (6, 6)."""

    T_base_tip: pin.SE3
    covariance: Matrix
    time: float


@dataclass(frozen=True, slots=True)
class Unusable:
    """A picture could not be used."""

    why: str


@dataclass(frozen=True, slots=True)
class Said:
    """Others have something to say to the pilot: the watchdog, a record that ends, the view."""

    answer: Answer


@dataclass(frozen=True, slots=True)
class Broken:
    """A command has ended in an error that nobody has foreseen."""


@dataclass(frozen=True, slots=True, eq=False)
class Reply:
    """The answer to an effect that has asked for it."""

    then: Then
    answer: object


@dataclass(frozen=True, slots=True)
class Failed:
    """An effect could not be carried out."""

    why: str


Event: TypeAlias = Command | Measured | Judged | Seen | TipSeen | Unusable | Said | Broken | Reply | Failed


# --- effects ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Stop:
    """The arm shall stop."""


@dataclass(frozen=True, slots=True, eq=False)
class SetPoint:
    """The arm shall go on.

    Attributes:
        aim: Where to, shape (dof,) [rad or m].
        ahead: How far each joint of it is ahead of the arm at most, shape (dof,).
        joint: The one that moves; None if all do.
    """

    aim: Vector
    ahead: Vector
    joint: int | None = None


@dataclass(frozen=True, slots=True)
class Grip:
    """The gripper shall close or open; the answer are the arm's joints after that, shape (dof,)."""

    closed: bool
    then: Then


@dataclass(frozen=True, slots=True)
class Read:
    """Where does the arm stand? The answer are its joints, shape (dof,)."""

    then: Then


@dataclass(frozen=True, slots=True)
class ReadMaster:
    """Where does the master arm stand? The answer are its joints, shape (dof,)."""

    then: Then


@dataclass(frozen=True, slots=True)
class FindRoute:
    """Is there a route? ``search`` is a function of values alone; the answer is what it gives."""

    search: Callable[[], Route | NoRoute]
    then: Then


@dataclass(frozen=True, slots=True, eq=False)
class StepToGrasp:
    """How does the tool come nearer to a grasp that is seen? The answer is a `ServoStep`.

    Attributes:
        world: In which the gripper may touch the object.
        goal: Where the tip shall be, by a picture of now, ``T_base_tip``; None if the object is not in it.
        seconds: Since the last step.
        begins: It is the first step.
    """

    world: World
    goal: pin.SE3 | None
    seconds: float
    begins: bool
    then: Then


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """The pilot knows of the fault: the arm may be driven again."""


@dataclass(frozen=True, slots=True)
class Give:
    """A command shall be given in the pilot's place."""

    verb: str


@dataclass(frozen=True, slots=True, eq=False)
class Write:
    """A line of the record of the session."""

    kind: str
    time: float
    values: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class WriteAnswer:
    """The last answer, as a line of the record."""

    time: float


Effect: TypeAlias = (
    Stop | SetPoint | Grip | Read | ReadMaster | FindRoute | StepToGrasp | Acknowledge | Give | Write | WriteAnswer
)


# --- answers ---------------------------------------------------------------------------------------------------------


class Level(str, Enum):
    """What kind of line it is: what was done, a command that is not executed, or what nobody has commanded."""

    NEWS = "news"
    REFUSAL = "refusal"
    ALARM = "alarm"


@dataclass(frozen=True, slots=True)
class Answer:
    """A line for the pilot.

    Attributes:
        level: Of the line.
        text: The line.

    Example:
        >>> refused("no object is chosen; choose one that is in view").level.value
        'refusal'
    """

    level: Level
    text: str


def news(text: str) -> Answer:
    """What was done, or is so now."""
    return Answer(Level.NEWS, text)


def refused(text: str) -> Answer:
    """Why a command is not executed, or has not led to what it is for."""
    return Answer(Level.REFUSAL, text)


def alarm(text: str) -> Answer:
    """What nobody has commanded: the arm was stopped, something is lost, a route must not be followed any more."""
    return Answer(Level.ALARM, text)
