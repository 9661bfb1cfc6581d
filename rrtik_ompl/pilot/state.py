"""All that a session knows and has decided, as one value. Only `machine.handle` makes the next one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.answers import Answer, news
from rrtik_ompl.pilot.arm_check import ArmCheck
from rrtik_ompl.pilot.drive import Drive, Press
from rrtik_ompl.pilot.events import Effect, Stop
from rrtik_ompl.pilot.feasibility import FeasibilityCache
from rrtik_ompl.pilot.interlock import MANOEUVRE, Sight
from rrtik_ompl.pilot.routes.follower import Follower, Progress, Track
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem


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
