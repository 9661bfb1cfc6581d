"""Choose what the camera shows, and from where: the box around the arm's configurations and its surroundings.

The first viewpoint is the direction from which obstacles hide the least of the arm's motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.viewer.drawing.meshes import look_of_shape

# Ratios of an obstacle's size to that of the arm's box above which only the part near the arm has to be in the picture:
# of a table only sideways, so that the ground stays below its legs.
TABLE_RATIO = 0.75
SURROUNDINGS_RATIO = 3.0
EMPTY_BOX = np.array([[-0.5] * 3, [0.5] * 3])  # [m]; shown if there is nothing else
TABLE_MARGIN = 0.15  # how far around the arm's box such an obstacle is shown, as a share of the box
SURROUNDINGS_MARGIN = 0.5
DIRECTIONS = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z])

DEFAULT_AZIMUTH = np.deg2rad(-50.0)  # the viewer stands in front of the arm (x), on its right
ELEVATIONS = np.deg2rad([27.0, 42.0])
TURNS = np.deg2rad([0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180])  # tried in this order
EYE_DISTANCE = 1.8  # of the camera from what it shows, in sizes of that, at the angle of view of the page
# A turn by 90 degrees from the default azimuth must reduce the share of hidden points by this much.
TURN_COST = 0.025


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """An axis-aligned box of the world.

    Attributes:
        low, high: Corners, shape (3,) [m].
        arm: Diagonal of the box around the arm, at least a tenth of the whole box's [m]; that of the whole box if there
            is no arm.
        points: Outermost points of what must be in the picture, shape (k, 3) [m].
    """

    low: Vector
    high: Vector
    arm: float
    points: Matrix

    @property
    def centre(self) -> Vector:
        """Middle of the box, shape (3,) [m]."""
        return 0.5 * (self.low + self.high)

    @property
    def size(self) -> float:
        """Diagonal of the box [m]."""
        return float(np.linalg.norm(self.high - self.low))


def frame_around(
    arm_points: Matrix | None, scene: Scene, extra: Sequence[Matrix] = (), *, whole: bool = False
) -> Frame:
    """Return the box around the arm, the bounded obstacles and further points.

    Args:
        arm_points: Points around the arm, shape (m, 3) [m]; None for no arm.
        scene: Its obstacles are included, of very large ones only the part near the arm.
        extra: Further points, arrays of shape (m, 3) [m].
        whole: Whether to include very large obstacles completely.
    """
    boxes = [obstacle_corners(o) for o in scene.obstacles if o.shape.bounded]
    if arm_points is None or len(arm_points) == 0:
        everything = np.concatenate([*boxes, *extra, *([] if boxes or extra else [EMPTY_BOX])])
        low = everything.min(axis=0)
        high = everything.max(axis=0)
        return Frame(low, high, max(float(np.linalg.norm(high - low)), 1e-3), _outermost(everything))

    points = np.concatenate([arm_points, *extra])
    low = points.min(axis=0)
    high = points.max(axis=0)
    arm = max(float(np.linalg.norm(high - low)), 1e-3)

    shown = boxes if whole else [_near_part(corners, low, high, arm) for corners in boxes]
    everything = np.concatenate([points, *shown])
    low = everything.min(axis=0)
    high = everything.max(axis=0)
    return Frame(low, high, max(arm, 0.1 * float(np.linalg.norm(high - low))), _outermost(everything))


def _near_part(corners: Matrix, low: Vector, high: Vector, arm: float) -> Matrix:
    """Return the corners of the part of an obstacle's box that must be in the picture, near the arm's, shape (8, 3)."""
    extent = float(np.ptp(corners, axis=0).max())
    if extent <= TABLE_RATIO * arm:
        return corners
    if extent <= SURROUNDINGS_RATIO * arm:
        sideways = np.clip(corners[:, :2], low[:2] - TABLE_MARGIN * arm, high[:2] + TABLE_MARGIN * arm)
        return np.column_stack([sideways, corners[:, 2]])
    near: Matrix = np.clip(corners, low - SURROUNDINGS_MARGIN * arm, high + SURROUNDINGS_MARGIN * arm)
    return near


def _outermost(points: Matrix) -> Matrix:
    """Return the points that are farthest in any of `DIRECTIONS`, shape (k, 3)."""
    farthest: Matrix = points[np.unique(np.argmax(points @ DIRECTIONS.T, axis=0))]
    return farthest


def obstacle_corners(obstacle: Obstacle) -> Matrix:
    """Return the corners of a box around a bounded obstacle in the world frame, shape (8, 3) [m]."""
    corners = look_of_shape(obstacle.shape).corners
    placed: Matrix = corners @ obstacle.pose.rotation.T + obstacle.pose.translation
    return placed


def overview(groups: Sequence[Matrix], scene: Scene, frame: Frame) -> Vector:
    """Return the best first viewpoint: a unit vector from the scene towards the viewer, shape (3,).

    Several directions are compared by the share of points that obstacles hide, plus a cost for turning away from the
    default direction. Each group of points counts as much as the others.

    Args:
        groups: Points that should be visible, arrays of shape (m, 3) [m].
        scene: Each obstacle hides what lies behind the box around it.
        frame: What the camera shows: it stands about `EYE_DISTANCE` sizes of that away.
    """
    obstacles = [o for o in scene.obstacles if o.shape.bounded]
    points = np.concatenate([np.empty((0, 3)), *groups])
    weights = np.concatenate([np.empty(0), *(np.full(len(group), 1.0 / len(group)) for group in groups if len(group))])
    best = direction(0.0, float(ELEVATIONS[0]))
    least = np.inf

    for elevation in ELEVATIONS:
        for turn in TURNS:
            away = direction(float(turn), float(elevation))
            eye = frame.centre + EYE_DISTANCE * frame.size * away
            hidden = np.zeros(len(points), dtype=bool)
            for obstacle in obstacles:
                hidden |= behind(points, eye, obstacle)

            extra = TURN_COST * (abs(turn) / (0.5 * np.pi) + (elevation > ELEVATIONS[0]))
            cost = float(weights @ hidden) / max(len(groups), 1) + float(extra)

            if cost < least - 1e-9:
                best = away
                least = cost

    return best


def direction(turn: float, elevation: float) -> Vector:
    """Return the unit vector at an azimuth ``turn`` [rad] from the default one and an elevation [rad], shape (3,)."""
    azimuth = DEFAULT_AZIMUTH + turn
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def behind(points: Matrix, eye: Vector, obstacle: Obstacle) -> Mask:
    """Check which points, shape (m, 3), are hidden from an eye by the box around an obstacle, shape (m,)."""
    corners = look_of_shape(obstacle.shape).corners
    rotation = obstacle.pose.rotation.T
    local = (points - obstacle.pose.translation) @ rotation.T

    # Slab method: the way from a point (0) to the eye (1) is in the box where it is inside all three pairs of planes.
    ray = (eye - obstacle.pose.translation) @ rotation.T - local
    ray = np.where(np.abs(ray) < 1e-12, 1e-12, ray)
    to_low = (corners.min(axis=0) - local) / ray
    to_high = (corners.max(axis=0) - local) / ray
    enter = np.minimum(to_low, to_high).max(axis=1)
    leave = np.maximum(to_low, to_high).min(axis=1)

    hit: Mask = (leave >= enter) & (leave > 1e-9) & (enter < 1.0)
    return hit
