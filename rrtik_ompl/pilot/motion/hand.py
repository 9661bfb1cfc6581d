"""The gripper of a session: opened and closed by command; what it holds is part of the arm until it lets go.

Source: [1, ch. 4 and 6.2.2] (augmented manipulation, pick and place).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.answers import Answer, alarm, news, refused
from rrtik_ompl.pilot.devices.arm import Arm
from rrtik_ompl.pilot.guide import Guide
from rrtik_ompl.pilot.interlock import MANOEUVRE, MOVING
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.pilot.routes.route import route_to
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject

REACH, TURN = 0.015, np.deg2rad(10.0)  # [m], [rad]; a gripper that closes this near to a grasp holds the object
LIFT_SECONDS = 0.2  # for the posture at the end of a lift
NOTHING = "closed; nothing is between the fingers"


class Handed(Protocol):
    """The session, as its gripper uses it."""

    robot: Robot
    arm: Arm
    rates: Vector
    q: Vector
    seed: int
    mode: str
    target: str | None
    choice: tuple[str, int] | None
    surroundings: Surroundings
    guide: Guide


class Hand:
    """The gripper.

    Attributes:
        closed: Whether it is.
        fixed: Name of an object that it is closed on and that cannot be carried away; "" if there is none.
    """

    def __init__(self, session: Handed) -> None:
        """Begin open."""
        self.closed, self.fixed = False, ""
        self._session, self._lift = session, 0.0

    @property
    def holds(self) -> str:
        """Name of what is held and moves with the arm; "" if nothing is."""
        held = self._session.surroundings.held
        return "" if held is None else held.seen.object.name

    def refusal(self, verb: str) -> str:
        """Why a command must not move the arm; "" if it may."""
        if self.fixed and verb in (*MOVING, "move", "plan", "replan", "accept", "lift", "together"):
            return f"refused: the gripper is closed on '{self.fixed}', which is fixed; open it first"
        return ""

    def close(self) -> Answer:
        """Close the gripper; an object at one of whose grasps it is, is held from now on."""
        session = self._session
        if self.closed:
            return refused("the gripper is closed already")
        self._grip(True)
        tip = session.robot.fk(session.q)
        near = sorted(
            ((apart(tip, pose), seen, lift) for seen, lift, pose in self._grasps()), key=lambda each: each[0][0]
        )
        if not near:
            return refused(NOTHING)
        there = next((each for each in near if _within(each[0])), None)
        if there is None:
            away, turned = near[0][0]
            far = f"{1e3 * away:.0f} mm and {np.rad2deg(turned):.0f} deg away"
            return refused(f"{NOTHING}; the nearest grasp is {far}")
        _, seen, self._lift = there
        name = seen.object.name
        if not seen.object.loose:
            self.fixed = name
            return news(f"closed on {name}")
        session.guide.leave()
        session.target, session.choice, session.mode = None, None, MANOEUVRE
        rests = session.surroundings.hold(seen, tip.actInv(seen.T_base_object), session.q)
        until = "".join(f"; {contact} until they part" for contact in rests)
        return news(f"closed: {name} is held{until}; 'lift' takes it up, or choose where it goes")

    def open(self) -> Answer:
        """Open the gripper; what was held stays where it is."""
        session = self._session
        if not self.closed:
            return refused("the gripper is open already")
        self._grip(False)
        name, self.fixed = self.holds, ""
        if not name:
            return news("open")
        session.guide.leave()
        inside = session.surroundings.left_inside(session.q)
        session.surroundings.release(session.robot.fk(session.q))
        session.target, session.choice, session.mode = name, None, MANOEUVRE
        return alarm(f"open: {inside}") if inside else news(f"open: {name} is put down")

    def lift(self) -> Answer:
        """Propose a route straight up from where something was taken."""
        session = self._session
        if not self.holds:
            raise InputError("nothing is held; close the gripper at a grasp first")
        tip = session.robot.fk(session.q)
        goal = pin.SE3(tip.rotation, tip.translation + np.array([0.0, 0.0, self._lift]))
        world = session.surroundings.world_at(session.q, None)
        found = solve_ik(session.robot, PoseGoal(goal), near=session.q, world=world, seconds=LIFT_SECONDS)
        if not found.found:
            why = found.detail or found.reason
            return refused(f"no lift: {why}; choose where {self.holds} goes, or drive the arm")
        made = route_to(world, session.q, found.solutions[0], session.rates, session.seed)
        return refused(f"no lift: {made}") if isinstance(made, NoRoute) else session.guide.propose(made)

    def _grasps(self) -> list[tuple[SeenObject, float, pin.SE3]]:
        """All grasps of what is in view: the object, how far it is lifted, and ``T_base_tip``."""
        return [
            (seen, grasp.lift, seen.grasp_pose(grasp.name, level))
            for seen in self._session.surroundings.seen
            for grasp in seen.object.grasps
            for level in range(len(grasp.levels))
        ]

    def _grip(self, closed: bool) -> None:
        session = self._session
        session.arm.stop()
        session.arm.grip(closed)
        session.q = frozen(session.arm.read())
        self.closed = closed


def _within(off: tuple[float, float]) -> bool:
    return off[0] <= REACH and off[1] <= TURN
