"""Bound how far any point of the arm can move when joints move [16]; the bounds give the steps of motion checks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.model.robot import Robot


def displacement_weights(robot: Robot, bodies: Iterable[Body]) -> Vector:
    """Return weights w such that no point of the arm moves farther than ``w @ |b - a|`` [m] from configuration a to b.

    The bound is the sum of the joints' contributions, so it holds for straight-line motion in configuration space. The
    tip counts as a point of the arm.

    Returns:
        The weights [m per rad, or 1 for prismatic joints], shape (dof,).
    """
    # Each joint's reach is that of the body it moves farthest.
    weights = np.max([_tip_weights(robot), *(_body_weights(robot, body) for body in bodies)], axis=0)
    return frozen(np.abs(robot.chain.gain).T @ weights)


def approach_weights(robot: Robot, bodies: Sequence[Body], pairs: Sequence[tuple[int, int]]) -> Matrix:
    """Return weights w, shape (pairs, dof): two bodies come nearer by at most ``w @ |b - a|`` [m] between a and b.

    A joint that carries both bodies moves them as one, so it has weight 0.
    """
    weights_of_body = np.zeros((len(bodies), len(robot.chain.parent)))
    for k, body in enumerate(bodies):
        if body.joint > 0:
            weights_of_body[k] = _body_weights(robot, body)

    first, second = weights_of_body[np.array(pairs, dtype=np.int64).reshape(-1, 2).T]
    return frozen(np.where((first > 0.0) & (second > 0.0), 0.0, first + second) @ np.abs(robot.chain.gain))


@kept_with
def _tip_weights(robot: Robot) -> Vector:
    """Return the `joint_weights` of the tip."""
    tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
    return frozen(joint_weights(robot, tip.parentJoint, tip.placement.translation, 0.0))


@kept_with
def _body_weights(robot: Robot, body: Body) -> Vector:
    """Return the `joint_weights` of a ball around a body; cached, as all worlds of a robot share its links' bodies."""
    geometry = body.geometry
    return frozen(joint_weights(robot, body.joint, body.placement.act(geometry.aabb_center), geometry.aabb_radius))


def joint_weights(robot: Robot, joint: int, centre: Vector, radius: float) -> Vector:
    """Return for each joint how far a point of a ball moves at most per unit of the joint, shape (joints,).

    For a revolute joint this is the largest distance that a point of the ball can have from its axis in any
    configuration; for a prismatic joint it is 1, and for a joint that does not carry the ball 0. The distances are
    propagated from the ball to the base: each is bounded by the length of the child's offset plus the reach beyond the
    child.

    Args:
        robot: The robot.
        joint: Number of the joint that carries the ball, from 1 on; 0 for the base.
        centre: Its centre in the joint's frame [m], shape (3,).
        radius: Its radius [m].
    """
    chain = robot.chain
    levers = _levers(robot)
    weights = np.zeros(len(levers))
    row = joint - 1
    if row < 0:
        return weights

    around_origin = float(np.linalg.norm(centre)) + radius
    around_axis = _from_axis(centre, chain.axis[row]) + radius
    while True:
        lever = levers[row]
        weights[row] = 1.0 if lever.slides else around_axis
        if lever.parent < 0:
            return weights
        reach = around_origin + lever.stroke
        around_origin = lever.length + reach
        around_axis = lever.from_axis + reach
        row = lever.parent


class _Lever(NamedTuple):
    """What a joint adds to the reach of what it carries.

    Attributes:
        parent: Row of the joint before; negative if there is none.
        slides: Whether the joint is prismatic.
        stroke: Its largest distance from its zero position if it is, else 0 [m].
        length: Distance of its origin from that of the joint before [m].
        from_axis: Distance of its origin from the axis of the joint before [m].
    """

    parent: int
    slides: bool
    stroke: float
    length: float
    from_axis: float


@kept_with
def _levers(robot: Robot) -> tuple[_Lever, ...]:
    """Return the lever of each joint of the chain."""
    chain = robot.chain
    levers = []
    for row, parent in enumerate(chain.parent.tolist()):
        origin = chain.placement[row][:3, 3]
        slides = bool(chain.prismatic[row])
        stroke = _stroke(robot, row) if slides else 0.0
        from_axis = _from_axis(origin, chain.axis[parent]) if parent >= 0 else 0.0
        levers.append(_Lever(parent, slides, stroke, float(np.linalg.norm(origin)), from_axis))
    return tuple(levers)


def _from_axis(point: Vector, axis: Vector) -> float:
    return float(np.linalg.norm(np.cross(axis, point)))


def _stroke(robot: Robot, row: int) -> float:
    """Return the largest distance of a prismatic joint from its zero position [m]."""
    # All of these joints have limits; a robot for which that does not hold is refused when it is made.
    is_driven = robot.chain.gain[row] != 0.0
    largest_values = np.maximum(np.abs(robot.lower[is_driven]), np.abs(robot.upper[is_driven]))
    return float(np.abs(robot.chain.gain[row, is_driven]) @ largest_values + abs(robot.chain.offset[row]))
