"""All joints at once, while a command is held: the last centimetres by sight, or after a master arm's joints.

Source: [1, ch. 2.2 and 6] (visual servoing, position control).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.following.servo import Servo
from rrtik_ompl.motion.following.visual_servo import VisualServo
from rrtik_ompl.pilot.answers import Answer, news
from rrtik_ompl.pilot.devices.arm import Arm
from rrtik_ompl.pilot.motion.drive import LEASH_SECONDS
from rrtik_ompl.pilot.motion.held import Held
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.world.world import World

NEAR, TURNED = 0.15, np.deg2rad(30.0)  # [m], [rad]; from farther away there may be no straight way to a grasp
ALIGNED, ALIGNED_SLIDING = np.deg2rad(5.0), 0.01  # [rad], [m]; a master arm that is farther away leads nothing
MAX_STEP_SECONDS = 0.2  # between two renewals
METHODS = ("position", "image")


class Led(Protocol):
    """The session, as it is led."""

    robot: Robot
    rates: Vector
    q: Vector
    desired: Vector
    time: float
    target: str | None
    choice: tuple[str, int] | None
    surroundings: Surroundings
    held: Held

    @property
    def world(self) -> World:
        """The world for moves by hand."""

    def unseen(self, name: str) -> float:
        """For how long an object has not been in view [s]."""


class Leading:
    """Leads the joints of an arm that takes set points.

    Attributes:
        master: An arm whose joints are followed by `lead`; None without one.
        method: Of visual servoing, one of `METHODS`.
    """

    def __init__(self, session: Led, master: Arm | None = None) -> None:
        """Take the session, and a master arm if there is one."""
        self.master, self.method = master, METHODS[0]
        self._session = session
        self._visual: VisualServo | None = None
        self._world: World | None = None
        self._before = 0.0

    def servo(self, press: float) -> Answer:
        """Go to the grasp that is chosen by what the camera sees of it; only the last centimetres."""
        session = self._session
        if session.target is None or session.choice is None:
            raise InputError("choose a grasp first: servoing leads the tool to it")
        seen, grasp = session.surroundings.named(session.target), session.choice
        if seen is None:
            raise InputError(f"{session.target} was not seen yet")
        goal, world = seen.grasp_pose(*grasp), session.surroundings.holding(session.target)
        if session.held.begins("servo", press):
            away, turned = apart(session.robot.fk(session.q), goal)
            if away > NEAR or turned > TURNED:
                far = f"{100 * away:.0f} cm and {np.rad2deg(turned):.0f} deg away"
                raise InputError(
                    f"the grasp is {far}; servoing is for the last {100 * NEAR:.0f} cm: plan a route first"
                )
            self._visual, self._before = None, session.time - LEASH_SECONDS
        if self._visual is None:
            self._visual, self._world = VisualServo(Servo(world), session.robot), world
        if world is not self._world:  # something has moved
            self._visual.go_on_with(Servo(world))
            self._world = world
        seconds = float(np.clip(session.time - self._before, 1e-3, MAX_STEP_SECONDS))
        self._before = session.time
        step = self._visual.step(session.q, goal if session.unseen(session.target) == 0.0 else None, seconds)
        left = f"{1e3 * step.away:.1f} mm and {np.rad2deg(step.turned):.1f} deg"
        if step.state != "moving":
            session.held.end()
            if step.state == "done":
                return news(f"at the grasp, to {1e3 * step.away:.2f} mm and {np.rad2deg(step.turned):.2f} deg")
            raise InputError(f"stopped {left} before the grasp: {WHY[step.state].format(session.target)}")
        fast = float((np.abs(step.rates) / session.rates).max()) / session.held.pace
        self._lead(session.q + step.rates * (LEASH_SECONDS / max(fast, 1.0)))
        return news(f"servoing: {left} to the grasp")

    def lead(self, press: float) -> Answer:
        """Follow the joints of the master arm."""
        session, master = self._session, self.master
        if master is None:
            raise InputError("there is no master arm: --master HOST:PORT names one")
        if master.lost:
            session.held.end()
            raise InputError(f"master arm: {master.lost}")
        wanted = session.robot.clamp(master.read())
        away = wanted - session.q
        if session.held.begins("lead", press):
            self._check_aligned(away)
        most = session.rates * session.held.pace * LEASH_SECONDS
        point = session.q + np.clip(away, -most, most)
        world = session.world
        if not world.motion_valid(session.q, point):
            session.held.end()
            touched = world.contacts(point)
            pair = f"'{touched[0].first}' and '{touched[0].second}' would touch" if touched else "not free"
            raise InputError(f"stopped: {pair}; lead the master another way, then hold again")
        self._lead(point)
        return news("led by the master arm")

    def _lead(self, point: Vector) -> None:
        session = self._session
        session.desired = session.robot.clamp(point)
        session.held.drive.lead(session.desired, session.held.pace, session.q, session.time)

    def _check_aligned(self, away: Vector) -> None:
        robot = self._session.robot
        share = np.abs(away) / np.where(robot.prismatic, ALIGNED_SLIDING, ALIGNED)
        worst = int(share.argmax())
        if share[worst] > 1.0:
            by, unit = reading(float(away[worst]), joint_unit(robot.prismatic[worst]))
            raise InputError(
                f"bring the master to the arm first: its {robot.joint_names[worst]} differs by {by:.1f} {unit}"
            )


WHY = {
    "lost": "{} is not in view",
    "jumped": "{} has jumped",
    "blocked": "a limit or an obstacle is in the way; back off, or plan a route",
}
