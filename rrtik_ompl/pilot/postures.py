"""Routes to named postures: those of the robot, such as "stowed", that of the begin, and those that a pilot keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from rrtik_ompl.base.arrays import Vector, frozen
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.pilot import guide
from rrtik_ompl.pilot.events import FindRoute, Read, Stop, news, refused
from rrtik_ompl.pilot.interlock import BY_HAND, ON_A_ROUTE, Verb
from rrtik_ompl.pilot.routes.follower import MADE
from rrtik_ompl.pilot.routes.route import Route, route_to
from rrtik_ompl.pilot.routes.route_search import NoRoute
from rrtik_ompl.pilot.state import Means, State

STOW = "stow"  # postures whose names begin so come first
MAX_KEPT = 9


def named_postures(means: Means, state: State) -> Mapping[str, Vector]:
    """Return all postures that a route may lead to, shape (dof,) each, in the order in which they are offered."""
    of_robot = means.robot.postures
    first = {name: q for name, q in of_robot.items() if name.startswith(STOW)}
    return first | dict(state.kept) | {name: q for name, q in of_robot.items() if name not in first}


def posture(means: Means, state: State, name: str) -> State:
    """Propose a route to a named posture, with what is held; the chosen grasp is left."""
    postures = named_postures(means, state)
    if name not in postures:
        raise UnknownNameError("posture", name, postures)
    return state.do(Stop(), Read(partial(_search, name=name, goal=postures[name])))


def _search(means: Means, state: State, q: Vector, *, name: str, goal: Vector) -> State:
    """Request a route from the configuration that was just read, on which nothing may be touched."""
    at_reading = replace(state, q=frozen(q))
    if np.abs(goal - q).max() <= MADE:
        return at_reading.say(news(f"the arm is at '{name}'"))

    world = state.around.world_at(q, None)
    search = partial(route_to, world, at_reading.q, goal, means.rates, means.seed)
    return at_reading.do(FindRoute(search, partial(_found, name=name)))


def _found(means: Means, state: State, found: Route | NoRoute, *, name: str) -> State:
    if isinstance(found, NoRoute):
        return state.say(refused(f"no route to '{name}': {found}"))
    proposal = guide.proposed(means, replace(state, choice=None), found)
    return proposal.say(news(f"to '{name}': {proposal.answer.text}"))


def keep(_: Means, state: State) -> State:
    """Keep the present posture until the session ends, so that a route may lead back to it."""
    kept = len(state.kept)
    if kept > MAX_KEPT:
        raise InputError(f"{MAX_KEPT} postures are kept already")
    name = f"posture {kept}"
    return replace(state, kept={**state.kept, name: state.q}).say(news(f"kept as '{name}'"))


VERBS = {
    "posture": Verb(posture, present=True, guided=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
    "keep": Verb(keep, present=True, modes=BY_HAND, otherwise=ON_A_ROUTE),
}
