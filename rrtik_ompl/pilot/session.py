"""The pilot's session without its page: objects and commands go in, the state comes out.

Source: [1, ch. 6] (flow chart). There are two ways of working: assisted manoeuvre moves one joint at a time and refuses
moves that are not free; assisted teleoperation chooses a grasp, plans a route, and guides the pilot through its moves.
The decisions are made in `machine`, by functions without side effects. A `Session` carries them out: it owns the arm,
the record and the present `State`.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot import events, queries
from rrtik_ompl.pilot.devices.arm import Arm, joint_rates
from rrtik_ompl.pilot.devices.arm_protocol import Health
from rrtik_ompl.pilot.devices.line_arm import LineArm
from rrtik_ompl.pilot.events import Answer, Level, alarm
from rrtik_ompl.pilot.interlock import LATE_SECONDS, UNSEEN_SECONDS, Knowledge, Sight
from rrtik_ompl.pilot.machine import handle
from rrtik_ompl.pilot.motion.leading import GraspServo, ToolLine
from rrtik_ompl.pilot.motion.supervisor import Supervisor
from rrtik_ompl.pilot.record import Record
from rrtik_ompl.pilot.routes.follower import Follower, Progress, Track
from rrtik_ompl.pilot.routes.lamps import Lamp
from rrtik_ompl.pilot.routes.manoeuvre import JointRange
from rrtik_ompl.pilot.routes.route import Route
from rrtik_ompl.pilot.state import Means, State
from rrtik_ompl.pilot.surroundings import Structure, Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

ALIVE_SECONDS = 1.0
BEGIN = "begin"  # name of the posture in which a session began


class Session:
    """One pilot, one arm, one scene.

    Attributes:
        means: What the session works with, unchanged from its begin to its end.
        state: The present state; each event replaces it by the next one.
        arm: The arm that is moved.
        master: A master arm whose joints `lead` follows; None without one.
        supervisor: Compares the motion of the arm with its set points.
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
        """Begin in the mode manoeuvre.

        Args:
            problem: Robot and surroundings; its goal is used by `plan` if no object is chosen.
            arm: The arm that is moved.
            rates: Of the joints, shape (dof,) [rad/s or m/s]; None for the default rates.
            record: The record of the session; None for no record.
            seed: Seed of the random numbers: the same commands give the same routes.
            past: Whether the pictures are old ones and the arm is simulated. Otherwise nothing moves without a present
                picture.
            recorded: Whether the arm moves as a record says. It is then not compared with its set points.
            structure: The object to which the problem's obstacles are fixed; None if they move with the arm's base.
            master: A master arm whose joints `lead` follows.
            patience: How long routes may depend on objects out of view [s]; None for 2 s with a structure, and for no
                limit without one, because the vehicle then stands still.
        """
        if patience is None:
            patience = np.inf if structure is None else UNSEEN_SECONDS
        self.means = Means(
            problem,
            joint_rates(problem.robot, rates),
            seed=seed,
            past=past,
            recorded=recorded,
            patience=patience,
        )

        self.arm = arm
        self.master = master
        self.supervisor = Supervisor(problem.robot, self.means.rates)
        q = frozen(arm.read())
        self.state = State(Surroundings(problem.world, structure), q, q, kept={BEGIN: q})

        self._grasp_servo = GraspServo(problem.robot)
        self._tool_line = ToolLine(problem.robot)
        self._record = record or Record(None)
        self._alive_at = -np.inf  # time of the last line that only says that the session goes on [s]
        self._read_by_arm = isinstance(arm, LineArm)  # its own thread passes its readings to the supervisor
        if isinstance(arm, LineArm):
            arm.judge = self.supervisor

    # --- events ---------------------------------------------------------------------------------------------------

    def see(self, objects: Sequence[SeenObject], time: float) -> None:
        """Update the surroundings by the objects in a picture taken at a time [s]."""
        self._take(events.Seen(objects, time))

    def see_arm(self, T_base_tip: pin.SE3, covariance: Matrix, time: float) -> None:
        """Compare the tip's pose in a picture, with its covariance (6, 6), to the joints; a conflict blocks motion."""
        self._take(events.TipSeen(T_base_tip, covariance, time))

    def see_unusable(self, why: str) -> None:
        """Register that a photograph, or a picture of a film, could not be used."""
        self._take(events.Unusable(why))

    def tick(self, time: float) -> None:
        """Read the arm and update its progress along the route; stop it if the present is no longer known."""
        self._take(self._measured(time))

        standing = None
        if not self.means.recorded:
            now = self._arms_time()
            if not self._read_by_arm:
                self.supervisor.read(self.state.q, now)
            standing = self.supervisor.standing(now)

        self._take(events.Judged(self.supervisor.fault, standing))

        if self.time - self._alive_at >= ALIVE_SECONDS:  # where the record ends, the session ended less than this later
            self._alive_at = self.time
            self._record.write("alive", self.time, arm_age=round(self.state.arm_age, 3))
        if ended := self._record.news():
            self.say(alarm(ended))

    def say(self, answer: Answer | None) -> None:
        """Show an answer to the pilot; None leaves the last one."""
        if answer is not None:
            self._take(events.Said(answer))

    def stand_still(self) -> None:
        """Stop the arm, and end the held command."""
        self._take(events.Broken())

    def command(self, verb: str, time: float, sight: Sight | None = None, /, **arguments: object) -> str:
        """Execute a command of the pilot, and return a line for a person, which is `message` from then on.

        A command that is not allowed in this mode, or on what is known, is refused and moves nothing. Held commands are
        repeated as long as the arm shall move. Any other command ends the motion.

        Args:
            verb: One of `machine.VERBS`.
            time: Current time [s].
            sight: What the page of the pilot had shown; None without a page.
            **arguments: Arguments of the command.
        """
        self._take(events.Command(verb, time, self.arm.lost, sight, arguments))
        return self.message

    # --- effects --------------------------------------------------------------------------------------------------

    def _take(self, event: events.Event) -> None:
        """Go on to the next state and carry out its effects; each answer is handled before the next effect."""
        before = self.state.answer
        self.state, effects = handle(self.means, self.state, event)
        self._write_said(before, event)

        for effect in effects:
            try:
                following = self._carry_out(effect)
            except RrtikError as error:
                following = events.Failed(str(error))

            if following is not None:
                self._take(following)

    def _write_said(self, before: Answer, event: events.Event) -> None:
        """Record what the pilot is told without having asked; answers to commands have lines of their own."""
        said = self.state.answer
        asked = isinstance(event, events.Command | events.Reply) and said.level is not Level.ALARM
        if said != before and not asked and not self.means.recorded:
            self._record.write("said", self.time, text=said.text, level=said.level.value)

    def _carry_out(self, effect: events.Effect) -> events.Event | None:
        """Carry out one effect; return the event that results from it, None for none."""
        match effect:
            case events.Stop():
                self.supervisor.stopped(self._arms_time())
                self.arm.stop()
            case events.SetPoint(wanted, speed, joint):
                aim = self.supervisor.told(wanted, speed, self.state.q, self._arms_time())
                self._record.write("set", self.time, joint=joint, q=np.round(aim, 5).tolist())
                if joint is None:
                    self.arm.follow(aim)
                else:
                    self.arm.move(joint, float(aim[joint]))
            case events.Grip(closed, then):
                self.arm.grip(closed)
                return events.Reply(then, self.arm.read())
            case events.Read(then):
                return events.Reply(then, self.arm.read())
            case events.ReadMaster(then):
                return events.Reply(then, self._read_master())
            case events.FindRoute(search, then):
                return events.Reply(then, search())
            case events.StepToGrasp(world, goal, seconds, begins, then):
                step = self._grasp_servo.step(self.state.q, world, goal, seconds, begins=begins)
                return events.Reply(then, step)
            case events.StepAlongTool(world, speed, begins, then):
                return events.Reply(then, self._tool_line.step(self.state.q, world, speed, begins=begins))
            case events.Acknowledge():
                self.supervisor.acknowledge()
            case events.Give(verb):
                return events.Command(verb, self.time, self.arm.lost, self.state.sight)
            case events.Write(kind, time, values):
                self._record.write(kind, time, **values)
            case events.WriteAnswer(time):
                said = self.state.answer
                self._record.write("answer", time, text=said.text, level=said.level.value, mode=self.mode)
        return None

    def _read_master(self) -> Vector:
        if self.master is None:
            raise InputError("there is no master arm: --master HOST:PORT names one")
        if self.master.lost:
            raise InputError(f"master arm: {self.master.lost}")
        if isinstance(self.master, LineArm):
            if self.master.fault:
                raise InputError(f"master arm: {self.master.fault}")
            if self.master.age > LATE_SECONDS:
                raise InputError(f"master arm: its joints come more than {LATE_SECONDS:g} s late")
        return self.master.read()

    def _measured(self, time: float) -> events.Measured:
        """Read the arm; one behind a line also says how it is, and how old that is."""
        if isinstance(self.arm, LineArm):
            return events.Measured(self.arm.read(), time, self.arm.lost, self.arm.fault, self.arm.age)
        return events.Measured(self.arm.read(), time, self.arm.lost)

    def _arms_time(self) -> float:
        """Return the current time by the clock of the component that reads the arm [s]."""
        return clock.monotonic() if self._read_by_arm else self.time

    # --- what it is like now --------------------------------------------------------------------------------------

    @property
    def robot(self) -> Robot:
        """The arm that is moved."""
        return self.means.robot

    @property
    def time(self) -> float:
        """Time of the last event [s]."""
        return self.state.time

    @property
    def q(self) -> Vector:
        """Present configuration, shape (dof,) [rad or m]."""
        return self.state.q

    @property
    def mode(self) -> str:
        """One of `interlock.MODES`."""
        return self.state.mode

    @property
    def message(self) -> str:
        """The last message."""
        return self.state.answer.text

    @property
    def level(self) -> Level:
        """Level of the last message."""
        return self.state.answer.level

    @property
    def driving(self) -> bool:
        """Whether the arm is driven."""
        return self.state.drive.active

    @property
    def arm_health(self) -> tuple[Health, ...] | None:
        """How the arm is, as it says itself; None for an arm that is not behind a line."""
        return self.arm.health if isinstance(self.arm, LineArm) else None

    @property
    def surroundings(self) -> Surroundings:
        """The objects as they were seen last, and the held object."""
        return self.state.around

    @property
    def target(self) -> str | None:
        """Name of the chosen object; None if none is chosen."""
        return self.state.target

    @property
    def route(self) -> Route | None:
        """The route that was planned last."""
        return self.state.way.route

    @property
    def follower(self) -> Follower | Track | None:
        """The tracker of the route, or of the way back; None without a route."""
        return self.state.way.follower

    @property
    def progress(self) -> Progress | None:
        """The place of the arm on its route; None before the route is accepted."""
        return self.state.way.progress

    @property
    def known(self) -> Knowledge:
        """What is known now of the arm and of the picture."""
        return queries.known(self.means, self.state)

    @property
    def world(self) -> World:
        """The world for moves by hand, in which the gripper may touch the target while it is in contact with it."""
        return queries.world_by_hand(self.state)

    def lamps(self) -> tuple[Lamp, ...]:
        """Return the lamps of the chosen object from the present configuration; none is green if routes are refused."""
        return queries.lamps(self.means, self.state)

    def lamp(self) -> Lamp | None:
        """Return the lamp of the chosen grasp; None if no grasp is chosen."""
        return queries.chosen_lamp(self.means, self.state)

    def fault(self) -> str:
        """Return why the chosen grasp cannot be made: how far out of reach it is, or what touches; "" if it can."""
        return queries.grasp_fault(self.means, self.state)

    def joint_range(self) -> JointRange:
        """Return the range within which the selected joint can be driven now."""
        return queries.joint_range(self.means, self.state)

    def unseen(self, name: str) -> float:
        """Return how long an object has been out of view at the time of the last picture [s]."""
        return queries.unseen_for(self.state, name)
