"""The route of a session: proposed, accepted, followed move by move, and withdrawn when it is not free any more.

Source: [1, ch. 6].
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.answers import Answer, alarm, news, refused
from rrtik_ompl.pilot.devices.arm import Arm
from rrtik_ompl.pilot.feasibility import FeasibilityCache
from rrtik_ompl.pilot.interlock import CHOOSING, FOLLOWING, MANOEUVRE, PROPOSED
from rrtik_ompl.pilot.routes.follower import Follower, Progress, path_fault
from rrtik_ompl.pilot.routes.manoeuvre import escape_advice
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.pilot.routes.proposal import propose
from rrtik_ompl.pilot.routes.route import MAX_END_OFFSET, MAX_END_TURN, Route
from rrtik_ompl.pilot.routes.track import Track, together
from rrtik_ompl.pilot.surroundings import MAX_SHIFT, MAX_TURN, Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

WITHDRAWN = "the route is withdrawn: {}; 'replan' finds another"
MADE = "all moves are done"


class Guided(Protocol):
    """The session, as its route uses it."""

    problem: Problem
    robot: Robot
    arm: Arm
    rates: Vector
    q: Vector
    desired: Vector
    selected: int
    seed: int
    mode: str
    target: str | None
    choice: tuple[str, int] | None
    surroundings: Surroundings
    feasibility: FeasibilityCache

    @property
    def world(self) -> World:
        """The world for moves by hand."""

    @property
    def driving(self) -> bool:
        """Whether a joint is driven."""

    def fault(self) -> str:
        """What is wrong with the grasp that is chosen; "" if nothing."""

    def stand_still(self) -> None:
        """Stop the arm, and end what is held."""


class Guide:
    """Proposes a route, and leads along it.

    Attributes:
        route: As it was planned last; None without one.
        follower: Tracks the arm along it, or along the way back.
        progress: Where the arm is on it; None before it is accepted.
        withdrawn: Why it must not be followed any more; "" while it may.
    """

    def __init__(self, session: Guided) -> None:
        """Begin without a route."""
        self.route: Route | None = None
        self.follower: Follower | Track | None = None
        self.progress: Progress | None = None
        self.withdrawn = ""
        self._session = session
        self._list: Route | None = None  # of single-joint moves: what `together` is made of, and goes back to
        self._aimed: SeenObject | None = None  # what the route leads to, as it was seen when it was planned

    def plan(self) -> Answer:
        """Propose a route from where the arm is."""
        session = self._session
        session.arm.stop()
        session.q = frozen(session.arm.read())
        lamp = session.feasibility.patient_lamp(session.target, session.choice, session.q)
        found = propose(session.problem, session.surroundings, session.target, lamp, session.q, session.rates,
                        session.seed)  # fmt: skip
        self.withdrawn = ""
        if isinstance(found, NoRoute):
            self.leave()
            otherwise = "choose another grasp" if session.choice else "drive the arm elsewhere, or choose an object"
            advice = escape_advice(session.world, session.q) or otherwise
            return refused(f"no route: {session.fault() or found}; {advice}")
        aimed = session.surroundings.named(session.target) if session.target and session.choice else None
        said = self.propose(found, aimed)
        return said if aimed is None else news(said.text + session.surroundings.not_compared(aimed.object.name))

    def propose(self, route: Route, aimed: SeenObject | None = None) -> Answer:
        """Propose a route that begins where the arm is.

        Args:
            route: The route.
            aimed: What it leads to; it is withdrawn when that has moved.
        """
        session = self._session
        kind = Track if route.together else Follower
        self.route, self.follower, self.progress = route, kind(route.path, session.rates), None
        self.withdrawn, self._aimed = "", aimed
        self._list = self._list if route.together else route
        session.mode, session.desired = PROPOSED, frozen(route.path.end)
        return news(route.summary() + "; 'accept' or 'reject'")

    def together(self) -> Answer:
        """Propose the same route with all joints at once, or the list of moves again."""
        session, list_of_moves = self._session, self._list
        route = self.route
        if route is None or list_of_moves is None:
            raise InputError("there is no route; 'plan' proposes one")
        if route.together:
            return self.propose(list_of_moves, self._aimed)
        world = session.surroundings.world_at(session.q, session.target)
        made = together(route, world, session.rates, session.seed)
        return refused(f"no route {made}") if isinstance(made, NoRoute) else self.propose(made, self._aimed)

    def accept(self) -> Answer:
        """Follow the route that is proposed."""
        session, follower = self._session, self.follower
        if follower is None:
            raise InputError("there is no route to accept; 'plan' proposes one")
        progress = follower.update(session.q)
        if progress.advice == "lost":
            raise InputError(f"the arm is not where the route starts: {progress.fault}; 'replan' starts it from here")
        self.refuse_if_blocked()
        session.mode, self.progress, self.withdrawn = FOLLOWING, progress, ""
        self.show_due(follower)
        return news("accepted; hold 'next' to make the next move")

    def reject(self) -> Answer:
        """Leave the route."""
        self._session.arm.stop()
        self.leave()
        self._session.desired = self._session.q
        return news("rejected")

    def back(self) -> Answer:
        """Propose the way back: the moves that were made, reversed."""
        session = self._session
        if self.follower is None:
            raise InputError("there is no route to go back on")
        session.arm.stop()
        back, self._aimed = self.follower.back(session.q), None
        kind = type(self.follower)
        self.follower, session.mode, self.progress, self.withdrawn = kind(back, session.rates), PROPOSED, None, ""
        moves = len(self.follower.moves)
        how = f"{moves} moves" if moves else "all joints at once"
        return news(f"the way back: {how}; 'accept' or 'reject'")

    def settle(self) -> Answer:
        """Take the current move for made where the arm does not come nearer to its end."""
        session, follower = self._session, self.follower
        if follower is None or follower.joint() is None:
            raise InputError("no move is due")
        joint, left = follower.pass_on(session.q)
        self.progress = follower.update(session.q)
        self.show_due(follower)
        return refused(f"{joint} comes no nearer than {left} to its end; release, then hold 'next' again")

    def over(self, verb: str) -> str:
        """What there is to say to who wants to go on along a route that was made to its end; "" else."""
        progress = self.progress
        ended = verb == "next" and self._session.mode in (MANOEUVRE, CHOOSING)
        return f"{MADE}; 'plan' proposes another route" if ended and progress and progress.advice == "done" else ""

    def watch(self) -> Answer | None:
        """Update the progress of an accepted route; what there is to say, None if nothing."""
        session, follower = self._session, self.follower
        if follower is None or session.mode != FOLLOWING:
            return None
        due, self.progress = follower.current, follower.update(session.q)
        if self.progress.advice == "lost":
            session.stand_still()
            return alarm(f"off the route: {self.progress.fault}; 'replan' finds a new one from here")
        if self.progress.advice == "done":
            return None if session.driving else self._ended(follower)
        if follower.current != due:
            self.show_due(follower)
            return news(f"move {follower.current} of {len(follower.moves)} is done; 'next' makes the next")
        return None

    def show_due(self, follower: Follower | Track) -> None:
        """Select the joint of the current move; its end is the desired value."""
        joint = follower.joint()
        if joint is not None:
            self._session.desired, self._session.selected = frozen(follower.target), joint

    def check(self) -> Answer | None:
        """After a change of the scene: withdraw a route that is not free any more, and say so; None if all is well."""
        session = self._session
        if self.follower is None or session.mode not in (FOLLOWING, PROPOSED):
            return None
        fault, before = self.fault_of_rest(), self.withdrawn
        if not fault:
            self.withdrawn = ""
            return news("the route is free again; 'accept' follows it") if before else None
        session.stand_still()
        self.withdrawn, session.mode = fault, PROPOSED
        return alarm(WITHDRAWN.format(fault))

    def refuse_if_blocked(self) -> None:
        """Withdraw the route and raise InputError if the rest of it is not free any more."""
        if fault := self.fault_of_rest():
            self.withdrawn, self._session.mode = fault, PROPOSED
            raise InputError(WITHDRAWN.format(fault))

    def fault_of_rest(self) -> str:
        """Why what remains of the route must not be followed; "" if it may be."""
        if self.follower is None:
            return ""
        session = self._session
        if moved := self._target_moved():
            return moved
        around, target = session.surroundings, session.target
        known = target is not None and session.choice is not None and around.named(target) is not None
        world = around.holding(str(target)) if known else around.world_at(session.q, target)
        return path_fault(world, self.follower.rest(session.q))

    def _target_moved(self) -> str:
        """By how much the target is not where the route ends any more; "" if it is there."""
        aimed = self._aimed
        now = None if aimed is None else self._session.surroundings.named(aimed.object.name)
        if aimed is None or now is None:
            return ""
        away, turned = apart(aimed.T_base_object, now.T_base_object)
        if away <= MAX_SHIFT and turned <= MAX_TURN:
            return ""
        far = f"{1e3 * away:.0f} mm and {np.rad2deg(turned):.1f} deg"
        return f"{aimed.object.name} has moved by {far} since the route was planned"

    def _ended(self, follower: Follower | Track) -> Answer:
        """All moves are made: whether the tip is where the route ends."""
        session = self._session
        session.mode = MANOEUVRE
        away, turned = apart(session.robot.fk(follower.path.end), session.robot.fk(session.q))
        if away <= MAX_END_OFFSET and turned <= MAX_END_TURN:
            return news(MADE)
        far = f"{1e3 * away:.1f} mm and {np.rad2deg(turned):.2f} deg"
        return refused(
            f"all moves are made, but the tip is {far} away from the end of the route; 'replan' may go nearer"
        )

    def leave(self) -> None:
        """Forget the route."""
        self.route = self.follower = self.progress = self._aimed = None
        self.withdrawn = ""
        self._session.mode = CHOOSING if self._session.choice else MANOEUVRE
