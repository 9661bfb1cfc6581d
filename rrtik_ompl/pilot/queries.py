"""What follows from a state: what is known or out of view, which grasps can be reached, how far a joint can go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rrtik_ompl.pilot.interlock import Knowledge
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, Lamp
from rrtik_ompl.pilot.routes.manoeuvre import JointRange
from rrtik_ompl.pilot.state import Means, State
from rrtik_ompl.world.world import World


def known(means: Means, state: State) -> Knowledge:
    """What is known now of the arm and of the picture."""
    return Knowledge(
        state.arm_lost,
        state.time - state.pictures.time,
        means.past,
        state.check.off,
        state.pictures.unusable,
        state.fault,
        state.sight,
        out_of_view(means, state),
    )


def out_of_view(means: Means, state: State) -> str:
    """What the world stands on and was not seen for longer than patience allows, in words; "" if nothing."""
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
    """For how long an object has not been in view, by the pictures taken since [s]."""
    pictures = state.pictures
    return max(pictures.time - pictures.seen_at.get(name, pictures.time), 0.0)


def world_by_hand(state: State) -> World:
    """The world for moves by hand: the gripper may touch what it holds, as long as it does."""
    return state.around.world_at(state.q, state.target)


def lamps(means: Means, state: State) -> tuple[Lamp, ...]:
    """Lamps of the chosen object where it is and for where the arm is; none is green if no route can be led."""
    found = means.feasibility.lamps(state.around, state.target, state.q)

    unseen = out_of_view(means, state)
    if not unseen:
        return found
    return tuple(replace(each, color=AMBER, reason=unseen) if each.color == GREEN else each for each in found)


def chosen_lamp(means: Means, state: State) -> Lamp | None:
    """The lamp of the grasp that is chosen."""
    return next((lamp for lamp in lamps(means, state) if (lamp.type, lamp.level) == state.choice), None)


def grasp_fault(means: Means, state: State) -> str:
    """What is wrong with the grasp that is chosen: by how much it is out of reach, what touches; "" if nothing."""
    lamp = chosen_lamp(means, state)
    if lamp is None:
        return ""
    return out_of_view(means, state) or means.feasibility.fault(state.around, str(state.target), lamp, state.q)


def joint_range(means: Means, state: State) -> JointRange:
    """The range in which the selected joint can be driven now."""
    return means.feasibility.joint_range(state.around, world_by_hand(state), state.q, state.selected)
