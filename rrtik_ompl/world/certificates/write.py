"""Certificates of paths, made by the kernels that prove motions."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, finite_array, not_negative
from rrtik_ompl.base.errors import require
from rrtik_ompl.model.certificate import Certificate
from rrtik_ompl.model.robot import require_joints, unnamed_joints
from rrtik_ompl.world.world import World


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
    required_clearance = not_negative(clearance, "clearance")
    robot = world.robot
    waypoints = path.waypoints if isinstance(path, HasWaypoints) else path
    rows = finite_array(waypoints, (None, None), "path of a certificate")
    require_joints(robot, getattr(path, "joint_names", unnamed_joints(rows.shape[1])), "path")
    return world.prover.certificate(rows, required_clearance)
