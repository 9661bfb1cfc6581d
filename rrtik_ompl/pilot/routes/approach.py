"""Find configurations in front of an object from which moves of few joints lead to the grasp.

The pose before a grasp has to be reached only roughly: it suffices that the gripper is clear of the object and in front
of it. This tolerance allows configurations that differ from the grasp in two or three joints, whereas the exact pose
would require all joints to move.
"""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.routes.follower import slack
from rrtik_ompl.world.world import World

MAX_JOINTS = 3  # largest number of joints that move between such a configuration and the grasp
MAX_OFFSET = 0.02  # [m] from the pose before the object
MAX_TILT = np.deg2rad(20.0)  # largest angle from the orientation of that pose
STANDOFF_FACTORS = (1.0, 1.5, 2.0)  # distances from the grasp that are tried, as multiples of that of the approach pose
ITERATIONS = 8  # steps of inverse kinematics for such configurations
DAMPING = 1e-4  # damping of its least-squares steps [m^2]
ERROR_SAMPLES = 40  # random errors by which the robustness of such a configuration is measured


def approaches(
    world: World, holding: World, grasp: Vector, stages: tuple[pin.SE3, pin.SE3, pin.SE3], max_count: int
) -> list[list[Matrix]]:
    """Return the last parts of routes, grouped by their first configuration.

    Each part moves the joints in which the first configuration differs from the grasp, one after the other; all orders
    that are free are returned. The groups are sorted: first those robust to small errors, then those with few joints.

    Args:
        world: World in which nothing may be touched: the first configuration is free in it.
        holding: World in which the gripper may touch the object: every move is free in it.
        grasp: The configuration that holds the object, shape (dof,).
        stages: ``T_base_tip`` of approach, grasp and lift.
        max_count: Largest number of groups.

    Returns:
        One list for each first configuration, with the free orders of its joints as waypoints, shape (moves + 1, dof)
        each; the last row is the grasp.
    """
    parts_by_beginning = []
    for begin in _beginnings(world, grasp, stages):
        parts = (_in_order(begin, grasp, order) for order in permutations(np.flatnonzero(begin != grasp).tolist()))
        free = [rows for rows in parts if holding.motion_valid_batch(rows[:-1], rows[1:]).all()]
        if free:
            parts_by_beginning.append(free)
        if len(parts_by_beginning) == max_count:
            break
    return parts_by_beginning


def _in_order(begin: Vector, end: Vector, order: tuple[int, ...]) -> Matrix:
    """Return the waypoints from one configuration to another, one joint at a time, shape (moves + 1, dof)."""
    rows = np.tile(begin, (len(order) + 1, 1))
    for number, joint in enumerate(order, start=1):
        rows[number:, joint] = end[joint]
    return rows


def _beginnings(world: World, grasp: Vector, stages: tuple[pin.SE3, pin.SE3, pin.SE3]) -> Matrix:
    """Return free configurations in front of the object that differ from the grasp in few joints, best first.

    For every choice of at most `MAX_JOINTS` joints and every standoff, inverse kinematics moves those joints until the
    tip is near the place in front of the object. Results with the right position and orientation that are free are
    sorted by robustness to small errors, then by the number of joints that differ, then by the deviation of the
    orientation.

    Returns:
        Shape (k, dof).
    """
    joints = range(world.robot.dof)
    joint_choices = [
        np.isin(joints, moving_joints)
        for size in range(1, MAX_JOINTS + 1)
        for moving_joints in combinations(joints, size)
    ]

    grasp_point = stages[1].translation
    to_approach = stages[0].translation - stages[1].translation
    places = np.repeat([grasp_point + factor * to_approach for factor in STANDOFF_FACTORS], len(joint_choices), axis=0)

    small_errors = slack(JointPath.of(world.robot, grasp[None]))
    rows = _moved_to_places(world.robot, grasp, np.tile(joint_choices, (len(STANDOFF_FACTORS), 1)), places)
    # Differences below the tolerance of following a route need no move.
    rows = np.where(np.abs(rows - grasp) <= small_errors, grasp, rows)

    _, distinct_rows = np.unique(rows, axis=0, return_index=True)
    rows = rows[distinct_rows]
    places = places[distinct_rows]

    poses = world.robot.fk_batch(rows)
    offsets = np.linalg.norm(poses[:, :3, 3] - places, axis=1)
    cosine = 0.5 * (np.einsum("ij,mij->m", stages[1].rotation, poses[:, :3, :3]) - 1.0)

    is_before_object = (offsets < MAX_OFFSET) & (cosine > np.cos(MAX_TILT))
    is_before_object[is_before_object] = world.valid_batch(rows[is_before_object])

    rows = rows[is_before_object]
    moving = (rows != grasp).sum(axis=1)
    order = np.lexsort((-cosine[is_before_object], moving, _touching(world, rows, small_errors)))
    return np.asarray(rows[order])


def _moved_to_places(robot: Robot, grasp: Vector, chosen: Mask, places: Matrix) -> Matrix:
    """Move chosen joints until the tip is near given places, by damped least squares on the position.

    Args:
        robot: The arm.
        grasp: The configuration from which all rows start, shape (dof,).
        chosen: Which joints move in each row, shape (m, dof).
        places: Desired position of the tip in the base frame for each row, shape (m, 3) [m].

    Returns:
        Configurations within the limits, shape (m, dof).
    """
    rows = np.tile(grasp, (len(chosen), 1))
    for _ in range(ITERATIONS):
        poses, jacobians = robot.fk_jacobian_batch(rows)
        turning = jacobians[:, :3] * chosen[:, None, :]
        normal = turning @ turning.transpose(0, 2, 1) + DAMPING * np.eye(3)
        step = turning.transpose(0, 2, 1) @ np.linalg.solve(normal, (places - poses[:, :3, 3])[..., None])
        rows = robot.clamp(rows + step[..., 0])
    return rows


def _touching(world: World, rows: Matrix, small_errors: Vector) -> Vector:
    """Return the share of small errors that bring each configuration into contact, in tenths, rounded, shape (m,)."""
    errors = np.random.default_rng(0).uniform(-small_errors, small_errors, (ERROR_SAMPLES, len(small_errors)))
    perturbed = world.robot.clamp((rows[:, None] + errors).reshape(-1, len(small_errors)))
    tenths: Vector = np.rint(10.0 * (1.0 - world.valid_batch(perturbed).reshape(len(rows), ERROR_SAMPLES).mean(axis=1)))
    return tenths
