"""Certificates of paths, made by the kernels that prove motions."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, finite_array, frozen, not_negative
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.digests import robot_digest, scene_digest
from rrtik_ompl.kernels.proof.log import ProofLog
from rrtik_ompl.model.robot import require_joints, unnamed_joints
from rrtik_ompl.world.certificates.certificate import Certificate, MotionEntries
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.world import Proof, World


@runtime_checkable
class HasWaypoints(Protocol):
    """A path."""

    @property
    def waypoints(self) -> Matrix:
        """Shape (k, dof)."""


def certificate_of(world: World, path: HasWaypoints | ArrayLike, clearance: float = 0.0) -> Certificate | None:
    """A certificate of a path; None if not every motion of it is proven free.

    Args:
        world: The world.
        path: Of the world's robot, or its waypoints, shape (k, dof).
        clearance: Kept from every obstacle beside its margin [m].

    Raises:
        InputError: If the path is another robot's, the clearance is negative or infinite, or the scene has a cloud.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> path = rrtik.plan(problem, seed=1).path
        >>> rrtik.certificate_of(problem.world, path, path.proof.clearance).save("proof.json")
    """
    require(world, World, "world of a certificate")
    kept, robot = not_negative(clearance, "clearance"), world.robot
    given = path.waypoints if isinstance(path, HasWaypoints) else path
    rows = finite_array(given, (None, None), "path of a certificate")
    require_joints(robot, getattr(path, "joint_names", unnamed_joints(rows.shape[1])), "path")
    return _made(world.prover, rows, kept)


def certificate_by(proof: Proof | None, waypoints: Matrix) -> Certificate:
    """The certificate of a path, waypoints of shape (k, dof), for what is proven of it already.

    Raises:
        InputError: If that does not cover the path or was made by another process, or the scene has a cloud.
    """
    if proof is None:
        raise InputError("path to save with its proof: it has none; use path.proved(world)")
    if not proof.proven:
        raise InputError(f"path to save with its proof: it is not proven free: {proof.unproven[0]}")
    if proof.prover is None or (found := _made(proof.prover, waypoints, proof.clearance)) is None:
        raise InputError("path to save with its proof: planes do not prove it here; use path.proved(world)")
    return found


def _made(prover: Prover, rows: Matrix, kept: float) -> Certificate | None:
    """The certificate for a clearance [m]; None if not every motion is proven."""
    if clouds := [body.name for body in prover.bodies if isinstance(body.geometry, CloudSolid)]:
        raise InputError(
            f"a certificate names planes of solids, and '{clouds[0]}' is a cloud; plan.proven says as much"
        )
    told = prover.logged(np.vstack([rows, rows]) if len(rows) == 1 else rows, clearance=kept)
    if told is None:
        return None
    digests = robot_digest(prover.robot), scene_digest(tuple(prover.bodies), prover.pairs)
    motions = tuple(_entries(*each) for each in told)
    return Certificate(prover.robot.name, *digests, kept, prover.self_margin, frozen(rows), motions)


def _entries(told: ProofLog, measured: NDArray[np.int64]) -> MotionEntries:
    """What a verifier does not find by itself; a motion that stands still is one interval of level 0."""
    intervals = told.intervals.copy()
    if len(intervals) and (intervals == intervals[0]).all():  # one interval alone is all of the motion
        intervals[:] = 0
    links = (told.solids[:, None, ::2] == measured[None, :, :2]).all(axis=2).any(axis=1)
    needed = ((intervals[:, 0] > 0) | told.normals.any(axis=1)) & ~links
    whole = np.insert(measured[:, :2], [1, 2], -1, axis=1)
    solids, intervals = np.vstack([told.solids[needed], whole]), np.vstack([intervals[needed], measured[:, 2:]])
    normals = np.vstack([told.normals[needed], np.zeros((len(measured), 3))])
    return MotionEntries(frozen(solids, np.int64), frozen(intervals, np.int64), frozen(normals))
