"""Commands that are held: a joint is driven, or a move of the route is made, as long as they are renewed."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.answers import Answer, alarm, news, refused
from rrtik_ompl.pilot.devices.arm import Arm
from rrtik_ompl.pilot.guide import Guide
from rrtik_ompl.pilot.interlock import FOLLOWING, MOVING, Knowledge, Sight
from rrtik_ompl.pilot.motion.drive import HOLD_SECONDS, LEASH_SECONDS, Drive
from rrtik_ompl.pilot.motion.supervisor import FOLLOW_SECONDS, slack_of
from rrtik_ompl.pilot.routes.follower import MADE, Follower
from rrtik_ompl.pilot.routes.manoeuvre import JointRange, check_move, move_refusal, way_out
from rrtik_ompl.pilot.routes.track import Track
from rrtik_ompl.world.world import World

STUCK_SECONDS = 0.8  # an arm that comes no nearer to the end of a move for as long does not get there
MIN_SPEED = 0.05  # share of the joints' rates


class Driven(Protocol):
    """The session, as the commands that are held use it."""

    robot: Robot
    arm: Arm
    rates: Vector
    q: Vector
    desired: Vector
    time: float
    selected: int
    mode: str
    guide: Guide
    answer: Answer
    sight: Sight | None

    @property
    def known(self) -> Knowledge:
        """What is known now of the arm and of the picture."""

    @property
    def world(self) -> World:
        """The world for moves by hand."""

    def joint_range(self) -> JointRange:
        """The range in which the selected joint can be driven now."""

    def command(self, verb: str, time: float, /, **arguments: object) -> str:
        """Execute a command."""


class Held:
    """What a pressed key, button or stick of the pilot does, one at a time.

    Attributes:
        drive: Moves the arm.
        speed: Share of the joints' rates, from `MIN_SPEED` to 1.
        over: The last press was ended: whoever still holds it has to press again.
    """

    def __init__(self, session: Driven) -> None:
        """Begin with nothing pressed."""
        self.drive, self.speed = Drive(session.robot, session.arm, session.rates), 1.0
        self._session, self._slack = session, slack_of(session.robot)
        self._press: tuple[str, float] = ("", -1.0)  # command and number of the press that drives, or drove last
        self.over = False
        self._due = 0, 0.0  # joint and end of the move that it makes
        self._nearest = np.inf, 0.0  # how near to its end the arm has come, and when
        self._near = MADE

    def goes_on(self, verb: str, arguments: dict[str, object]) -> bool:
        """Whether a command renews the press of before."""
        return verb in MOVING and (verb, arguments.get("press")) == self._press

    def end(self) -> None:
        """Stop what is driven; the press that drove it has no effect any more."""
        self.drive.end(self._session.time)
        self.over = True

    def refuse(self, verb: str, press: object) -> None:
        """Stop what is driven; a press that was refused has to be made anew, even if it could be made by now."""
        self.end()
        if verb in MOVING and isinstance(press, int | float):
            self._press = (verb, press)

    def expire(self) -> Answer | None:
        """End a press that was not renewed in time; what there is to say, None if nothing."""
        if not self.drive.expire(self._session.time):
            return None
        self.end()
        return alarm(f"no command for {HOLD_SECONDS:g} s: stopped, press again")

    def watch(self) -> Answer | None:
        """After a reading of the arm: end a press that does not move it; what there is to say, None if nothing."""
        session, drive = self._session, self.drive
        drive.read(session.q, session.time)
        standing = drive.standing(session.time)
        if standing is None:
            return None
        joint, moved, seconds = standing
        name, amount = session.robot.joint_names[joint], drive.supervisor.amount
        left = abs(drive.goal - float(session.q[joint]))
        near = joint == drive.joint and left <= self._slack[joint]
        if near and self._press[0] == "next":
            return None  # `next` itself takes the move for made
        self.end()
        if near:
            return refused(f"{name} comes no nearer than {amount(joint, left)}: stopped")
        late = f"does not move ({amount(joint, moved)} in {seconds:.1f} s)"
        return alarm(f"{name} {late}: stopped, for an arm that follows later than {FOLLOW_SECONDS:g} s is not driven")

    @property
    def pace(self) -> float:
        """Share of the joints' rates at which none moves farther than a degree in the time that the pilot sees late."""
        sight = self._session.sight
        if sight is None or sight.state <= 0.0:
            return self.speed
        return min(self.speed, float((self._slack / (sight.state * self._session.rates)).min()))

    def set_speed(self, share: float) -> Answer:
        """At which share of their rates joints are driven."""
        self.speed = float(np.clip(share, MIN_SPEED, 1.0))
        return news(f"speed {100 * self.speed:.0f} %")

    def release(self) -> Answer:
        """Nothing is pressed any more."""
        session, driven = self._session, self.drive.active
        self.end()
        if not driven or session.mode != FOLLOWING:
            return news("released") if driven else session.answer
        if session.guide.follower is None or session.guide.follower.joint() is None:
            return news("released: hold 'next' to go on")
        joint, end = self._due
        left, unit = reading(abs(end - float(session.q[joint])), joint_unit(session.robot.prismatic[joint]))
        name = session.robot.joint_names[joint]
        return refused(f"{name}: {left:.3g} {unit} are left of the move; hold 'next' to go on")

    def jog(self, direction: float, press: float) -> Answer:
        """Drive the selected joint, at a share of the speed from -1 to 1."""
        session, sign = self._session, float(np.sign(direction))
        self.begins("jog", press)
        if sign == 0.0:
            self.drive.end(session.time)
            return news("released")
        joint, room = session.selected, session.joint_range()
        goal, end = (room.high, room.above) if sign > 0.0 else (room.low, room.below)
        if room.low == room.high:
            goal, end = way_out(session.world, session.q, joint, sign), "out of contact"
        return self._run(joint, goal, min(abs(direction), 1.0), refused(f"end of the range: {end}"))

    def move(self, target: float) -> Answer:
        """Say where the selected joint is to go; `go`, held, drives it there."""
        session, joint = self._session, self._session.selected
        check = check_move(session.world, session.q, joint, float(target))
        if not check.allowed:
            raise InputError(move_refusal(session.world, session.q, joint, float(target), check))
        session.desired = self._with(joint, float(target))
        warnings = (*check.warnings, session.known.unseen)
        place = f"{self._place(joint, float(target))}: hold Enter to drive there"
        return news("; ".join(filter(None, (place, *warnings))))

    def go(self, press: float) -> Answer:
        """Drive the selected joint to where it is to go."""
        session, joint = self._session, self._session.selected
        target = float(session.desired[joint])
        if self.begins("go", press):
            check = check_move(session.world, session.q, joint, target)
            if not check.allowed:
                raise InputError(move_refusal(session.world, session.q, joint, target, check))
        return self._run(joint, target, 1.0, news(self._place(joint, target)))

    def next(self, press: float) -> Answer:
        """Make the current move of the route; each press makes one move at most, but for a route of all joints."""
        session, follower = self._session, self._session.guide.follower
        if follower is None:
            raise InputError("there is no route to follow; 'plan' proposes one")
        if isinstance(follower, Track):
            return self._along(follower, press)
        if self.begins("next", press):
            self._due, self._nearest = self._due_move(follower), (np.inf, session.time)
        joint, end = self._due
        if self._stuck(abs(end - float(session.q[joint])), float(follower.slack[joint])):
            session.command("settle", session.time)
            return session.answer
        name = session.robot.joint_names[joint]
        return self._run(joint, end, 1.0, news(f"{name} is there: release, then hold 'next' again"))

    def _along(self, track: Track, press: float) -> Answer:
        """Go on along a route of all joints."""
        session = self._session
        if self.begins("next", press):
            session.guide.progress = track.update(session.q)
            session.guide.refuse_if_blocked()
        if track.done:
            self.end()
            return news("all joints are there")
        point = track.ahead(self.pace * LEASH_SECONDS)
        self.drive.lead(point, self.pace, session.q, session.time)
        return news("driving all joints")

    def _stuck(self, away: float, slack: float) -> bool:
        """Whether the arm has stopped coming nearer to the end of its move, within the tolerance of the route."""
        nearest, since = self._nearest
        if away < nearest - MADE:
            self._nearest = away, self._session.time
            return False
        return MADE < away <= slack and self._session.time - since > STUCK_SECONDS

    def begins(self, verb: str, press: float) -> bool:
        """Whether a press is a new one."""
        if (verb, press) == self._press:
            return False
        self.drive.end(self._session.time)
        self._press, self.over, self._near = (verb, press), False, MADE
        return True

    def _due_move(self, follower: Follower) -> tuple[int, float]:
        """Joint and end [rad or m] of the move that is due."""
        session = self._session
        session.guide.progress = progress = follower.update(session.q)
        joint = follower.joint()
        if progress.advice == "lost" or joint is None:
            raise InputError(progress.fault or "all moves are done")
        session.guide.refuse_if_blocked()
        session.guide.show_due(follower)
        end = float(follower.target[joint])
        self._near = min(MADE, 0.25 * abs(end - float(session.q[joint])))  # a short move has to be made, too
        return joint, end

    def still_free(self) -> bool:
        """Whether what is driven by hand is free in the world as it is now."""
        session, joint = self._session, self.drive.joint
        return joint is None or session.world.motion_valid(session.q, self._with(joint, self.drive.goal))

    def _run(self, joint: int, goal: float, share: float, at_goal: Answer) -> Answer:
        session = self._session
        if abs(goal - session.q[joint]) <= self._near:
            self.end()
            return at_goal
        speed = max(min(self.speed * share, self.pace), 1e-3)
        point = self.drive.renew(joint, goal, speed, session.q, session.time)
        if self._press[0] == "jog":
            session.desired = self._with(joint, point)
        return news(f"driving {session.robot.joint_names[joint]}")

    def _with(self, joint: int, value: float) -> Vector:
        desired = self._session.q.copy()
        desired[joint] = value
        return frozen(desired)

    def _place(self, joint: int, value: float) -> str:
        robot = self._session.robot
        number, unit = reading(value, joint_unit(robot.prismatic[joint]))
        return f"{robot.joint_names[joint]} to {number:.4g} {unit}"
