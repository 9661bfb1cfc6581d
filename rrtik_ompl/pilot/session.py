"""The pilot's session without its page: objects and commands go in, the state comes out.

Source: [1, ch. 6] (flow chart). Two modes: assisted manoeuvre moves one joint at a time and refuses moves that are not
free; assisted teleoperation chooses a grasp, plans a route, and guides the pilot through its moves.

What the session decides stands in `machine`: a function of values. Here it is carried out: a `Session` has the arm, the
record and the `State` of now.
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
from rrtik_ompl.pilot.devices.line_arm import LineArm
from rrtik_ompl.pilot.events import Answer, Level, alarm
from rrtik_ompl.pilot.interlock import UNSEEN_SECONDS, Knowledge, Sight
from rrtik_ompl.pilot.machine import handle
from rrtik_ompl.pilot.motion.leading import GraspServo
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


class Session:
    """One pilot, one arm, one scene.

    Attributes:
        means: What the session works with, the same from its begin to its end.
        state: All that it knows and has decided; each event makes the next one.
        arm: The arm that is moved.
        master: An arm whose joints `lead` follows; None without one.
        supervisor: Compares what the arm does with what it was told.
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
        self.state = State(Surroundings(problem.world, structure), q, q)

        self._grasp_servo = GraspServo(problem.robot)
        self._record = record or Record(None)
        self._read_by_arm = isinstance(arm, LineArm)  # its own thread gives its readings to the supervisor
        if isinstance(arm, LineArm):
            arm.judge = self.supervisor

    # --- events ---------------------------------------------------------------------------------------------------

    def see(self, objects: Sequence[SeenObject], time: float) -> None:
        """Update the surroundings by the objects of a picture."""
        self._take(events.Seen(objects, time))

    def see_arm(self, T_base_tip: pin.SE3, covariance: Matrix, time: float) -> None:
        """Where a picture shows the tip, with its covariance (6, 6); nothing moves where the joints say otherwise."""
        self._take(events.TipSeen(T_base_tip, covariance, time))

    def see_unusable(self, why: str) -> None:
        """A photograph, or picture of a film, could not be used."""
        self._take(events.Unusable(why))

    def tick(self, time: float) -> None:
        """Read the arm and update its progress along the route; stop it where the present is not known any more."""
        self._take(events.Measured(self.arm.read(), time, self.arm.lost))

        standing = None
        if not self.means.recorded:
            now = self._arms_time()
            if not self._read_by_arm:
                self.supervisor.read(self.state.q, now)
            standing = self.supervisor.standing(now)

        self._take(events.Judged(self.supervisor.fault, standing))

        if ended := self._record.news():
            self.say(alarm(ended))

    def say(self, answer: Answer | None) -> None:
        """Show an answer to the pilot; None leaves the last one."""
        if answer is not None:
            self._take(events.Said(answer))

    def stand_still(self) -> None:
        """Stop the arm, and end what is held."""
        self._take(events.Broken())

    def command(self, verb: str, time: float, sight: Sight | None = None, /, **arguments: object) -> str:
        """Execute a command of the pilot; returns a line for a person, which is `message` from then on.

        A command that cannot be executed in this mode, or on what is known, says so and moves nothing. Those that are
        held are repeated as long as the arm shall move. Any other command ends the motion.

        Args:
            verb: One of `machine.VERBS`.
            time: Now [s].
            sight: What the page of the pilot had shown; None without a page.
            **arguments: Of the command.
        """
        self._take(events.Command(verb, time, self.arm.lost, sight, arguments))
        return self.message

    # --- effects --------------------------------------------------------------------------------------------------

    def _take(self, event: events.Event) -> None:
        """Go on to the next state, and carry out what is to be done; an answer to that is the next event, at once."""
        self.state, effects = handle(self.means, self.state, event)

        for effect in effects:
            try:
                following = self._carry_out(effect)
            except RrtikError as error:
                following = events.Failed(str(error))

            if following is not None:
                self._take(following)

    def _carry_out(self, effect: events.Effect) -> events.Event | None:
        match effect:
            case events.Stop():
                self.supervisor.stopped(self._arms_time())
                self.arm.stop()
            case events.SetPoint(aim, ahead, joint):
                self.supervisor.told(aim, ahead, self.state.q, self._arms_time())
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
        return self.master.read()

    def _arms_time(self) -> float:
        """Now, by the clock of whoever reads the arm [s]."""
        return clock.monotonic() if self._read_by_arm else self.time

    # --- what it is like now --------------------------------------------------------------------------------------

    @property
    def robot(self) -> Robot:
        """The arm that is moved."""
        return self.means.robot

    @property
    def time(self) -> float:
        """Of the last event [s]."""
        return self.state.time

    @property
    def q(self) -> Vector:
        """Where the arm is, shape (dof,) [rad or m]."""
        return self.state.q

    @property
    def mode(self) -> str:
        """One of `interlock.MODES`."""
        return self.state.mode

    @property
    def message(self) -> str:
        """The line that was said last."""
        return self.state.answer.text

    @property
    def level(self) -> Level:
        """Of the line that was said last."""
        return self.state.answer.level

    @property
    def driving(self) -> bool:
        """Whether the arm is driven."""
        return self.state.drive.active

    @property
    def surroundings(self) -> Surroundings:
        """The objects as they were seen last, and what the gripper holds."""
        return self.state.around

    @property
    def target(self) -> str | None:
        """Name of the object that is chosen."""
        return self.state.target

    @property
    def route(self) -> Route | None:
        """The route that was planned last."""
        return self.state.way.route

    @property
    def follower(self) -> Follower | Track | None:
        """Of the route, or of the way back."""
        return self.state.way.follower

    @property
    def progress(self) -> Progress | None:
        """Where the arm is on its route."""
        return self.state.way.progress

    @property
    def known(self) -> Knowledge:
        """What is known now of the arm and of the picture."""
        return queries.known(self.means, self.state)

    @property
    def world(self) -> World:
        """The world for moves by hand: the gripper may touch what it holds, as long as it does."""
        return queries.world_by_hand(self.state)

    def lamps(self) -> tuple[Lamp, ...]:
        """Lamps of the chosen object where it is and for where the arm is; none is green if no route can be led."""
        return queries.lamps(self.means, self.state)

    def lamp(self) -> Lamp | None:
        """The lamp of the grasp that is chosen."""
        return queries.chosen_lamp(self.means, self.state)

    def fault(self) -> str:
        """What is wrong with the grasp that is chosen: by how much it is out of reach, what touches; "" if nothing."""
        return queries.grasp_fault(self.means, self.state)

    def joint_range(self) -> JointRange:
        """The range in which the selected joint can be driven now."""
        return queries.joint_range(self.means, self.state)

    def unseen(self, name: str) -> float:
        """For how long an object has not been in view, by the pictures taken since [s]."""
        return queries.unseen_for(self.state, name)
