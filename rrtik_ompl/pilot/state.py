"""The complete state of a session as one immutable value, and its parts. Only `machine.handle` makes the next one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.events import Answer, Effect, Level, Stop, news
from rrtik_ompl.pilot.feasibility import FeasibilityCache
from rrtik_ompl.pilot.interlock import MANOEUVRE, Sight
from rrtik_ompl.pilot.routes.follower import MADE, Follower, Progress, Track
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem

# Pictures and readings are delayed differently, so they are compared only if the arm has stood still this long.
STILL_SECONDS = 0.5
TIP_TOLERANCE = 0.005  # [m]; error of the arm's model and of the marker on it
TIP_SIGMAS = 3.0
MIN_CHANGE = 1e-4  # [rad or m]; smaller changes of a reading are noise

LEASH_SECONDS = 0.1  # largest lead of a set point over the arm, as time at the present speed
# It may always be this far ahead, as time at the joint's rate: arms that stick, or whose encoders are coarse, need it.
LEAST_LEASH_SECONDS = 0.05
MAX_ALARMS = 12  # that are listed
HOLD_SECONDS = 0.25  # a drive ends if it is not renewed within this time
# Duration of the motion that the first command of a press asks for: a short tap moves the arm this far.
FIRST_SECONDS = 0.04


def leash(speed: Vector, rates: Vector) -> Vector:
    """Return how far a set point may be ahead of each joint at most, shape (dof,) [rad or m].

    Args:
        speed: Speed of each joint, shape (dof,) [rad/s or m/s].
        rates: Their rates at full speed, shape (dof,).
    """
    return np.maximum(speed * LEASH_SECONDS, rates * LEAST_LEASH_SECONDS)


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """What a session works with, unchanged from its begin to its end.

    Attributes:
        problem: Robot and surroundings; its goal is used by `plan` if no object is chosen.
        rates: Rates of the joints, shape (dof,) [rad/s or m/s].
        seed: Seed of the random numbers.
        past: Whether the pictures are old ones and the arm is simulated.
        recorded: Whether the arm moves as a record says, regardless of its set points.
        patience: How long routes may depend on objects out of view [s].
        feasibility: Cache of results for a state; it affects nothing but the speed.
    """

    problem: Problem
    rates: Vector
    seed: int = 0
    past: bool = False
    recorded: bool = False
    patience: float = np.inf
    feasibility: FeasibilityCache = field(default_factory=FeasibilityCache)

    @property
    def robot(self) -> Robot:
        """The arm that is moved."""
        return self.problem.robot


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The route that is proposed or followed.

    Attributes:
        route: The route as it was planned last; None without one.
        follower: Tracks the arm along the route, or along the way back.
        progress: Place of the arm on the route; None before the route is accepted.
        withdrawn: Why the route must not be followed any more; "" while it may.
        list_of_moves: The route of single-joint moves, from which `together` starts and to which it returns.
        aimed: The object that the route leads to, as it was seen when the route was planned.
    """

    route: Route | None = None
    follower: Follower | Track | None = None
    progress: Progress | None = None
    withdrawn: str = ""
    list_of_moves: Route | None = None
    aimed: SeenObject | None = None


@dataclass(frozen=True, slots=True)
class Gripper:
    """The gripper.

    Attributes:
        closed: Whether it is closed.
        fixed: Name of an object that it is closed on and that cannot be carried away; "" if there is none.
        lift: Height to which the held object is lifted [m].
    """

    closed: bool = False
    fixed: str = ""
    lift: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """The times of the pictures and of what they have shown.

    Attributes:
        time: Time of the last picture [s].
        unusable: Why the last picture could not be used; "" if it could.
        seen_at: Time at which each object was seen last, by its name [s].
    """

    time: float = -np.inf
    unusable: str = ""
    seen_at: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class ArmCheck:
    """Comparison of camera and joints: a marker on the gripper shows whether the arm is where its encoders say.

    Attributes:
        off: How far they differ, in words, if that exceeds the tolerance; "" if not, or if the tip was never seen.
        q: Configuration in which the arm stands since it moved last, shape (dof,); empty before the first reading.
        since: Time of the last motion [s].
    """

    off: str = ""
    q: Vector = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0

    def read(self, q: Vector, time: float) -> ArmCheck:
        """Return the check after a reading of the joints at a time [s]."""
        if len(q) == len(self.q) and np.abs(q - self.q).max() <= MIN_CHANGE:
            return self
        return replace(self, q=q, since=time)

    def see(self, T_base_tip: pin.SE3, covariance: Matrix, expected: pin.SE3, time: float) -> ArmCheck:
        """Return the check after a picture of the tip.

        While the arm moves, and shortly after, the last result is kept.

        Args:
            T_base_tip: Pose of the tip in the picture.
            covariance: Its covariance, shape (6, 6).
            expected: Pose of the tip according to the joints.
            time: Time of the picture [s].
        """
        if time - self.since < STILL_SECONDS:
            return self

        distance = float(np.linalg.norm(T_base_tip.translation - expected.translation))
        sigma = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
        if distance <= TIP_TOLERANCE + TIP_SIGMAS * sigma:
            return replace(self, off="")

        how_far = f"{1e3 * distance:.0f} mm"
        return replace(self, off=f"the camera sees the gripper {how_far} from where the joints say; check both")


@dataclass(frozen=True, slots=True)
class Press:
    """A key, button or stick that is held; only one at a time.

    Attributes:
        verb: The command that it renews.
        number: Number of the press: a key that is pressed anew has another.
        over: Whether it was ended: the pilot must release and press again.
        due: Joint and end [rad or m] of the move that it makes.
        nearest: Least distance to the end of the move so far [rad or m], and when it was reached [s].
        near: Distance from the end of a move within which it is completed [rad or m].
    """

    verb: str = ""
    number: float = -1.0
    over: bool = False
    due: tuple[int, float] = (0, 0.0)
    nearest: tuple[float, float] = (np.inf, 0.0)
    near: float = MADE

    def is_of(self, verb: str, number: object) -> bool:
        """Check whether a command renews this press."""
        return (verb, number) == (self.verb, self.number)


@dataclass(frozen=True, slots=True)
class Drive:
    """How the arm is driven at present: one joint, or all joints together, only as long as the command is renewed.

    Each renewal gives the arm a set point that is ahead of it by its `leash` at most. Without a renewal,
    whatever the reason (the key is released, the page or the line hangs), the arm stops there.

    Attributes:
        joint: Number of the joint that is driven; None if none is.
        goal: Value at which the drive ends [rad or m].
        leading: Whether all joints are led to set points.
        point: Set point of the joint [rad or m].
        renewed: Time of the last renewal [s].
    """

    joint: int | None = None
    goal: float = 0.0
    leading: bool = False
    point: float = 0.0
    renewed: float = -np.inf

    @property
    def active(self) -> bool:
        """Whether the arm is driven."""
        return self.leading or self.joint is not None

    def expired(self, time: float) -> bool:
        """Check whether the drive was not renewed in time."""
        return self.active and time - self.renewed > HOLD_SECONDS

    def goes_on_to(self, joint: int, goal: float) -> bool:
        """Check whether a joint is already driven, and in the direction of a goal [rad or m]."""
        turned = self.active and (goal - self.point) * (self.goal - self.point) < 0.0
        return joint == self.joint and not turned and not self.leading

    def begun(self, here: float, time: float) -> Drive:
        """Return a new drive of a joint that is at the value ``here`` [rad or m]."""
        return Drive(point=here, renewed=time - FIRST_SECONDS)

    def on(self, joint: int, goal: float, speed: float, lead: float, here: float, time: float) -> Drive:
        """Return the drive after its set point has moved on towards a goal.

        The set point advances at the speed for the time since the last renewal.

        Args:
            joint: Number of the joint.
            goal: Value at which the drive ends [rad or m].
            speed: Speed of the joint [rad/s or m/s].
            lead: How far the set point may be ahead of the joint [rad or m].
            here: Present value of the joint [rad or m].
            time: Current time [s].
        """
        seconds = float(np.clip(time - self.renewed, 0.0, LEASH_SECONDS))
        step = np.clip(goal - self.point, -speed * seconds, speed * seconds)
        point = float(np.clip(self.point + step, here - lead, here + lead))
        return Drive(joint, goal, False, point, max(time, self.renewed))

    def led(self, time: float) -> Drive:
        """Return a drive that leads all joints to set points."""
        return Drive(None, self.goal, True, self.point, max(time, self.renewed))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The state of a session at one moment.

    Attributes:
        around: The world with the objects as they were seen last, and with the held object.
        q: Present configuration, shape (dof,) [rad or m].
        desired: Desired configuration, shape (dof,) [rad or m].
        time: Current time [s].
        mode: One of `interlock.MODES`.
        selected: Number of the joint that is driven by hand.
        speed: Share of the joints' rates at which the joints are driven.
        target: Name of the chosen object; None if none is chosen.
        choice: Type and level of the chosen grasp; None if none is chosen.
        answer: The last message to the pilot, and its level.
        alarms: The last alarms, each with its time [s], the newest at the end.
        sight: What the page of the pilot had shown when the last command was given; None without a page.
        pictures: What the pictures have shown.
        check: Comparison of camera and joints.
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        arm_fault: What the arm says is wrong with itself; "" if nothing.
        arm_age: How old the joint values are at most [s].
        fault: What the arm did against its set points; "" if nothing, or if the pilot has acknowledged it.
        fault_at: Time at which the fault was reported [s].
        stopped: Whether STOP was pressed; nothing moves until the pilot resets it.
        trouble: Why nothing moves, as it was reported last; "" if all is well.
        unseen: What is out of view, as it was reported last; "" if nothing.
        way: The route.
        press: The press that drives the arm, or did so last.
        drive: How the arm is driven.
        gripper: The gripper.
        kept: Postures that routes may lead to, by name, shape (dof,) each: the one at the begin, and those kept since.
        servoed_at: Time of the last step of visual servoing [s].
        given: The last command, and the number of its press; None if the command is not held.
        due: The effects to carry out, in this order; `machine.handle` returns and clears them.
    """

    around: Surroundings
    q: Vector
    desired: Vector
    time: float = 0.0
    mode: str = MANOEUVRE
    selected: int = 0
    speed: float = 1.0
    target: str | None = None
    choice: tuple[str, int] | None = None
    answer: Answer = field(default_factory=lambda: news(""))
    alarms: tuple[tuple[float, str], ...] = ()
    sight: Sight | None = None
    pictures: Pictures = field(default_factory=Pictures)
    check: ArmCheck = field(default_factory=ArmCheck)
    arm_lost: str = ""
    arm_fault: str = ""
    arm_age: float = 0.0
    fault: str = ""
    fault_at: float = -np.inf
    stopped: bool = False
    trouble: str = ""
    unseen: str = ""
    way: Way = field(default_factory=Way)
    press: Press = field(default_factory=Press)
    drive: Drive = field(default_factory=Drive)
    gripper: Gripper = field(default_factory=Gripper)
    kept: Mapping[str, Vector] = field(default_factory=dict)
    servoed_at: float = 0.0
    given: tuple[str, object] = ("", None)
    due: tuple[Effect, ...] = ()

    @property
    def holds(self) -> str:
        """Name of the held object, which moves with the arm; "" if nothing is held."""
        held = self.around.held
        return "" if held is None else held.seen.object.name

    def do(self, *effects: Effect) -> State:
        """Return the state with further effects to carry out."""
        return replace(self, due=(*self.due, *effects))

    def say(self, answer: Answer | None) -> State:
        """Return the state with a message to the pilot; None keeps the last one. New alarms are also listed."""
        if answer is None:
            return self
        is_new = answer.level is Level.ALARM and answer != self.answer
        alarms = (*self.alarms, (self.time, answer.text))[-MAX_ALARMS:] if is_new else self.alarms
        return replace(self, answer=answer, alarms=alarms)

    def at_rest(self) -> State:
        """Return the state without a drive; the arm is stopped if it was driven."""
        if not self.drive.active:
            return self
        return replace(self, drive=replace(self.drive, joint=None, leading=False)).do(Stop())

    def released(self) -> State:
        """Return the state without a drive, in which the present press has no effect any more."""
        return replace(self.at_rest(), press=replace(self.press, over=True))

    def stand_still(self) -> State:
        """Return the state in which the arm is stopped in any case, and the present press has no effect any more."""
        return self.released().do(Stop())

    def on_its_way(self, **changes: object) -> State:
        """Return the state with changes of the route's attributes."""
        return replace(self, way=replace(self.way, **changes))  # type: ignore[arg-type]
