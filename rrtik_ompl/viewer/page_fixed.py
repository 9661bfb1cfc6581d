"""What never moves of an arm, for a page whose obstacles do: the kernels compare what moves alone."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np

from rrtik_ompl.collision.bodies import Body, by_motion
from rrtik_ompl.collision.enclosure import enclosure
from rrtik_ompl.collision.solids import is_closed, is_mesh, mesh_arrays
from rrtik_ompl.fast.tables.layout import CONVEX_SOLID
from rrtik_ompl.fast.tables.solid_tables import convex_solids
from rrtik_ompl.world import World

GRAIN = 1e-7  # [m] of the corners of triangles; obstacles are so much larger for it
MOST_TRIANGLES = 10_000  # of a mesh; a page that has more would be too large, and takes the pieces around it


def standing_parts(world: World) -> list[dict[str, Any]] | None:
    """The bodies of the arm that stand still, in the world, and which obstacles must not touch each.

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
        body = world.bodies[number]
        found.append({"name": body.name, "meets": sorted(set(names)), "solids": solids, "surfaces": _surfaces(body)})
    return found


def _solids(body: Body) -> list[dict[str, Any]] | None:
    around, placement = convex_solids(body.geometry).around, body.placement
    if not around or any(solid.kind != CONVEX_SOLID for solid in around):
        return None
    return [
        {
            "corners": (solid.corners @ placement.rotation.T + placement.translation).tolist(),
            "axis": (placement.rotation @ solid.axis).tolist(),
            "disc": solid.disc,
            "radius": solid.radius,
        }
        for solid in around
    ]


def _surfaces(body: Body) -> list[dict[str, Any]]:
    """The triangles of a mesh, in the world, which decide where the solids around it are touched."""
    if not is_mesh(body.geometry):
        return []
    vertices, triangles = mesh_arrays(body.geometry)
    if len(triangles) > MOST_TRIANGLES:
        return []
    used, numbers = np.unique(triangles, return_inverse=True)
    placed = vertices[used] @ body.placement.rotation.T + body.placement.translation
    faces = np.asarray(numbers, dtype="<u4")
    corners = np.round(placed / GRAIN).astype("<i4")
    return [
        {
            "corners": packed(corners.tobytes()),
            "faces": packed(faces.tobytes()),
            "grain": GRAIN,
            "enclosed": None if is_closed(body.geometry) else _enclosed(body),
        }
    ]


def _enclosed(body: Body) -> dict[str, Any]:
    """What an open mesh encloses, as cells in its own frame, and how the page comes from the world to these."""
    found, box = enclosure(body.geometry), body.geometry.aabb_local
    return {
        "into": body.placement.inverse().homogeneous.ravel().tolist(),
        "low": box.min_.tolist(),
        "high": box.max_.tolist(),
        "origin": found.origin.tolist(),
        "size": found.size,
        "shape": list(found.inside.shape),
        "cells": packed(found.inside.astype(np.uint8).tobytes()),
    }


def packed(data: bytes) -> str:
    """Bytes as text that a page unpacks."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")
