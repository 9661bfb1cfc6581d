"""Derive information from a state: what is known or out of view, and which grasps and joint ranges are possible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rrtik_ompl.pilot.interlock import Knowledge
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, Lamp
from rrtik_ompl.pilot.routes.manoeuvre import JointRange
from rrtik_ompl.pilot.state import Means, State
from rrtik_ompl.world.world import World


def known(means: Means, state: State) -> Knowledge:
    """Return what is known at present of the arm and of the picture."""
    return Knowledge(
        state.arm_lost,
        state.time - state.pictures.time,
        means.past,
        state.check.off,
        state.pictures.unusable,
        state.fault,
        state.stopped,
        state.arm_fault,
        state.arm_age,
        state.sight,
        out_of_view(means, state),
    )


def out_of_view(means: Means, state: State) -> str:
    """Return, in words, which object that the world depends on has been out of view for too long; "" if none has."""
    if means.past or means.patience == np.inf or state.pictures.time == -np.inf:
        return ""
    for name in state.around.basis:
        if name not in state.pictures.seen_at:
            return f"'{name}' was not seen yet"
        seconds = unseen_for(state, name)
        if seconds > means.patience:
            return f"'{name}' has not been in view for {seconds:.0f} s"
    return ""


def unseen_for(state: State, name: str) -> float:
    """Return how long an object has been out of view at the time of the last picture [s]."""
    pictures = state.pictures
    return max(pictures.time - pictures.seen_at.get(name, pictures.time), 0.0)


def world_by_hand(state: State) -> World:
    """Return the world for moves by hand, in which the gripper may touch the target while it is in contact with it."""
    return state.around.world_at(state.q, state.target)


def lamps(means: Means, state: State) -> tuple[Lamp, ...]:
    """Return the lamps of the chosen object from the present configuration.

    Green lamps become amber while an object that routes depend on is out of view.
    """
    found = means.feasibility.lamps(state.around, state.target, state.q)

    unseen = out_of_view(means, state)
    if not unseen:
        return found
    return tuple(replace(each, color=AMBER, reason=unseen) if each.color == GREEN else each for each in found)


def chosen_lamp(means: Means, state: State) -> Lamp | None:
    """Return the lamp of the chosen grasp; None if no grasp is chosen."""
    return next((lamp for lamp in lamps(means, state) if (lamp.type, lamp.level) == state.choice), None)


def grasp_fault(means: Means, state: State) -> str:
    """Return why the chosen grasp cannot be made: how far it is out of reach, or which pair touches; "" if it can."""
    lamp = chosen_lamp(means, state)
    if lamp is None:
        return ""
    return out_of_view(means, state) or means.feasibility.fault(state.around, str(state.target), lamp, state.q)


def joint_range(means: Means, state: State) -> JointRange:
    """Return the range within which the selected joint can be driven now."""
    return means.feasibility.joint_range(state.around, world_by_hand(state), state.q, state.selected)
