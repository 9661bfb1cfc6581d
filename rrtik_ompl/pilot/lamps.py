"""A lamp for every grasp TYPE and LEVEL of an object: can the arm get there, hold it and lift it?

Green: approach, grasp and lift are in reach, inside the limits and free. Amber: in reach, but something is in the way.
Red: out of reach. Source: shared-control tool, section 4; that the whole sequence counts is what users ask for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.goal import PoseGoal, joint_difference
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.batch import solve_ik_batch
from rrtik_ompl.ik.solve import chosen_method, solve_ik
from rrtik_ompl.robot import Robot
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject
from rrtik_ompl.world import World

STAGES = ("approach", "grasp", "lift")
GREEN, AMBER, RED = "green", "amber", "red"
LIMITS, UNREACHABLE = "joint limits", "out of reach"
NUMERIC_SECONDS = 0.01  # for a pose, where the arm has no closed form
TELLING_SECONDS = 0.02  # for the reason why one grasp cannot be made


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """What the arm can do with one grasp.

    Attributes:
        type: Name of the grasp type.
        level: Number of the level, from 0.
        color: "green", "amber" or "red".
        reason: Which stage fails and why; "" if green.
        q: Configurations of approach, grasp and lift, NaN where there is none. Shape (3, dof).
    """

    type: str
    level: int
    color: str
    reason: str
    q: Matrix


def stage_poses(T_base_object: Any, grasp: GraspType, level: int) -> tuple[Any, Any, Any]:
    """``T_base_tip`` of approach, grasp and lift."""
    at = T_base_object * grasp.levels[level]
    before, after = at.copy(), at.copy()
    before.translation = at.translation - grasp.approach * at.rotation[:, 2]
    after.translation = at.translation + np.array([0.0, 0.0, grasp.lift])
    return before, at, after


def lamps(world: World, thing: MarkedObject, T_base_object: Any, near: Vector, *, holding: World) -> tuple[Lamp, ...]:
    """The lamps of all types and levels of an object where it is now.

    Args:
        world: For the approach: everything that must not be touched, the object too.
        thing: What is to be grasped.
        T_base_object: Where it is.
        near: Posture near which configurations are wanted, shape (dof,).
        holding: For grasp and lift: the same world in which the gripper may touch the object.
    """
    names = [(grasp, level) for grasp in thing.grasps for level in range(len(grasp.levels))]
    if not names:
        return ()
    poses = np.array([[T.homogeneous for T in stage_poses(T_base_object, *name)] for name in names])
    postures, why = _postures(world.robot, poses.reshape(-1, 4, 4), near)
    shape = (len(names), len(STAGES), *postures.shape[1:])
    free = _free(postures.reshape(shape), (world, holding, holding))
    nearest = _nearest(world.robot, postures.reshape(shape), free, near)
    found = []
    for row, (grasp, level) in enumerate(names):
        reasons = why[row * len(STAGES) : (row + 1) * len(STAGES)]
        color, reason = _color(reasons, free[row].any(axis=1))
        found.append(Lamp(grasp.name, level, color, reason, nearest[row]))
    return tuple(found)


def fault_of(lamp: Lamp, thing: MarkedObject, T_base_object: Any, near: Vector, world: World, holding: World) -> str:
    """Which stage of a grasp fails, and by how much it is out of reach or what would touch.

    Args:
        lamp: Of the grasp; it has a reason.
        thing: What is to be grasped.
        T_base_object: Where it is.
        near: Posture near which the arm would be, shape (dof,).
        world: For the approach.
        holding: For grasp and lift.
    """
    name = lamp.reason.partition(":")[0]
    stage = STAGES.index(name)
    goal = PoseGoal(stage_poses(T_base_object, thing.grasp(lamp.type), lamp.level)[stage])
    asked = solve_ik(world.robot, goal, near=near, world=(world, holding, holding)[stage], seconds=TELLING_SECONDS)
    return f"{name}: {asked.detail}" if asked.detail else lamp.reason


def _postures(robot: Robot, poses: NDArray[np.float64], near: Vector) -> tuple[NDArray[np.float64], list[str]]:
    """For each pose the postures inside the limits, NaN for the others, shape (m, b, dof); and why there is none."""
    if chosen_method(robot, (PoseGoal(poses[0]),), "auto") == "closed-form":
        found = solutions(robot, poses, near=near, check=False)
        postures = np.where(found.valid[..., None], found.branches, np.nan)
        reasons = np.where(found.real.any(axis=1), LIMITS, UNREACHABLE)
        return postures, np.where(found.valid.any(axis=1), "", reasons).tolist()
    batch = solve_ik_batch(robot, poses, near=near, seconds=NUMERIC_SECONDS)
    return np.array(batch.q[:, None]), list(batch.reasons)


def _free(postures: NDArray[np.float64], worlds: tuple[World, ...]) -> NDArray[np.bool_]:
    """Which postures are there and touch nothing, stage by stage in its own world. Shape (m, stages, b)."""
    free = ~np.isnan(postures[..., 0])
    for world in dict.fromkeys(worlds):
        stages = [k for k, each in enumerate(worlds) if each is world]
        asked = np.zeros_like(free)
        asked[:, stages] = free[:, stages]
        free[asked] = world.valid_batch(postures[asked])
    return free


def _nearest(robot: Robot, postures: NDArray[np.float64], free: NDArray[np.bool_], near: Vector) -> NDArray[np.float64]:
    """Of the free postures of each stage the nearest one, NaN where there is none. Shape (m, stages, dof)."""
    away = np.linalg.norm(joint_difference(robot, postures, near), axis=-1)
    best = np.argmin(np.where(free, away, np.inf), axis=2)
    chosen: NDArray[np.float64] = np.take_along_axis(postures, best[..., None, None], axis=2)[:, :, 0]
    some: NDArray[np.bool_] = np.asarray(free.any(axis=2))
    return np.where(some[..., None], chosen, np.nan)


def _color(reasons: list[str], clear: NDArray[np.bool_]) -> tuple[str, str]:
    failing = [k for k, reason in enumerate(reasons) if reason]
    if failing:
        return RED, f"{STAGES[failing[0]]}: {reasons[failing[0]]}"
    if not clear.all():
        return AMBER, f"{STAGES[int(np.argmin(clear))]}: something is in the way"
    return GREEN, ""
