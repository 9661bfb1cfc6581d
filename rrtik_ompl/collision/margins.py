"""How far bodies must stay apart, and the request by which coal checks it."""

from __future__ import annotations

import coal

from rrtik_ompl.collision.bodies import Body

DISTANCE_TOLERANCE = 1e-5  # [m] for rounding, in our arithmetic and in coal's distances and depths


def kept_apart(first: Body, second: Body) -> float:
    """How far two bodies must stay apart [m]: the margin of an obstacle, or that of the arm's own bodies, and paddings.

    No margin between bodies of which neither moves, for no posture of the arm would give what is missing: they must
    only not touch.
    """
    if first.joint == second.joint == 0:
        return 0.0
    return (second.margin if second.kind == "obstacle" else first.margin) + first.padding + second.padding


def request(margin: float) -> coal.DistanceRequest:
    """A fresh request to coal: do two geometries touch, or stay no farther than ``margin`` [m] apart."""
    asked = coal.CollisionRequest()
    asked.security_margin = margin
    return asked
