"""Determine from the stages what is taken and set down: at the end of a motion, and too deep whatever is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Touching
from rrtik_ompl.planning.tip_motion import DEVIATION, TURN_DEVIATION
from rrtik_ompl.tasks.contact_life import (
    EXTRA_DEPTH,
    Nearness,
    allowed,
    joined_with,
    left_inside,
    signed_distance,
    touching_at,
)
from rrtik_ompl.tasks.program import Step, options_of
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, MoveTo, Straight
from rrtik_ompl.world.world import World


@dataclass(frozen=True, slots=True)
class Handled:
    """A thing that is taken or set down.

    Attributes:
        name: Name of the thing.
        by: Links that may touch it then; None if everything may.
    """

    name: str
    by: frozenset[str] | None


def handled(steps: Sequence[Step], robot: Robot) -> list[Handled]:
    """Return the things that may be taken or set down before the arm moves on, for any choice of alternatives."""
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
    """Return contacts that let the things that are taken or set down next touch all that they may touch."""
    bodies = world.bodies
    names = {(bodies[i].name, bodies[j].name) for i, j in world.pairs}
    contact_of_pair: dict[frozenset[str], Touching] = {}
    for thing in handled(steps, world.robot):
        for pair in map(frozenset, names):
            other = next(iter(pair - {thing.name}), None)
            if thing.name in pair and other is not None and (thing.by is None or other in thing.by):
                contact_of_pair[pair] = allowed(bodies, thing.name, other)
    return sorted(contact_of_pair.values(), key=lambda contact: contact.names)


@dataclass(frozen=True, slots=True)
class Arrival:
    """What touches where things are taken or set down.

    Attributes:
        contacts: The contacts, without those too deep.
        fault: Why something would be set down too deep inside another; "" if nothing would.
    """

    contacts: tuple[Touching, ...]
    fault: str = ""


def arrival(world: World, steps: Sequence[Step], q: Vector) -> Arrival:
    """Return what touches where things are taken or set down at q, shape (dof,)."""
    obstacle_names = frozenset(world.scene.names)
    contact_of_pair: dict[frozenset[str], Touching] = {}
    faults = []
    for thing in handled(steps, world.robot):
        near = [each for each in touching_at(world, q, thing.name) if thing.by is None or each.second in thing.by]
        contact_of_pair |= {each.pair: each.arriving() for each in near if not each.too_deep}
        if thing.by is None:
            faults += [left_inside(each) for each in near if each.second in obstacle_names and each.too_deep]
    return Arrival(tuple(contact_of_pair.values()), faults[0] if faults else "")


@dataclass(frozen=True, slots=True)
class Tip:
    """A pose of the tip, and how far from it the tip may be [m] and how far it may be turned [rad]."""

    pose: pin.SE3
    away: float = 0.0
    turned: float = 0.0


def never_set_down(steps: Sequence[Step], world: World, q: Vector) -> str:
    """Return why a stage can never set down what it holds, as the place is too deep inside an obstacle; "" if it may.

    Only certain faults are reported: the prediction ends where the pose of the tip is unknown, and at alternatives.

    Args:
        steps: Steps of the task.
        world: The world at its beginning.
        q: Configuration at its beginning, shape (dof,).
    """
    tip: Tip | None = Tip(world.robot.fk(q))
    grasps: dict[str, Tip] = {}
    moved_before = {held.name for held in world.scene.attached}

    for step in steps:
        stage = step.stage
        if isinstance(stage, Alternatives):
            return ""
        if isinstance(stage, MoveTo):
            tip = _reached(stage, world)
        elif isinstance(stage, Straight) and tip is not None:
            tip = Tip(stage.goal(tip.pose), tip.away + DEVIATION, tip.turned + TURN_DEVIATION)
        elif isinstance(stage, Attach):
            already_moved = stage.object in moved_before
            if tip is not None and not already_moved and world.robot.tip in joined_with(world.robot, stage.link):
                pose = tip.pose.actInv(world.scene.obstacle(stage.object).pose)
                grasps[stage.object] = replace(tip, pose=pose)
            moved_before.add(stage.object)
        elif isinstance(stage, Detach):
            grasp = grasps.pop(stage.object, None)
            fault = "" if tip is None or grasp is None else _too_deep(world, q, stage.object, tip, grasp, moved_before)
            if fault:
                return f"{step} failed: {fault}"
    return ""


def _reached(stage: MoveTo, world: World) -> Tip | None:
    """Return the pose of the tip after a motion; None if several poses are possible."""
    goal = stage.goal
    if isinstance(goal, Target) and goal.oriented:
        return Tip(goal.pose, *goal.tolerances)
    if isinstance(goal, str):
        return Tip(world.robot.fk(world.robot.posture(goal)))
    return Tip(world.robot.fk(goal)) if isinstance(goal, np.ndarray) else None


def _too_deep(world: World, q: Vector, name: str, tip: Tip, grasp: Tip, moved_before: set[str]) -> str:
    """Return a message if a thing would certainly be left too deep inside an unmoved obstacle; "" otherwise.

    The thing's place is uncertain by the tolerances of the tip when it was grasped and when it is set down.

    Args:
        world: The world at the beginning of the task.
        q: Configuration at its beginning, shape (dof,).
        name: Name of the thing.
        tip: Pose of the tip when the thing is set down.
        grasp: Pose of the thing in the frame of the tip, with the tolerances of the tip at the grasp.
        moved_before: Names of all things that may have moved.
    """
    frames = world.robot.joint_frames(q[None])[0]
    pose = tip.pose * grasp.pose
    allowed_pairs = {frozenset(pair) for pair in world.scene.allowed_collisions}
    not_allowed = {each.name for each in world.scene.obstacles if frozenset((name, each.name)) not in allowed_pairs}
    names_of_others = not_allowed - moved_before
    grasp_length = float(np.linalg.norm(grasp.pose.translation))
    shift = pose * world.scene.obstacle(name).pose.inverse()

    for part in (body for body in world.bodies if body.name == name):
        reach = grasp_length + float(np.linalg.norm(_centre(world, part, name)) + part.geometry.aabb_radius)
        uncertainty = tip.away + grasp.away + (tip.turned + grasp.turned) * reach
        placed_body = replace(part, placement=shift * part.placement)
        for other in (body for body in world.bodies if body.name in names_of_others):
            gap = signed_distance(world.robot, (placed_body, other), q, frames)
            if gap < -EXTRA_DEPTH - uncertainty:
                return left_inside(Nearness(name, other.name, gap, EXTRA_DEPTH))
    return ""


def _centre(world: World, body: Body, name: str) -> Vector:
    """Return the centre of a body's bounding box in the frame of the obstacle that it is part of [m], shape (3,)."""
    placement = world.scene.obstacle(name).pose.actInv(body.placement)
    return np.array(placement.act(np.array(body.geometry.aabb_center)))
