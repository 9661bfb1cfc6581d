"""What is taken and set down where a motion ends: read from the stages that follow it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Touching
from rrtik_ompl.tasks.contact_life import allowed, joined_with, left_inside, touching_at
from rrtik_ompl.tasks.program import Step, options_of
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, MoveTo, Straight
from rrtik_ompl.world.world import World


@dataclass(frozen=True, slots=True)
class Handled:
    """A thing that is taken or set down. ``by``: the links that may touch it then; None if all that it may meet may."""

    name: str
    by: frozenset[str] | None


def handled(steps: Sequence[Step], robot: Robot) -> list[Handled]:
    """What may be taken and set down before the arm moves on, whatever is chosen."""
    things: list[Handled] = []
    for place, step in enumerate(steps):
        stage = step.stage
        if isinstance(stage, MoveTo | Straight):
            break
        if isinstance(stage, Alternatives):
            for row in options_of(step):
                things += handled((*row, *steps[place + 1 :]), robot)
            break
        if isinstance(stage, Attach):
            things.append(Handled(stage.object, joined_with(robot, stage.link) | frozenset(stage.allow)))
        elif isinstance(stage, Detach):
            things.append(Handled(stage.object, None))
    return list(dict.fromkeys(things))


def may_touch(world: World, steps: Sequence[Step]) -> list[Touching]:
    """Contacts that would let what is taken or set down next touch all that it may touch there."""
    contact_of_pair: dict[frozenset[str], Touching] = {}
    for thing in handled(steps, world.robot):
        for pair in {frozenset(world.bodies[k].name for k in numbers) for numbers in world.pairs}:
            other = next(iter(pair - {thing.name}), None)
            if thing.name in pair and other is not None and (thing.by is None or other in thing.by):
                contact_of_pair[pair] = allowed(world.bodies, thing.name, other)
    return sorted(contact_of_pair.values(), key=lambda contact: contact.names)


def fault_of_setting_down(world: World, steps: Sequence[Step], q: Vector) -> str:
    """Why something cannot be set down at q, shape (dof,), because of its depth; "" if it can."""
    obstacle_names = frozenset(world.scene.names)
    for thing in handled(steps, world.robot):
        for near in touching_at(world, q, thing.name) if thing.by is None else ():
            if near.second in obstacle_names and near.too_deep:
                return left_inside(near)
    return ""


def contacts_on_arrival(world: World, steps: Sequence[Step], q: Vector) -> tuple[Touching, ...]:
    """The contacts of what is taken or set down at q, shape (dof,); none where it would be deeper than it may be."""
    contact_of_pair: dict[frozenset[str], Touching] = {}
    for thing in handled(steps, world.robot):
        near = (each for each in touching_at(world, q, thing.name) if thing.by is None or each.second in thing.by)
        contact_of_pair |= {each.pair: each.arriving() for each in near if not each.too_deep}
    return tuple(contact_of_pair.values())
