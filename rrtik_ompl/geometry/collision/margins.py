"""How far bodies must stay apart, and the request by which coal checks it."""

from __future__ import annotations

import coal

from rrtik_ompl.geometry.collision.bodies import Body

DISTANCE_TOLERANCE = 1e-5  # [m] for rounding, in our arithmetic and in coal's distances and depths


def kept_apart(first: Body, second: Body) -> float:
    """How far two bodies must stay apart [m]: the margin of an obstacle, or that of the arm's own bodies, and paddings.

    Negative is the depth to which two that are in contact may overlap. No margin between bodies of which neither moves,
    for no posture of the arm would give what is missing: they must only not touch.
    """
    contact = contact_distance(first, second)
    without_contact = usually_apart(first, second)
    return without_contact if contact is None else min(without_contact, contact)


def usually_apart(first: Body, second: Body) -> float:
    """How far two bodies must stay apart where they are not in contact [m]."""
    if first.joint == second.joint == 0:
        return 0.0
    return (second.margin if second.kind == "obstacle" else first.margin) + first.padding + second.padding


def keeps_clearance(first: Body, second: Body) -> bool:
    """Whether a clearance from obstacles is kept between two bodies too: one is an obstacle, and they do not touch."""
    return "obstacle" in (first.kind, second.kind) and contact_distance(first, second) is None


def contact_distance(first: Body, second: Body) -> float | None:
    """How near each other two bodies may come that are in contact [m], negative for a depth; None if they are not."""
    if not first.contacts or not second.contacts:
        return None
    return min((distance for name, distance in first.contacts if name == second.name), default=None)


def request(margin: float) -> coal.DistanceRequest:
    """A fresh request to coal: do two geometries touch, or stay no farther than ``margin`` [m] apart."""
    collision_request = coal.CollisionRequest()
    collision_request.security_margin = margin
    return collision_request
