"""The pilot's session without its page: objects and commands go in, the state comes out.

Source: [1, ch. 6] (flow chart). Two modes: assisted manoeuvre moves one joint at a time and refuses moves that are not
free; assisted teleoperation chooses a grasp, plans a route, and guides the pilot through its moves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError, RrtikError, UnknownNameError
from rrtik_ompl.pilot.answers import Answer, Level, alarm, news, refused
from rrtik_ompl.pilot.arguments import MAX_WORD_LENGTH, fitting
from rrtik_ompl.pilot.arm_check import ArmCheck
from rrtik_ompl.pilot.devices.arm import Arm, joint_rates
from rrtik_ompl.pilot.feasibility import FeasibilityCache
from rrtik_ompl.pilot.guide import Guide
from rrtik_ompl.pilot.interlock import (
    ACKNOWLEDGE,
    CHOOSING,
    FOLLOWING,
    MANOEUVRE,
    MOVING,
    PROPOSED,
    UNSEEN_SECONDS,
    Knowledge,
    Sight,
    refusal,
)
from rrtik_ompl.pilot.motion.hand import Hand
from rrtik_ompl.pilot.motion.held import Held
from rrtik_ompl.pilot.motion.leading import Leading
from rrtik_ompl.pilot.records.record import Record
from rrtik_ompl.pilot.routes.follower import Follower, Progress
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, Lamp
from rrtik_ompl.pilot.routes.manoeuvre import JointRange
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.pilot.routes.track import Track
from rrtik_ompl.pilot.surroundings import Structure, Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

READ_SECONDS = 1.0  # a stop so soon after a fault is against the fault: it does not acknowledge it


class Session:
    """One pilot, one arm, one scene.

    Attributes:
        answer: What was said last, and its level.
        sight: What the page of the pilot had shown when the command of now was given; None without a page.
    """

    def __init__(
        self,
        problem: Problem,
        arm: Arm,
        *,
        rates: ArrayLike | None = None,
        record: Record | None = None,
        seed: int = 0,
        past: bool = False,
        recorded: bool = False,
        structure: Structure | None = None,
        master: Arm | None = None,
        patience: float | None = None,
    ) -> None:
        """Begin in manoeuvre.

        Args:
            problem: Robot and surroundings; its goal serves `plan` where no object was chosen.
            arm: The arm that is moved.
            rates: Of the joints, shape (dof,) [rad/s or m/s]; default ones if None.
            record: Where the session is recorded.
            seed: Of the random numbers: the same commands give the same routes.
            past: Pictures are not of now, and the arm is a simulated one. Else nothing moves without a picture of now.
            recorded: The arm moves as a record says, whatever it is told: it is not compared with that.
            structure: To what the problem's obstacles are fixed; None if they move with the arm's base.
            master: An arm whose joints `lead` follows.
            patience: For how long routes stand on what is out of view [s]; None for 2 s with a structure, and for ever
                without one, where the vehicle stands still.
        """
        self.problem, self.robot, self.arm, self.seed = problem, problem.robot, arm, seed
        self.rates: Vector = joint_rates(self.robot, rates)
        self.surroundings = Surroundings(problem.world, structure)
        self.mode, self.selected, self.speed = MANOEUVRE, 0, 1.0
        self.target: str | None = None
        self.choice: tuple[str, int] | None = None
        self.answer = news("")
        self.sight: Sight | None = None
        self.q: Vector = frozen(arm.read())
        self.desired: Vector = self.q
        self.time = 0.0
        self.picture_time, self.unusable = -np.inf, ""  # of the last picture, and why it could not be used
        self.feasibility = FeasibilityCache(self.surroundings)
        self.guide = Guide(self)
        self.held, self.hand = Held(self), Hand(self)
        self.leading = Leading(self, master)
        self._check = ArmCheck()
        self.past, self._recorded = past, recorded
        self._trouble = ""
        self._unseen = ""
        self._seen_at = dict[str, float]()
        self._patience = (np.inf if structure is None else UNSEEN_SECONDS) if patience is None else patience
        self._fault, self._fault_at = "", -np.inf  # what the arm has done that it was not told, as of the last tick
        self._record = record or Record(None)
        self._commands: dict[str, Callable[..., Answer]] = {
            "select": self._select, "jog": self.held.jog, "move": self.held.move, "go": self.held.go,
            "next": self.held.next, "release": self.held.release, "speed": self.held.set_speed, "stop": self._stop,
            "object": self._object, "grasp": self._grasp, "plan": self.guide.plan, "replan": self.guide.plan,
            "accept": self.guide.accept, "reject": self.guide.reject, "back": self.guide.back,
            "settle": self.guide.settle, "close": self.hand.close, "open": self.hand.open,
            "lift": self.hand.lift, "halt": self._halt, "servo": self.leading.servo, "lead": self.leading.lead,
            "together": self.guide.together,
        }  # fmt: skip

    # --- input -------------------------------------------------------------------------------------------

    def see(self, objects: Sequence[SeenObject], time: float) -> None:
        """Update the surroundings by the objects of a picture."""
        self.time, self.picture_time, self.unusable = max(self.time, time), time, ""
        self._seen_at |= {each.object.name: time for each in objects}
        if self.hand.holds:
            self._seen_at[self.hand.holds] = time  # it is where the arm is
        if self.surroundings.see(objects):
            self._record.write("seen", time, objects=self.surroundings.places())
            if self.target is None:
                targets = [o.object.name for o in objects if o.object.role == "target" and o.object.grasps]
                self.target = targets[0] if targets else None
            self._check_motion()

    def see_arm(self, T_base_tip: pin.SE3, covariance: Matrix, time: float) -> None:
        """Where a picture shows the tip, with its covariance (6, 6); nothing moves where the joints say otherwise."""
        if not self.past:
            self._check.see(T_base_tip, covariance, self.robot.fk(self.q), time)

    def tick(self, time: float) -> None:
        """Read the arm and update its progress along the route; stop it where the present is not known any more."""
        self.time = max(self.time, time)
        before, self.q = self.q, frozen(self.arm.read())
        if not np.array_equal(before, self.q):
            self._record.write("joints", time, q=self.q.tolist())
            if self.surroundings.settle(self.q):
                self._check_motion()
        self._check.read(self.q, time)
        expired = self.held.expire()
        if not self._recorded:
            self.say(expired)
            self.say(self.held.watch())
        self._fault = self.held.drive.supervisor.fault
        self._watch()
        self._watch_view()
        self.say(self.guide.watch())
        if ended := self._record.news():
            self.say(alarm(ended))

    def say(self, answer: Answer | None) -> None:
        """Show an answer to the pilot; None leaves the last one."""
        self.answer = answer or self.answer

    def command(self, verb: str, time: float, /, **arguments: object) -> str:
        """Execute a command of the pilot; returns a line for a person, which is `message` from then on.

        A command that cannot be executed in this mode, or on what is known, says so and moves nothing. Those of
        `MOVING` are held: they are repeated as long as the arm shall move. Any other command ends the motion.
        """
        self.time = max(self.time, time)
        goes_on = self.held.goes_on(verb, arguments)
        if goes_on and self.held.over:
            return self.message  # of what ended the press
        try:
            if verb not in self._commands:
                raise UnknownNameError("command", verb[:MAX_WORD_LENGTH], self._commands)
            act = self._commands[verb]
            given = fitting(act, verb, arguments)
            if verb not in (*MOVING, "release"):
                self.held.end()
            why = self.guide.over(verb) or refusal(verb, self.mode, self.known) or self.hand.refusal(verb)
            if why:
                raise InputError(why)
            if not goes_on:
                self._record.write("command", time, name=verb, arguments=given)
            self.say(act(**given))
        except RrtikError as error:
            self.held.refuse(verb, arguments.get("press"))
            self.say(refused(str(error)))
        if not goes_on:
            self._record.write("answer", time, text=self.message, level=self.answer.level.value, mode=self.mode)
        return self.message

    # --- output -------------------------------------------------------------------------------------------

    @property
    def known(self) -> Knowledge:
        """What is known now of the arm and of the picture."""
        age = self.time - self.picture_time
        fault = self._fault
        off = self._check.off
        unseen = self._out_of_view()
        return Knowledge(self.arm.lost, age, self.past, off, self.unusable, fault, self.sight, unseen)

    @property
    def message(self) -> str:
        """The line that was said last."""
        return self.answer.text

    @property
    def level(self) -> Level:
        """Of that line."""
        return self.answer.level

    @property
    def driving(self) -> bool:
        """Whether a joint is driven."""
        return self.held.drive.active

    @property
    def route(self) -> Route | None:
        """The route that was planned last."""
        return self.guide.route

    @property
    def follower(self) -> Follower | Track | None:
        """Of the route, or of the way back."""
        return self.guide.follower

    @property
    def progress(self) -> Progress | None:
        """Where the arm is on its route."""
        return self.guide.progress

    @property
    def world(self) -> World:
        """The world for moves by hand: the gripper may touch what it holds, as long as it does."""
        return self.surroundings.world_at(self.q, self.target)

    def lamps(self) -> tuple[Lamp, ...]:
        """Lamps of the chosen object where it is and for where the arm is; none is green if no route can be led."""
        found = self.feasibility.lamps(self.target, self.q)
        unseen = self.known.unseen
        if not unseen:
            return found
        return tuple(replace(each, color=AMBER, reason=unseen) if each.color == GREEN else each for each in found)

    def lamp(self) -> Lamp | None:
        """The lamp of the grasp that is chosen."""
        return next((lamp for lamp in self.lamps() if (lamp.type, lamp.level) == self.choice), None)

    def fault(self) -> str:
        """What is wrong with the grasp that is chosen: by how much it is out of reach, what touches; "" if nothing."""
        lamp = self.lamp()
        return "" if lamp is None else self.known.unseen or self.feasibility.fault(str(self.target), lamp, self.q)

    def joint_range(self) -> JointRange:
        """The range in which the selected joint can be driven now."""
        return self.feasibility.joint_range(self.world, self.q, self.selected)

    def unseen(self, name: str) -> float:
        """For how long an object has not been in view, by the pictures taken since [s]."""
        return max(self.picture_time - self._seen_at.get(name, self.picture_time), 0.0)

    def _out_of_view(self) -> str:
        """What the world stands on and was not seen for longer than patience allows, in words; "" if nothing."""
        if self.past or self._patience == np.inf or self.picture_time == -np.inf:
            return ""
        for name in self.surroundings.basis:
            if name not in self._seen_at:
                return f"'{name}' was not seen yet"
            if self.unseen(name) > self._patience:
                return f"'{name}' has not been in view for {self.unseen(name):.0f} s"
        return ""

    # --- commands ------------------------------------------------------------------------------------------------

    def _select(self, joint: int) -> Answer:
        if not 0 <= int(joint) < self.robot.dof:
            raise InputError(f"joint must be 1 to {self.robot.dof}, got {int(joint) + 1}")
        self.selected = int(joint)
        return news(f"{self.robot.joint_names[self.selected]} selected")

    def stand_still(self) -> None:
        """Stop the arm, and end what is held."""
        self.held.end()
        self.arm.stop()

    def _stop(self) -> Answer:
        """Stop the arm; a fault that the pilot has had time to read is acknowledged."""
        said = self._end_motion()
        if self._fault and self.time - self._fault_at <= READ_SECONDS:
            return alarm(f"stopped; {self._fault}; {ACKNOWLEDGE}")
        if self._fault:  # one of this moment, which nobody has read, stays
            self._fault = ""
            self.held.drive.supervisor.acknowledge()
        return news(said)

    def _end_motion(self) -> str:
        """Stop the arm, and take back that a route is followed; what there is to say."""
        self.stand_still()
        self.desired = self.q
        if self.mode == FOLLOWING:
            self.mode = PROPOSED
            return "stopped; 'accept' goes on with the route, 'reject' leaves it"
        return "stopped"

    def _halt(self) -> Answer:
        """Stop the arm, for no page has the pilot any more."""
        self._end_motion()
        return alarm("the pilot has left; the arm stands still")

    def _object(self, name: str) -> Answer:
        if self.surroundings.named(name) is None:
            raise UnknownNameError("object in view", name, [o.object.name for o in self.surroundings.seen])
        self.target, self.choice, self.mode = name, None, CHOOSING
        return news(f"{name} chosen; now a grasp")

    def _grasp(self, type: str, level: int) -> Answer:
        self.surroundings.check_grasp(self.target, type, int(level))
        self.choice, self.mode = (type, int(level)), CHOOSING
        fault, place = self.fault(), f"{type} at level {int(level) + 1}"
        return refused(f"{place}: {fault}") if fault else news(f"{place}: can be reached")

    # --- what ends a motion ---------------------------------------------------------------------------------------

    def _watch(self) -> None:
        """Stop when picture or arm are not known any more, and leave the route; say when they are known again."""
        trouble, before = self.known.trouble, self._trouble
        self._trouble = trouble
        if trouble == before:
            return
        how = f"; {ACKNOWLEDGE}" if self._fault == trouble else ""
        if self._fault == trouble:
            self._fault_at = self.time
        if not trouble:
            self.say(news("picture and arm are known again; the arm stands still"))
        elif self.mode == FOLLOWING or self.held.drive.active:
            self._record.write("command", self.time, name="stop", arguments={})
            self.say(alarm(f"{trouble}: {self._end_motion()}{how}"))
        else:
            self.arm.stop()
            self.say(alarm(trouble + how))

    def _watch_view(self) -> None:
        """Leave the route when something that it stands on has been out of view for too long, and say so."""
        unseen = self.known.unseen
        before = self._unseen
        self._unseen = unseen
        if bool(unseen) == bool(before):
            return
        if not unseen:
            self.say(news("all that routes stand on is in view"))
        elif self.mode == FOLLOWING:
            self._record.write("command", self.time, name="stop", arguments={})
            self.say(alarm(f"{unseen}: {self._end_motion()}"))
        else:
            self.say(alarm(f"{unseen}: no route is led past it, and by hand it may be elsewhere"))

    def _check_motion(self) -> None:
        """After a change of the scene: stop if what is driven, followed or proposed is not free any more."""
        if self.mode != FOLLOWING and not self.held.still_free():
            self.held.end()
            self.say(alarm("stopped: something has come into the way"))
        self.say(self.guide.check())
