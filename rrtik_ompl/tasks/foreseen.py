"""What a task sets down too deep whatever is chosen, known from its stages before anything is searched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.model.goal import Target
from rrtik_ompl.planning.tip_motion import DEVIATION, TURN_DEVIATION
from rrtik_ompl.tasks.contact_life import DEEPER, Nearness, joined_with, left_inside, signed_distance
from rrtik_ompl.tasks.program import Step
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, MoveTo, Straight
from rrtik_ompl.world.world import World


@dataclass(frozen=True, slots=True)
class Tip:
    """Where the tip is, and how far it may be from there [m] and turned [rad]."""

    pose: pin.SE3
    away: float = 0.0
    turned: float = 0.0


def never_set_down(steps: Sequence[Step], world: World, q: Vector) -> str:
    """Why a stage can never set down what it holds: the place is too deep inside an obstacle; "" if nothing says so.

    Only what is sure is said: poses of the tip that are not known, and alternatives, end the look ahead.

    Args:
        steps: Of the task.
        world: At its beginning.
        q: Where the arm begins, shape (dof,).
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
    """Where the tip is after a motion; None if several places are possible."""
    goal = stage.goal
    if isinstance(goal, Target) and goal.oriented:
        return Tip(goal.pose, *goal.tolerances)
    if isinstance(goal, str):
        return Tip(world.robot.fk(world.robot.posture(goal)))
    return Tip(world.robot.fk(goal)) if isinstance(goal, np.ndarray) else None


def _too_deep(world: World, q: Vector, name: str, tip: Tip, grasp: Tip, moved_before: set[str]) -> str:
    """Says how deep a thing would be left inside an obstacle that nothing has moved, if that is sure."""
    frames = world.robot.joint_frames(q[None])[0]
    pose = tip.pose * grasp.pose
    allowed = {frozenset(pair) for pair in world.scene.allowed_collisions}
    not_allowed = {each.name for each in world.scene.obstacles if frozenset((name, each.name)) not in allowed}
    names_of_others = not_allowed - moved_before
    grasp_length = float(np.linalg.norm(grasp.pose.translation))
    shift = pose * world.scene.obstacle(name).pose.inverse()

    for part in (body for body in world.bodies if body.name == name):
        reach = grasp_length + float(np.linalg.norm(_centre(world, part, name)) + part.geometry.aabb_radius)
        uncertainty = tip.away + grasp.away + (tip.turned + grasp.turned) * reach
        placed_body = replace(part, placement=shift * part.placement)
        for other in (body for body in world.bodies if body.name in names_of_others):
            gap = signed_distance(world.robot, (placed_body, other), q, frames)
            if gap < -DEEPER - uncertainty:
                return left_inside(Nearness(name, other.name, gap, DEEPER))
    return ""


def _centre(world: World, body: Body, name: str) -> Vector:
    """Of the box around a body, as seen from the frame of the obstacle that it is part of [m], shape (3,)."""
    placement = world.scene.obstacle(name).pose.actInv(body.placement)
    return np.array(placement.act(np.array(body.geometry.aabb_center)))
