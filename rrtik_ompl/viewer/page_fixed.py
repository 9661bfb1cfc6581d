"""What never moves of an arm, for a page whose obstacles do: the kernels compare what moves alone."""

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

DIGITS = 6  # of a metre, of corners of pieces around meshes; pieces are so much larger for it
GRAIN = 1e-6  # [m] of the corners of triangles; obstacles are so much larger for it
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
        body = world.bodies[number]
        surfaces = _surfaces(body)
        solids = [] if surfaces else _solids(body)
        if solids is None:
            return None
        found.append({"name": body.name, "meets": sorted(set(names)), "solids": solids, "surfaces": surfaces})

    return found


def _solids(body: Body) -> list[dict[str, Any]] | None:
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
    """The triangles of a mesh, in the world; none of another body, nor of a mesh of very many."""
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
    """Triangles as small numbers: the lowest corner first, less that of the one before; the others less it."""
    lowest = faces.argmin(axis=1)
    turned = faces[np.arange(len(faces))[:, None], (lowest[:, None] + np.arange(3)) % 3]  # its sense stays
    turned = turned[np.argsort(turned[:, 0], kind="stable")]
    return np.column_stack([np.diff(turned[:, 0], prepend=0), turned[:, 1:] - turned[:, :1]])


def _planes(rows: NDArray[Any]) -> bytes:
    """Whole numbers, shape (n, 3), column by column, all their lowest bytes first: half as large once packed."""
    columns = np.ascontiguousarray(rows.T).astype("<i4").reshape(-1)
    return np.ascontiguousarray(columns.view(np.uint8).reshape(-1, 4).T).tobytes()


def _enclosed(body: Body) -> dict[str, Any]:
    """What an open mesh encloses, as cells in its own frame, and how the page comes from the world to these."""
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
    """Bytes as text that a page unpacks."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")
