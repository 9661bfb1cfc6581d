"""Compute digests of what a proof is about: the robot's geometry and joints, the scene's geometry, pairs and margins.

Numbers are rounded before they are hashed, so that machines whose sines differ in the last bit agree. A digest is a
short reason why a certificate does not belong to a world; a verifier computes everything else again in any case.
"""

from __future__ import annotations

from collections.abc import Iterable

import coal
import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.geometry.collision.bodies import Body, link_bodies
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.shape_table import numbers_of
from rrtik_ompl.model.robot import Robot

DIGITS = 16  # hexadecimal digits of a digest
DECIMALS = 12  # decimals to which lengths [m] and angles [rad] are rounded


@kept_with
def robot_digest(robot: Robot) -> str:
    """Return a digest of a robot's joint tree and the geometry of its links."""
    chain = robot.chain
    numbers = (chain.parent, chain.placement, chain.axis, chain.prismatic, chain.gain, chain.offset)
    names = " ".join([robot.name, *robot.joint_names]).encode()
    return _hash([names, *map(_numbers, numbers), *_bodies(link_bodies(robot))])


def scene_digest(bodies: tuple[Body, ...], pairs: Iterable[tuple[int, int]]) -> str:
    """Return a digest of all bodies but links, of all margins, and of the pairs that move and must not touch."""
    moving = [_numbers(pair) for pair in pairs if any(bodies[k].joint > 0 for k in pair)]
    margins = [_numbers(body.margin) for body in bodies if body.kind == "link" and body.margin > 0.0]
    return _hash([*_bodies(body for body in bodies if body.kind != "link"), *margins, b"pairs", *moving])


def world_digest(robot: Robot, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> str:
    """Return the digest of the robot followed by that of the scene."""
    return robot_digest(robot) + scene_digest(bodies, pairs)


def _bodies(bodies: Iterable[Body]) -> Iterable[bytes]:
    for body in bodies:
        yield f"{body.kind} {body.name} {body.joint} {type(body.geometry).__name__}".encode()
        yield _numbers([body.margin, *np.array(body.placement.homogeneous).ravel(), *_swept(body.geometry)])
        yield from map(_numbers, _shape(body.geometry))
        if body.padding:
            yield _numbers(body.padding)
        for name, distance in body.contacts:
            yield f"in contact with {name}".encode()
            yield _numbers(distance)


def _shape(geometry: coal.CollisionGeometry) -> Iterable[ArrayLike]:
    """Return the numbers that define a coal geometry, as arrays."""
    numbers = numbers_of(geometry)
    if numbers is not None:
        return numbers
    if isinstance(geometry, CloudSolid):
        return (geometry.cloud.points, geometry.cloud.radius, geometry.cloud.half)
    if isinstance(geometry, coal.Halfspace):
        return (np.array(geometry.n), geometry.d)
    return (np.array(geometry.aabb_center), geometry.aabb_radius)  # Nothing is ever proven about other kinds.


def _swept(geometry: coal.CollisionGeometry) -> list[float]:
    return [float(geometry.getSweptSphereRadius())] if hasattr(geometry, "getSweptSphereRadius") else []


def _numbers(values: ArrayLike) -> bytes:
    array = np.asarray(values, dtype=np.float64)
    return f"{array.shape}".encode() + (np.round(array, DECIMALS) + 0.0).tobytes()  # Adding 0.0 turns -0.0 into 0.0.


def _hash(parts: Iterable[bytes]) -> str:
    digest = sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()[:DIGITS]
