"""Commands of the gripper: open, close and lift. A held object is part of the arm until it is released.

Source: [1, ch. 4 and 6.2.2] (augmented manipulation, pick and place).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import apart
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.pilot import guide
from rrtik_ompl.pilot.events import FindRoute, Grip, Stop, alarm, news, refused
from rrtik_ompl.pilot.interlock import BY_HAND, MANOEUVRE, ON_A_ROUTE, Verb
from rrtik_ompl.pilot.routes.route import Route, route_to
from rrtik_ompl.pilot.routes.route_search import NoRoute
from rrtik_ompl.pilot.state import Gripper, Means, State
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.world.world import World

REACH = 0.015  # [m]; a gripper that closes this near to a grasp holds the object
TURN = np.deg2rad(10.0)  # and its orientation differs from that of the grasp by no more than this
LIFT_SECONDS = 0.2  # time limit of inverse kinematics for the end of a lift
NOTHING = "closed; nothing is between the fingers"


def refusal(verb: Verb, state: State) -> str:
    """Return why a command must not move the arm in the present state of the gripper; "" if it may."""
    fixed = state.gripper.fixed
    if fixed and verb.present and not verb.gripping:
        return f"refused: the gripper is closed on '{fixed}', which is fixed; open it first"
    return ""


def close(_: Means, state: State) -> State:
    """Close the gripper; if it is at a grasp of an object, it holds this object from now on."""
    if state.gripper.closed:
        return state.say(refused("the gripper is closed already"))
    return state.do(Stop(), Grip(True, _closed))


def _closed(means: Means, state: State, q: Vector) -> State:
    """Hold the object at the nearest grasp within `REACH` and `TURN` of the tip.

    A loose object becomes part of the arm. An object that cannot be carried only locks the arm until the gripper
    opens.
    """
    after = replace(state, q=frozen(q), gripper=replace(state.gripper, closed=True))

    tip = means.robot.fk(after.q)
    grasp_errors = sorted(
        ((apart(tip, pose), seen, lift) for seen, lift, pose in _grasps(after.around)), key=lambda grasp: grasp[0][0]
    )

    if not grasp_errors:
        return after.say(refused(NOTHING))
    at_grasp = next((grasp for grasp in grasp_errors if _within(grasp[0])), None)
    if at_grasp is None:
        distance, turn = grasp_errors[0][0]
        how_far = f"{1e3 * distance:.0f} mm and {np.rad2deg(turn):.0f} deg away"
        return after.say(refused(f"{NOTHING}; the nearest grasp is {how_far}"))

    _, seen, lift = at_grasp
    name = seen.object.name

    if not seen.object.loose:
        return replace(after, gripper=Gripper(True, name, lift)).say(news(f"closed on {name}"))

    surroundings = after.around.hold(seen, tip.actInv(seen.T_base_object), after.q)
    contact_texts = "".join(f"; {contact} until they part" for contact in surroundings.rests)

    holding = replace(
        guide.leave(after),
        around=surroundings,
        target=None,
        choice=None,
        mode=MANOEUVRE,
        gripper=replace(after.gripper, lift=lift),
    )
    return holding.say(news(f"closed: {name} is held{contact_texts}; 'lift' takes it up, or choose where it goes"))


def open_hand(_: Means, state: State) -> State:
    """Open the gripper; a held object stays where it is."""
    if not state.gripper.closed:
        return state.say(refused("the gripper is open already"))
    return state.do(Stop(), Grip(False, _opened))


def _opened(means: Means, state: State, q: Vector) -> State:
    """Release the held object at its present pose, and warn if it is left deep inside an obstacle."""
    after = replace(state, q=frozen(q), gripper=replace(state.gripper, closed=False, fixed=""))

    name = after.holds
    if not name:
        return after.say(news("open"))

    left_inside = after.around.left_inside(after.q)
    surroundings = after.around.release(means.robot.fk(after.q))
    left = replace(guide.leave(after), around=surroundings, target=name, choice=None, mode=MANOEUVRE)
    return left.say(alarm(f"open: {left_inside}") if left_inside else news(f"open: {name} is put down"))


def lift(means: Means, state: State) -> State:
    """Propose a route that lifts the held object straight up from its present pose."""
    if not state.holds:
        raise InputError("nothing is held; close the gripper at a grasp first")

    tip = means.robot.fk(state.q)
    goal = pin.SE3(tip.rotation, tip.translation + np.array([0.0, 0.0, state.gripper.lift]))
    world = state.around.world_at(state.q, None)

    search = partial(_route_up, means, world, state.q, goal, state.holds)
    return state.do(FindRoute(search, _lifted))


def _route_up(means: Means, world: World, q: Vector, goal: pin.SE3, name: str) -> Route | NoRoute:
    """Return a route to a pose of the tip, or the reason why it cannot be reached and what the pilot can do."""
    result = solve_ik(means.robot, PoseGoal(goal), near=q, world=world, seconds=LIFT_SECONDS)
    if not result.found:
        why = result.detail or result.reason
        return NoRoute(f"{why}; choose where {name} goes, or drive the arm")

    return route_to(world, q, result.solutions[0], means.rates, means.seed)


def _lifted(means: Means, state: State, made: Route | NoRoute) -> State:
    if isinstance(made, NoRoute):
        return state.say(refused(f"no lift: {made}"))
    return guide.proposed(means, state, made)


def _grasps(surroundings: Surroundings) -> list[tuple[SeenObject, float, pin.SE3]]:
    """Return all grasps of all objects seen, as tuples of the object, the height of its lift [m] and ``T_base_tip``."""
    return [
        (seen, grasp.lift, seen.grasp_pose(grasp.name, level))
        for seen in surroundings.seen
        for grasp in seen.object.grasps
        for level in range(len(grasp.levels))
    ]


def _within(off: tuple[float, float]) -> bool:
    return off[0] <= REACH and off[1] <= TURN


VERBS = {
    "close": Verb(close, present=True, gripping=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "open": Verb(open_hand, present=True, gripping=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "lift": Verb(lift, present=True, guided=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
}
