"""Bound how far any point of the arm can move when joints move [16]; the bounds give the steps of motion checks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

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
    return _displacement_weights(robot, tuple(bodies))


@kept_with
def _displacement_weights(robot: Robot, bodies: tuple[Body, ...]) -> Vector:
    """Return the weights of `displacement_weights`; cached, as all worlds of a robot share the bodies of its links."""
    tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
    points = [*_balls(bodies), (tip.parentJoint, tip.placement.translation, 0.0)]
    return frozen(np.abs(robot.chain.gain).T @ joint_weights(robot, points))


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
def _body_weights(robot: Robot, body: Body) -> Vector:
    """Return the `joint_weights` of one body; cached, as all worlds of a robot share the bodies of its links."""
    return frozen(joint_weights(robot, _balls([body])))


def _balls(bodies: Iterable[Body]) -> list[tuple[int, Vector, float]]:
    """Return a ball around each body: the number of its joint, the centre in the joint's frame, and the radius [m]."""
    return [(b.joint, b.placement.act(b.geometry.aabb_center), b.geometry.aabb_radius) for b in bodies]


def joint_weights(robot: Robot, balls: list[tuple[int, Vector, float]]) -> Vector:
    """Return for each joint how far a point of the balls moves at most per unit of the joint, shape (joints,).

    For a revolute joint this is the largest distance that a point beyond the joint can have from its axis in any
    configuration; for a prismatic joint it is 1, and for a joint that carries none of the balls 0. The distances are
    propagated from the tip to the base: each is bounded by the length of the child's offset plus the reach beyond the
    child.

    Args:
        robot: The robot.
        balls: Number of the joint, centre in the joint's frame [m] and radius [m] of each ball.
    """
    chain = robot.chain
    count = len(robot.chain.parent)
    around_origin = np.zeros(count)
    around_axis = np.zeros(count)
    carries = np.zeros(count, dtype=bool)

    # Children have higher numbers than their parents, so this order visits them first.
    for k in range(count - 1, -1, -1):
        axis = chain.axis[k]
        for joint, centre, radius in balls:
            if joint == k + 1:
                carries[k] = True
                around_origin[k] = max(around_origin[k], float(np.linalg.norm(centre)) + radius)
                around_axis[k] = max(around_axis[k], _from_axis(centre, axis) + radius)

        for child in (int(c) for c in np.flatnonzero((chain.parent == k) & carries)):
            carries[k] = True
            reach = around_origin[child] + (_stroke(robot, child) if chain.prismatic[child] else 0.0)
            origin = chain.placement[child][:3, 3]
            around_origin[k] = max(around_origin[k], float(np.linalg.norm(origin)) + reach)
            around_axis[k] = max(around_axis[k], _from_axis(origin, axis) + reach)

    return np.where(carries, np.where(chain.prismatic, 1.0, around_axis), 0.0)


def _from_axis(point: Vector, axis: Vector) -> float:
    return float(np.linalg.norm(np.cross(axis, point)))


def _stroke(robot: Robot, row: int) -> float:
    """Return the largest distance of a prismatic joint from its zero position [m]."""
    # All of these joints have limits; a robot for which that does not hold is refused when it is made.
    is_driven = robot.chain.gain[row] != 0.0
    largest_values = np.maximum(np.abs(robot.lower[is_driven]), np.abs(robot.upper[is_driven]))
    return float(np.abs(robot.chain.gain[row, is_driven]) @ largest_values + abs(robot.chain.offset[row]))
