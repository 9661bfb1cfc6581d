"""Configurations in front of an object from which few joints lead on to the grasp.

The pose before a grasp is reached only roughly: what counts is that the gripper is clear of the object and in front of
it. That leaves configurations which differ from the grasp in two or three joints, where the exact pose would take all.
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

MAX_JOINTS = 3  # that move between such a configuration and the grasp
MAX_OFFSET = 0.02  # [m] from the pose before the object
MAX_TILT = np.deg2rad(20.0)  # from its orientation
STANDOFF_FACTORS = (1.0, 1.5, 2.0)  # distances from the object that are tried, over that of the pose before it
ITERATIONS = 8  # of the search for such configurations
DAMPING = 1e-4  # of it [m^2]
ERROR_SAMPLES = 40  # small errors that measure the clearance of a beginning


def approaches(
    world: World, holding: World, grasp: Vector, stages: tuple[pin.SE3, pin.SE3, pin.SE3], max_count: int
) -> list[list[Matrix]]:
    """Last parts of routes, grouped by where they begin; first where small errors do no harm, then of few joints.

    Args:
        world: In which nothing may be touched: every part begins free in it.
        holding: In which the gripper may touch the object: every part is free in it.
        grasp: The configuration that holds the object, shape (dof,).
        stages: ``T_base_tip`` of approach, grasp and lift.
        max_count: Number of beginnings at most.

    Returns:
        For each beginning the orders of its joints that are free, shape (moves + 1, dof) each; the last row is the
        grasp.
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
    """From one configuration to another, joint by joint. Shape (moves + 1, dof)."""
    rows = np.tile(begin, (len(order) + 1, 1))
    for number, joint in enumerate(order, start=1):
        rows[number:, joint] = end[joint]
    return rows


def _beginnings(world: World, grasp: Vector, stages: tuple[pin.SE3, pin.SE3, pin.SE3]) -> Matrix:
    """Free configurations before the object that differ from the grasp in few joints, best first. Shape (k, dof)."""
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
    rows = np.where(np.abs(rows - grasp) <= small_errors, grasp, rows)  # no move for a difference too small to notice

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
    """For each choice of joints, shape (m, dof), the grasp with those moved until the tip is near its place, (m, 3).

    By damped least squares. Shape (m, dof).
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
    """Tenths of small errors that make a configuration touch something. Shape (m,)."""
    errors = np.random.default_rng(0).uniform(-small_errors, small_errors, (ERROR_SAMPLES, len(small_errors)))
    perturbed = world.robot.clamp((rows[:, None] + errors).reshape(-1, len(small_errors)))
    tenths: Vector = np.rint(10.0 * (1.0 - world.valid_batch(perturbed).reshape(len(rows), ERROR_SAMPLES).mean(axis=1)))
    return tenths
