"""How far any point of the arm can move when joints move [16]: bounds by which motions are divided into steps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.model.robot import Robot


def displacement_weights(robot: Robot, bodies: Iterable[Body]) -> Vector:
    """Weights w, shape (dof,), such that no point of the arm moves farther than ``w @ |b - a|`` [m] from a to b.

    The bound adds what each joint contributes, hence holds for joint motion along a straight line in configuration
    space. The tip counts as a point of the arm.
    """
    return _displacement_weights(robot, tuple(bodies))


@lru_cache(maxsize=16)
def _displacement_weights(robot: Robot, bodies: tuple[Body, ...]) -> Vector:
    """See above; kept, for the links of a robot are those of all its worlds."""
    tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
    points = [*_balls(bodies), (tip.parentJoint, tip.placement.translation, 0.0)]
    return frozen(np.abs(robot.chain.gain).T @ joint_weights(robot, points))


def approach_weights(robot: Robot, bodies: Sequence[Body], pairs: Sequence[tuple[int, int]]) -> Matrix:
    """Weights w, shape (pairs, dof): two bodies come nearer by ``w @ |b - a|`` [m] from a to b at most.

    A joint that carries both of them turns them as one.
    """
    weights_of_body = np.zeros((len(bodies), len(robot.chain.parent)))
    for k, body in enumerate(bodies):
        if body.joint > 0:
            weights_of_body[k] = _body_weights(robot, body)

    first, second = weights_of_body[np.array(pairs, dtype=np.int64).reshape(-1, 2).T]
    return frozen(np.where((first > 0.0) & (second > 0.0), 0.0, first + second) @ np.abs(robot.chain.gain))


@lru_cache(maxsize=512)
def _body_weights(robot: Robot, body: Body) -> Vector:
    """See :func:`joint_weights`; cached, for the links of a robot are those of all its worlds."""
    return frozen(joint_weights(robot, _balls([body])))


def _balls(bodies: Iterable[Body]) -> list[tuple[int, Vector, float]]:
    """Joint, centre in its frame and radius of a ball around each body."""
    return [(b.joint, b.placement.act(b.geometry.aabb_center), b.geometry.aabb_radius) for b in bodies]


def joint_weights(robot: Robot, balls: list[tuple[int, Vector, float]]) -> Vector:
    """For each joint how far a point of the balls moves at most per unit of it, shape (joints,).

    For a revolute joint that is the largest distance that any point beyond it can have from its axis (over all
    postures), for a prismatic joint 1; 0 for one that carries none of the balls.
    """
    chain = robot.chain
    count = len(robot.chain.parent)
    around_origin = np.zeros(count)
    around_axis = np.zeros(count)
    carries = np.zeros(count, dtype=bool)

    for k in range(count - 1, -1, -1):  # children come after their parents, so they are done first
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
    """Largest distance of a sliding joint from its zero [m]."""
    is_driven = robot.chain.gain[row] != 0.0  # joints with limits all of them, or the robot would have been refused
    largest_values = np.maximum(np.abs(robot.lower[is_driven]), np.abs(robot.upper[is_driven]))
    return float(np.abs(robot.chain.gain[row, is_driven]) @ largest_values + abs(robot.chain.offset[row]))
