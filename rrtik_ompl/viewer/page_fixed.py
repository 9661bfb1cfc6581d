"""What never moves of an arm, for a page whose obstacles do: the kernels compare what moves alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.collision.bodies import Body, by_motion
from rrtik_ompl.fast.tables.layout import CONVEX_SOLID
from rrtik_ompl.fast.tables.solid_tables import convex_solids
from rrtik_ompl.world import World

DIGITS = 6  # of a metre, of corners; solids are so much larger for it


def standing_parts(world: World) -> list[dict[str, Any]] | None:
    """The bodies of the arm that stand still, as convex solids in the world, and which obstacles must not touch each.

    None if one of them cannot be given as such solids.
    """
    partners: dict[int, list[str]] = {}
    for i, j in by_motion(world.bodies, world.pairs)[1]:
        first, second = (i, j) if world.bodies[j].kind == "obstacle" else (j, i)
        partners.setdefault(first, []).append(world.bodies[second].name)
    found = []
    for number, names in partners.items():
        solids = _solids(world.bodies[number])
        if solids is None:
            return None
        found.append({"name": world.bodies[number].name, "meets": sorted(set(names)), "solids": solids})
    return found


def _solids(body: Body) -> list[dict[str, Any]] | None:
    around, placement = convex_solids(body.geometry).around, body.placement
    if not around or any(solid.kind != CONVEX_SOLID for solid in around):
        return None
    return [
        {
            "corners": np.round(solid.corners @ placement.rotation.T + placement.translation, DIGITS).tolist(),
            "axis": (placement.rotation @ solid.axis).tolist(),
            "disc": solid.disc,
            "radius": solid.radius + body.padding + 2.0 * 10.0**-DIGITS,
        }
        for solid in around
    ]
