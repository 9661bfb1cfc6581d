"""The values that the state machine of a session exchanges with its surroundings: events, effects and answers.

An event is passed to `machine.handle`, which returns the next state and a list of effects. `Session` carries the
effects out. An effect that asks for something has a continuation ``then``: it is called with the answer (by the event
`Reply`) before the next effect is carried out. An `Answer` is a line for the pilot with its level, which decides how
the page shows it.
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

# Called with means, state and the answer to an effect; returns the next state.
Then: TypeAlias = "Callable[[Means, State, Any], State]"


# --- events ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """The pilot gives a command.

    Attributes:
        verb: One of `machine.VERBS`, or whatever a page has sent instead.
        time: Current time [s].
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        sight: What the page had shown; None without a page.
        arguments: By name, as the page sent them: not checked yet.
    """

    verb: str
    time: float
    arm_lost: str = ""
    sight: Sight | None = None
    arguments: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The arm was read at a time [s].

    Attributes:
        q: Joint values, shape (dof,) [rad or m].
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        arm_fault: What the arm says is wrong with itself; "" if nothing.
        arm_age: How old the joint values are at most [s].
    """

    q: Vector
    time: float
    arm_lost: str = ""
    arm_fault: str = ""
    arm_age: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """The supervisor has compared the motion of the arm with the set points it was given.

    Attributes:
        fault: What the arm did against its set points; "" if nothing.
        standing: A driven joint that does not move: its number, how far it has moved [rad or m], and within what time
            [s]; None if there is no such joint.
    """

    fault: str
    standing: tuple[int, float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A picture taken at a time [s] was evaluated; ``objects`` holds the objects found in it, and may be empty."""

    objects: Sequence[SeenObject]
    time: float


@dataclass(frozen=True, slots=True, eq=False)
class TipSeen:
    """A picture taken at a time [s] shows the tip of the arm.

    Attributes:
        T_base_tip: Measured pose of the tip.
        covariance: Of this pose, shape (6, 6).
    """

    T_base_tip: pin.SE3
    covariance: Matrix
    time: float


@dataclass(frozen=True, slots=True)
class Unusable:
    """A picture could not be used."""

    why: str


@dataclass(frozen=True, slots=True)
class Said:
    """Another component has a message for the pilot: the watchdog, a record that ends, or the view."""

    answer: Answer


@dataclass(frozen=True, slots=True)
class Broken:
    """A command has ended in an unexpected exception."""


@dataclass(frozen=True, slots=True, eq=False)
class Reply:
    """An effect has produced the answer that it was asked for."""

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
    """The arm shall move towards a set point.

    Attributes:
        aim: The set point, shape (dof,) [rad or m].
        speed: Speed at which each joint shall go there, shape (dof,) [rad/s or m/s].
        joint: Number of the only joint that moves; None if all do.
    """

    aim: Vector
    speed: Vector
    joint: int | None = None


@dataclass(frozen=True, slots=True)
class Grip:
    """The gripper shall close or open; the answer is the arm's joint values afterwards, shape (dof,)."""

    closed: bool
    then: Then


@dataclass(frozen=True, slots=True)
class Read:
    """The arm shall be read; the answer is its joint values, shape (dof,)."""

    then: Then


@dataclass(frozen=True, slots=True)
class ReadMaster:
    """The master arm shall be read; the answer is its joint values, shape (dof,)."""

    then: Then


@dataclass(frozen=True, slots=True)
class FindRoute:
    """A route shall be searched for; the answer is the result of ``search``, a function without side effects."""

    search: Callable[[], Route | NoRoute]
    then: Then


@dataclass(frozen=True, slots=True, eq=False)
class StepToGrasp:
    """A step of visual servoing towards a grasp shall be computed; the answer is a `ServoStep`.

    Attributes:
        world: World in which the gripper may touch the object.
        goal: Desired pose of the tip according to the present picture, ``T_base_tip``; None if the object is not in it.
        seconds: Time since the last step [s].
        begins: Whether this is the first step.
    """

    world: World
    goal: pin.SE3 | None
    seconds: float
    begins: bool
    then: Then


@dataclass(frozen=True, slots=True, eq=False)
class StepAlongTool:
    """A step of the tip along the axis of the tool shall be computed; the answer is the joint rates, shape (dof,).

    Attributes:
        world: World in which the tip moves.
        speed: Speed along the z axis of the tool [m/s]; below 0 it is drawn back.
        begins: Whether this is the first step, which decides on which line the tip moves.
    """

    world: World
    speed: float
    begins: bool
    then: Then


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """The pilot has acknowledged the fault: the arm may be driven again."""


@dataclass(frozen=True, slots=True)
class Give:
    """A command shall be executed on the pilot's behalf."""

    verb: str


@dataclass(frozen=True, slots=True, eq=False)
class Write:
    """A line shall be added to the record of the session."""

    kind: str
    time: float
    values: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class WriteAnswer:
    """The last answer shall be added to the record of the session."""

    time: float


Effect: TypeAlias = (
    Stop
    | SetPoint
    | Grip
    | Read
    | ReadMaster
    | FindRoute
    | StepToGrasp
    | StepAlongTool
    | Acknowledge
    | Give
    | Write
    | WriteAnswer
)


# --- answers ---------------------------------------------------------------------------------------------------------


class Level(str, Enum):
    """The kind of an answer.

    ``NEWS`` reports what was done, ``REFUSAL`` why a command was not executed, ``ALARM`` what nobody has commanded.
    """

    NEWS = "news"
    REFUSAL = "refusal"
    ALARM = "alarm"


@dataclass(frozen=True, slots=True)
class Answer:
    """A line for the pilot.

    Attributes:
        level: Level of the line.
        text: Text of the line.

    Example:
        >>> refused("no object is chosen; choose one that is in view").level.value
        'refusal'
    """

    level: Level
    text: str


def news(text: str) -> Answer:
    """Return an answer that reports what was done, or what is so now."""
    return Answer(Level.NEWS, text)


def refused(text: str) -> Answer:
    """Return an answer that says why a command was not executed, or did not lead to its aim."""
    return Answer(Level.REFUSAL, text)


def alarm(text: str) -> Answer:
    """Return an answer that reports an uncommanded event: a stop of the arm, a lost device, a withdrawn route."""
    return Answer(Level.ALARM, text)
