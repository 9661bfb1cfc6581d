"""Data on the fixed parts of an arm, for a page with movable obstacles: the kernels check only moving parts."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.geometry.collision.bodies import Body, by_motion
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import is_closed, is_mesh, mesh_arrays
from rrtik_ompl.kernels.layout import CONVEX_SOLID
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.world.world import World

DIGITS = 6  # decimals [m] of vertices of convex pieces around meshes, which are enlarged by the rounding error
GRAIN = 1e-6  # [m]; rounding of the vertices of triangles, by which obstacles are enlarged
# Larger meshes would make the page too large; it uses the convex pieces around them instead.
MOST_TRIANGLES = 10_000


def standing_parts(world: World) -> list[dict[str, Any]] | None:
    """Return the fixed bodies of the arm in the world frame, each with the obstacles that must not touch it.

    Returns:
        None if one of the bodies cannot be represented by such solids.
    """
    partners: dict[int, list[str]] = {}
    for i, j in by_motion(world.bodies, world.pairs)[1]:
        first, second = (i, j) if world.bodies[j].kind == "obstacle" else (j, i)
        partners.setdefault(first, []).append(world.bodies[second].name)

    found = []
    for number, names in partners.items():
        body = world.bodies[number]
        surfaces = _surfaces(body)
        solids = [] if surfaces else _solids(body)
        if solids is None:
            return None
        found.append({"name": body.name, "meets": sorted(set(names)), "solids": solids, "surfaces": surfaces})

    return found


def _solids(body: Body) -> list[dict[str, Any]] | None:
    """Return the convex solids around a body in the world frame; None if there are none of that kind."""
    around = convex_solids(body.geometry).around
    placement = body.placement
    if not around or any(solid.kind != CONVEX_SOLID for solid in around):
        return None

    rounded = is_mesh(body.geometry)
    digits, more = (DIGITS, 2.0 * 10.0**-DIGITS) if rounded else (17, 0.0)

    return [
        {
            "corners": np.round(solid.corners @ placement.rotation.T + placement.translation, digits).tolist(),
            "axis": (placement.rotation @ solid.axis).tolist(),
            "disc": solid.disc,
            "radius": solid.radius + more,
        }
        for solid in around
    ]


def _surfaces(body: Body) -> list[dict[str, Any]]:
    """Return the triangles of a mesh in the world frame; an empty list for other bodies and very large meshes."""
    if not is_mesh(body.geometry):
        return []

    vertices, triangles = mesh_arrays(body.geometry)
    if len(triangles) > MOST_TRIANGLES:
        return []

    used, numbers = np.unique(triangles, return_inverse=True)
    placed = vertices[used] @ body.placement.rotation.T + body.placement.translation

    return [
        {
            "corners": packed(_planes(np.round(placed / GRAIN))),
            "faces": packed(_planes(_steps(numbers.reshape(-1, 3)))),
            "grain": GRAIN,
            "enclosed": None if is_closed(body.geometry) else _enclosed(body),
        }
    ]


def _steps(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Encode triangles as small numbers, which compress well, shape (m, 3).

    Each triangle is rotated so that its lowest vertex index comes first. The triangles are sorted by it; the first
    column holds differences to the previous triangle, the others differences to the first vertex.
    """
    lowest = faces.argmin(axis=1)
    # A rotation keeps the orientation.
    turned = faces[np.arange(len(faces))[:, None], (lowest[:, None] + np.arange(3)) % 3]
    turned = turned[np.argsort(turned[:, 0], kind="stable")]
    return np.column_stack([np.diff(turned[:, 0], prepend=0), turned[:, 1:] - turned[:, :1]])


def _planes(rows: NDArray[Any]) -> bytes:
    """Return integers, shape (n, 3), column by column, with all lowest bytes first: half as large after compression."""
    columns = np.ascontiguousarray(rows.T).astype("<i4").reshape(-1)
    return np.ascontiguousarray(columns.view(np.uint8).reshape(-1, 4).T).tobytes()


def _enclosed(body: Body) -> dict[str, Any]:
    """Return the cells that an open mesh encloses in its own frame, and the transformation from the world to it."""
    found = enclosure(body.geometry)
    box = body.geometry.aabb_local
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
    """Return bytes as compressed text, which the page decompresses."""
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")
