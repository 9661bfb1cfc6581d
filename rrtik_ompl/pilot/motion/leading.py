"""Held commands that move all joints at once: servoing to a grasp, motion along the tool, following a master arm.

Source: [1, ch. 2.2 and 6] (visual servoing, position control).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.motion.following.servo import Servo
from rrtik_ompl.motion.following.visual_servo import ServoStep, VisualServo
from rrtik_ompl.pilot.events import ReadMaster, StepAlongTool, StepToGrasp, news
from rrtik_ompl.pilot.interlock import BY_HAND, ON_A_ROUTE, Verb
from rrtik_ompl.pilot.motion.held import begins, lead_to, pace
from rrtik_ompl.pilot.queries import unseen_for, world_by_hand
from rrtik_ompl.pilot.state import LEASH_SECONDS, Means, State, leash
from rrtik_ompl.world.world import World

NEAR = 0.15  # [m]; from farther away the straight motion to a grasp may be blocked
TURNED = np.deg2rad(30.0)  # largest angle between the tool and the grasp, for the same reason
# The master arm leads only if each of its joints is this close to the same joint of the arm.
ALIGNED = np.deg2rad(5.0)
AHEAD = 3.0  # a master that is farther ahead than this multiple of `ALIGNED` leads no more
ALIGNED_SLIDING = 0.01  # [m]; the same for a sliding joint
MAX_STEP_SECONDS = 0.2  # longest time step between two renewals
TOOL_SPEED = 0.1  # [m/s]; along the tool at full speed, if no joint is at its rate before that
RETURN_RATE = 2.0  # [1/s]; how fast the tip returns to the line on which it shall move
LEAST_SHARE = 0.005  # of the joints' rates; an arm that would be slower stands
WHY_NOT = {  # reasons by the state of a `ServoStep`
    "lost": "{} is not in view",
    "jumped": "{} has jumped",
    "blocked": "a limit or an obstacle is in the way; back off, or plan a route",
}


class GraspServo:
    """Visual servoing of the tip to a grasp; what was seen of the grasp is kept from one step to the next."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._visual: VisualServo | None = None
        self._world: World | None = None

    def step(self, q: Vector, world: World, goal: pin.SE3 | None, seconds: float, *, begins: bool) -> ServoStep:
        """Return the joint rates for a time step.

        Args:
            q: Present configuration, shape (dof,).
            world: World in which the gripper may touch the object.
            goal: Desired pose of the tip according to the present picture, ``T_base_tip``; None if the object is not in
                it.
            seconds: Time since the last step [s].
            begins: Whether to discard what was seen before.
        """
        if self._visual is None or begins:
            self._visual = VisualServo(Servo(world), self._robot)
        elif world is not self._world:  # an object has moved: check collisions in the new world
            self._visual.go_on_with(Servo(world))
        self._world = world
        return self._visual.step(q, goal, seconds)


class ToolLine:
    """Motion of the tip along the axis that the tool had when the command was pressed, without turning."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._servo: Servo | None = None
        self._world: World | None = None
        self._begin = pin.SE3.Identity()

    def step(self, q: Vector, world: World, speed: float, *, begins: bool) -> Vector:
        """Return joint rates that are proven free for `LEASH_SECONDS`, shape (dof,); zeros if there are none.

        Args:
            q: Present configuration, shape (dof,).
            world: Robot and surroundings.
            speed: Speed along the axis [m/s].
            begins: Whether the line begins at q.
        """
        tip = self._robot.fk(q)
        if begins:
            self._begin = tip
        if self._servo is None or world is not self._world:
            self._servo = Servo(world)
        self._world = world

        axis = self._begin.rotation[:, 2]
        offset = self._begin.translation - tip.translation
        to_line = offset - (offset @ axis) * axis
        turn = pin.log3(self._begin.rotation @ tip.rotation.T)
        twist = np.concatenate([speed * axis + RETURN_RATE * to_line, RETURN_RATE * turn])
        return self._servo.step(q, twist, LEASH_SECONDS)


def servo(means: Means, state: State, press: float) -> State:
    """Move the tip to the chosen grasp by visual servoing while the command is held.

    Only the last centimetres are servoed: from farther away (`NEAR`, `TURNED`) the command is refused.
    """
    if state.target is None or state.choice is None:
        raise InputError("choose a grasp first: servoing leads the tool to it")
    seen = state.around.named(state.target)
    if seen is None:
        raise InputError(f"{state.target} was not seen yet")

    goal = seen.grasp_pose(*state.choice)
    world = state.around.holding(state.target)

    pressed, anew = begins(state, "servo", press)
    last_time = state.servoed_at
    if anew:
        distance, turn = apart(means.robot.fk(state.q), goal)
        if distance > NEAR or turn > TURNED:
            how_far = f"{100 * distance:.0f} cm and {np.rad2deg(turn):.0f} deg away"
            raise InputError(
                f"the grasp is {how_far}; servoing is for the last {100 * NEAR:.0f} cm: plan a route first"
            )
        last_time = state.time - LEASH_SECONDS

    seconds = float(np.clip(state.time - last_time, 1e-3, MAX_STEP_SECONDS))
    target_in_view = unseen_for(state, state.target) == 0.0
    request = StepToGrasp(world, goal if target_in_view else None, seconds, anew, _stepped)
    return replace(pressed, servoed_at=state.time).do(request)


def _stepped(means: Means, state: State, step: ServoStep) -> State:
    """Send the arm along the computed rates, as slowly as the pilot needs; report the distance left."""
    remaining = f"{1e3 * step.away:.1f} mm and {np.rad2deg(step.turned):.1f} deg"

    if step.state == "done":
        message = f"at the grasp, to {1e3 * step.away:.2f} mm and {np.rad2deg(step.turned):.2f} deg"
        return state.released().say(news(message))
    if step.state != "moving":
        raise InputError(f"stopped {remaining} before the grasp: {WHY_NOT[step.state].format(state.target)}")

    speed_excess = float((np.abs(step.rates) / means.rates).max()) / pace(means, state)
    led = _led(means, state, state.q + step.rates * (LEASH_SECONDS / max(speed_excess, 1.0)))
    return led.say(news(f"servoing: {remaining} to the grasp"))


def along_tool(means: Means, state: State, direction: float, press: float) -> State:
    """Move the tip straight along the axis of the tool, forwards or back, while the command is held.

    Near obstacles it becomes slower, and it ends before it touches one.

    Args:
        means: What the session works with.
        state: Present state.
        direction: Share of the speed from -1 to 1; 0 ends the drive.
        press: Number of the press that this command belongs to.
    """
    pressed, anew = begins(state, "tool", press)
    if direction == 0.0:
        return pressed.at_rest().say(news("released"))
    speed = float(np.clip(direction, -1.0, 1.0)) * TOOL_SPEED * state.speed
    return pressed.do(StepAlongTool(world_by_hand(state), speed, anew, _along))


def _along(means: Means, state: State, rates: Vector) -> State:
    share = float((np.abs(rates) / means.rates).max())
    if share < LEAST_SHARE:
        raise InputError("the tool goes no farther this way: a limit, an obstacle or a singular posture is in the way")
    led = _led(means, state, state.q + rates * (LEASH_SECONDS / max(share / pace(means, state), 1.0)))
    return led.say(news("the tool moves along its axis"))


def lead(_: Means, state: State, press: float) -> State:
    """Follow the joints of the master arm while the command is held."""
    pressed, anew = begins(state, "lead", press)
    return pressed.do(ReadMaster(_begin_lead if anew else _go_on_leading))


def _begin_lead(means: Means, state: State, master: Vector) -> State:
    _check_aligned(means.robot, means.robot.clamp(master) - state.q)
    return _go_on_leading(means, state, master)


def _go_on_leading(means: Means, state: State, master: Vector) -> State:
    """Move towards the master's joints, as far as one step allows; refuse a step that is not free."""
    to_go = means.robot.clamp(master) - state.q
    _check_aligned(means.robot, to_go, AHEAD)
    max_lead = leash(means.rates * pace(means, state), means.rates)
    point = state.q + np.clip(to_go, -max_lead, max_lead)

    world = world_by_hand(state)
    if not world.motion_valid(state.q, point):
        contacts = world.contacts(point)
        pair = f"'{contacts[0].first}' and '{contacts[0].second}' would touch" if contacts else "not free"
        raise InputError(f"stopped: {pair}; lead the master another way, then hold again")
    return _led(means, state, point).say(news("led by the master arm"))


def _led(means: Means, state: State, point: Vector) -> State:
    desired = means.robot.clamp(point)
    return lead_to(means, replace(state, desired=desired), desired, pace(means, state))


def _check_aligned(robot: Robot, errors: Vector, times: float = 1.0) -> None:
    error_shares = np.abs(errors) / (times * np.where(robot.prismatic, ALIGNED_SLIDING, ALIGNED))
    worst = int(error_shares.argmax())
    if error_shares[worst] > 1.0:
        shown_error, unit = reading(float(errors[worst]), joint_unit(robot.prismatic[worst]))
        raise InputError(
            f"bring the master to the arm first: its {robot.joint_names[worst]} differs by {shown_error:.1f} {unit}"
        )


VERBS = {
    "servo": Verb(servo, present=True, held=True, guided=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "tool": Verb(along_tool, present=True, held=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "lead": Verb(lead, present=True, held=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
}
