"""Held commands: a joint is driven, or a move of the route is made, only as long as the command is renewed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot import guide
from rrtik_ompl.pilot.events import Answer, Give, SetPoint, alarm, news, refused
from rrtik_ompl.pilot.interlock import BY_HAND, FOLLOWING, ON_A_ROUTE, Verb
from rrtik_ompl.pilot.motion.supervisor import FAULTS, FOLLOW_SECONDS, amount, slack_of
from rrtik_ompl.pilot.queries import joint_range, out_of_view, world_by_hand
from rrtik_ompl.pilot.routes.follower import MADE, Follower, Track
from rrtik_ompl.pilot.routes.manoeuvre import check_move, move_refusal, way_out
from rrtik_ompl.pilot.state import HOLD_SECONDS, LEASH_SECONDS, LEAST_LEASH_SECONDS, Means, Press, State, leash

# If the arm has come no nearer to the end of a move for this long, it will not get there.
STUCK_SECONDS = 0.8
MIN_SECONDS = 1e-3  # joints that are nearer to their set points than this, as time, are there
MIN_SPEED = 0.05  # least share of the joints' rates


# --- commands --------------------------------------------------------------------------------------------------------


def set_speed(_: Means, state: State, share: float) -> State:
    """Set the speed of driving by hand, as a share of the joints' rates; it is clipped to `MIN_SPEED` and 1."""
    speed = float(np.clip(share, MIN_SPEED, 1.0))
    return replace(state, speed=speed).say(news(f"speed {100 * speed:.0f} %"))


def release(means: Means, state: State) -> State:
    """End the press: stop what is driven, and report what remains of the current move."""
    after = state.released()
    if not state.drive.active:
        return after

    follower = state.way.follower
    if state.mode != FOLLOWING or follower is None or follower.joint() is None:
        going_on = state.mode == FOLLOWING
        return after.say(news("released: hold 'next' to go on" if going_on else "released"))

    joint, target = state.press.due
    remaining, unit = reading(abs(target - float(state.q[joint])), joint_unit(means.robot.prismatic[joint]))
    name = means.robot.joint_names[joint]
    return after.say(refused(f"{name}: {remaining:.3g} {unit} are left of the move; hold 'next' to go on"))


def jog(means: Means, state: State, direction: float, press: float) -> State:
    """Drive the selected joint while the command is held.

    The joint stops at the end of its free range. If the arm is in contact, the joint may only move so that it gets
    free.

    Args:
        means: What the session works with.
        state: Present state.
        direction: Share of the speed from -1 to 1; 0 ends the drive.
        press: Number of the press that this command belongs to.
    """
    sign = float(np.sign(direction))
    pressed, _ = begins(state, "jog", press)
    if sign == 0.0:
        return pressed.at_rest().say(news("released"))

    joint = state.selected
    free_range = joint_range(means, state)
    goal, what_ends_it = (free_range.high, free_range.above) if sign > 0.0 else (free_range.low, free_range.below)
    if free_range.low == free_range.high:  # an empty range means that the arm is in contact now
        goal = way_out(world_by_hand(state), state.q, joint, sign)
        what_ends_it = "out of contact"
    at_goal = refused(f"end of the range: {what_ends_it}")

    driven = _drive(means, pressed, joint, goal, min(abs(direction), 1.0), at_goal)
    if not driven.drive.active:
        return driven
    return replace(driven, desired=_with(state.q, joint, driven.drive.point))


def move(means: Means, state: State, target: float) -> State:
    """Set the desired value [rad or m] of the selected joint after checking the move; holding `go` drives it."""
    joint = state.selected
    warnings = _check(state, joint, target)

    announcement = f"{_place(means.robot, joint, target)}: hold Enter to drive there"
    message = "; ".join(filter(None, (announcement, *warnings, out_of_view(means, state))))
    return replace(state, desired=_with(state.q, joint, target)).say(news(message))


def go(means: Means, state: State, press: float) -> State:
    """Drive the selected joint to its desired value while the command is held."""
    joint = state.selected
    target = float(state.desired[joint])
    pressed, anew = begins(state, "go", press)
    if anew:
        _check(state, joint, target)
    return _drive(means, pressed, joint, target, 1.0, news(_place(means.robot, joint, target)))


def make_next(means: Means, state: State, press: float) -> State:
    """Make the current move of the route while the command is held.

    A press makes at most one move. On a route of all joints at once it goes on to the end of the route.
    """
    follower = state.way.follower
    if follower is None:
        raise InputError("there is no route to follow; 'plan' proposes one")

    pressed, anew = begins(state, "next", press)
    if isinstance(follower, Track):
        return _along(means, pressed, follower, anew)
    return _begin_move(means, pressed, follower) if anew else _go_on(means, pressed, follower)


def _check(state: State, joint: int, target: float) -> tuple[str, ...]:
    """Return the warnings for a move of one joint to a value [rad or m].

    Raises:
        InputError: If the move must not be made.
    """
    world = world_by_hand(state)
    check = check_move(world, state.q, joint, target)
    if not check.allowed:
        raise InputError(move_refusal(world, state.q, joint, target, check))
    return check.warnings


# --- moves of the route ----------------------------------------------------------------------------------------------


def _along(means: Means, state: State, track: Track, anew: bool) -> State:
    """Continue along a route of all joints at once; a new press first checks that the remainder is still free."""
    if anew:
        track, progress = track.update(state.q)
        state = state.on_its_way(follower=track, progress=progress)
        if fault := guide.fault_of_rest(state):
            return guide.withdrawn(state, fault)

    if track.done:
        return state.released().say(news("all joints are there"))

    share = pace(means, state)
    point = track.ahead(max(share * LEASH_SECONDS, LEAST_LEASH_SECONDS))
    return lead_to(means, state, point, share).say(news("driving all joints"))


def _begin_move(means: Means, state: State, due: Follower) -> State:
    """Begin the current move of the route, after a check that the arm is on the route and the remainder is free."""
    follower, progress = due.update(state.q)
    joint = follower.joint()
    updated = state.on_its_way(follower=follower, progress=progress)
    if progress.advice == "lost" or joint is None:
        return updated.released().say(refused(progress.fault or "all moves are done"))

    if fault := guide.fault_of_rest(updated):
        return guide.withdrawn(updated, fault)

    end = float(follower.target[joint])
    # A move shorter than the usual tolerance must not count as made before it begins.
    made_within = min(MADE, 0.25 * abs(end - float(state.q[joint])))
    press = replace(updated.press, due=(joint, end), nearest=(np.inf, state.time), near=made_within)
    return _go_on(means, replace(guide.show_due(updated), press=press), follower)


def _go_on(means: Means, state: State, follower: Follower) -> State:
    """Continue the current move; if the arm stops approaching the end, though near it, `settle` completes the move."""
    joint, end = state.press.due
    remaining = abs(end - float(state.q[joint]))
    nearest, since = state.press.nearest
    if remaining < nearest - MADE:
        state = replace(state, press=replace(state.press, nearest=(remaining, state.time)))
    elif MADE < remaining <= float(follower.slack[joint]) and state.time - since > STUCK_SECONDS:
        return state.do(Give("settle"))

    name = means.robot.joint_names[joint]
    return _drive(means, state, joint, end, 1.0, news(f"{name} is there: release, then hold 'next' again"))


# --- what ends a press -----------------------------------------------------------------------------------------------


def refuse(state: State, why: str) -> State:
    """Refuse the last command: stop the arm, and require a new press even if the command would soon be allowed."""
    verb, number = state.given
    after = state.released().say(refused(why))
    if not isinstance(number, int | float):
        return after
    return replace(after, press=replace(after.press, verb=verb, number=number))


def expire(state: State) -> tuple[State, Answer | None]:
    """End a press that was not renewed in time.

    Returns:
        The state, and the message for the pilot; None if the press goes on.
    """
    if not state.drive.expired(state.time):
        return state, None
    return state.released(), alarm(f"no command for {HOLD_SECONDS:g} s: stopped, press again")


def watch(means: Means, state: State, standing: tuple[int, float, float] | None) -> State:
    """End a press whose joint does not move.

    Args:
        means: What the session works with.
        state: Present state.
        standing: The joint that does not move; see `Judged`.
    """
    if standing is None:
        return state

    robot = means.robot
    drive = state.drive
    joint, moved, seconds = standing
    name = robot.joint_names[joint]
    prismatic = bool(robot.prismatic[joint])

    remaining = abs(drive.goal - float(state.q[joint]))
    is_near = joint == drive.joint and remaining <= slack_of(robot)[joint]
    if is_near and state.press.verb == "next":
        return state  # `next` itself treats the move as completed

    released = state.released()
    if is_near:
        return released.say(refused(f"{name} comes no nearer than {amount(remaining, prismatic=prismatic)}: stopped"))

    description = FAULTS["dead"].format(joint=name, amount=amount(moved, prismatic=prismatic), seconds=seconds)
    stopped = f"stopped, for an arm that follows later than {FOLLOW_SECONDS:g} s is not driven"
    return released.say(alarm(f"{description}: {stopped}"))


def still_free(state: State) -> bool:
    """Check whether the motion that is driven by hand is still free in the present world."""
    drive = state.drive
    if drive.joint is None:
        return True
    return bool(world_by_hand(state).motion_valid(state.q, _with(state.q, drive.joint, drive.goal)))


# --- how the arm is driven -------------------------------------------------------------------------------------------


def begins(state: State, verb: str, number: float) -> tuple[State, bool]:
    """Register the press of a command; a new press first stops what was driven before.

    Returns:
        The state, and whether the press is new.
    """
    if state.press.is_of(verb, number):
        return state, False
    return replace(state.at_rest(), press=Press(verb, number)), True


def pace(means: Means, state: State) -> float:
    """Return the share of the joints' rates at which the pilot can still react in time.

    At this share no joint moves farther than its tolerance (a degree, or 2 mm) during the delay of the pilot's page.
    """
    sight = state.sight
    if sight is None or sight.state <= 0.0:
        return state.speed
    return min(state.speed, float((slack_of(means.robot) / (sight.state * means.rates)).min()))


def lead_to(means: Means, state: State, point: Vector, share: float) -> State:
    """Send all joints towards a set point, so that they would arrive together; it is ahead by its `leash` at most.

    Args:
        means: What the session works with.
        state: Present state.
        point: Set point, shape (dof,) [rad or m].
        share: Share of the joints' rates, above 0 and up to 1.
    """
    before = state if state.drive.joint is None else state.at_rest()
    led = replace(before, drive=before.drive.led(state.time))

    to_go = np.abs(point - state.q)
    seconds = float((to_go / (share * means.rates)).max())
    return led.do(SetPoint(point, to_go / max(seconds, MIN_SECONDS)))


def _drive(means: Means, state: State, joint: int, goal: float, share: float, at_goal: Answer) -> State:
    """Move one joint a step towards a goal; at the goal, stop it and give the answer ``at_goal``.

    Args:
        means: What the session works with.
        state: Present state.
        joint: Number of the joint.
        goal: Value at which the drive ends [rad or m].
        share: Share of the present speed.
        at_goal: Answer once the joint has arrived.
    """
    value = float(state.q[joint])
    if abs(goal - value) <= state.press.near:
        return state.released().say(at_goal)

    speed = max(min(state.speed * share, pace(means, state)), 1e-3)
    speeds = np.zeros(means.robot.dof)
    speeds[joint] = speed * means.rates[joint]
    if not state.drive.goes_on_to(joint, goal):
        rested = state.at_rest()
        state = replace(rested, drive=rested.drive.begun(value, state.time))

    lead = float(leash(speeds, means.rates)[joint])
    drive = state.drive.on(joint, goal, float(speeds[joint]), lead, value, state.time)

    driven = replace(state, drive=drive).do(SetPoint(_with(state.q, joint, drive.point), speeds, joint))
    return driven.say(news(f"driving {means.robot.joint_names[joint]}"))


def _with(q: Vector, joint: int, value: float) -> Vector:
    changed = q.copy()
    changed[joint] = value
    return frozen(changed)


def _place(robot: Robot, joint: int, value: float) -> str:
    number, unit = reading(value, joint_unit(robot.prismatic[joint]))
    return f"{robot.joint_names[joint]} to {number:.4g} {unit}"


VERBS = {
    "jog": Verb(jog, present=True, held=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "move": Verb(move, present=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "go": Verb(go, present=True, held=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "next": Verb(
        make_next,
        present=True,
        held=True,
        guided=True,
        modes=(FOLLOWING,),
        otherwise="no route is being followed; 'plan' and 'accept' one first",
    ),
    "release": Verb(release),
    "speed": Verb(set_speed),
}
