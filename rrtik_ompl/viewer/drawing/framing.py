"""What the camera shows: the box around the arm's configurations and its surroundings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.viewer.drawing.meshes import look_of_shape

SURROUNDINGS_RATIO = 3.0  # of an obstacle's size to the arm's box, above which the picture shows only a part of it
EMPTY_BOX = np.array([[-0.5] * 3, [0.5] * 3])  # [m] shown where there is nothing
SURROUNDINGS_MARGIN = 0.5  # of the arm's box: how much of such an obstacle is shown


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """An axis-aligned box of the world.

    Attributes:
        low, high: Corners, shape (3,) [m].
        arm: Diagonal of the box around the arm alone, not below a tenth of the whole box's, or of everything if there
            is no arm [m].
    """

    low: Vector
    high: Vector
    arm: float

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
    """Box around the arm, the bounded obstacles and further points.

    Args:
        arm_points: Points around the arm, shape (m, 3) [m], or None.
        scene: Its obstacles are taken in, of huge ones only the part near the arm.
        extra: Further points, each array of shape (m, 3) [m].
        whole: Take in huge obstacles completely.
    """
    boxes = [obstacle_corners(o) for o in scene.obstacles if o.shape.bounded]
    if arm_points is None or len(arm_points) == 0:
        everything = np.concatenate([*boxes, *extra, *([] if boxes or extra else [EMPTY_BOX])])
        low = everything.min(axis=0)
        high = everything.max(axis=0)
        return Frame(low, high, max(float(np.linalg.norm(high - low)), 1e-3))

    points = np.concatenate([arm_points, *extra])
    low = points.min(axis=0)
    high = points.max(axis=0)
    arm = max(float(np.linalg.norm(high - low)), 1e-3)

    near_low = low - SURROUNDINGS_MARGIN * arm
    near_high = high + SURROUNDINGS_MARGIN * arm
    for corners in boxes:
        if not whole and float(np.ptp(corners, axis=0).max()) > SURROUNDINGS_RATIO * arm:
            corners = np.clip(corners, near_low, near_high)
        low = np.minimum(low, corners.min(axis=0))
        high = np.maximum(high, corners.max(axis=0))

    return Frame(low, high, max(arm, 0.1 * float(np.linalg.norm(high - low))))


def obstacle_corners(obstacle: Obstacle) -> Matrix:
    """Corners in the world of a box around a bounded obstacle, shape (8, 3) [m]."""
    corners = look_of_shape(obstacle.shape).corners
    placed: Matrix = corners @ obstacle.pose.rotation.T + obstacle.pose.translation
    return placed
