"""Commands of a guided route: propose, accept, follow move by move, and withdraw it when it is no longer free.

Source: [1, ch. 6].
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.events import FindRoute, Read, Stop, alarm, news, refused
from rrtik_ompl.pilot.interlock import CHOOSING, FOLLOWING, MANOEUVRE, PROPOSED, Verb
from rrtik_ompl.pilot.queries import grasp_fault, world_by_hand
from rrtik_ompl.pilot.routes.follower import Follower, Track, path_fault
from rrtik_ompl.pilot.routes.manoeuvre import escape_advice
from rrtik_ompl.pilot.routes.route import MAX_END_OFFSET, MAX_END_TURN, Route, all_at_once, propose
from rrtik_ompl.pilot.routes.route_search import NoRoute
from rrtik_ompl.pilot.state import Means, State, Way
from rrtik_ompl.pilot.surroundings import MAX_SHIFT, MAX_TURN
from rrtik_ompl.sensing.scene_from_view import SeenObject

WITHDRAWN = "the route is withdrawn: {}; 'replan' finds another"
MADE = "all moves are done"


# --- commands --------------------------------------------------------------------------------------------------------


def plan(_: Means, state: State) -> State:
    """Propose a route from the present configuration; the arm is stopped and read first."""
    return state.do(Stop(), Read(_search))


def _search(means: Means, state: State, q: Vector) -> State:
    """Request a route to the chosen grasp, or to the problem's goal, from the configuration that was just read."""
    at_reading = replace(state, q=frozen(q))
    surroundings = state.around
    lamp = means.feasibility.patient_lamp(surroundings, state.target, state.choice, at_reading.q)
    search = partial(propose, means.problem, surroundings, state.target, lamp, at_reading.q, means.rates, means.seed)
    return at_reading.do(FindRoute(search, _planned))


def _planned(means: Means, state: State, found: Route | NoRoute) -> State:
    """Propose the route that was found, or say why there is none and what the pilot can do."""
    if isinstance(found, NoRoute):
        without_route = leave(state)
        otherwise = "choose another grasp" if without_route.choice else "drive the arm elsewhere, or choose an object"
        advice = escape_advice(world_by_hand(without_route), without_route.q) or otherwise
        return without_route.say(refused(f"no route: {grasp_fault(means, without_route) or found}; {advice}"))
    target_seen = state.around.named(state.target) if state.target and state.choice else None

    proposal = proposed(means, state, found, target_seen)
    if target_seen is None:
        return proposal
    return proposal.say(news(proposal.answer.text + proposal.around.not_compared(target_seen.object.name)))


def proposed(means: Means, state: State, route: Route, aimed: SeenObject | None = None) -> State:
    """Return the state in which a route that begins at the present configuration is proposed.

    Args:
        means: What the session works with.
        state: Present state.
        route: The route.
        aimed: The object that the route leads to. The route is withdrawn when this object has moved; None for no
            object.
    """
    kind = Track if route.together else Follower
    list_of_moves = state.way.list_of_moves if route.together else route

    way = Way(route, kind(route.path, means.rates), list_of_moves=list_of_moves, aimed=aimed)
    made = replace(state, way=way, mode=PROPOSED, desired=frozen(route.path.end))
    return made.say(news(route.summary() + "; 'accept' or 'reject'"))


def together(means: Means, state: State) -> State:
    """Propose the same route with all joints at once; if it is shown so already, propose the list of moves again."""
    route = state.way.route
    list_of_moves = state.way.list_of_moves
    if route is None or list_of_moves is None:
        raise InputError("there is no route; 'plan' proposes one")

    if route.together:
        return proposed(means, state, list_of_moves, state.way.aimed)

    search = partial(all_at_once, route, world_by_hand(state), means.rates, means.seed)
    return state.do(FindRoute(search, _put_together))


def _put_together(means: Means, state: State, route: Route | NoRoute) -> State:
    if isinstance(route, NoRoute):
        return state.say(refused(f"no route {route}"))
    return proposed(means, state, route, state.way.aimed)


def accept(_: Means, state: State) -> State:
    """Follow the proposed route, if the arm is at its start and the route is still free."""
    if state.way.follower is None:
        raise InputError("there is no route to accept; 'plan' proposes one")

    follower, progress = state.way.follower.update(state.q)
    updated = state.on_its_way(follower=follower)
    if progress.advice == "lost":
        message = f"the arm is not where the route starts: {progress.fault}"
        return updated.say(refused(f"{message}; 'replan' starts it from here"))

    if fault := fault_of_rest(updated):
        return withdrawn(updated, fault)

    accepted = replace(updated.on_its_way(progress=progress, withdrawn=""), mode=FOLLOWING)
    return show_due(accepted).say(news("accepted; hold 'next' to make the next move"))


def reject(_: Means, state: State) -> State:
    """Discard the route that is proposed or followed."""
    return replace(leave(state.do(Stop())), desired=state.q).say(news("rejected"))


def back(means: Means, state: State) -> State:
    """Propose the way back: the moves made so far, in reverse."""
    if state.way.follower is None:
        raise InputError("there is no route to go back on")

    reverse = type(state.way.follower)(state.way.follower.back(state.q), means.rates)
    moves = len(reverse.moves)
    how = f"{moves} moves" if moves else "all joints at once"

    made = state.do(Stop()).on_its_way(follower=reverse, progress=None, withdrawn="", aimed=None)
    return replace(made, mode=PROPOSED).say(news(f"the way back: {how}; 'accept' or 'reject'"))


def settle(_: Means, state: State) -> State:
    """Treat the current move as completed although the arm does not reach its end exactly."""
    follower_before = state.way.follower
    if follower_before is None or follower_before.joint() is None:
        raise InputError("no move is due")

    passed, joint, remaining = follower_before.pass_on(state.q)
    follower, progress = passed.update(state.q)

    after = show_due(state.on_its_way(follower=follower, progress=progress))
    return after.say(refused(f"{joint} comes no nearer than {remaining} to its end; release, then hold 'next' again"))


# --- what happens meanwhile ------------------------------------------------------------------------------------------


def watch(means: Means, state: State) -> State:
    """Update the progress along the accepted route, and stop the arm if it is off the route."""
    follower_before = state.way.follower
    if follower_before is None or state.mode != FOLLOWING:
        return state

    follower, progress = follower_before.update(state.q)
    after = state.on_its_way(follower=follower, progress=progress)

    if progress.advice == "lost":
        stopped = after.stand_still()
        return stopped.say(alarm(f"off the route: {progress.fault}; 'replan' finds a new one from here"))
    if progress.advice == "done":
        return after if after.drive.active else _ended(means.robot, after, follower)
    if follower.current == follower_before.current:
        return after

    message = f"move {follower.current} of {len(follower.moves)} is done; 'next' makes the next"
    return show_due(after).say(news(message))


def _ended(robot: Robot, state: State, follower: Follower | Track) -> State:
    """End a completed route, and report whether the tip is where the route ends."""
    ended = replace(state, mode=MANOEUVRE)

    distance, turn = apart(robot.fk(follower.path.end), robot.fk(state.q))
    if distance <= MAX_END_OFFSET and turn <= MAX_END_TURN:
        return ended.say(news(MADE))

    how_far = f"{1e3 * distance:.1f} mm and {np.rad2deg(turn):.2f} deg"
    message = f"all moves are made, but the tip is {how_far} away from the end of the route; 'replan' may go nearer"
    return ended.say(refused(message))


def check(state: State) -> State:
    """Withdraw the route if a change of the scene has blocked it; announce when a withdrawn route is free again."""
    if state.way.follower is None or state.mode not in (FOLLOWING, PROPOSED):
        return state

    fault = fault_of_rest(state)
    if fault:
        stopped = replace(state.stand_still().on_its_way(withdrawn=fault), mode=PROPOSED)
        return stopped.say(alarm(WITHDRAWN.format(fault)))

    if not state.way.withdrawn:
        return state
    return state.on_its_way(withdrawn="").say(news("the route is free again; 'accept' follows it"))


# --- parts of both ---------------------------------------------------------------------------------------------------


def over(state: State, verb: str) -> str:
    """Return a message if the pilot asks for the next move of a route that is already completed; "" otherwise."""
    progress = state.way.progress
    ended = verb == "next" and state.mode in (MANOEUVRE, CHOOSING)
    return f"{MADE}; 'plan' proposes another route" if ended and progress and progress.advice == "done" else ""


def show_due(state: State) -> State:
    """Select the joint of the current move, and show the end of the move as the desired configuration."""
    follower = state.way.follower

    joint = None if follower is None else follower.joint()
    if follower is None or joint is None:
        return state
    return replace(state, desired=frozen(follower.target), selected=joint)


def withdrawn(state: State, fault: str) -> State:
    """Refuse to go on along a route whose remainder is no longer free, and propose it as withdrawn."""
    refusal = refused(WITHDRAWN.format(fault))
    return replace(state.released().on_its_way(withdrawn=fault), mode=PROPOSED).say(refusal)


def fault_of_rest(state: State) -> str:
    """Return why the remainder of the route must not be followed; "" if it may be.

    The route is refused if its target has moved, or if the remaining moves collide in the present world.
    """
    if state.way.follower is None:
        return ""
    if moved := _target_moved(state):
        return moved
    surroundings = state.around
    target = state.target
    is_grasping = target is not None and state.choice is not None and surroundings.named(target) is not None
    world = surroundings.holding(str(target)) if is_grasping else world_by_hand(state)
    return path_fault(world, state.way.follower.rest(state.q))


def _target_moved(state: State) -> str:
    """Return by how much the target has moved since the route was planned, in words; "" within the tolerance."""
    aimed = state.way.aimed
    seen_now = None if aimed is None else state.around.named(aimed.object.name)
    if aimed is None or seen_now is None:
        return ""

    distance, turn = apart(aimed.T_base_object, seen_now.T_base_object)
    if distance <= MAX_SHIFT and turn <= MAX_TURN:
        return ""

    how_far = f"{1e3 * distance:.0f} mm and {np.rad2deg(turn):.1f} deg"
    return f"{aimed.object.name} has moved by {how_far} since the route was planned"


def leave(state: State) -> State:
    """Discard the route; the chosen grasp stays chosen."""
    return replace(state, way=Way(), mode=CHOOSING if state.choice else MANOEUVRE)


VERBS = {
    "plan": Verb(plan, present=True, guided=True),
    "replan": Verb(plan, present=True, guided=True),
    "accept": Verb(
        accept,
        present=True,
        guided=True,
        modes=(PROPOSED,),
        otherwise="there is no route to accept; 'plan' proposes one",
    ),
    "reject": Verb(reject),
    "back": Verb(back, present=True, guided=True, gripping=True),
    "settle": Verb(settle, modes=(FOLLOWING,), otherwise="no route is being followed"),
    "together": Verb(
        together,
        present=True,
        guided=True,
        modes=(PROPOSED,),
        otherwise="there is no route that is proposed; 'plan' proposes one",
    ),
}
