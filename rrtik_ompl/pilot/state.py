"""All that a session knows and has decided, as one value, and its parts. Only `machine.handle` makes the next one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.events import Answer, Effect, Stop, news
from rrtik_ompl.pilot.feasibility import FeasibilityCache
from rrtik_ompl.pilot.interlock import MANOEUVRE, Sight
from rrtik_ompl.pilot.routes.follower import MADE, Follower, Progress, Track
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem

STILL_SECONDS = 0.5  # an arm that stands for so long is where its last reading says: pictures and joints are not of now
TIP_TOLERANCE = 0.005  # [m] of the arm's model and of the marker on it
TIP_SIGMAS = 3.0
MIN_CHANGE = 1e-4  # [rad or m]; less is noise

LEASH_SECONDS = 0.1  # how far a set point may be ahead of the arm, at the speed of the moment
HOLD_SECONDS = 0.25  # without a renewal for as long the drive is over
FIRST_SECONDS = 0.04  # of motion that the first command of a press asks for: a tap moves the arm by as much


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """What a session works with, the same from its begin to its end.

    Attributes:
        problem: Robot and surroundings; its goal serves `plan` where no object was chosen.
        rates: Of the joints, shape (dof,) [rad/s or m/s].
        seed: Of the random numbers.
        past: Pictures are not of now, and the arm is a simulated one.
        recorded: The arm moves as a record says, whatever it is told.
        patience: For how long routes stand on what is out of view [s].
        feasibility: What was found out for a state, kept for the next one; nothing else depends on it.
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
        route: As it was planned last; None without one.
        follower: Tracks the arm along it, or along the way back.
        progress: Where the arm is on it; None before it is accepted.
        withdrawn: Why it must not be followed any more; "" while it may.
        list_of_moves: Of single joints: what `together` is made of, and goes back to.
        aimed: What the route leads to, as it was seen when it was planned.
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
        closed: Whether it is.
        fixed: Name of an object that it is closed on and that cannot be carried away; "" if there is none.
        lift: How far what it holds is lifted [m].
    """

    closed: bool = False
    fixed: str = ""
    lift: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """What the pictures have shown.

    Attributes:
        time: Of the last one [s].
        unusable: Why the last one could not be used; "" if it could.
        seen_at: When each object was seen last, by its name [s].
    """

    time: float = -np.inf
    unusable: str = ""
    seen_at: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class ArmCheck:
    """The camera against the joints: a marker on the gripper shows whether the arm is where its encoders say.

    Attributes:
        off: How far they differ, in words, if that is more than may be; "" if not, or if the tip was never seen.
        q: Where the arm has stood since it moved last, shape (dof,); empty before it was read.
        since: When that was [s].
    """

    off: str = ""
    q: Vector = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0

    def read(self, q: Vector, time: float) -> ArmCheck:
        """After a reading of the joints at a time [s]."""
        if len(q) == len(self.q) and np.abs(q - self.q).max() <= MIN_CHANGE:
            return self
        return replace(self, q=q, since=time)

    def see(self, T_base_tip: pin.SE3, covariance: Matrix, expected: pin.SE3, time: float) -> ArmCheck:
        """After a picture.

        Of an arm that moves nothing is said: the last word holds.

        Args:
            T_base_tip: The tip as the picture shows it.
            covariance: Of that, shape (6, 6).
            expected: Where joints say that the tip is.
            time: Of the picture [s].
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
    """A key, button or stick that is held; one at a time.

    Attributes:
        verb: The command that it renews.
        number: Of the press: a key that is pressed anew has another.
        over: It was ended: whoever still holds it has to press again.
        due: Joint and end of the move that it makes.
        nearest: How near to its end the arm has come, and when.
        near: From the end of a move at which it is made [rad or m].
    """

    verb: str = ""
    number: float = -1.0
    over: bool = False
    due: tuple[int, float] = (0, 0.0)
    nearest: tuple[float, float] = (np.inf, 0.0)
    near: float = MADE

    def is_of(self, verb: str, number: object) -> bool:
        """Whether a command renews it."""
        return (verb, number) == (self.verb, self.number)


@dataclass(frozen=True, slots=True)
class Drive:
    """How the arm is driven: one joint at a time, or all together. Hold to run: only as long as its command is renewed.

    Each renewal gives the arm a set point that is a little ahead of it, by no more than `LEASH_SECONDS` of its way.
    Without a renewal, whatever the reason (the key is released, the page or the line hangs), the arm stops there.

    Attributes:
        joint: Number of the joint that is driven; None if none is.
        goal: Where the drive ends [rad or m].
        leading: Whether all joints are led to set points.
        point: The set point of the joint [rad or m].
        renewed: When the drive was renewed last [s].
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
        """Whether it was not renewed in time."""
        return self.active and time - self.renewed > HOLD_SECONDS

    def goes_on_to(self, joint: int, goal: float) -> bool:
        """Whether a joint is driven already, and in the direction of a goal [rad or m]."""
        turned = self.active and (goal - self.point) * (self.goal - self.point) < 0.0
        return joint == self.joint and not turned and not self.leading

    def begun(self, here: float, time: float) -> Drive:
        """A new drive of a joint that is at a value [rad or m]."""
        return Drive(point=here, renewed=time - FIRST_SECONDS)

    def on(self, joint: int, goal: float, rate: float, here: float, time: float) -> Drive:
        """Driven on towards a goal.

        Args:
            joint: Number of the joint.
            goal: Where it goes at most [rad or m].
            rate: Of the joint [rad/s or m/s].
            here: Where the joint is [rad or m].
            time: Now [s].
        """
        seconds = float(np.clip(time - self.renewed, 0.0, LEASH_SECONDS))
        step = np.clip(goal - self.point, -rate * seconds, rate * seconds)
        leash = rate * LEASH_SECONDS
        point = float(np.clip(self.point + step, here - leash, here + leash))
        return Drive(joint, goal, False, point, max(time, self.renewed))

    def led(self, time: float) -> Drive:
        """All joints are led to set points."""
        return Drive(None, self.goal, True, self.point, max(time, self.renewed))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A session at a moment.

    Attributes:
        around: The world with the objects as they were seen last, and with what the gripper holds.
        q: Where the arm is, shape (dof,) [rad or m].
        desired: Where it shall be, shape (dof,).
        time: Now [s].
        mode: One of `interlock.MODES`.
        selected: Number of the joint that is driven by hand.
        speed: Share of the joints' rates at which they are driven.
        target: Name of the object that is chosen.
        choice: Type and level of the grasp that is chosen.
        answer: What was said last, and its level.
        sight: What the page of the pilot had shown when the last command was given; None without a page.
        pictures: What the pictures have shown.
        check: Of the camera against the joints.
        arm_lost: Why the connection to the arm is lost; "" if it is not.
        fault: What the arm has done that it was not told; "" if nothing, or the pilot has acknowledged it.
        fault_at: When that was said [s].
        trouble: Why nothing moves, as it was said last; "" if all is well.
        unseen: What is out of view, as it was said last; "" if nothing.
        way: The route.
        press: Of the key that drives, or drove last.
        drive: Of the arm.
        gripper: The gripper.
        servoed_at: When the tool was led by the camera last [s].
        given: The last command, and the number of its press if it has one.
        due: What is to be done, in this order; `machine.handle` gives it away.
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
    sight: Sight | None = None
    pictures: Pictures = field(default_factory=Pictures)
    check: ArmCheck = field(default_factory=ArmCheck)
    arm_lost: str = ""
    fault: str = ""
    fault_at: float = -np.inf
    trouble: str = ""
    unseen: str = ""
    way: Way = field(default_factory=Way)
    press: Press = field(default_factory=Press)
    drive: Drive = field(default_factory=Drive)
    gripper: Gripper = field(default_factory=Gripper)
    servoed_at: float = 0.0
    given: tuple[str, object] = ("", None)
    due: tuple[Effect, ...] = ()

    @property
    def holds(self) -> str:
        """Name of what is held and moves with the arm; "" if nothing is."""
        held = self.around.held
        return "" if held is None else held.seen.object.name

    def do(self, *effects: Effect) -> State:
        """The same, with more to be done."""
        return replace(self, due=(*self.due, *effects))

    def say(self, answer: Answer | None) -> State:
        """Something is said to the pilot; None leaves the last answer."""
        return self if answer is None else replace(self, answer=answer)

    def at_rest(self) -> State:
        """Nothing is driven any more."""
        if not self.drive.active:
            return self
        return replace(self, drive=replace(self.drive, joint=None, leading=False)).do(Stop())

    def released(self) -> State:
        """Nothing is driven any more, and the press that drove has no effect any more."""
        return replace(self.at_rest(), press=replace(self.press, over=True))

    def stand_still(self) -> State:
        """The arm stops, whatever moves it, and what is held has no effect any more."""
        return self.released().do(Stop())

    def on_its_way(self, **changes: object) -> State:
        """With changes of the route."""
        return replace(self, way=replace(self.way, **changes))  # type: ignore[arg-type]
