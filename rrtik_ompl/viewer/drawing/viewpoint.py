"""The first viewpoint: the direction from which obstacles hide the least of the arm's motion."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.viewer.drawing.meshes import look_of_shape

DEFAULT_AZIMUTH = np.deg2rad(-50.0)  # from in front of the arm (x), on its right
ELEVATIONS = np.deg2rad([27.0, 42.0])
TURNS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180])  # tried in this order
TURN_COST = 0.04  # share of hidden points that a turn by 90 degrees away from the default azimuth must save


def overview(points: Matrix, scene: Scene) -> Vector:
    """Unit vector from the scene towards the viewer, shape (3,).

    Args:
        points: Places that should be seen, shape (m, 3) [m].
        scene: Its obstacles hide what lies behind the boxes around them.
    """
    obstacles = [o for o in scene.obstacles if o.shape.bounded]
    best = direction(0.0, float(ELEVATIONS[0]))
    least = np.inf

    for elevation in ELEVATIONS:
        for turn in TURNS:
            away = direction(float(turn), float(elevation))
            hidden = np.zeros(len(points), dtype=bool)
            for obstacle in obstacles:
                hidden |= behind(points, away, obstacle)

            extra = TURN_COST * (abs(turn) / (0.5 * np.pi) + (elevation > ELEVATIONS[0]))
            cost = (float(hidden.mean()) if len(points) else 0.0) + float(extra)

            if cost < least - 1e-9:
                best = away
                least = cost

    return best


def direction(turn: float, elevation: float) -> Vector:
    """Unit vector at an azimuth ``turn`` [rad] from the default one and an elevation [rad], shape (3,)."""
    azimuth = DEFAULT_AZIMUTH + turn
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def behind(points: Matrix, away: Vector, obstacle: Obstacle) -> Mask:
    """Which points, shape (m, 3), have the box around an obstacle between them and a distant viewer. Shape (m,)."""
    corners = look_of_shape(obstacle.shape).corners
    rotation = obstacle.pose.rotation.T
    local = (points - obstacle.pose.translation) @ rotation.T

    # Slabs: the ray is inside the box where it is inside all three pairs of planes.
    ray = rotation @ away
    ray = np.where(np.abs(ray) < 1e-12, 1e-12, ray)
    to_low = (corners.min(axis=0) - local) / ray
    to_high = (corners.max(axis=0) - local) / ray
    enter = np.minimum(to_low, to_high).max(axis=1)
    leave = np.maximum(to_low, to_high).min(axis=1)

    hit: Mask = (leave >= enter) & (leave > 1e-9)
    return hit
