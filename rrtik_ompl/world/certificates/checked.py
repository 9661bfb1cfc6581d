"""The verifier as users call it: arguments of another kind are refused first. The verifier itself needs no World."""

from __future__ import annotations

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import not_negative, number_rows
from rrtik_ompl.base.errors import require
from rrtik_ompl.model.certificate import Certificate
from rrtik_ompl.world.certificates import verify
from rrtik_ompl.world.world import World


def verify_certificate(certificate: Certificate, world: World, waypoints: ArrayLike, *, clearance: float = 0.0) -> str:
    """The first fault of a certificate in one line; "" if it proves that a path is free.

    Args:
        certificate: The certificate; nothing in it is believed.
        world: The robot and the scene; bodies, pairs and the chain of joints are read, no check of it is asked.
        waypoints: Of the path, shape (k, dof); the certificate has to be for these to the bit.
        clearance: What the path has to keep from obstacles beside their margins at least [m].

    Raises:
        InputError: If an argument is of another kind.

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
    return verify.verify_certificate(certificate, world, rows, clearance=required_clearance)
