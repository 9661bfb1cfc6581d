"""The pilot's session without its page: objects and commands go in, the state comes out.

Source: [1, ch. 6] (flow chart). Two modes: assisted manoeuvre moves one joint at a time and refuses moves that are not
free; assisted teleoperation chooses a grasp, plans a route, and guides the pilot through its moves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Vector, frozen
from rrtik_ompl.errors import InputError, RrtikError, UnknownNameError
from rrtik_ompl.goal import JointGoal
from rrtik_ompl.pilot.arguments import MAX_WORD_LENGTH, fitting
from rrtik_ompl.pilot.devices.arm import Arm, joint_rates
from rrtik_ompl.pilot.feasibility import FeasibilityCache
from rrtik_ompl.pilot.lamps import Lamp, stage_poses
from rrtik_ompl.pilot.record import Record
from rrtik_ompl.pilot.routes.follower import Follower, Progress, path_fault
from rrtik_ompl.pilot.routes.manoeuvre import JointRange, MoveCheck, check_move, escape_advice, free_until
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.pilot.routes.route import Route, route_to, route_to_grasp
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.problem import Problem
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.units import joint_unit, reading

MANOEUVRE, CHOOSING, PROPOSED, FOLLOWING = "manoeuvre", "choosing", "proposed", "following"
STALE_SECONDS = 0.5  # a picture older than that does not show the present


class Session:
    """One pilot, one arm, one scene."""

    def __init__(
        self, problem: Problem, arm: Arm, *, rates: ArrayLike | None = None, record: Record | None = None, seed: int = 0
    ) -> None:
        """Begin in manoeuvre.

        Args:
            problem: Robot and surroundings; its goal serves `plan` where no object was chosen.
            arm: The arm that is moved.
            rates: Of the joints, shape (dof,) [rad/s or m/s]; default ones if None.
            record: Where the session is recorded.
            seed: Of the random numbers: the same commands give the same routes.
        """
        self.problem, self.robot, self.arm, self.seed = problem, problem.robot, arm, seed
        self.rates: Vector = joint_rates(self.robot, rates)
        self.surroundings = Surroundings(problem.world)
        self.mode, self.selected = MANOEUVRE, 0
        self.target: str | None = None
        self.choice: tuple[str, int] | None = None
        self.route: Route | None = None
        self.follower: Follower | None = None
        self.progress: Progress | None = None
        self.move_check: MoveCheck | None = None
        self.message = ""
        self.q: Vector = frozen(arm.read())
        self.desired: Vector = self.q
        self.time = 0.0
        self.picture_time = -np.inf
        self._seen_at: dict[str, float] = {}
        self._record = record or Record(None)
        self._feasibility = FeasibilityCache(self.surroundings)
        self._commands: dict[str, Callable[..., str]] = {
            "select": self._select, "move": self._move, "nudge": self._nudge, "stop": self._stop,
            "object": self._object, "grasp": self._grasp, "plan": self._plan, "accept": self._accept,
            "reject": self._reject, "next": self._next, "back": self._back, "replan": self._plan,
            "halt": self._halt,
        }  # fmt: skip

    # --- input -------------------------------------------------------------------------------------------

    def see(self, objects: Sequence[SeenObject], time: float) -> None:
        """Update the surroundings by the objects of a picture."""
        self.time, self.picture_time = max(self.time, time), time
        self._seen_at |= {each.object.name: time for each in objects}
        if self.surroundings.see(objects):
            self._record.write("seen", time, objects=self.surroundings.places())
            if self.target is None:
                targets = [o.object.name for o in objects if o.object.role == "target" and o.object.grasps]
                self.target = targets[0] if targets else None
            self._check_route()

    def tick(self, time: float) -> None:
        """Read the arm and update its progress along the route."""
        self.time = max(self.time, time)
        q = frozen(self.arm.read())
        if self.arm.lost and self.arm.lost != self.message:
            self.message = self.arm.lost
        if not np.array_equal(q, self.q):
            self._record.write("joints", time, q=q.tolist())
        self.q = q
        if self.follower is None or self.mode != FOLLOWING:
            return
        before, self.progress = self.follower.current, self.follower.update(q)
        if self.progress.advice == "lost":
            self.arm.stop()
            self.message = f"off the route: {self.progress.fault}; 'replan' finds a new one from here"
        elif self.progress.advice == "done":
            self.mode, self.message = MANOEUVRE, "all moves are done"
        elif self.follower.current != before:
            self._show_due(self.follower)
            self.message = f"move {self.follower.current} of {len(self.follower.moves)} is done; 'next' makes the next"

    def command(self, verb: str, time: float, /, **arguments: object) -> str:
        """Execute a command of the pilot; returns a line for a person, which is `message` from then on.

        A command that cannot be executed in this mode says so and changes nothing.
        """
        self.time = max(self.time, time)
        try:
            if verb not in self._commands:
                raise UnknownNameError("command", verb[:MAX_WORD_LENGTH], self._commands)
            act = self._commands[verb]
            given = fitting(act, verb, arguments)
            self._record.write("command", time, name=verb, arguments=given)
            self.message = act(**given)
        except RrtikError as error:
            self.message = str(error)
        self._record.write("answer", time, text=self.message, mode=self.mode)
        return self.message

    # --- output -------------------------------------------------------------------------------------------

    def lamps(self) -> tuple[Lamp, ...]:
        """Lamps of the chosen object where it is and for where the arm is."""
        return self._feasibility.lamps(self.target, self.q)

    def lamp(self) -> Lamp | None:
        """The lamp of the grasp that is chosen."""
        return next((lamp for lamp in self.lamps() if (lamp.type, lamp.level) == self.choice), None)

    def fault(self) -> str:
        """What is wrong with the grasp that is chosen: by how much it is out of reach, what touches; "" if nothing."""
        lamp = self.lamp()
        return "" if lamp is None else self._feasibility.fault(str(self.target), lamp, self.q)

    def joint_range(self) -> JointRange:
        """The range in which the selected joint can be driven now."""
        return self._feasibility.joint_range(self.q, self.selected)

    def unseen(self, name: str) -> float:
        """For how long an object has not been in view, by the pictures taken since [s]."""
        return max(self.picture_time - self._seen_at.get(name, self.picture_time), 0.0)

    # --- commands ------------------------------------------------------------------------------------------------

    def _select(self, joint: int) -> str:
        if not 0 <= int(joint) < self.robot.dof:
            raise InputError(f"joint must be 1 to {self.robot.dof}, got {int(joint) + 1}")
        self.selected = int(joint)
        return f"{self.robot.joint_names[self.selected]} selected"

    def _move(self, target: float) -> str:
        if self.mode == FOLLOWING:
            raise InputError("a route is being followed: 'next' makes its next move, 'stop' leaves it")
        return self._send(self.selected, float(target))

    def _nudge(self, change: float) -> str:
        return self._move(self.q[self.selected] + float(change))

    def _send(self, joint: int, target: float) -> str:
        self.move_check = check_move(self.surroundings.world, self.q, joint, target)
        if not self.move_check.allowed:
            if not self.surroundings.world.valid(self.q):
                return f"refused: {self.move_check.reason}"
            reached = free_until(self.surroundings.world, self.q, joint, target)
            value, unit = reading(reached, joint_unit(self.robot.prismatic[joint]))
            return f"refused: {self.move_check.reason}; free until {value:.4g} {unit}"
        desired = self.q.copy()
        desired[joint] = target
        self.desired = frozen(desired)
        self.arm.move(joint, target)
        return "; ".join(("moving " + self.robot.joint_names[joint], *self.move_check.warnings))

    def _stop(self) -> str:
        self.arm.stop()
        self.desired = self.q
        if self.mode == FOLLOWING:
            self.mode = PROPOSED
            return "stopped; 'accept' goes on with the route, 'reject' leaves it"
        return "stopped"

    def _halt(self) -> str:
        """Stop the arm, for no page has the pilot any more."""
        self.arm.stop()
        return "the pilot has left; the arm stands still"

    def _object(self, name: str) -> str:
        seen = self.surroundings.named(name)
        if seen is None:
            raise UnknownNameError("object in view", name, [o.object.name for o in self.surroundings.seen])
        self.target, self.choice, self.mode = name, None, CHOOSING
        return f"{name} chosen; now a grasp"

    def _grasp(self, type: str, level: int) -> str:
        if self.target is None:
            raise InputError("no object is chosen; choose one that is in view")
        seen = self.surroundings.named(self.target)
        if seen is None:
            raise InputError(f"{self.target} was not seen yet")
        count = len(seen.object.grasp(type).levels)
        if not 0 <= int(level) < count:
            raise InputError(f"level must be 1 to {count}, got {int(level) + 1}")
        self.choice, self.mode = (type, int(level)), CHOOSING
        return f"{type} at level {int(level) + 1}: {self.fault() or 'can be reached'}"

    def _plan(self) -> str:
        self.arm.stop()
        self.q = frozen(self.arm.read())
        found = self._route()
        if isinstance(found, NoRoute):
            self.route = self.follower = self.progress = None
            self.mode = CHOOSING if self.choice else MANOEUVRE
            otherwise = "choose another grasp" if self.choice else "drive the arm elsewhere, or choose an object"
            return f"no route: {found}; {escape_advice(self.surroundings.world, self.q) or otherwise}"
        self.route, self.mode = found, PROPOSED
        self.follower, self.progress = Follower(found.path, self.rates), None
        self.desired = frozen(found.path.end)
        return found.summary() + "; 'accept' or 'reject'"

    def _route(self) -> Route | NoRoute:
        seen = None if self.target is None or self.choice is None else self.surroundings.named(self.target)
        if seen is None or self.choice is None:
            goal = self.problem.goal
            if not isinstance(goal, JointGoal):
                return NoRoute("choose an object and a grasp first")
            return route_to(self.surroundings.world, self.q, np.array(goal.q), self.rates, self.seed)
        stages = stage_poses(seen.T_base_object, seen.object.grasp(self.choice[0]), self.choice[1])
        lamp = self.lamp()
        near = self.q if lamp is None or np.isnan(lamp.q[0]).any() else lamp.q[0]
        holding = self.surroundings.holding(seen.object.name)
        return route_to_grasp(self.surroundings.world, holding, self.q, stages, near, self.rates, self.seed)

    def _accept(self) -> str:
        if self.route is None or self.follower is None or self.mode != PROPOSED:
            raise InputError("there is no route to accept; 'plan' proposes one")
        progress = self.follower.update(self.q)
        if progress.advice == "lost":
            raise InputError(f"the arm is not where the route starts: {progress.fault}; 'replan' starts it from here")
        self.mode, self.progress = FOLLOWING, progress
        self._show_due(self.follower)
        return "accepted; 'next' makes the next move"

    def _show_due(self, follower: Follower) -> None:
        """Select the joint of the current move; its end is the desired value."""
        joint = follower.joint()
        if joint is not None:
            self.desired, self.selected = frozen(follower.target), joint

    def _reject(self) -> str:
        self.route = self.follower = self.progress = None
        self.mode, self.desired = (CHOOSING if self.choice else MANOEUVRE), self.q
        return "rejected"

    def _next(self) -> str:
        if self.follower is None or self.mode != FOLLOWING:
            raise InputError("no route is being followed; 'plan' and 'accept' one first")
        self.progress = self.follower.update(self.q)
        joint = self.follower.joint()
        if self.progress.advice == "lost" or joint is None:
            raise InputError(self.progress.fault or "all moves are done")
        fault = self._fault_of_rest()
        if fault:
            raise InputError(f"the route is blocked now: {fault}; 'replan' finds another")
        self._show_due(self.follower)
        self.arm.move(joint, float(self.desired[joint]))
        move = self.follower.moves[self.follower.current]
        return f"move {self.follower.current + 1} of {len(self.follower.moves)}: {move.joint}"

    def _back(self) -> str:
        if self.follower is None:
            raise InputError("there is no route to go back on")
        self.arm.stop()
        back = self.follower.back(self.q)
        self.follower, self.mode = Follower(back, self.rates), PROPOSED
        self.progress = None
        return f"the way back: {len(back.moves())} moves; 'accept' or 'reject'"

    def _check_route(self) -> None:
        """After a change of the scene: stop if the route that is followed or proposed is not free any more."""
        if self.follower is None or self.mode not in (FOLLOWING, PROPOSED):
            return
        fault = self._fault_of_rest()
        if fault:
            self.arm.stop()
            self.message = f"the route is blocked now: {fault}; 'replan' finds another"

    def _fault_of_rest(self) -> str:
        if self.follower is None:
            return ""
        grasped = self.target is not None and self.choice is not None
        world = self.surroundings.holding(str(self.target)) if grasped else self.surroundings.world
        return path_fault(world, self.follower.rest(self.q))
