"""Certificates of paths: made by the kernels that prove motions, verified without them."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, finite_array, not_negative, number_rows
from rrtik_ompl.base.errors import require
from rrtik_ompl.model.certificate import Certificate
from rrtik_ompl.model.robot import require_joints, unnamed_joints
from rrtik_ompl.world.certificate_check import certificate_fault
from rrtik_ompl.world.world import World


@runtime_checkable
class HasWaypoints(Protocol):
    """An object with waypoints, such as a path."""

    @property
    def waypoints(self) -> Matrix:
        """The waypoints, shape (k, dof)."""


def certificate_of(world: World, path: HasWaypoints | ArrayLike, clearance: float = 0.0) -> Certificate | None:
    """Certify a path; return None if not every motion of it is proven free.

    Args:
        world: The world.
        path: A path of the world's robot, or its waypoints, shape (k, dof).
        clearance: Distance kept from every obstacle on top of its margin [m].

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


def verify_certificate(certificate: Certificate, world: World, waypoints: ArrayLike, *, clearance: float = 0.0) -> str:
    """Verify a certificate of a path: return its first fault in one line, or "" if it proves the path free.

    Args:
        certificate: The certificate; nothing in it is trusted.
        world: The robot and the scene. Only the bodies, pairs and the chain of joints are read; none of the world's
            own checks are used.
        waypoints: Waypoints of the path, shape (k, dof); they have to equal those of the certificate to the bit.
        clearance: Least distance that the path has to keep from obstacles on top of their margins [m].

    Raises:
        InputError: If an argument has the wrong type.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> path = rrtik.plan(problem, seed=1).path
        >>> rrtik.verify_certificate(rrtik.certificate_of(problem.world, path), problem.world, path.waypoints)
        ''
    """
    require(certificate, Certificate, "certificate")
    require(world, World, "world of a certificate")
    rows = number_rows(waypoints, "waypoints of a certificate")
    required_clearance = not_negative(clearance, "clearance")
    return certificate_fault(certificate, world, rows, clearance=required_clearance)
