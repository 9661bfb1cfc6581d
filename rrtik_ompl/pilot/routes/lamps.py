"""Compute a lamp for every grasp type and level of an object: can the arm reach it, hold it and lift it?

Green: the grasp is reachable, within the limits and free, the arm gets to it from in front of the object, and can lift
it. Amber: the grasp is reachable, but something blocks it, the approach or the lift. Red: the grasp is out of reach, so
that no route leads there. Source: [1, ch. 6]; here the whole sequence of approach, grasp and lift counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.batch import solve_ik_many
from rrtik_ompl.ik.solve import chosen_method, solve_ik
from rrtik_ompl.model.goal import PoseGoal, joint_difference
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.routes.approach import approaches
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject
from rrtik_ompl.world.world import World

Stage: TypeAlias = Literal["approach", "grasp", "lift"]
Color: TypeAlias = Literal["green", "amber", "red"]

STAGES: tuple[Stage, Stage, Stage] = ("approach", "grasp", "lift")
GREEN: Final = "green"
AMBER: Final = "amber"
RED: Final = "red"
LIMITS = "joint limits"
UNREACHABLE = "out of reach"
NUMERIC_SECONDS = 0.01  # time limit for a pose if the arm has no closed-form inverse kinematics
DIAGNOSIS_SECONDS = 0.02  # time limit for finding the reason why a grasp cannot be made


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """The feasibility of one grasp.

    Attributes:
        type: Name of the grasp type.
        level: Number of the level, from 0.
        color: "green", "amber" or "red".
        stage: The stage that fails; None if green.
        reason: Which stage fails and why; "" if green.
        q: Configurations of approach, grasp and lift, shape (3, dof); rows of NaN where there is none.
        grasps: All configurations found for the grasp that are within the limits and free, shape (k, dof).
    """

    type: str
    level: int
    color: Color
    stage: Stage | None
    reason: str
    q: Matrix
    grasps: Matrix


def stage_poses(T_base_object: pin.SE3, grasp: GraspType, level: int) -> tuple[pin.SE3, pin.SE3, pin.SE3]:
    """Return ``T_base_tip`` of approach, grasp and lift.

    The approach is before the grasp along the tool's z axis, the lift is above it along the z axis of the base.
    """
    grasp_pose = T_base_object * grasp.levels[level]
    approach_pose = grasp_pose.copy()
    lift_pose = grasp_pose.copy()

    approach_pose.translation = grasp_pose.translation - grasp.approach * grasp_pose.rotation[:, 2]
    lift_pose.translation = grasp_pose.translation + np.array([0.0, 0.0, grasp.lift])
    return approach_pose, grasp_pose, lift_pose


def lamps(
    world: World,
    thing: MarkedObject,
    T_base_object: pin.SE3,
    near: Vector,
    *,
    holding: World,
    seconds: float = NUMERIC_SECONDS,
) -> tuple[Lamp, ...]:
    """Return the lamps of all grasp types and levels of an object at its present pose.

    The configurations of all stages are computed as one batch and checked for collisions, each stage in its own world.
    A grasp whose exact approach pose is blocked is still green if a few joints lead to it from nearby. If the arm is in
    contact at present, green lamps become amber.

    Args:
        world: World of the approach: nothing may be touched, including the object.
        thing: The object.
        T_base_object: Its pose.
        near: Present configuration, shape (dof,); configurations near to it are preferred.
        holding: World of grasp and lift: the same, but the gripper may touch the object.
        seconds: Time limit for each pose if the arm has no closed form [s].
    """
    grasps_and_levels = [(grasp, level) for grasp in thing.grasps for level in range(len(grasp.levels))]
    if not grasps_and_levels:
        return ()

    poses = np.array([[T.homogeneous for T in stage_poses(T_base_object, *name)] for name in grasps_and_levels])
    postures, why = _postures(world.robot, poses.reshape(-1, 4, 4), near, seconds)
    shape = (len(grasps_and_levels), len(STAGES), *postures.shape[1:])
    postures = postures.reshape(shape)

    free = _free(postures, (world, holding, holding))
    nearest = _nearest(world.robot, postures, free, near)

    found_lamps = []
    is_stuck = not (world.valid(near) or holding.valid(near))
    for row, (grasp, level) in enumerate(grasps_and_levels):
        reasons = why[row * len(STAGES) : (row + 1) * len(STAGES)]

        grasps = postures[row, 1][free[row, 1]]
        has_free_posture = free[row].any(axis=1)
        if has_free_posture[1] and not has_free_posture[0]:
            has_free_posture[0] = _approached(world, holding, nearest[row, 1], stage_poses(T_base_object, grasp, level))

        color, stage, fault = _color(reasons, has_free_posture)
        if is_stuck and color == GREEN:
            color = AMBER
            stage = STAGES[0]
            fault = "the arm touches something where it is"

        reason = "" if stage is None else f"{stage}: {fault}"
        found_lamps.append(Lamp(grasp.name, level, color, stage, reason, nearest[row], grasps))
    return tuple(found_lamps)


def _approached(world: World, holding: World, grasp: Vector, stages: tuple[pin.SE3, pin.SE3, pin.SE3]) -> bool:
    """Check whether moves of a few joints lead to a grasp from near the approach pose, as on a route."""
    return bool(approaches(world, holding, grasp, stages, max_count=1))


def diagnose(
    lamp: Lamp, thing: MarkedObject, T_base_object: pin.SE3, near: Vector, world: World, holding: World
) -> str:
    """Return which stage of a grasp fails, and how far it is out of reach or what would touch; "" for a green lamp.

    Args:
        lamp: Lamp of the grasp.
        thing: The object.
        T_base_object: Its pose.
        near: Configuration near which a solution is searched, shape (dof,).
        world: World of the approach.
        holding: World of grasp and lift.
    """
    if lamp.stage is None:
        return ""

    stage = STAGES.index(lamp.stage)
    goal = PoseGoal(stage_poses(T_base_object, thing.grasp(lamp.type), lamp.level)[stage])
    result = solve_ik(world.robot, goal, near=near, world=(world, holding, holding)[stage], seconds=DIAGNOSIS_SECONDS)
    return f"{lamp.stage}: {result.detail}" if result.detail else lamp.reason


def _postures(
    robot: Robot, poses: NDArray[np.float64], near: Vector, seconds: float
) -> tuple[NDArray[np.float64], list[str]]:
    """Solve inverse kinematics for m poses.

    Returns:
        Configurations within the limits, shape (m, b, dof) for b branches, rows of NaN where there is none, and for
        each pose the reason if there is none, "" otherwise.
    """
    if chosen_method(robot, (PoseGoal(poses[0]),), "auto") == "closed-form":
        closed_form = solutions(robot, poses, near=near, check=False)
        postures = np.where(closed_form.valid[..., None], closed_form.branches, np.nan)
        reasons = np.where(closed_form.real.any(axis=1), LIMITS, UNREACHABLE)
        return postures, np.where(closed_form.valid.any(axis=1), "", reasons).tolist()
    batch = solve_ik_many(robot, poses, near=near, seconds=seconds)
    return np.array(batch.q[:, None]), list(batch.reasons)


def _free(postures: NDArray[np.float64], worlds: tuple[World, ...]) -> NDArray[np.bool_]:
    """Check which postures exist and are free of collisions, each stage in its own world.

    Args:
        postures: Shape (m, stages, b, dof), rows of NaN where there is none.
        worlds: The world of each stage.

    Returns:
        Shape (m, stages, b).
    """
    free = ~np.isnan(postures[..., 0])
    for world in dict.fromkeys(worlds):
        stages = [k for k, stage_world in enumerate(worlds) if stage_world is world]
        pending = np.zeros_like(free)
        pending[:, stages] = free[:, stages]
        free[pending] = world.valid_batch(postures[pending])
    return free


def _nearest(robot: Robot, postures: NDArray[np.float64], free: NDArray[np.bool_], near: Vector) -> NDArray[np.float64]:
    """Select the free posture of each stage that is nearest to a configuration.

    Args:
        robot: The arm.
        postures: Shape (m, stages, b, dof).
        free: Which of them are free, shape (m, stages, b).
        near: The configuration, shape (dof,).

    Returns:
        Shape (m, stages, dof), rows of NaN where no posture is free.
    """
    distances = np.linalg.norm(joint_difference(robot, postures, near), axis=-1)

    best = np.argmin(np.where(free, distances, np.inf), axis=2)
    nearest: NDArray[np.float64] = np.take_along_axis(postures, best[..., None, None], axis=2)[:, :, 0]
    exists: NDArray[np.bool_] = np.asarray(free.any(axis=2))
    return np.where(exists[..., None], nearest, np.nan)


def _color(reasons: list[str], has_free_posture: NDArray[np.bool_]) -> tuple[Color, Stage | None, str]:
    """Determine the colour of a lamp.

    Args:
        reasons: For each stage, why inverse kinematics has no solution; "" if it has one.
        has_free_posture: Which stages have a free posture, shape (3,).

    Returns:
        The colour, the first stage that fails (None if green), and why it fails.
    """
    if reasons[1]:
        return RED, STAGES[1], reasons[1]

    failing = next((k for k in (1, 0, 2) if not has_free_posture[k]), None)
    if failing is None:
        return GREEN, None, ""
    return AMBER, STAGES[failing], reasons[failing] or "something is in the way"
