"""Planes that proofs try first between bodies in contact.

Between bodies that overlap there is no plane that a search for their distance would find, but a proof needs none that
parts them: one beyond which neither reaches deeper than it may. Coal knows that one, by the normal of the contact.
"""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.solids import around
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.model.robot import Robot


def suggest_planes(robot: Robot, bodies: Sequence[Body], packed: ProofPairs, ends: Matrix) -> None:
    """Let the kernels try the planes of contacts first, where a motion begins or ends, shape (2, dof)."""
    frames = robot.chain.joint_frames(ends)
    normals_of_rows = packed.table.ways.reshape(-1, 3)
    bases = packed.table.pairs.reshape(-1, layout.PAIR_SIZE)[:, layout.PAIR_BASE]
    normal_of_solids: dict[tuple[int, int], tuple[int, Vector]] = {}

    for row in packed.touching:
        first, second = packed.sides[row, ::2].tolist()
        if (first, second) not in normal_of_solids:
            normal_of_solids[first, second] = _normal((bodies[second], bodies[first]), frames)
        end, normal = normal_of_solids[first, second]
        normals_of_rows[row] = frames[end, bases[row], :3, :3].T @ normal


def _normal(pair: tuple[Body, Body], frames: Matrix) -> tuple[int, Vector]:
    """Where two bodies are nearer to each other, 0 or 1, and there the unit vector from the first to the second."""
    if any(isinstance(body.geometry, CloudSolid) for body in pair):
        return 0, np.zeros(3)  # kernels look for their own

    least_distance = np.inf
    nearest_end = 0
    normal = np.zeros(3)

    for end in range(len(frames)):
        poses = (pin.SE3(frames[end, body.joint]) * body.placement for body in pair)
        first, second = (coal.Transform3s(pose.rotation, pose.translation) for pose in poses)
        solids = around(pair[0].geometry), first, around(pair[1].geometry), second

        result = coal.DistanceResult()
        if coal.distance(*solids, coal.DistanceRequest(), result) < least_distance:
            least_distance = result.min_distance
            nearest_end = end
            normal = np.array(result.normal)

    return nearest_end, normal
