"""Generated moving obstacles keep to their speed and their distance."""

from __future__ import annotations

import numpy as np

from rrtik_bench.moving_scenes import moving_scene
from rrtik_ompl.description.catalog import load_robot


def test_generated_obstacles_keep_to_their_speed_and_their_distance():
    robot = load_robot("titan4")
    scene = moving_scene(robot, 6, 0.1, 3, seconds=10.0)
    again = moving_scene(robot, 6, 0.1, 3, seconds=10.0)
    for obstacle, twin in zip(scene.obstacles, again.obstacles, strict=True):
        assert np.array_equal(obstacle.pose.homogeneous, twin.pose.homogeneous)
        at = [obstacle.motion.pose_at(obstacle.pose, t).translation for t in np.arange(0.0, 10.0, 0.05)]
        assert np.linalg.norm(np.diff(at, axis=0), axis=1).max() <= 0.1 * 0.05 * (1.0 + 1e-9)
