"""Certificates of paths: made by the kernels that prove motions, verified without them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, finite_array, not_negative, number_rows
from rrtik_ompl.base.errors import require
from rrtik_ompl.model.certificate import Certificate, Route
from rrtik_ompl.model.robot import require_joints, unnamed_joints

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World


@runtime_checkable
class HasWaypoints(Protocol):
    """An object with waypoints, such as a path."""

    @property
    def waypoints(self) -> Matrix:
        """The waypoints, shape (k, dof)."""


@runtime_checkable
class HasRoute(Protocol):
    """An object that moves by a route, such as a trajectory."""

    @property
    def route(self) -> Route:
        """How it moves."""


Certifiable: TypeAlias = Route | HasRoute | HasWaypoints | ArrayLike


def certificate_for(world: World, path: Certifiable, clearance: float) -> Certificate | None:
    """Certify a path or a timed motion; see :meth:`rrtik_ompl.World.certificate`.

    Raises:
        InputError: If the path is another robot's, or the clearance is negative or infinite.
    """
    required_clearance = not_negative(clearance, "clearance")
    robot = world.robot
    route = _route(path)
    rows = finite_array(route.waypoints, (None, None), "path of a certificate")
    require_joints(robot, getattr(path, "joint_names", unnamed_joints(rows.shape[1])), "path")
    if route.times is None:
        return world.prover.certificate(rows, required_clearance)
    from rrtik_ompl.world.certificate_making import certificate_of  # few need it, and it loads scipy

    return certificate_of(world.prover, route, required_clearance, world)


def fault_of(certificate: Certificate, world: World, path: Certifiable, clearance: float) -> str:
    """Verify a certificate of a path or a timed motion; see :meth:`rrtik_ompl.World.verify`.

    Raises:
        InputError: If an argument has the wrong type, or the path moves other joints than the world's robot, or these
            in another order.
    """
    from rrtik_ompl.world.certificate_check import certificate_fault  # a plan does not need it

    require(certificate, Certificate, "certificate", "World.certificate(path) makes one")
    names = getattr(path, "joint_names", None)
    if names is not None:
        require_joints(world.robot, names, "path")
    return certificate_fault(certificate, world, _route(path), clearance=not_negative(clearance, "clearance"))


def _route(path: Certifiable) -> Route:
    """Return how something moves."""
    if isinstance(path, Route):
        return path
    if isinstance(path, HasRoute) and isinstance(path.route, Route):  # a roadmap's is a method
        return path.route
    waypoints = path.waypoints if isinstance(path, HasWaypoints) else path
    return Route(number_rows(waypoints, "waypoints of a certificate"))
