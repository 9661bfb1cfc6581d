"""Certificates of paths, made by the kernels that prove motions."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import frozen, not_negative
from rrtik_ompl.certificates.certificate import Certificate, MotionEntries
from rrtik_ompl.collision.digests import robot_digest, scene_digest
from rrtik_ompl.errors import InputError, require
from rrtik_ompl.fast.proof.log import ProofLog
from rrtik_ompl.path import JointPath
from rrtik_ompl.shapes import PointCloud
from rrtik_ompl.world import World


def certificate_of(world: World, path: JointPath, clearance: float = 0.0) -> Certificate | None:
    """A certificate of a path; None if not every motion of it is proven free.

    Args:
        world: The world.
        path: Of the world's robot.
        clearance: Kept from every obstacle beside its margin [m].

    Raises:
        InputError: If the path is another robot's, the clearance is negative or infinite, or the scene has a cloud.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> path = rrtik.plan(problem, seed=1).path
        >>> rrtik.certificate_of(problem.world, path, path.proof.clearance).save("proof.json")
    """
    require(world, World, "world of a certificate")
    require(path, JointPath, "path of a certificate")
    kept, rows, robot = not_negative(clearance, "clearance"), path.waypoints, world.robot
    if rows.shape[1] != robot.dof:
        raise InputError(f"path of {rows.shape[1]} joints: robot '{robot.name}' has {robot.dof}; it is another robot's")
    if clouds := [o.name for o in world.scene.obstacles if isinstance(o.shape, PointCloud)]:
        raise InputError(
            f"a certificate names planes of solids, and '{clouds[0]}' is a cloud; plan.proven says as much"
        )
    told = world.prover.logged(np.vstack([rows, rows]) if len(rows) == 1 else rows, clearance=kept)
    if told is None:
        return None
    digests = robot_digest(robot), scene_digest(world.bodies, world.pairs)
    return Certificate(robot.name, *digests, kept, world.self_margin, frozen(rows), tuple(map(_entries, told)))


def _entries(told: ProofLog) -> MotionEntries:
    """What a verifier does not find by itself; a motion that stands still is one interval of level 0."""
    intervals = told.intervals.copy()
    if len(intervals) and (intervals == intervals[0]).all():  # one interval alone is all of the motion
        intervals[:] = 0
    needed = (intervals[:, 0] > 0) | told.normals.any(axis=1)
    return MotionEntries(
        frozen(told.solids[needed], np.int64), frozen(intervals[needed], np.int64), frozen(told.normals[needed])
    )
