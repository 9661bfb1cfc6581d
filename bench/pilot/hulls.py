"""Links of UR5 as given, as convex hulls, and as hulls of fewer vertices that still contain every point."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import coal
import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision.solids import hull, is_mesh

GROWTH = 1e-3  # [m] that a hull of fewer vertices may stand out
PLACES = 300


class Link(NamedTuple):
    """A link: numbers of vertices, how far points stand out of its hulls [m], how much faster a collision check is."""

    name: str
    vertices: int
    exact: int
    grown: int
    outside: float
    speed_exact: float
    speed_grown: float


def hulls_of_links() -> list[Link]:
    """All links that are meshes."""
    bodies = rrtik.load_robot("ur5").visual.geometryObjects
    return [_link(body.name, body.geometry) for body in bodies if is_mesh(body.geometry)]


def _link(name: str, mesh: Any) -> Link:
    points = np.unique(np.array(mesh.vertices()), axis=0)
    corners = points[ConvexHull(points).vertices]
    around = grown_hull(corners, GROWTH)
    plain = _seconds(mesh, points)
    faster = [plain / _seconds(hull(each), points) for each in (corners, around)]
    outside = max(_outside(corners, points), _outside(around, points))
    return Link(name, len(points), len(corners), len(around), outside, *faster)


def grown_hull(points: Any, growth: float) -> Any:
    """Vertices of a polytope that contains all points and stands out of their hull's planes by ``growth`` at most.

    It is bounded by some of the hull's own planes: those that cut off what stands out most, again and again.
    """
    planes = np.unique(ConvexHull(points).equations, axis=0)
    inside = points.mean(axis=0)
    box = np.vstack([np.c_[side * np.eye(3), -(side * points).max(axis=0)] for side in (1.0, -1.0)])
    chosen = box
    while True:
        vertices = HalfspaceIntersection(chosen, inside).intersections
        above = vertices @ planes[:, :3].T + planes[:, 3]
        worst = np.unique(above.argmax(axis=1)[above.max(axis=1) > growth])
        if len(worst) == 0:
            return np.unique(np.round(vertices, 12), axis=0)
        chosen = np.vstack([chosen, planes[worst]])


def _outside(corners: Any, points: Any) -> float:
    planes = ConvexHull(corners).equations
    return float(max((points @ planes[:, :3].T + planes[:, 3]).max(), 0.0))


def _seconds(geometry: Any, points: Any) -> float:
    """Processor time of collision checks against a small box, here and there around the link."""
    rng, box, here = np.random.default_rng(6), coal.Box(0.05, 0.05, 0.05), coal.Transform3s()
    size, middle = 2.0 * np.ptp(points, axis=0), points.mean(axis=0)
    places = [coal.Transform3s(np.eye(3), middle + rng.uniform(-0.5, 0.5, 3) * size) for _ in range(PLACES)]
    begin = time.process_time()
    for place in places:
        coal.collide(geometry, here, box, place, coal.CollisionRequest(), coal.CollisionResult())
    return time.process_time() - begin
